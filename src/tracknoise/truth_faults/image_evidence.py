"""What images say about a recording: motion of points, and how far it is from what the truth predicts.

Image motion is measured from images alone. That of a camera whose intrinsics change is as one camera would have seen
it.
"""

from collections.abc import Callable, Iterator
from collections.abc import Sequence as ListOf
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import permutations, product
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.corrections import Corrections
from tracknoise.geometry.depth import DepthMap, sample
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.sequence import (
    IMAGE_AXES,
    NED_AXES,
    OPENGL_AXES,
    Axes,
    Sequence,
    body_of,
    camera_at,
    recorded_axes,
    z_depth_from,
)
from tracknoise.text import significant


def focal_px(camera: CameraModel) -> float:
    """Pixels per unit of slope at the centre of the image."""
    centre = np.array([(camera.width - 1) / 2, (camera.height - 1) / 2])
    rays = camera.bearings(centre + np.array([[-0.5, 0.0], [0.5, 0.0]]))
    return float(1.0 / abs(rays[1, 0] - rays[0, 0]))


@lru_cache
def principal_point(camera: CameraModel) -> NDArray[np.float64]:
    """(2,) float64: pixel of the optical axis."""
    centre: NDArray[np.float64] = camera.project(np.array([[0.0, 0.0, 1.0]]))[0]
    return centre


SHORT_PX, LONG_PX = 3.0, 15.0
"""Median image motion of the two baselines at which images, poses and depths are compared, px."""
FEWEST_POINTS = 12
"""A pair of images with fewer points is not used."""


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Points of one image that were found again in another.

    Attributes
    ----------
    first, second
        The two frames.
    uv_first, uv_second
        (n, 2) float64, px.
    depth_first_m, depth_second_m
        (n,) float64, metres: depth at the point in each frame; NaN where unknown.
    """

    first: int
    second: int
    uv_first: NDArray[np.float64]
    uv_second: NDArray[np.float64]
    depth_first_m: NDArray[np.float64]
    depth_second_m: NDArray[np.float64]

    @property
    def motion_px(self) -> float:
        """Median length of the image motion, px."""
        return float(np.median(np.linalg.norm(self.uv_second - self.uv_first, axis=1)))

    @property
    def has_depth(self) -> bool:
        """Whether enough points have a depth in the first frame."""
        return int(np.isfinite(self.depth_first_m).sum()) >= FEWEST_POINTS

    def corrected(self, of_depths: Corrections) -> "Pair":
        """The same with corrected depths."""
        depths = (of_depths.depths_m(stated_m) for stated_m in (self.depth_first_m, self.depth_second_m))
        first_m, second_m = (np.where(depth_m > 0.0, depth_m, np.nan) for depth_m in depths)
        return replace(self, depth_first_m=first_m, depth_second_m=second_m)


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """Image motion of a recording.

    Attributes
    ----------
    steps
        Pairs of consecutive frames.
    wide
        Pairs whose image motion has just reached `SHORT_PX` or `LONG_PX`, or as far as points could be followed.
    """

    steps: tuple[Pair, ...]
    wide: tuple[Pair, ...]


Poses: TypeAlias = NDArray[np.float64]
MOST_SHIFT_FRAMES = 3
"""Poses that are off by up to this many frames are recognised, frames."""
_SCALES = (1000.0, 0.001, 100.0, 0.01, 10.0, 0.1, 5.0, 0.2)
_SOME_FACTORS = np.array([1.2, 1.6, 2.5])
_ANY_FACTORS = np.array([1.1, 1.35, *np.geomspace(1.5, 1000.0, 40)])
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
    is_about
        Whether the factor is the nearest one of a series.
    """

    kind: str
    name: str
    poses: Callable[[Poses], Poses] = lambda poses: poses
    depth_scale: float = 1.0
    along_ray: bool = False
    resolution: float = 1.0
    zoom: float = 1.0
    moves_frames: bool = False
    is_about: bool = False

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


AS_TURNING = Hypothesis(
    "positions",
    "errors of the camera's positions are larger than the parallax",
    lambda poses: _turning(poses),
)
"""The camera only turns: a scale of positions that fits no better is none, but makes their errors smaller."""


def _turning(poses: Poses) -> Poses:
    changed = poses.copy()
    changed[:, :3, 3] = np.where(np.isfinite(poses[:, :3, 3]), 0.0, np.nan)
    return changed


def hypotheses(
    *,
    has_depth: bool = True,
    is_z: bool = False,
    expected: Axes = IMAGE_AXES,
    body_from_camera: NDArray[np.float64] | None = None,
) -> list[Hypothesis]:
    """All mistakes that are looked for, the most usual first.

    `expected`: axes that the reader expects of poses. `body_from_camera`: (4, 4), where the recording states it.
    """
    orders = _quaternion_orders()
    known_axes, other_axes = _axes(expected)
    return [
        *_inversions(expected),
        *_of_body(body_from_camera),
        *known_axes,
        *orders[:2],
        *([AS_TURNING, *_scales()] if has_depth else []),
        *([AS_RAY_DEPTH] if has_depth and not is_z else []),
        *(_resolution(factor) for factor in _RESOLUTIONS),
        *(_shifted(n) for n in range(-MOST_SHIFT_FRAMES, MOST_SHIFT_FRAMES + 1) if n),
        Hypothesis("transposed", "rotations are transposed, but positions are right", _transposed),
        *orders[2:],
        *other_axes,
    ]


def corrected(poses: Poses, mistake: Hypothesis) -> Poses:
    """(n, 4, 4) float64: the poses with a mistake undone; NaN for frames without a pose."""
    has_pose = np.isfinite(poses).all(axis=(1, 2))
    if mistake.moves_frames or has_pose.all():
        return mistake.poses(poses)
    changed = np.full_like(poses, np.nan)
    changed[has_pose] = mistake.poses(poses[has_pose])
    return changed


def _transposed(poses: Poses) -> Poses:
    changed = poses.copy()
    changed[:, :3, :3] = np.swapaxes(poses[:, :3, :3], 1, 2)
    return changed


def axis_rotations() -> list[NDArray[np.float64]]:
    """The 24 rotations (3, 3) that permute the axes of a frame, the identity first."""
    rotations = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        matrix = np.zeros((3, 3))
        matrix[range(3), order] = signs
        if np.linalg.det(matrix) > 0:
            rotations.append(matrix)
    return sorted(rotations, key=lambda matrix: -float(np.trace(matrix)))


_KNOWN_AXES: dict[Axes, str] = {
    OPENGL_AXES: "poses have the axes of OpenGL (x right, y up, z backward), not those of a camera image",
    NED_AXES: "poses have NED axes (x forward, y right, z down), not those of a camera image",
    (3, -1, -2): "poses have body axes (x forward, y left, z up): the rotation of the camera in the body is missing",
    (2, 3, 1): "poses were converted from NED axes (x forward, y right, z down) although they did not have them",
    (-2, -3, 1): "poses were converted from body axes (x forward, y left, z up) although they did not have them",
}
"""What is wrong where a reader expects the axes of an image."""
_NAMED_AXES: dict[Axes, str] = {IMAGE_AXES: "of a camera image ", OPENGL_AXES: "of OpenGL ", NED_AXES: "of NED "}
_DIRECTIONS = {1: "right", 2: "down", 3: "forward", -1: "left", -2: "up", -3: "backward"}


def _inversions(expected: Axes) -> Iterator[Hypothesis]:
    """Inverted poses: as they are, and inverted before the reader turned their axes into those of the image."""
    name = "poses are inverted: they are camera_from_world, not world_from_camera"
    yield Hypothesis("inverted", name, invert)
    if expected != IMAGE_AXES:
        turn = _turn(expected)
        yield Hypothesis("inverted", name, lambda poses: invert(poses @ turn.T) @ turn)


def _of_body(body_from_camera: NDArray[np.float64] | None) -> Iterator[Hypothesis]:
    """Mistakes of the poses of a body that the camera is mounted on, and of the mounting; none where it is the body."""
    if body_from_camera is None or np.allclose(body_from_camera, np.eye(4)):
        return
    back = invert(body_from_camera)
    yield Hypothesis(
        "mounting",
        "the pose of the camera on the body (T_BS, T_cam_imu) is inverted",
        lambda poses: poses @ back @ back,
    )
    name = "poses of the body are inverted: they are body_from_world, not world_from_body"
    yield Hypothesis("inverted", name, lambda poses: invert(poses @ back) @ body_from_camera)
    for text, source in _ORDERS:
        name = f"the numbers of quaternions are in another order: {text}"
        yield Hypothesis("quaternion_order", name, partial(_reordered_on_body, body_from_camera, source))


def _reordered_on_body(body_from_camera: NDArray[np.float64], source: tuple[int, ...], poses: Poses) -> Poses:
    return _reordered(poses @ invert(body_from_camera), source, np.eye(3)) @ body_from_camera


def _axes(expected: Axes) -> tuple[list[Hypothesis], list[Hypothesis]]:
    """Other axes of the camera than those that the reader expects of poses: the known ones, and all others."""
    all_axes = [_signed(matrix) for matrix in axis_rotations()]
    named = [IMAGE_AXES, *_KNOWN_AXES]
    known_axes, other_axes = (
        [axes for axes in group if axes != expected] for group in (named, sorted({*all_axes} - {*named}))
    )
    return [_of_axes(axes, expected) for axes in known_axes], [_of_axes(axes, expected) for axes in other_axes]


def _of_axes(signed: Axes, expected: Axes) -> Hypothesis:
    turn = _turn(expected).T @ _turn(signed)
    return Hypothesis("axes", _name_of_axes(signed, expected, _signed(turn[:3, :3])), lambda poses: poses @ turn)


def _name_of_axes(recorded: Axes, expected: Axes, read: Axes) -> str:
    """What is wrong with axes. `read`: those that poses have once the reader turned its own into those of the image."""
    unlisted = f"poses have axes ({_directions(read)}) that are not those of a camera image"
    name = _KNOWN_AXES.get(read, unlisted)
    if expected == IMAGE_AXES:
        return name
    wanted = f"axes {_NAMED_AXES[expected]}({_directions(expected)})"
    if recorded in _NAMED_AXES:
        recorded_text = f"axes {_NAMED_AXES[recorded]}({_directions(recorded)})"
        return f"recorded poses have {recorded_text}, where the format of the reader has {wanted}"
    return f"{name}, once the reader has turned {wanted} into those"


def _directions(signed: Axes) -> str:
    return ", ".join(f"{name} {_DIRECTIONS[axis]}" for name, axis in zip("xyz", signed, strict=True))


def _turn(signed: Axes) -> NDArray[np.float64]:
    """(4, 4): poses with these axes times it have those of the image."""
    turn = np.eye(4)
    turn[:3, :3] = [np.sign(axis) * np.eye(3)[abs(axis) - 1] for axis in signed]
    return turn


def _signed(matrix: NDArray[np.float64]) -> Axes:
    """Row i of a rotation holds axis i of the poses in the axes of the image."""
    columns = np.argmax(np.abs(matrix), axis=1)
    x, y, z = (int((column + 1) * matrix[row, column]) for row, column in enumerate(columns))
    return x, y, z


_ORDERS = (("w x y z were read as x y z w", (1, 2, 3, 0)), ("x y z w were read as w x y z", (3, 0, 1, 2)))


def _quaternion_orders() -> list[Hypothesis]:
    """Both wrong orders: first as read, then for readers that rename the axes of what they read."""
    return [_of_order(*order, axes) for axes in axis_rotations() for order in _ORDERS]


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
        name = f"depths are {_times(factor, '{:g}'.format)} for the positions of the camera"
        yield Hypothesis("scale", name, depth_scale=factor)
    yield from _about(_SOME_FACTORS)


@lru_cache
def any_scale() -> tuple[Hypothesis, ...]:
    """Other factors of depths than the usual ones."""
    return _about(_ANY_FACTORS)


def _about(larger: NDArray[np.float64]) -> tuple[Hypothesis, ...]:
    """Factors above 1 and their inverses, each as the nearest of a series."""
    factors = (*larger, *(1.0 / larger))
    about = [f"depths are about {_times(factor, _rounded)} for the positions of the camera" for factor in factors]
    return tuple(
        Hypothesis("scale", name, depth_scale=float(factor), is_about=True)
        for name, factor in zip(about, factors, strict=True)
    )


_PER_CENT_TOO_LONG = (-40, -30, -20, -15, -10, -7, 7, 10, 15, 20, 30, 45, 60)


@lru_cache
def other_focal_lengths() -> tuple[Hypothesis, ...]:
    """Focal lengths that are not those of another resolution."""
    return tuple(
        Hypothesis(
            "focal",
            f"the focal length is about {abs(share)} % too {'long' if share > 0 else 'short'}",
            zoom=1.0 / (1.0 + share / 100.0),
        )
        for share in _PER_CENT_TOO_LONG
    )


def _times(factor: float, shown: Callable[[float], str]) -> str:
    return f"{shown(factor)} times too small" if factor > 1.0 else f"{shown(1.0 / factor)} times too large"


def _rounded(factor: float) -> str:
    return significant(factor, 2)


def _resolution(factor: float) -> Hypothesis:
    text = "half" if factor > 1 else "twice"
    return Hypothesis("intrinsics", f"the intrinsics are those of images of {text} the size", resolution=factor)


def _shifted(n: int) -> Hypothesis:
    plural = "s" if abs(n) > 1 else ""
    text = f"poses are off by {abs(n)} frame{plural}: pose i {'+' if n > 0 else '-'} {abs(n)} belongs to frame i"
    return Hypothesis("shift", text, lambda poses: _rolled(poses, n), moves_frames=True)


def _rolled(poses: Poses, n: int) -> Poses:
    """Pose i + n for frame i; NaN where there is none."""
    moved = np.full_like(poses, np.nan)
    place = np.arange(len(poses)) + n
    inside = (place >= 0) & (place < len(poses))
    moved[inside] = poses[place[inside]]
    return moved


_KEPT = 256
"""Rays of this many pairs are kept: most hypotheses change poses alone, and the inverse of a distortion is slow."""


def relative_pose(poses: Poses, pair: Pair) -> NDArray[np.float64]:
    """(4, 4) float64: second_from_first; NaN where a pose is missing."""
    relative: NDArray[np.float64] = invert(poses[pair.second]) @ poses[pair.first]
    return relative


def reprojection_px(
    pair: Pair, relative: NDArray[np.float64], camera: CameraModel, assumed: Hypothesis
) -> NDArray[np.float64]:
    """(m, 2) float64: observed minus predicted position of each point with depth, px; infinite behind the camera."""
    has_depth = np.isfinite(pair.depth_first_m)
    bearings = _rays(pair, camera, assumed.resolution, assumed.zoom)[0][has_depth]
    points = bearings * assumed.depths(bearings, pair.depth_first_m[has_depth])[:, None]
    with np.errstate(all="ignore"):
        predicted = assumed.project(camera, transform(relative, points))
    residual = pair.uv_second[has_depth] - predicted
    return np.where(np.isfinite(residual), residual, np.inf)


def epipolar_px(
    pair: Pair, relative: NDArray[np.float64], camera: CameraModel, assumed: Hypothesis
) -> NDArray[np.float64]:
    """(n,) float64: signed distance of each point from its epipolar line, px at the centre of the image.

    From where the rotation alone moves it, if the camera stays at its place: there are no such lines then.
    """
    first, second = _rays(pair, camera, assumed.resolution, assumed.zoom)
    turned = first @ relative[:3, :3].T
    lines = np.cross(relative[:3, 3], turned)
    norm = np.linalg.norm(lines[:, :2], axis=1)
    with np.errstate(all="ignore"):
        distance = np.einsum("ni,ni->n", lines, second) / norm
        if not relative[:3, 3].any():
            distance = np.linalg.norm(second[:, :2] - turned[:, :2] / turned[:, 2:], axis=1)
        distance = distance * focal_px(camera) * assumed.resolution
    return np.where(np.isfinite(distance), distance, np.inf)


def median_residual_px(pair: Pair, poses: Poses, camera: CameraModel, assumed: Hypothesis, *, has_depth: bool) -> float:
    """Median distance of the points of a pair from their prediction, px; NaN where a pose is missing."""
    residual = residuals_px(pair, poses, camera, assumed, has_depth=has_depth)
    return float(np.median(residual)) if len(residual) >= FEWEST_POINTS else np.nan


def residuals_px(
    pair: Pair, poses: Poses, camera: CameraModel, assumed: Hypothesis, *, has_depth: bool
) -> NDArray[np.float64]:
    """(m,) float64: distances of the points of a pair from their prediction, px; none where a pose is missing."""
    relative = relative_pose(poses, pair)
    if not np.isfinite(relative).all():
        return np.empty(0)
    if has_depth:
        return np.asarray(np.linalg.norm(reprojection_px(pair, relative, camera, assumed), axis=1))
    return np.abs(epipolar_px(pair, relative, camera, assumed))


@lru_cache(maxsize=_KEPT)
def _rays(
    pair: Pair, camera: CameraModel, resolution: float, zoom: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n, 3) float64 each: rays through the points of both images, z = 1."""
    assumed = Hypothesis("optics", "other optics", resolution=resolution, zoom=zoom)
    return assumed.bearings(camera, pair.uv_first), assumed.bearings(camera, pair.uv_second)


def seen_by_one_camera(flow: Flow, sequence: Sequence) -> Flow:
    """Positions of points where the camera of the first frame would have seen them; unchanged if that is the camera.

    Rays and depths stay as they are. Points without a position in that camera are left out.

    Parameters
    ----------
    flow
        Image motion of the sequence.
    sequence
        With the camera of each frame.
    """
    frames = {frame for pair in (*flow.steps, *flow.wide) for frame in (pair.first, pair.second)}
    cameras = {frame: camera_at(sequence, frame) for frame in frames}
    if all(camera == sequence.camera for camera in cameras.values()):
        return flow
    steps, wide = (
        (_moved(pair, cameras[pair.first], cameras[pair.second], sequence.camera) for pair in pairs)
        for pairs in (flow.steps, flow.wide)
    )
    return Flow(tuple(filter(_has_points, steps)), tuple(filter(_has_points, wide)))


def _moved(pair: Pair, first: CameraModel, second: CameraModel, to: CameraModel) -> Pair:
    uv_first, uv_second = _seen(pair.uv_first, first, to), _seen(pair.uv_second, second, to)
    usable = np.flatnonzero(np.isfinite(uv_first).all(axis=1) & np.isfinite(uv_second).all(axis=1))
    return replace(
        pair,
        uv_first=uv_first[usable],
        uv_second=uv_second[usable],
        depth_first_m=pair.depth_first_m[usable],
        depth_second_m=pair.depth_second_m[usable],
    )


def _has_points(pair: Pair) -> bool:
    return len(pair.uv_first) >= FEWEST_POINTS


def _seen(uv: NDArray[np.float64], by: CameraModel, to: CameraModel) -> NDArray[np.float64]:
    """(n, 2) float64, px: positions of the rays through pixels of one camera in another."""
    return uv if by == to else to.project(by.bearings(uv))


_MOST_FRAMES, _WINDOW_FRAMES = 240, 30
_CHAIN_EVERY, _CHAIN_STEPS = 3, 30
_POINTS, _MARGIN_PX, _SPACING_PX = 200, 12, 12
_ROUND_TRIP_PX = 0.5
_LEAST_QUALITY = 0.005
_WINDOW = (21, 21)
_LEVELS = 4


@dataclass(slots=True, eq=False)
class _Chain:
    """Points of one frame that are followed from frame to frame."""

    first: int
    uv_first: NDArray[np.float64]
    uv: NDArray[np.float64]
    depth_m: NDArray[np.float64]
    thresholds_px: tuple[float, ...]


def windows(n_frames: int, most: int = _MOST_FRAMES, length: int = _WINDOW_FRAMES) -> list[range]:
    """Parts of a recording that are read: all of a short one, otherwise stretches spread evenly over it."""
    if n_frames <= most:
        return [range(n_frames)]
    starts = np.linspace(0, n_frames - length, most // length).astype(int)
    return [range(start, start + length) for start in starts.tolist()]


def measure_flow(sequence: Sequence, parts: ListOf[range]) -> Flow:
    """Follow points through parts of a recording with pyramidal Lucas-Kanade, forward and back."""
    steps: list[Pair] = []
    wide: list[Pair] = []
    for part in parts:
        for pair in _followed(sequence, part):
            (steps if pair.second == pair.first + 1 else wide).append(pair)
    return Flow(tuple(steps), tuple(wide))


def _followed(sequence: Sequence, part: range) -> Iterator[Pair]:
    """Pairs of one stretch of frames."""
    previous = sequence.image(part[0])
    chains = [_begin(part[0], previous, camera_at(sequence, part[0]), sequence.depth(part[0]), wide=True)]
    for index in part[1:]:
        image, camera, depth = sequence.image(index), camera_at(sequence, index), sequence.depth(index)
        _follow(chains, previous, image)
        chains = [chain for chain in chains if len(chain.uv) >= FEWEST_POINTS]
        for chain in chains:
            yield from _emitted(chain, index, camera, depth, is_last=index == part[-1])
        chains = [chain for chain in chains if chain.thresholds_px and index - chain.first < _CHAIN_STEPS]
        chains.append(_begin(index, image, camera, depth, wide=(index - part[0]) % _CHAIN_EVERY == 0))
        previous = image


def _begin(index: int, image: NDArray[np.uint8], camera: CameraModel, depth: DepthMap | None, *, wide: bool) -> _Chain:
    """Corners of one frame, with their depths."""
    margin = np.zeros_like(image)
    margin[_MARGIN_PX:-_MARGIN_PX, _MARGIN_PX:-_MARGIN_PX] = 255
    corners = cv2.goodFeaturesToTrack(image, _POINTS, _LEAST_QUALITY, _SPACING_PX, mask=margin)
    uv: NDArray[np.float64] = np.array([] if np.ndim(corners) == 0 else corners, dtype=np.float64).reshape(-1, 2)
    return _Chain(index, uv, uv, _depths(depth, uv, camera), (SHORT_PX, LONG_PX) if wide else ())


def _follow(chains: ListOf[_Chain], previous: NDArray[np.uint8], image: NDArray[np.uint8]) -> None:
    """Move the points of chains into the next image; drop those that are not found again on the way back.

    All points are tracked together, so that the image pyramids are built once for all chains.
    """
    start = np.concatenate([np.zeros((0, 2)), *(chain.uv for chain in chains)]).astype(np.float32)
    if not len(start):
        return
    moved, is_found = _tracked(previous, image, start)
    back, is_found_back = _tracked(image, previous, moved)
    good = is_found & is_found_back & (np.linalg.norm(back - start, axis=1) < _ROUND_TRIP_PX)
    height, width = image.shape
    good &= np.all((moved >= 0) & (moved <= (width - 1, height - 1)), axis=1)
    ends = np.cumsum([len(chain.uv) for chain in chains])[:-1]
    for chain, kept, uv in zip(chains, np.split(good, ends), np.split(moved, ends), strict=True):
        chain.uv_first, chain.uv = chain.uv_first[kept], uv[kept].astype(np.float64)
        chain.depth_m = chain.depth_m[kept]


def _tracked(
    source: NDArray[np.uint8], target: NDArray[np.uint8], uv: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """(n, 2) positions of points in another image, and (n,) whether they were found."""
    moved, status, _ = cv2.calcOpticalFlowPyrLK(source, target, uv, uv.copy(), winSize=_WINDOW, maxLevel=_LEVELS)
    return np.asarray(moved, dtype=np.float32), status[:, 0] == 1


def _emitted(
    chain: _Chain, index: int, camera: CameraModel, depth: DepthMap | None, *, is_last: bool
) -> Iterator[Pair]:
    """The pair of a chain's first frame and this one, where it is consecutive or has reached a baseline."""
    pair = Pair(chain.first, index, chain.uv_first, chain.uv, chain.depth_m, _depths(depth, chain.uv, camera))
    if index == chain.first + 1:
        yield pair
    reached = [least for least in chain.thresholds_px if pair.motion_px >= least]
    ends = is_last or index - chain.first == _CHAIN_STEPS
    if (reached or (chain.thresholds_px and ends)) and index > chain.first + 1:
        yield pair
    chain.thresholds_px = tuple(least for least in chain.thresholds_px if least not in reached)


def _depths(depth: DepthMap | None, uv: NDArray[np.float64], camera: CameraModel) -> NDArray[np.float64]:
    """(n,) float64: depth at points, NaN where unknown."""
    if depth is None or not len(uv):
        return np.full(len(uv), np.nan)
    read = sample(depth, uv, camera)
    return np.where(read.valid, read.depth_m, np.nan)


LEAST_MOTION_PX = 0.5
"""Pairs of images with less motion say nothing about poses."""
MOST_PAIRS = 60
"""Hypotheses are compared on at most this many pairs."""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """Image motion of a sequence with its poses and intrinsics.

    Attributes
    ----------
    flow
        Measured from the images.
    poses
        (n, 4, 4) float64, NaN for frames without a pose.
    camera
        Intrinsics of the images.
    has_depth
        Whether most pairs have depths.
    pairs
        Pairs of frames with image motion and poses, by their first frame; with depths if `has_depth`.
    z_depth_from
        What depths that are along z by construction were computed from; None where their kind is only stated.
    expected
        Axes of the camera that the reader expects in recorded poses.
    body_from_camera
        (4, 4) float64: the mounting of the camera that the recording states; None where it states none.
    """

    flow: Flow
    poses: NDArray[np.float64]
    camera: CameraModel
    has_depth: bool
    pairs: tuple[Pair, ...]
    z_depth_from: str | None = None
    expected: Axes = IMAGE_AXES
    body_from_camera: NDArray[np.float64] | None = None

    @classmethod
    def of(
        cls,
        flow: Flow,
        poses: NDArray[np.float64],
        camera: CameraModel,
        z_depth_from: str | None = None,
        expected: Axes = IMAGE_AXES,
        body_from_camera: NDArray[np.float64] | None = None,
    ) -> "Evidence":
        """Choose the pairs that can be compared with poses."""
        has_pose: NDArray[np.bool_] = np.isfinite(poses.sum(axis=(1, 2)))
        by_frames = {(pair.first, pair.second): pair for pair in (*flow.steps, *flow.wide)}
        moving = [
            pair
            for _, pair in sorted(by_frames.items())
            if pair.motion_px >= LEAST_MOTION_PX and has_pose[pair.first] and has_pose[pair.second]
        ]
        with_depth = [pair for pair in moving if pair.has_depth]
        has_depth = bool(with_depth) and 2 * len(with_depth) >= len(moving)
        pairs = tuple(with_depth if has_depth else moving)
        known_from = z_depth_from if has_depth else None
        return cls(flow, poses, camera, has_depth, pairs, known_from, expected, body_from_camera)

    @classmethod
    def stated(cls, flow: Flow, poses: NDArray[np.float64], sequence: Sequence) -> "Evidence":
        """With what a sequence states of its camera, depths and poses."""
        body = body_of(sequence)
        mounting = None if body is None else body.from_camera
        return cls.of(flow, poses, sequence.camera, z_depth_from(sequence), recorded_axes(sequence), mounting)

    def with_truth(self, poses: NDArray[np.float64], of_depths: Corrections) -> "Evidence":
        """The same with other poses, (n, 4, 4), NaN for frames whose pairs are left out, and corrected depths."""
        has_pose: NDArray[np.bool_] = np.isfinite(poses.sum(axis=(1, 2)))
        parts = (
            tuple(pair.corrected(of_depths) for pair in pairs if has_pose[pair.first] and has_pose[pair.second])
            for pairs in (self.flow.steps, self.flow.wide)
        )
        return Evidence.of(Flow(*parts), poses, self.camera, self.z_depth_from, self.expected, self.body_from_camera)

    @property
    def stands_still(self) -> bool:
        """Whether all poses are the same."""
        poses = self.poses[np.isfinite(self.poses).all(axis=(1, 2))]
        return len(poses) > 1 and float(np.ptp(poses, axis=0).max()) == 0.0

    @classmethod
    def measured(cls, sequence: Sequence) -> "Evidence":
        """Measure the image motion of a sequence; as its first camera would have seen it, if the camera changes.

        Raises
        ------
        DataError
            If an image or depth cannot be read.
        """
        flow = measure_flow(sequence, windows(len(sequence)))
        seen = seen_by_one_camera(flow, sequence)
        return cls.stated(seen, sequence.world_from_camera, sequence)


def thinned(pairs: ListOf[Pair]) -> list[Pair]:
    """At most `MOST_PAIRS` of some pairs, spread evenly."""
    if len(pairs) <= MOST_PAIRS:
        return list(pairs)
    return [pairs[place] for place in np.linspace(0, len(pairs) - 1, MOST_PAIRS).astype(int)]


def residual_px(evidence: Evidence, pair: Pair, assumed: Hypothesis) -> float:
    """Median distance of the points of a pair from their prediction, px; NaN where a pose is missing."""
    return median_residual_px(pair, evidence.poses, evidence.camera, assumed, has_depth=evidence.has_depth)
