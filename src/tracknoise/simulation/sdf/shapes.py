"""Boxes, spheres, cylinders and planes as triangles. Each is centred on its origin, as in SDF."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError
from tracknoise.foreign.xml_file import Element
from tracknoise.simulation.quad import box
from tracknoise.simulation.sdf.part import Part
from tracknoise.simulation.sdf.xml import child_numbers

_AROUND = 32  # number of segments, as in Gazebo
_UPWARDS = 16
_PIECES = 16  # along each side of a plane: a few huge triangles would slow down ray casting


def _box(element: Element, place: str) -> Part:
    """Each face has the whole texture once, upright on vertical faces."""
    half_m = _lengths(element, "size", 3, place) / 2.0
    once = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]])
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    faces = [face.corners[halves] for face in box(np.zeros(3), half_m, Rotation.identity())]
    return Part(np.concatenate(faces), np.tile(once[halves], (len(faces), 1, 1)))


def _plane(element: Element, place: str) -> Part:
    """A rectangle with the whole texture once; rotated from z to its normal by the smallest angle."""
    width, depth = _lengths(element, "size", 2, place)
    normal = child_numbers(element, "normal", (0.0, 0.0, 1.0), place)
    if not np.any(normal):
        raise DataError(place, "<normal> 0 0 0", "a direction")
    s, t = _grid(_PIECES, np.linspace(0.0, 1.0, _PIECES + 1))
    flat = np.stack([(s - 0.5) * width, (0.5 - t) * depth, np.zeros_like(s)], axis=-1)
    axis = np.array([-normal[1], normal[0], 0.0])  # z cross normal
    sine = np.linalg.norm(axis)
    turn = Rotation.from_rotvec((axis / sine if sine else np.eye(3)[0]) * np.arctan2(sine, normal[2]))
    return _patch(turn.apply(flat.reshape(-1, 3)).reshape(flat.shape), s, t)


def _sphere(element: Element, place: str) -> Part:
    """The texture goes once around the vertical, and from pole to pole."""
    (radius,) = _lengths(element, "radius", 1, place)
    rows = np.linspace(0.0, 1.0, _UPWARDS + 1)
    return _revolved(radius * np.sin(np.pi * rows), radius * np.cos(np.pi * rows), rows)


def _cylinder(element: Element, place: str) -> Part:
    """The texture goes once around the side; the ends have the colours of its borders."""
    (radius,), (length,) = _lengths(element, "radius", 1, place), _lengths(element, "length", 1, place)
    z = length / 2.0
    return _revolved(np.array([0.0, radius, radius, 0.0]), np.array([z, z, -z, -z]), np.array([0.0, 0.0, 1.0, 1.0]))


SHAPES: Mapping[str, Callable[[Element, str], Part]] = MappingProxyType(
    {"box": _box, "sphere": _sphere, "cylinder": _cylinder, "plane": _plane}
)
"""Functions that make the triangles of a shape from its element and its place (for messages), by element name."""


def _lengths(element: Element, tag: str, count: int, place: str) -> NDArray[np.float64]:
    """Sizes, metres; 1 if they are not given."""
    lengths = child_numbers(element, tag, (1.0,) * count, place)
    if np.any(lengths <= 0.0):
        raise DataError(place, f"<{tag}> {' '.join(f'{length:g}' for length in lengths)}", "lengths above 0")
    return lengths


def _revolved(radius_m: NDArray[np.float64], z_m: NDArray[np.float64], rows: NDArray[np.float64]) -> Part:
    """An outline from top to bottom, with the row of the texture at each of its points, revolved about z."""
    s, t = _grid(_AROUND, rows)
    level = radius_m[:, None, None] * np.stack([np.cos(2.0 * np.pi * s), np.sin(2.0 * np.pi * s)], axis=-1)
    return _patch(np.concatenate([level, np.broadcast_to(z_m[:, None, None], (*s.shape, 1))], axis=-1), s, t)


def _grid(columns: int, rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Texture coordinates (rows, columns + 1) of the nodes of a grid."""
    s, t = np.meshgrid(np.linspace(0.0, 1.0, columns + 1), rows)
    return s, t


def _patch(points: NDArray[np.float64], s: NDArray[np.float64], t: NDArray[np.float64]) -> Part:
    """Triangles of a grid of points (rows, columns, 3), seen from the side where columns go right and rows go down."""
    nodes = np.concatenate([points, s[..., None], t[..., None]], axis=-1)
    above, below, below_right, right = nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]
    halves = [[above, below, below_right], [above, below_right, right]]
    triangles = np.concatenate([np.stack(half, axis=-2).reshape(-1, 3, 5) for half in halves])
    return Part(triangles[..., :3], triangles[..., 3:])
