"""XML files of bounded size and depth."""

from pathlib import Path
from xml.etree import ElementTree as ET
from xml.parsers.expat import ErrorString

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import MOST_TEXT_BYTES, read_bytes

Element = ET.Element
_MOST_LEVELS = 32


def read_xml(path: Path) -> Element:
    """Root element of an XML file.

    Raises
    ------
    DataError
        If the file is missing, malformed (the message names the line), nested too deep, or in an encoding that cannot
        be read.
    """
    content = read_bytes(path, "an XML file", most=MOST_TEXT_BYTES)
    try:
        root = ET.fromstring(content)
    except ET.ParseError as error:
        what = ErrorString(error.code)
        raise DataError(f"{path}:{error.position[0]}", f"malformed XML ({what})", "well-formed XML") from error
    except (LookupError, ValueError) as error:  # expat supports few encodings, and only single-byte ones of Python
        raise DataError(path, f"an encoding that cannot be read ({error})", "well-formed XML in UTF-8") from error
    level = [root]
    for _ in range(_MOST_LEVELS):
        level = [child for element in level for child in element]
    if level:
        raise DataError(path, f"elements nested more than {_MOST_LEVELS} deep", "fewer levels")
    return root
