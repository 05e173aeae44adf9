"""Scenes whose true positions have a closed form, and tracks in them that are written down in advance.

The scenes are planes, seen by a pinhole camera that moves and turns. All formulas of projection are written out here.
The self-test compares them with `tracknoise.geometry` and `tracknoise.truth`, and uses neither.

A pixel (u, v) has its centre at whole numbers. In the frame of the camera its ray is r = ((u - cx) / fx,
(v - cy) / fy, 1). With the rotation R and the position t of the camera, it meets the plane a + alpha b + beta c at the
depth Z and the coordinates alpha, beta that solve

    Z R r - alpha b - beta c = a - t (ray)

so that Z = (a - t).n / (R r).n with the normal n = b x c. A panel is the part of a plane with 0 <= alpha, beta <= 1.
The panel with the least depth Z > 0 is seen. The image of the world point X is u = fx x / z + cx, v = fy y / z + cy
with (x, y, z) = R' (X - t) (image).

A script holds what the package must find: the true position, its visibility and the age of each observation, and why
each track ended. The tracker reports observed positions and ends alone.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.images import encode_png
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.sequence import Scan, TruthKind
from tracknoise.sequences.views import View
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.tracker import Frame, SequenceContext, Step

Array = NDArray[np.float64]

NOTHING = -1
"""In place of the number of a panel: the ray meets none."""


@dataclass(frozen=True, slots=True)
class Pinhole:
    """Focal lengths and principal point, px, and the size of the image."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def rays(self, uv: Array) -> Array:
        """Rays of pixels (..., 2), scaled to depth 1, (..., 3)."""
        x, y = (uv[..., 0] - self.cx) / self.fx, (uv[..., 1] - self.cy) / self.fy
        return np.stack([x, y, np.ones_like(x)], axis=-1)

    def image(self, points: Array) -> Array:
        """Pixels (..., 2) of points of the camera's frame (..., 3) in front of it."""
        x, y, z = np.moveaxis(points, -1, 0)
        return np.stack([self.fx * x / z + self.cx, self.fy * y / z + self.cy], axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Panels and a camera path."""

    camera: Pinhole  # its intrinsics
    panels: Array  # (panels, 3, 3): a, b and c of each panel, metres, world frame
    # (frames, 4): unit quaternions (x, y, z, w) that turn directions from the frame of the camera to the world
    quaternions: Array
    positions: Array  # (frames, 3): of the camera, metres, world frame

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.positions)

    @property
    def rotations(self) -> Array:
        """(frames, 3, 3) R of each frame."""
        return rotation_of(self.quaternions)

    def look(self, frame: NDArray[np.int64], uv: Array) -> tuple[Array, NDArray[np.int64]]:
        """Depth Z along the optical axis under pixels, and the panel that is seen, by (ray).

        Shapes: frame (...), uv (..., 2) px.
        """
        rays = np.einsum("...ij,...j->...i", self.rotations[frame], self.camera.rays(uv))
        depth = np.stack([_met(each, self.positions[frame], rays) for each in self.panels])
        nearest = depth.min(axis=0)
        return nearest, np.where(np.isfinite(nearest), depth.argmin(axis=0), NOTHING)

    def world(self, frame: NDArray[np.int64], uv: Array, depth: Array) -> Array:
        """World points (..., 3) at depths under pixels."""
        points = depth[..., None] * self.camera.rays(uv)
        turned: Array = np.einsum("...ij,...j->...i", self.rotations[frame], points)
        return turned + self.positions[frame]

    def images(self, points: Array) -> tuple[Array, Array]:
        """Pixels (n, frames, 2) and depths (n, frames) of world points (n, 3) in all frames, by (image)."""
        apart = points[:, None, :] - self.positions
        seen = np.einsum("fji,nfj->nfi", self.rotations, apart)
        return self.camera.image(seen), seen[..., 2]


def _met(panel: Array, position: Array, rays: Array) -> Array:
    """Z of (ray) for rays (..., 3) in the world frame that start at positions (..., 3); infinite where they miss."""
    a, b, c = panel
    normal = np.cross(b, c)
    with np.errstate(divide="ignore"):
        z: Array = (a - position) @ normal / (rays @ normal)
    point = position + np.where(np.isfinite(z), z, 0.0)[..., None] * rays - a
    alpha, beta = (
        point @ side / (along @ side) for along, side in ((b, np.cross(c, normal)), (c, np.cross(b, normal)))
    )
    met = (z > 0) & (np.minimum(alpha, beta) >= 0) & (np.maximum(alpha, beta) <= 1)
    depth: Array = np.where(met, z, np.inf)
    return depth


def rotation_of(quaternions: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4) (x, y, z, w)."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def about(axis: tuple[float, float, float], angle: Array) -> Array:
    """Unit quaternions (n, 4) of rotations by angles (n,), radians, about an axis."""
    unit = np.array(axis) / np.linalg.norm(axis)
    return np.concatenate([np.sin(angle / 2)[:, None] * unit, np.cos(angle / 2)[:, None]], axis=1)


def product(p: Array, q: Array) -> Array:
    """Products (n, 4) of quaternions: the rotation q, and then p."""
    (a, r), (b, s) = ((each[..., :3], each[..., 3:]) for each in (p, q))
    vector = r * b + s * a + np.cross(a, b)
    return np.concatenate([vector, r * s - (a * b).sum(axis=-1, keepdims=True)], axis=-1)


def panel(corner: tuple[float, ...], right: tuple[float, ...], down: tuple[float, ...]) -> Array:
    """a, b and c of a panel, (3, 3), from a corner and two sides."""
    return np.array([corner, right, down])


def occluded_scene(number: int, *, n_frames: int) -> Scene:
    """A slanted wall behind a slanted board; the camera moves to the side, forward, and turns.

    Neither the world axes nor the first camera are special: a rotation that is transposed, or a pose that is inverted,
    changes all positions.
    """
    step = np.arange(n_frames, dtype=np.float64)
    wall, board = _panels(number)
    turned = rotation_of(about((1.0, 2.0, -0.5), np.array([0.7 + 0.3 * number])))[0]
    start = np.array([0.8, -1.1, 0.4])
    moved = np.column_stack([0.06 * step, 0.008 * np.sin(0.4 * step), 0.02 * step])
    own = product(about((0.0, 1.0, 0.1), 0.004 * step), about((0.0, 0.0, 1.0), 0.003 * step))
    base = np.broadcast_to(about((1.0, 2.0, -0.5), np.array([0.7 + 0.3 * number])), own.shape)
    panels = np.stack([np.vstack([each[0] @ turned.T + start, each[1:] @ turned.T]) for each in (wall, board)])
    return Scene(
        camera=Pinhole(120, 90, fx=104.0, fy=97.0, cx=57.3, cy=46.2),
        panels=panels,
        quaternions=product(base, own),
        positions=moved @ turned.T + start,
    )


def plain_scene(number: int, *, n_frames: int) -> Scene:
    """One slanted wall; the camera moves so little that no feature leaves the image."""
    step = np.arange(n_frames, dtype=np.float64)
    wall = panel((-40.0, -40.0, 5.0 + 0.1 * number), (80.0, 0.0, 4.0), (0.0, 80.0, -3.0))
    return Scene(
        camera=Pinhole(48, 36, fx=40.0, fy=42.0, cx=22.7, cy=18.4),
        panels=wall[None],
        quaternions=about((0.2, 1.0, 0.0), 0.0004 * step),
        positions=np.column_stack([0.004 * step, -0.003 * step, 0.005 * step]),
    )


def _panels(number: int) -> tuple[Array, Array]:
    """A wall and a board, in the frame of the first camera."""
    slope = 12.0 + 4.0 * number
    wall = panel((-60.0, -60.0, -5.0 - slope / 2), (120.0, 0.0, 20.0), (0.0, 120.0, slope))
    board = panel((-0.15, -0.6, 2.3), (0.55, 0.05, 0.15), (-0.05, 0.9 + 0.1 * number, 0.1))
    return wall, board


UNKNOWN = ""
"""End of a track whose cause is not reported."""


@dataclass(frozen=True, slots=True, eq=False)
class Script:
    """All tracks of one tracker at one speed on one sequence, in the order of their birth.

    The steps are the frames that the tracker sees: 0, speed, 2 speed, ... Every array by step has all steps, and
    `alive` says which of them a track has.

    Attributes
    ----------
    frames : (steps,) int64
        Frame of each step.
    alive : (tracks, steps) bool
        Whether the track is observed.
    true_px, error_px : (tracks, steps, 2) float64
        True position, and observed minus true position.
    status : (tracks, steps) <U16
        Names of `tracknoise.tables.schema.TruthStatus`.
    end : (tracks,) <U16
        Names of `TrackEnd`; `UNKNOWN` where the tracker does not report causes.
    depth_m : (tracks,) float64
        Depth of the point in the first frame of the track; NaN where it has no true position.
    zero_frame : (tracks,) int64
        Frame in which the error is zero because the true position is fixed there.
    """

    frames: NDArray[np.int64]
    alive: NDArray[np.bool_]
    true_px: Array
    error_px: Array
    status: NDArray[np.str_]
    end: NDArray[np.str_]
    depth_m: Array
    zero_frame: NDArray[np.int64]

    @property
    def birth(self) -> NDArray[np.intp]:
        """(tracks,) step in which each track begins."""
        first: NDArray[np.intp] = self.alive.argmax(axis=1)
        return first

    @property
    def observed_px(self) -> Array:
        """(tracks, steps, 2) what the tracker reports."""
        return self.true_px + self.error_px


@dataclass(frozen=True, slots=True)
class Scripted:
    """Settings of the tracker that reports scripts.

    Parameters
    ----------
    scripts
        By key of the sequence (`tracknoise.tables.identity.SequenceId.key`) and speed.
    """

    kind: ClassVar[str] = "scripted"
    description: ClassVar[str] = "tracks that are known in advance"

    scripts: Mapping[tuple[str, int], Script] = field(repr=False)

    def start(self, context: SequenceContext) -> "ScriptedTracker":
        """Start on one sequence at one speed."""
        return ScriptedTracker(self.scripts[context.sequence.key, context.speed])


class ScriptedTracker:
    """Reports the tracks of one script."""

    def __init__(self, script: Script) -> None:
        self._script = script
        self._observed_px = script.observed_px
        self._ends = np.array([TrackEnd[name] for name in script.end], dtype=np.int8)

    def step(self, frame: Frame) -> Step:
        """Report one frame."""
        step = int(np.searchsorted(self._script.frames, frame.index))
        before = self._script.alive[:, step - 1] if step else np.zeros(len(self._ends), dtype=bool)
        now = self._script.alive[:, step]
        ended = np.flatnonzero(before & ~now)
        outliers = int(np.count_nonzero(self._ends[ended] == TrackEnd.outlier))
        seen = np.flatnonzero(now)
        return Step(
            ids=seen,
            uv=self._observed_px[seen, step],
            born=~before[seen],
            response=np.full(len(seen), np.nan, dtype=np.float32),
            ended_ids=ended,
            ended=self._ends[ended],
            offered=int(before.sum()),
            matched=int((before & now).sum()) + outliers,
            outliers=outliers,
            alive=len(seen),
        )


_CLEAR_PX = 1.5
"""Smallest distance from outlines and from the border, px. What is seen nearer to them is a matter of convention."""
_NAMES = "<U16"


@dataclass(frozen=True, slots=True)
class Shown:
    """How a scene is shown: frames in their order or reversed, images turned by quarters, every `speed`-th frame."""

    backward: bool = False
    quarters: int = 0
    speed: int = 1


@dataclass(frozen=True, slots=True)
class Lives:
    """How tracks live."""

    n_tracks: int  # number of tracks that are tried; those that come near an outline are left out
    end_rate: float  # probability that a track ends at a step
    outlier_share: float  # share of these that end as an outlier; the others are lost


def scripted_tracks(
    scene: Scene, view: Shown, lives: Lives, rng: np.random.Generator, *, key_frame: int | None = None
) -> Script:
    """Tracks through a scene with errors that differ in u and v, between tracks, and where the point is occluded."""
    order = np.arange(scene.n_frames)[:: -1 if view.backward else 1]
    frames = np.arange(0, scene.n_frames, view.speed)
    alive, end = draw_lives(lives, len(frames), rng)
    anchor = alive.argmax(axis=1) if key_frame is None else np.full(len(alive), np.searchsorted(frames, key_frame))
    known = alive[np.arange(len(alive)), anchor]
    camera = scene.camera
    first_px = rng.uniform(_CLEAR_PX, np.array([camera.width, camera.height]) - 1 - _CLEAR_PX, (len(alive), 2))
    depth, panel = scene.look(order[frames[anchor]], first_px)
    every_px, every_depth = scene.images(scene.world(order[frames[anchor]], first_px, depth))
    true_px, depth_m = every_px[:, order[frames]], every_depth[:, order[frames]]
    status, clear = _visibility(scene, order[frames], true_px, panel)
    chosen = (clear | ~alive).all(axis=1)
    status[~known] = "no_depth"
    error_px = _errors(alive, status == "occluded", rng)
    error_px[np.arange(len(alive)), anchor] = 0.0
    at_birth = depth_m[np.arange(len(alive)), alive.argmax(axis=1)]
    return Script(
        frames=frames,
        alive=alive[chosen],
        true_px=turned(true_px, camera.width, camera.height, view.quarters)[chosen],
        error_px=error_px[chosen],
        status=status[chosen],
        end=end[chosen],
        depth_m=np.where(known, at_birth, np.nan)[chosen],
        zero_frame=frames[anchor][chosen],
    )


def turned(uv: Array, width: int, height: int, quarters: int) -> Array:
    """Where the image turned by quarters counter-clockwise shows the pixels (..., 2) of the upright one."""
    for _ in range(quarters):
        uv = np.stack([uv[..., 1], width - 1 - uv[..., 0]], axis=-1)
        width, height = height, width
    return uv


def draw_lives(lives: Lives, n_steps: int, rng: np.random.Generator) -> tuple[NDArray[np.bool_], NDArray[np.str_]]:
    """Steps in which each track is observed, (tracks, steps), and its end; half of the tracks begin at once."""
    birth = np.sort(np.where(rng.random(lives.n_tracks) < 0.5, 0, rng.integers(0, n_steps, lives.n_tracks)))
    beyond = birth + rng.geometric(lives.end_rate, lives.n_tracks)
    steps = np.arange(n_steps)
    alive = (steps >= birth[:, None]) & (steps < beyond[:, None])
    outlier = rng.random(lives.n_tracks) < lives.outlier_share
    ended = np.where(outlier, "outlier", "lost")
    return alive, np.where(beyond < n_steps, ended, "sequence_end").astype(_NAMES)


def _visibility(
    scene: Scene, frame: NDArray[np.int64], uv: Array, panel: NDArray[np.int64]
) -> tuple[NDArray[np.str_], NDArray[np.bool_]]:
    """Status of points of panels (tracks,) in frames (steps,), and whether no outline or border is near."""
    size = np.array([scene.camera.width, scene.camera.height])
    inside = np.all((uv >= -0.5) & (uv < size - 0.5), axis=-1)
    border = np.minimum(np.abs(uv + 0.5), np.abs(uv - size + 0.5)).min(axis=-1)
    frames = np.broadcast_to(frame, uv.shape[:-1])
    seen = scene.look(frames, uv)[1]
    around = [np.array([right, down]) * _CLEAR_PX for right in (-1, 0, 1) for down in (-1, 0, 1)]
    same = np.all([scene.look(frames, uv + offset)[1] == seen for offset in around], axis=0)
    status = np.where(inside, np.where(seen == panel[:, None], "valid", "occluded"), "out_of_image").astype(_NAMES)
    return status, (same | ~inside) & (border > _CLEAR_PX)


def _errors(alive: NDArray[np.bool_], occluded: NDArray[np.bool_], rng: np.random.Generator) -> Array:
    """Errors with a mean, a correlation, a scale of each track, and a heavy tail: no statistic has a special value."""
    noise = rng.standard_normal((*alive.shape, 2)) @ np.array([[0.3, 0.1], [0.0, 0.2]])
    scale = np.exp(0.5 * rng.standard_normal(len(alive)))[:, None, None]
    step = np.arange(alive.shape[1])[:, None] * np.array([0.01, -0.02])
    errors: Array = np.array([0.15, -0.08]) + step + noise * scale * np.where(occluded, 5.0, 1.0)[..., None]
    return errors


def write_recording(scene: Scene, folder: Path) -> None:
    """Write a scene in the layout of docs/data.md. Images are gray: nothing looks at them."""
    for name in ("images", "depth"):
        (folder / name).mkdir(parents=True)
    picture = encode_png(_gray(scene))
    for index, depth in enumerate(depth_maps(scene)):
        (folder / "images" / f"{index:06d}.png").write_bytes(picture)
        np.save(folder / "depth" / f"{index:06d}.npy", depth)
    camera = scene.camera
    names = ("width", "height", "fx", "fy", "cx", "cy")
    (folder / "camera.json").write_text(json.dumps({name: getattr(camera, name) for name in names}), encoding="utf-8")
    rows = np.hstack([scene.positions, scene.quaternions]).tolist()
    lines = [" ".join(map(repr, row)) for row in rows]
    (folder / "poses.txt").write_text("\n".join([*lines, ""]), encoding="utf-8")


def depth_maps(scene: Scene) -> Array:
    """Depth along the optical axis at the centre of every pixel of every frame, (frames, height, width), metres."""
    rows, columns = np.indices((scene.camera.height, scene.camera.width))
    pixels = np.stack([columns, rows], axis=-1).astype(np.float64)
    shape = (scene.n_frames, *rows.shape)
    frame = np.broadcast_to(np.arange(scene.n_frames)[:, None, None], shape)
    return scene.look(frame, np.broadcast_to(pixels, (*shape, 2)))[0]


def in_memory(scene: Scene, name: SequenceId) -> RecordedSequence:
    """A recording of a scene that is not written to files."""
    depths = depth_maps(scene)
    poses = np.zeros((scene.n_frames, 4, 4))
    poses[:, :3, :3], poses[:, :3, 3], poses[:, 3, 3] = scene.rotations, scene.positions, 1.0
    camera = scene.camera
    gray = _gray(scene)
    return RecordedSequence(
        id=name,
        source=f"self-test {name.scene}",
        camera=Camera(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy),
        world_from_camera=poses,
        images=lambda _: gray,
        depths=lambda index: DepthMap(depths[index], np.ones(depths[index].shape, dtype=bool)),
    )


@dataclass(frozen=True, slots=True, eq=False)
class WithSurface(View):
    """A recording whose exact surface is known, and has been scanned."""

    scene: Scene  # what was recorded
    scanned: Scan | None = None  # scan points and key frame

    @property
    def truths(self) -> tuple[str, ...]:
        """Birth, ray cast, and scan where there is one."""
        return TruthKind.birth, TruthKind.raycast, *(() if self.scanned is None else (TruthKind.scan,))

    @property
    def surface(self) -> "WithSurface":
        """Itself."""
        return self

    @property
    def scan(self) -> Scan | None:
        """The scan points."""
        return self.scanned

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points under pixels: see `tracknoise.sequences.sequence.Surface.cast`."""
        frame = np.full(len(uv), index)
        depth, panel = self.scene.look(frame, uv)
        hit = panel != NOTHING
        return self.scene.world(frame, uv, np.where(hit, depth, 1.0)), hit


def _gray(scene: Scene) -> NDArray[np.uint8]:
    return np.full((scene.camera.height, scene.camera.width), 128, dtype=np.uint8)
