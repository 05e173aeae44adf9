"""Parsers of the syntaxes in which estimators read their settings."""

import json
import re
import shlex
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping

import cv2
import yaml

Values = dict[str, object]


def opencv_yaml(text: str) -> Values:
    """As OpenVINS and Kimera-VIO read it."""
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    root = storage.root()
    found = {key: root.getNode(key) for key in root.keys()}  # noqa: SIM118
    assert all(node.isReal() or node.isInt() for node in found.values())
    return {key: node.real() for key, node in found.items()}


def plain_yaml(text: str) -> Values:
    found = yaml.safe_load(text)
    assert isinstance(found, dict)
    return found


def strict_json(text: str) -> Values:
    """As cereal reads it: without comments."""
    found = json.loads(text)
    assert isinstance(found, dict)
    return found


def json_with_comments(text: str) -> Values:
    """As JsonCpp reads it, with comments to the end of a line. There are no strings with slashes here."""
    return strict_json(re.sub(r"//.*", "", text))


def boost_info(text: str) -> Values:
    """As Boost's property tree reads INFO files: keys and data, blocks in braces, comments from a semicolon on."""
    root: Values = {}
    blocks, key = [root], ""
    for words in filter(None, (line.partition(";")[0].split() for line in text.splitlines())):
        if words == ["{"]:
            blocks.append(blocks[-1].setdefault(key, {}))  # type: ignore[arg-type]
        elif words == ["}"]:
            blocks.pop()
        else:
            key, *data = words
            assert len(data) <= 1
            if data:
                blocks[-1][key] = data[0]
    assert blocks == [root]
    return root


def launch(text: str) -> Values:
    """Parameters of a launch file, or of a part of it."""
    return {node.attrib["name"]: float(node.attrib["value"]) for node in ET.fromstring(text).iter("param")}


def arguments(text: str) -> Values:
    """Arguments of a command, ``--name value`` or ``-name=value``, with lines of comments."""
    words = shlex.split(text, comments=True)
    if all("=" in word for word in words):
        return {name.lstrip("-"): float(value) for name, value in (word.split("=") for word in words)}
    return {name.lstrip("-"): float(value) for name, value in zip(words[::2], words[1::2], strict=True)}


PARSERS: Mapping[str, Callable[[str], Values]] = {
    "openvins_noise.yaml": opencv_yaml,
    "kimera_noise.yaml": opencv_yaml,
    "opensfm_noise.yaml": plain_yaml,
    "basalt_noise.json": strict_json,
    "xivo_noise.json": json_with_comments,
    "rovio_noise.info": boost_info,
    "msckf_vio_noise.launch": launch,
    "rtabmap_noise.txt": arguments,
    "hybvio_noise.txt": arguments,
}
