"""Observations that take part in an audit, as arrays, and the motion of their cameras at any time.

The truth interpolates between all poses of a recording, such as those of frames that a run leaves out. (truth.shutter)
"""

from dataclasses import dataclass, field, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Intrinsics
from tracknoise.geometry.pose import from_quaternion
from tracknoise.inference.units import Resampled


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """Poses and velocities of n cameras.

    Attributes
    ----------
    rotation : (n, 3, 3) float64
        world_from_camera.
    position : (n, 3) float64
        Metres, world frame.
    turning : (n, 3) float64
        Angular velocity in the camera frame, radians per unit of time.
    velocity : (n, 3) float64
        Metres per unit of time, world frame.
    """

    rotation: NDArray[np.float64]
    position: NDArray[np.float64]
    turning: NDArray[np.float64]
    velocity: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """Poses of the frames of several sequences, one after the other; between frames as `PosePath` has them.

    Attributes
    ----------
    times : (frames,) float64
        Increasing within each sequence.
    first, last : (frames,) intp
        First and last frame of the sequence of each frame.
    posed : (frames, 2) float64
        Times of the first and last pose of the sequence of each frame.
    rotation, position : (frames, 3, 3), (frames, 3) float64
        NaN where a frame has no pose.
    turning, velocity : (frames, 3) float64
        Between a frame and the next, see `Moving`; NaN where there is none or either has no pose.
    mean_turning, mean_velocity : (frames, 3) float64
        Mean of those before and after a frame; beyond the ends of a sequence the last velocity goes on.
    bend : (frames, 2, 3) float64
        Second differences of rotation, in the frame of the camera, and of position: one unit of time before and after.
    """

    times: NDArray[np.float64]
    first: NDArray[np.intp]
    last: NDArray[np.intp]
    posed: NDArray[np.float64]
    rotation: NDArray[np.float64]
    position: NDArray[np.float64]
    turning: NDArray[np.float64]
    velocity: NDArray[np.float64]
    mean_turning: NDArray[np.float64]
    mean_velocity: NDArray[np.float64]
    bend: NDArray[np.float64]

    @classmethod
    def of(cls, times: NDArray[np.float64], poses: NDArray[np.float64], sequence: NDArray[np.intp]) -> "Paths":
        """Make the paths of frames.

        Shapes: times (frames,), poses (frames, 4, 4), sequence (frames,). `poses`: NaN where a frame has none.
        """
        first = np.searchsorted(sequence, sequence, side="left")
        last = np.searchsorted(sequence, sequence, side="right") - 1
        rotation, position = poses[:, :3, :3], poses[:, :3, 3]
        has_pose = np.asarray(np.isfinite(poses).all(axis=(1, 2)))
        between = np.flatnonzero(has_pose[:-1] & has_pose[1:] & (sequence[:-1] == sequence[1:]))
        span = (times[between + 1] - times[between])[:, None]
        turning, velocity = np.full((2, len(times), 3), np.nan)
        step = np.swapaxes(rotation[between], 1, 2) @ rotation[between + 1]
        turning[between] = _rotation_vectors(step) / span
        velocity[between] = (position[between + 1] - position[between]) / span
        place = np.arange(len(times))
        before, after = (np.clip(side, first, last - 1) for side in (place - 1, place))
        turn, move = (0.5 * (rate[before] + rate[after]) for rate in (turning, velocity))
        posed = _ends(np.where(has_pose, times, np.nan), first)
        paths = cls(times, first, last, posed, rotation, position, turning, velocity, turn, move, np.empty((0, 2, 3)))
        return replace(paths, bend=_bend(paths))

    @property
    def surrounded(self) -> NDArray[np.bool_]:
        """Whether the frame and its neighbours in its sequence have poses, (frames,); never in one of one frame."""
        place, has_rate = np.arange(len(self.times)), np.isfinite(self.turning[:, 0])
        before, after = np.maximum(place - 1, 0), place
        ends = (has_rate[before] | (place == self.first)) & (has_rate[after] | (place == self.last))
        return np.asarray(ends & (self.first < self.last))

    @property
    def longest_half(self) -> float:
        """Half of the longest time from the first pose of a sequence to its last."""
        return 0.5 * float(np.max(self.posed[:, 1] - self.posed[:, 0]))

    def from_middle(self, frame: NDArray[np.intp]) -> NDArray[np.float64]:
        """Time of frames, (n,), after the middle of the poses of their sequence, in units of `longest_half`."""
        return np.asarray((self.times[frame] - self.posed[frame].mean(axis=1)) / self.longest_half)

    def at(self, frame: NDArray[np.intp], delay: NDArray[np.float64]) -> Moving:
        """Poses some time after frames. Where no time is after its frame, velocities are the mean before and after it.

        Parameters
        ----------
        frame : (n,) intp
            Frames.
        delay : (n,) float64
            Time after each; negative before it. Beyond the ends of a sequence the last velocity goes on.
        """
        if not np.any(delay):
            turning, velocity = self.mean_turning[frame], self.mean_velocity[frame]
            return Moving(self.rotation[frame], self.position[frame], turning, velocity)
        start = self._segment(frame, delay)
        elapsed = self.times[frame] + delay - self.times[start]
        turned = Rotation.from_rotvec(np.nan_to_num(elapsed[:, None] * self.turning[start])).as_matrix()
        position = self.position[start] + elapsed[:, None] * self.velocity[start]
        rotation = self.rotation[start] @ turned
        rotation[np.isnan(position[:, 0])] = np.nan
        return Moving(rotation, position, self.turning[start], self.velocity[start])

    def bend_at(
        self, frame: NDArray[np.intp], delay: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """`bend` some time after frames, and how it changes with time, both (n, 2, 3).

        Differences are interpolated between frames, and stay as they are beyond the ends of a sequence.
        """
        start = self._segment(frame, delay)
        span = self.times[start + 1] - self.times[start]
        fraction = (self.times[frame] + delay - self.times[start]) / span
        inside = np.clip(fraction, 0.0, 1.0)
        change = self.bend[start + 1] - self.bend[start]
        slope = np.where(fraction == inside, 1.0 / span, 0.0)
        return self.bend[start] + inside[:, None, None] * change, slope[:, None, None] * change

    def _segment(self, frame: NDArray[np.intp], delay: NDArray[np.float64]) -> NDArray[np.intp]:
        """First of the two frames around each time. Sequences are laid out one after the other on one axis of time."""
        if not np.any(delay):
            return np.clip(frame, self.first[frame], self.last[frame] - 1)
        since_first = self.times - self.times[self.first]
        span = float(since_first.max(initial=0.0)) + 1.0
        ahead = float(np.nanmax(np.abs(delay), initial=0.0))
        apart = (span + 2.0 * ahead) * (np.cumsum(self.first == np.arange(len(self.first))) - 1)
        segment = np.searchsorted(since_first + apart, since_first[frame] + apart[frame] + delay, side="right") - 1
        return np.clip(segment, self.first[frame], self.last[frame] - 1)


def _ends(times: NDArray[np.float64], first: NDArray[np.intp]) -> NDArray[np.float64]:
    """First and last of the known times of the sequence of each frame, (frames, 2); 0 where it has none."""
    starts, place = np.unique(first, return_inverse=True)
    if not starts.size:
        return np.empty((0, 2))
    ends = np.stack([np.fmin.reduceat(times, starts), np.fmax.reduceat(times, starts)], axis=1)
    return np.asarray(np.nan_to_num(ends[place]))


def _bend(paths: Paths) -> NDArray[np.float64]:
    """See `Paths.bend`. A step to where no pose is known is taken as that on the other side; without both it is 0."""
    frames = np.arange(len(paths.times))
    if not frames.size:
        return np.empty((0, 2, 3))
    before, after = (paths.at(frames, np.full(len(frames), delay)) for delay in (-1.0, 1.0))
    turns = [steps(before.rotation, paths.rotation), steps(paths.rotation, after.rotation)]
    moves = [paths.position - before.position, after.position - paths.position]
    (turn, next_turn), (move, next_move) = (
        (np.where(np.isnan(earlier), later, earlier), np.where(np.isnan(later), earlier, later))
        for earlier, later in (turns, moves)
    )
    return np.asarray(np.nan_to_num(np.stack([next_turn - turn, next_move - move], axis=1)))


def steps(start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation vectors (n, 3) from rotations to others, both (n, 3, 3); NaN where either is unknown."""
    vectors = np.full((len(start), 3), np.nan)
    is_known = np.isfinite(start).all(axis=(1, 2)) & np.isfinite(end).all(axis=(1, 2))
    vectors[is_known] = _rotation_vectors(np.swapaxes(start[is_known], 1, 2) @ end[is_known])
    return vectors


_NEAR_IDENTITY = 0.5
"""Smallest cosine of an angle whose sine determines it well."""


def _rotation_vectors(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3), rad, of rotations (n, 3, 3). Those of small angles, from their antisymmetric parts, are the fastest."""
    if not len(rotations):
        return np.empty((0, 3))
    parts = [rotations[:, row, column] - rotations[:, column, row] for row, column in ((2, 1), (0, 2), (1, 0))]
    along = 0.5 * np.stack(parts, axis=1)
    sine, cosine = np.linalg.norm(along, axis=1), 0.5 * (np.einsum("nii->n", rotations) - 1.0)
    angle = np.arctan2(sine, cosine)
    vectors = along * (np.divide(angle, sine, out=np.ones_like(sine), where=sine > 0.0))[:, None]
    large = np.flatnonzero(cosine < _NEAR_IDENTITY)
    if large.size:
        vectors[large] = Rotation.from_matrix(rotations[large]).as_rotvec()
    return np.asarray(vectors)


DEPTH_CELLS = 4
"""Cells of like depth in which depth maps are compared."""


@dataclass(frozen=True, slots=True, eq=False)
class DepthRepeats:
    """Standard deviation of depths, relative to them, at some depths.

    Attributes
    ----------
    depth_m, relative : (cells,) float64
        Depths in order, metres, and the standard deviations there; none where too few points are in two maps.
    """

    depth_m: NDArray[np.float64]
    relative: NDArray[np.float64]

    @classmethod
    def of_rows(cls, depth_m: NDArray[np.float64], relative: NDArray[np.float64]) -> "DepthRepeats":
        """From cells (n,) in any order, such as those of several parts of a recording; like ones are joined."""
        order = np.argsort(depth_m, kind="stable")
        parts = np.array_split(order, min(DEPTH_CELLS, len(order))) if len(order) else []
        return cls(*(np.array([np.median(values[part]) for part in parts]) for values in (depth_m, relative)))

    def at(self, depth_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Standard deviations at depths (n,), (n,); NaN where none is known."""
        if not len(self.depth_m):
            return np.full(len(depth_m), np.nan)
        return np.asarray(np.interp(np.log(depth_m), np.log(self.depth_m), self.relative), dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class AuditSamples:
    """n observations of several trackers in several sequences.

    Attributes
    ----------
    trackers
        Names of the trackers.
    tracker, age : (n,) intp
        Place in `trackers`; frames since birth.
    cluster, block : (n,) intp
        Number of what is left out at a time: scenes, groups or blocks; and of the block of tracks within its scene.
        Both from 0, without gaps.
    resampled, n_scenes
        What the clusters are, and the number of scenes.
    birth, now : (n,) intp
        Frames, as places in `paths`.
    uv_at_birth, observed, stated : (n, 2) float64
        Position in the first frame, observed position, and true position as stated, px.
    depth : (n,) float64
        In the first frame, metres.
    paths
        Poses of all frames of all sequences.
    cameras, camera : (frames,) intp
        Different cameras, and the place of each frame's camera.
    readout_of : (frames,) float64
        Stated readout of each frame.
    axis_of : (frames,) intp
        Coordinate along which the shutter moves.
    interval_s
        Median time between frames, seconds: the unit of time. None where it is unknown.
    z_depth_from
        What depths that are along z by construction were computed from; None where their kind is only stated.
    depth_sd : (n,) float64, or None
        Standard deviation of `depth` relative to it, as depth maps repeat it; NaN where unknown, None where all are.
    refined
        Whether poses were fitted to reference tracks. Such poses absorb a part of errors of the camera and the clock.
    rays : by cameras, (n, 3) float64
        Of the first positions, as computed last: most corrections change no camera.
    """

    trackers: tuple[str, ...]
    tracker: NDArray[np.intp]
    age: NDArray[np.intp]
    cluster: NDArray[np.intp]
    block: NDArray[np.intp]
    resampled: Resampled
    n_scenes: int
    birth: NDArray[np.intp]
    now: NDArray[np.intp]
    uv_at_birth: NDArray[np.float64]
    observed: NDArray[np.float64]
    stated: NDArray[np.float64]
    depth: NDArray[np.float64]
    paths: Paths
    cameras: tuple[Intrinsics, ...]
    camera: NDArray[np.intp]
    readout_of: NDArray[np.float64]
    axis_of: NDArray[np.intp]
    interval_s: float | None
    z_depth_from: str | None = None
    depth_sd: NDArray[np.float64] | None = None
    refined: bool = False
    rays: dict[tuple[Intrinsics, ...], NDArray[np.float64]] = field(default_factory=dict, init=False, repr=False)

    @property
    def n_clusters(self) -> int:
        """How many clusters there are."""
        return int(self.cluster.max(initial=-1)) + 1

    @property
    def by_blocks(self) -> "AuditSamples":
        """The same observations, with blocks of tracks as clusters."""
        return replace(self, cluster=self.block, resampled=Resampled.blocks)

    @property
    def group(self) -> NDArray[np.intp]:
        """Number of the tracker and age of each observation, (n,): those with a scale of their own."""
        return np.asarray(self.tracker * (self.age.max(initial=0) + 1) + self.age)

    @property
    def readout(self) -> NDArray[np.float64]:
        """Stated readout of each observation, (n,), in frame intervals."""
        return self.readout_of[self.now]

    @property
    def axis(self) -> NDArray[np.intp]:
        """Coordinate along which the shutter of each observation moves, (n,)."""
        return self.axis_of[self.now]

    @property
    def side(self) -> NDArray[np.float64]:
        """Size of the image along which the shutter moves, (n,), px."""
        sizes = np.array([(camera.width, camera.height) for camera in self.cameras], dtype=np.float64)
        sides: NDArray[np.float64] = sizes[self.camera[self.now], self.axis]
        return sides

    def along_shutter(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Coordinates of vectors (n, 2) along which the shutter moves, (n,)."""
        return np.take_along_axis(vectors, self.axis[:, None], axis=1)[:, 0]

    def phase(self, row: NDArray[np.float64]) -> NDArray[np.float64]:
        """Time of rows after that of their frame, in units of the readout, (n,): from -0.5 to 0.5."""
        phase: NDArray[np.float64] = (row + 0.5) / self.side - 0.5
        return phase

    @property
    def phase_at_birth(self) -> NDArray[np.float64]:
        """`phase` of the position in the first frame, (n,)."""
        return self.phase(self.along_shutter(self.uv_at_birth))

    def chosen(self, rows: NDArray[np.intp]) -> "AuditSamples":
        """Some of the observations, whose clusters and blocks are numbered again without gaps."""
        names = ["tracker", "age", "birth", "now", "uv_at_birth", "observed", "stated", "depth"]
        names += ["depth_sd"] if self.depth_sd is not None else []
        columns = {name: getattr(self, name)[rows] for name in names}
        cluster, block = numbered(self.cluster[rows]), numbered(self.block[rows])
        return replace(self, cluster=cluster, block=block, **columns)


def numbered(labels: NDArray[np.intp]) -> NDArray[np.intp]:
    """The same labels (n,) from 0, without gaps."""
    return np.unique(labels, return_inverse=True)[1].astype(np.intp)


_POSITION, _QUATERNION = ("x_m", "y_m", "z_m"), ("qx", "qy", "qz", "qw")


@dataclass(frozen=True, slots=True, eq=False)
class Instants:
    """n times of a sequence, increasing.

    Attributes
    ----------
    cameras
        Schema `CAMERAS`, n rows; those of other times repeat the frame before them.
    poses : (n, 4, 4) float64
        NaN where there is none.
    place : (frames,) intp
        Where each frame is among them.
    """

    cameras: pl.DataFrame
    poses: NDArray[np.float64]
    place: NDArray[np.intp]


def instants_of(cameras: pl.DataFrame, poses: pl.DataFrame, path: pl.DataFrame | None) -> Instants:
    """Times of a sequence. `path`: schema `PATH`. None where only the poses of frames are known."""
    if path is None:
        return Instants(cameras, _matrices(poses), np.arange(cameras.height))
    frames_s, others_s = cameras["time_s"].to_numpy(), path["time_s"].to_numpy()
    before = np.clip(np.searchsorted(frames_s, others_s, side="right") - 1, 0, None)
    order, place = in_order(frames_s, others_s)
    repeated = cameras[before].with_columns(path["time_s"])
    matrices = np.concatenate([_matrices(poses), _matrices(path)])
    return Instants(pl.concat([cameras, repeated])[order], matrices[order], place)


def in_order(frames: NDArray[np.float64], others: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Order of the times of frames and of others, one after the other, and where each frame is in it."""
    order = np.argsort(np.concatenate([frames, others]))
    return order, np.argsort(order)[: len(frames)]


def _matrices(table: pl.DataFrame) -> NDArray[np.float64]:
    """(n, 4, 4): NaN where a row has no pose."""
    has_pose = table["qw"].is_not_null().to_numpy()
    poses = np.full((table.height, 4, 4), np.nan)
    rows = table.filter(pl.col("qw").is_not_null())
    poses[has_pose] = from_quaternion(rows.select(_POSITION).to_numpy(), rows.select(_QUATERNION).to_numpy())
    return poses
