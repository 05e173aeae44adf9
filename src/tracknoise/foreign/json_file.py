"""Objects in JSON files."""

import json
from pathlib import Path
from typing import Any

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_text


def read_json_object(path: Path, expected: str) -> dict[str, Any]:
    """Read a JSON file whose top level is an object.

    Parameters
    ----------
    path
        The file.
    expected
        What it should hold, for the error of a file that is missing.

    Raises
    ------
    DataError
        If the file is missing, unreadable, or no JSON object; the message names the line.
    """
    try:
        entries = json.loads(read_text(path, expected))
    except json.JSONDecodeError as error:
        raise DataError(f"{path}:{error.lineno}", f"no JSON ({error.msg})", "a JSON object") from error
    except (ValueError, RecursionError) as error:  # a number of thousands of digits, or thousands of brackets
        raise DataError(path, "unreadable file", "a JSON object") from error
    if not isinstance(entries, dict):
        raise DataError(path, "JSON, but no object", "a JSON object")
    return entries
