"""The usual mistakes: how poses, depths or intrinsics would have to be changed if one of them was made."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import permutations, product
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.camera_model import CameraModel
from tracknoise.geometry.pose import invert
from tracknoise.inspection.optics import principal_point

Poses: TypeAlias = NDArray[np.float64]
MOST_SHIFT_FRAMES = 3
"""Poses that are off by up to this many frames are recognised, frames."""
_SCALES = (1000.0, 0.001, 10.0, 0.1, 5.0, 0.2)
_RESOLUTIONS = (2.0, 0.5)


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A mistake that may have been made, and how to undo it.

    Attributes
    ----------
    kind
        One word for programs; `as_given` where nothing is wrong.
    name
        What is wrong, as the end of the sentence "it looks as if ...".
    poses
        Undoes it in the poses.
    depth_scale
        Factor of all depths.
    along_ray
        Whether depths are distances along the ray.
    resolution
        Factor of focal lengths and principal point.
    zoom
        Factor of the focal lengths alone.
    moves_frames
        Whether the poses of other frames are used.
    """

    kind: str
    name: str
    poses: Callable[[Poses], Poses] = lambda poses: poses
    depth_scale: float = 1.0
    along_ray: bool = False
    resolution: float = 1.0
    zoom: float = 1.0
    moves_frames: bool = False

    def project(self, camera: CameraModel, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 2) float64: pixels of points (n, 3) of the camera frame."""
        centre = principal_point(camera)
        uv = centre + self.zoom * (camera.project(points) - centre)
        return uv * self.resolution + 0.5 * (self.resolution - 1.0)

    def bearings(self, camera: CameraModel, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, 3) float64: rays through pixels, z = 1."""
        centre = principal_point(camera)
        same = (uv - 0.5 * (self.resolution - 1.0)) / self.resolution
        return camera.bearings(centre + (same - centre) / self.zoom)

    def depths(self, bearings: NDArray[np.float64], depth_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) float64: depths along z, metres, of pixels whose rays are given."""
        scaled = depth_m * self.depth_scale
        return scaled / np.linalg.norm(bearings, axis=1) if self.along_ray else scaled


AS_GIVEN = Hypothesis("as_given", "nothing is wrong")
AS_RAY_DEPTH = Hypothesis(
    "ray_depth", "depth is the distance along the ray, not along the optical axis", along_ray=True
)


def hypotheses(*, has_depth: bool = True, is_z: bool = False) -> list[Hypothesis]:
    """All mistakes that are looked for, the most usual first.

    Parameters
    ----------
    has_depth
        Whether there are depths. Without them a scale, and the kind of depth, cannot be seen.
    is_z
        Whether depths are known to be along the optical axis, so that their kind is no mistake.
    """
    orders = _quaternion_orders()
    axes = _axes()
    known = [one for one in axes if one.name in _KNOWN_AXES.values()]
    return [
        Hypothesis("inverted", "poses are inverted: they are camera_from_world, not world_from_camera", invert),
        *known,
        *orders[:2],
        *(_scales() if has_depth else []),
        *([AS_RAY_DEPTH] if has_depth and not is_z else []),
        *(_resolution(factor) for factor in _RESOLUTIONS),
        *(_shifted(n) for n in range(-MOST_SHIFT_FRAMES, MOST_SHIFT_FRAMES + 1) if n),
        Hypothesis("transposed", "rotations are transposed, but positions are right", _transposed),
        *orders[2:],
        *(one for one in axes if one not in known),
    ]


def corrected(poses: Poses, mistake: Hypothesis) -> Poses:
    """(n, 4, 4) float64: the poses with a mistake undone; NaN for frames without a pose."""
    known = np.isfinite(poses).all(axis=(1, 2))
    if mistake.moves_frames or known.all():
        return mistake.poses(poses)
    changed = np.full_like(poses, np.nan)
    changed[known] = mistake.poses(poses[known])
    return changed


def _transposed(poses: Poses) -> Poses:
    changed = poses.copy()
    changed[:, :3, :3] = np.swapaxes(poses[:, :3, :3], 1, 2)
    return changed


def axis_rotations() -> list[NDArray[np.float64]]:
    """The 24 rotations (3, 3) that permute the axes of a frame, the identity first."""
    found = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        matrix = np.zeros((3, 3))
        matrix[range(3), order] = signs
        if np.linalg.det(matrix) > 0:
            found.append(matrix)
    return sorted(found, key=lambda matrix: -float(np.trace(matrix)))


_KNOWN_AXES: dict[tuple[int, ...], str] = {
    (1, -2, -3): "poses have the axes of OpenGL (x right, y up, z backward), not those of a camera image",
    (3, 1, 2): "poses have NED axes (x forward, y right, z down), not those of a camera image",
    (3, -1, -2): "poses have body axes (x forward, y left, z up): the rotation of the camera in the body is missing",
    (2, 3, 1): "poses were converted from NED axes (x forward, y right, z down) although they did not have them",
    (-2, -3, 1): "poses were converted from body axes (x forward, y left, z up) although they did not have them",
}
"""Names of axes. For x, y and z of the poses: which axis of the image it is (1 right, 2 down, 3 forward), with sign."""
_DIRECTIONS = {1: "right", 2: "down", 3: "forward", -1: "left", -2: "up", -3: "backward"}


def _axes() -> list[Hypothesis]:
    """Other axes of the camera, in the order of `_KNOWN_AXES`, then all others."""
    named = {_signed(matrix): matrix for matrix in axis_rotations()[1:]}
    return [_of_axes(signed, named[signed]) for signed in (*_KNOWN_AXES, *(named.keys() - _KNOWN_AXES.keys()))]


def _of_axes(signed: tuple[int, ...], matrix: NDArray[np.float64]) -> Hypothesis:
    turn = np.eye(4)
    turn[:3, :3] = matrix
    each = ", ".join(f"{name} {_DIRECTIONS[axis]}" for name, axis in zip("xyz", signed, strict=True))
    name = _KNOWN_AXES.get(signed, f"poses have axes ({each}) that are not those of a camera image")
    return Hypothesis("axes", name, lambda poses: poses @ turn)


def _signed(matrix: NDArray[np.float64]) -> tuple[int, ...]:
    """Key of a rotation in `_KNOWN_AXES`: row i holds axis i of the poses in the axes of the image."""
    columns = np.argmax(np.abs(matrix), axis=1)
    return tuple(int((column + 1) * matrix[row, column]) for row, column in enumerate(columns))


def _quaternion_orders() -> list[Hypothesis]:
    """Both wrong orders: first as read, then for readers that rename the axes of what they read."""
    reverse = "w x y z were read as x y z w", (1, 2, 3, 0)
    forward = "x y z w were read as w x y z", (3, 0, 1, 2)
    return [_of_order(*order, axes) for axes in axis_rotations() for order in (reverse, forward)]


def _of_order(text: str, source: tuple[int, ...], axes: NDArray[np.float64]) -> Hypothesis:
    name = f"the numbers of quaternions are in another order: {text}"
    return Hypothesis("quaternion_order", name, lambda poses: _reordered(poses, source, axes))


def _reordered(poses: Poses, source: tuple[int, ...], axes: NDArray[np.float64]) -> Poses:
    """Rotations whose quaternion, in other axes, has number ``source[i]`` of what was read as its x, y, z or w."""
    read = Rotation.from_matrix(axes.T @ poses[:, :3, :3] @ axes).as_quat()
    changed = poses.copy()
    changed[:, :3, :3] = axes @ Rotation.from_quat(read[:, list(source)]).as_matrix() @ axes.T
    return changed


def _scales() -> Iterator[Hypothesis]:
    for factor in _SCALES:
        size = f"{factor:g} times too small" if factor > 1 else f"{1 / factor:g} times too large"
        yield Hypothesis("scale", f"depths are {size} for the positions of the camera", depth_scale=factor)


def _resolution(factor: float) -> Hypothesis:
    text = "half" if factor > 1 else "twice"
    return Hypothesis("intrinsics", f"the intrinsics are those of images of {text} the size", resolution=factor)


def _shifted(n: int) -> Hypothesis:
    plural = "s" if abs(n) > 1 else ""
    text = f"poses are off by {abs(n)} frame{plural}: pose i {n:+d} belongs to frame i"
    return Hypothesis("shift", text, lambda poses: _rolled(poses, n), moves_frames=True)


def _rolled(poses: Poses, n: int) -> Poses:
    """Pose i + n for frame i; NaN where there is none."""
    moved = np.full_like(poses, np.nan)
    there = np.arange(len(poses)) + n
    inside = (there >= 0) & (there < len(poses))
    moved[inside] = poses[there[inside]]
    return moved
