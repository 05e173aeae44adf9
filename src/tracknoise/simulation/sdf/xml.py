"""SDF's XML: numbers and poses."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError
from tracknoise.foreign.xml_file import Element
from tracknoise.printable import counted

_LARGEST, _SHORTEST = 1e9, 1e-9
"""Largest number in a file, and smallest length of a quaternion that has a direction."""


def text_of(element: Element | None, tag: str) -> str | None:
    """Text of a child without surrounding spaces; None if there is no child or no text."""
    text = None if element is None else element.findtext(tag)
    return (text or "").strip() or None


def numbers(element: Element, count: int, place: str | Path) -> NDArray[np.float64]:
    """(count,) float64: the numbers in an element.

    Raises
    ------
    DataError
        If the number of values is wrong, or one is not finite.
    """
    text = (element.text or "").strip()
    words = text.split()
    try:
        values = np.array([float(word) for word in words if len(words) == count], np.float64)
    except ValueError:
        values = np.empty(0)
    if len(values) != count or not np.isfinite(values).all():
        raise DataError(place, f"<{element.tag}> {text!r}", counted(count, "finite number"))
    if np.any(np.abs(values) > _LARGEST):
        raise DataError(place, f"<{element.tag}> {text!r}", f"numbers up to {_LARGEST:g}")
    return values


def child_numbers(element: Element, tag: str, default: tuple[float, ...], place: str | Path) -> NDArray[np.float64]:
    """Numbers in a child, as many as in the default. The default is used if there is no such child."""
    child = element.find(tag)
    return np.array(default) if child is None else numbers(child, len(default), place)


def pose_of(element: Element | None, place: str | Path) -> NDArray[np.float64]:
    """(4, 4) float64: parent_from_child of a ``<pose>``; the identity if there is none.

    The six numbers are x, y, z (metres) and roll, pitch, yaw (radians; degrees if ``degrees="true"``) about the
    parent's fixed axes in this order: R = Rz(yaw) Ry(pitch) Rx(roll). With ``rotation_format="quat_xyzw"`` the last
    three are a quaternion instead.

    Raises
    ------
    DataError
        If the number of values is wrong, one is not finite, or they are not a rotation.
    """
    pose = np.eye(4)
    if element is None or not (element.text or "").strip():
        return pose
    if element.get("rotation_format") == "quat_xyzw":
        values = numbers(element, 7, place)
        if np.linalg.norm(values[3:]) < _SHORTEST:
            raise DataError(place, f"<pose> {(element.text or '').strip()!r}", "a non-zero quaternion")
        rotation = Rotation.from_quat(values[3:])
    else:
        values = numbers(element, 6, place)
        rotation = Rotation.from_euler("xyz", values[3:], degrees=element.get("degrees") in ("true", "1"))
    pose[:3, :3], pose[:3, 3] = rotation.as_matrix(), values[:3]
    return pose
