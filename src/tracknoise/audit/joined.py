"""Corrections that were found under others, and these, as one.

With the corrections of a run (1) and those that its audit found (2), focal lengths have the factor s1 s2 and depths
become s2 (s1 Z + o1) + o2. The camera is mounted as M1 M2 in the frame of the poses. All others add up.
(audit.corrections)
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from tracknoise.geometry.corrections import UNCORRECTED

_FACTORS = frozenset({"focal_scale", "depth_scale"})
_TURNED, _MOVED, _OFFSET = "mounting_rotation_deg", "mounting_translation_m", "depth_offset_m"


def joined(present: Mapping[str, Any], found: Mapping[str, Any]) -> dict[str, Any]:
    """Corrections that do what others do one after the other: (audit.corrections).

    Exact, but for an offset of depths that was found where depths were corrected to be along the ray already: it is
    taken along the ray too.

    Parameters
    ----------
    present
        By the keys of `tracknoise.geometry.corrections.Corrections`: those of the run.
    found
        Those that were found under them; keys that are not of corrections stay as they are.

    Returns
    -------
    dict
        Without those that change nothing.
    """
    both = {name: _added(name, present, found) for name in (*found, *(name for name in present if name not in found))}
    if _OFFSET in both:
        both[_OFFSET] = found.get("depth_scale", 1.0) * present.get(_OFFSET, 0.0) + found.get(_OFFSET, 0.0)
    if {_TURNED, _MOVED} & both.keys():
        both |= _mounted(present, found)
    return {name: value for name, value in both.items() if not _is_neutral(name, value)}


def _added(name: str, present: Mapping[str, Any], found: Mapping[str, Any]) -> Any:
    if name not in present or name not in found:
        return found.get(name, present.get(name))
    one, other = present[name], found[name]
    if isinstance(one, bool):
        return one or other
    if name in _FACTORS:
        return one * other
    return np.add(one, other).tolist()


def _mounted(present: Mapping[str, Any], found: Mapping[str, Any]) -> dict[str, list[float]]:
    """M1 M2: rotation vector, degrees, and position, metres."""
    nothing = [0.0, 0.0, 0.0]
    one, other = (Rotation.from_rotvec(part.get(_TURNED, nothing), degrees=True) for part in (present, found))
    moved = np.add(present.get(_MOVED, nothing), one.apply(found.get(_MOVED, nothing)))
    return {_TURNED: (one * other).as_rotvec(degrees=True).tolist(), _MOVED: moved.tolist()}


def _is_neutral(name: str, value: Any) -> bool:
    neutral = getattr(UNCORRECTED, name, None)
    return bool(np.array_equal(value, neutral)) if isinstance(neutral, tuple) else value == neutral
