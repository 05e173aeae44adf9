"""Windows of tracks with the true poses and points, as an estimator would be given them.

The windows are cut from a run. They are those of the view that noise models are fitted to. Observations are images of
the true points from the true poses, with the errors of the run: an estimator is taken to know a rolling shutter as the
truth does.

Only tracks whose distance the window shows are used, up to a stated number, drawn at random. A track ends before its
first observation that is not visible, or that errs by more than an estimator's outlier test lets through. A window
whose tracks do not determine all of its poses is left out: one in which all tracks were lost has no answer.

The windows are then divided: something is learned from some of them, and tried on the others. Scenes of one group, such
as pieces of one recording, are not independent. Where a run has enough groups to resample them, each group counts as
one scene: it is learned from or tried on as a whole, and intervals are over groups. A single scene is cut in two: its
earlier windows are learned from, and its later ones tried. Nothing is decided then.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.analysis.condition_units import groups_of_run
from tracknoise.estimators.linear_window import Gauge, LinearTracks, PointTracks, determines_poses, linear_tracks
from tracknoise.estimators.model import Training
from tracknoise.estimators.training import reference_view
from tracknoise.exceptions import SettingsError, StoreError
from tracknoise.experiments.measured_poses import recorded_poses
from tracknoise.geometry.cameras import CameraModel, KnownCamera, make_camera
from tracknoise.geometry.pose import invert, transform
from tracknoise.inference.units import JoinedScenes, SceneGroups
from tracknoise.statistics.noise_sums import MOTION
from tracknoise.statistics.prepared import in_population
from tracknoise.tables.enumerations import Population
from tracknoise.tables.schema import QUALITY_PREFIX
from tracknoise.tables.store import RunFolder
from tracknoise.words import count

ROUNDING_PX = 1e-6
"""Errors below this are 0 but for rounding, as those in the frame that fixes the true position."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackGroup:
    """Tracks of a window that have the same number n of observations."""

    frames: NDArray[np.int64]  # (tracks, n) integers: frames of the window, increasing
    uv: NDArray[np.float64]  # (tracks, n, 2) float64: observed positions, px
    points: NDArray[np.float64]  # (tracks, 3) float64: true points, world, metres
    # (tracks,) bool: whether a track begins with its first observation of the window. Others began before it.
    born: NDArray[np.bool_]
    # (tracks, n) float64 each, NaN where unknown: what a front end knows of each observation, by its name
    quality: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    @property
    def ages(self) -> NDArray[np.int64]:
        """(tracks, n) integers: frames since the first observation of the window."""
        return self.frames - self.frames[:, :1]

    def chosen(self, tracks: NDArray[np.bool_]) -> "TrackGroup":
        """Some of the tracks."""
        quality = {name: values[tracks] for name, values in self.quality.items()}
        return TrackGroup(self.frames[tracks], self.uv[tracks], self.points[tracks], self.born[tracks], quality)


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A window of frames with its tracks, and its truth."""

    scene: str  # Name of the scene. Windows of one scene are not independent of each other.
    camera: CameraModel
    world_from_camera: NDArray[np.float64]  # (frames, 4, 4) float64: the true poses
    groups: tuple[TrackGroup, ...]  # tracks, grouped by the number of their observations
    start: int = 0  # frame of its sequence with which it begins

    @property
    def gauge(self) -> Gauge:
        """What an estimator takes as known."""
        return Gauge.of(self.world_from_camera[:, :3, 3])

    @property
    def n_tracks(self) -> int:
        """How many tracks there are."""
        return sum(len(group.points) for group in self.groups)

    def with_uv(self, uv: tuple[NDArray[np.float64], ...]) -> "Problem":
        """The same with other observed positions, one array for each group."""
        return replace(self, groups=tuple(replace(group, uv=own) for group, own in zip(self.groups, uv, strict=True)))


def images(
    camera: CameraModel, world_from_camera: NDArray[np.float64], tracks: TrackGroup | PointTracks
) -> NDArray[np.float64]:
    """(tracks, n, 2) float64, px: where points are seen from poses (frames, 4, 4)."""
    count, length = tracks.frames.shape
    seen = transform(invert(world_from_camera)[tracks.frames.ravel()], np.repeat(tracks.points, length, axis=0))
    return camera.project(seen).reshape(count, length, 2)


def moved(
    gauge: Gauge, world_from_camera: NDArray[np.float64], coordinates: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(frames, 4, 4) float64: poses moved by their coordinates (p,)."""
    moves = np.concatenate([np.zeros(6), coordinates[:-2], gauge.across @ coordinates[-2:]]).reshape(-1, 6)
    poses = world_from_camera.copy()
    poses[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(moves[:, :3]).as_matrix()
    poses[:, :3, 3] += moves[:, 3:]
    return poses


def between(gauge: Gauge, estimated: NDArray[np.float64], true: NDArray[np.float64]) -> NDArray[np.float64]:
    """(p,) float64: coordinates that move true poses (frames, 4, 4) to estimated ones."""
    turned = np.swapaxes(true[:, :3, :3], 1, 2) @ estimated[:, :3, :3]
    moves = np.hstack([Rotation.from_matrix(turned).as_rotvec(), estimated[:, :3, 3] - true[:, :3, 3]])
    return gauge.free(moves.ravel())


def fitted_scenes(training: Training, dataset: str) -> frozenset[str]:
    """Names of scenes of a data set that a model was fitted to. Other data sets have scenes of the same names."""
    return frozenset(training.scenes if dataset in training.dataset.split(", ") else ())


def linear_window(problem: Problem) -> list[LinearTracks]:
    """The tracks of a window about the truth, to first order."""
    return [
        linear_tracks(problem.camera, problem.world_from_camera, PointTracks(group.frames, group.points, group.born))
        for group in problem.groups
    ]


def errors_of(problem: Problem) -> tuple[NDArray[np.float64], ...]:
    """(tracks, n, 2) float64, px, for each group: observed minus true positions."""
    return tuple(group.uv - images(problem.camera, problem.world_from_camera, group) for group in problem.groups)


def are_exact(problem: Problem) -> bool:
    """Whether no observation has an error."""
    return all(np.abs(part).max() < ROUNDING_PX for part in errors_of(problem))


def magnification_of(problem: Problem, group: TrackGroup) -> NDArray[np.float64]:
    """(tracks, n) float64: Z_0 / Z_k since the first observation of the window, from the truth."""
    count, length = group.frames.shape
    poses = invert(problem.world_from_camera)[group.frames.ravel()]
    depth = transform(poses, np.repeat(group.points, length, axis=0))[:, 2].reshape(count, length)
    return np.asarray(depth[:, :1] / depth)


_LEAST_LENGTH, _LEAST_TRACKS = 3, 20
_UNCERTAIN = 0.3
"""A track is used if noise of 1 px leaves its distance uncertain by at most this share."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Cut:
    """How windows are cut from a run."""

    # tracker, speed: as in the run
    tracker: str
    speed: int
    length: int = 11  # processed frames of a window
    # processed frames from one window to the next; by default `length`, so that windows share no frame
    every: int | None = None
    per_sequence: int = 8  # most windows of a sequence, spread evenly
    most_tracks: int = 80  # most tracks of a window
    most_px: float = np.inf  # larger errors are taken for outliers that an estimator rejects
    seed: int = 0  # of the choice of tracks


def recorded_problems(folder: RunFolder, cut: Cut) -> list[Problem]:
    """Windows of all sequences of a run that are of the reference view, in the order of their keys."""
    return [problem for key in _keys(folder, cut) for problem in _of_sequence(folder, key, cut)]


def _keys(folder: RunFolder, cut: Cut) -> list[str]:
    """Sequences of the view that models are fitted to (`tracknoise.estimators.training`)."""
    entries = folder.manifest().sequences
    columns = ("rotation", "direction", "tracker", "speed")
    parts = [table.unique() for table in folder.stacked_tables("observations", sorted(entries), only=columns)]
    seen = pl.concat(parts).filter(_mine(cut))
    if seen.is_empty():
        found = f"no observation of {cut.tracker} at speed {cut.speed}"
        raise SettingsError(f"{folder.path}: found {found}, expected the tracker and the speed of the model")
    view = reference_view(seen).items()
    return [
        key
        for key, entry in sorted(entries.items())
        if all(getattr(entry.sequence, name) == value for name, value in view)
    ]


def _mine(cut: Cut) -> pl.Expr:
    return (pl.col("tracker") == cut.tracker) & (pl.col("speed") == cut.speed)


@dataclass(frozen=True, slots=True, eq=False)
class _Sequence:
    scene: str
    camera: KnownCamera
    poses: NDArray[np.float64]
    observations: pl.DataFrame


def _of_sequence(folder: RunFolder, key: str, cut: Cut) -> Iterator[Problem]:
    sequence = _read(folder, key, cut)
    frames = np.arange(0, len(sequence.poses), cut.speed)
    starts = np.arange(0, len(frames) - cut.length + 1, cut.every or cut.length)
    chosen = starts[np.unique(np.linspace(0, len(starts) - 1, min(cut.per_sequence, len(starts))).astype(int))]
    for start in chosen:
        found = _window(sequence, frames[start : start + cut.length], cut)
        if found is not None:
            yield found


def _read(folder: RunFolder, key: str, cut: Cut) -> _Sequence:
    observations = folder.sequence_table("observations", key).filter(_mine(cut))
    tracks = folder.sequence_table("tracks", key).filter(_mine(cut)).select("track", "first_frame", "depth_m")
    poses, cameras = folder.sequence_table("poses", key), folder.sequence_table("cameras", key)
    return _Sequence(
        scene=poses["scene"][0],
        camera=recorded_camera(cameras, key),
        poses=recorded_poses(poses),
        observations=_seen(observations, cut.most_px).join(tracks, on="track").sort("track", "frame"),
    )


def recorded_camera(table: pl.DataFrame, key: str) -> KnownCamera:
    """The camera of a sequence, from its table `cameras`. `key`: of the sequence, for messages."""
    names = ("model", "width", "height", "fx_px", "fy_px", "cx_px", "cy_px", "distortion")
    different = table.select(names).unique()
    if different.height != 1 or different["model"][0] is None:
        raise StoreError(f"{key}: the camera is not known or changes, expected one camera model for all frames")
    model, width, height, *intrinsics, distortion = different.row(0)
    return make_camera(model, (width, height), intrinsics, tuple(distortion))


def _seen(observations: pl.DataFrame, most_px: float) -> pl.DataFrame:
    """Observations of each track before the first that is not visible or errs too much, with their true birth."""
    usable = in_population(observations, Population.visible) & _small(observations, most_px)
    ordered = observations.with_columns(usable=pl.Series(usable)).sort("track", "frame")
    before = pl.col("usable").cast(pl.UInt8).cum_min().over("track") == 1
    birth = {f"birth_{axis}_px": pl.col(f"{axis}_true_px").first().over("track") for axis in "uv"}
    moved = [pl.col(f"{axis}_true_px").diff().over("track").pow(2) for axis in "uv"]
    motion = {QUALITY_PREFIX + MOTION: (moved[0] + moved[1]).sqrt()}
    kept = ordered.with_columns(**birth, **motion).filter(before)
    known = [one.name for one in kept if one.name.startswith(QUALITY_PREFIX) and one.count()]
    return kept.select("track", "frame", "du_px", "dv_px", *birth, *known)


def _small(observations: pl.DataFrame, most_px: float) -> NDArray[np.bool_]:
    error = observations.select("du_px", "dv_px").to_numpy()
    return np.asarray(np.nan_to_num(np.linalg.norm(error, axis=1), nan=np.inf) <= most_px)


def _window(sequence: _Sequence, frames: NDArray[np.intp], cut: Cut) -> Problem | None:
    """The window of these frames; None if a pose is missing or nothing moves, or tracks do not determine the poses."""
    poses = sequence.poses[frames]
    if np.isnan(poses).any() or np.array_equal(poses[0, :3, 3], poses[-1, :3, 3]):
        return None
    inside = sequence.observations.filter(pl.col("frame").is_in(frames.tolist()))
    long_enough = inside.filter(pl.len().over("track") >= _LEAST_LENGTH)
    groups = [
        group
        for length in sorted(long_enough.select(length=pl.len().over("track")).unique()["length"].to_list())
        if (group := _group(sequence, long_enough.filter(pl.len().over("track") == length), length, frames)) is not None
    ]
    shown = [part for group in groups if (part := _showing_depth(sequence.camera, poses, group)) is not None]
    chosen = _drawn(shown, cut.most_tracks, np.random.default_rng((cut.seed, int(frames[0]))))
    if sum(len(group.points) for group in chosen) < _LEAST_TRACKS:
        return None
    tracks = [PointTracks(group.frames, group.points) for group in chosen]
    if not determines_poses([linear_tracks(sequence.camera, poses, each) for each in tracks]):
        return None
    return Problem(sequence.scene, sequence.camera, poses, tuple(chosen), start=int(frames[0]))


def _group(sequence: _Sequence, rows: pl.DataFrame, length: int, frames: NDArray[np.intp]) -> TrackGroup | None:
    """Tracks of equal length, where their births have poses."""
    first = rows.gather_every(length)
    birth = sequence.poses[first["first_frame"].to_numpy()]
    birth_uv = first.select("birth_u_px", "birth_v_px").to_numpy()
    seen = sequence.camera.unproject(birth_uv, first["depth_m"].to_numpy())
    points = transform(birth, seen)
    error = rows.select("du_px", "dv_px").to_numpy().reshape(-1, length, 2)
    at = rows["frame"].to_numpy().reshape(-1, length)
    tracks = PointTracks(np.searchsorted(frames, at).astype(np.int64), points)
    uv = images(sequence.camera, sequence.poses[frames], tracks) + error
    group = TrackGroup(
        frames=tracks.frames,
        uv=uv,
        points=points,
        born=at[:, 0] == first["first_frame"].to_numpy(),
        quality={
            name.removeprefix(QUALITY_PREFIX): rows[name].cast(pl.Float64).to_numpy().reshape(-1, length)
            for name in rows.columns
            if name.startswith(QUALITY_PREFIX)
        },
    )
    return _chosen(group, np.flatnonzero(np.isfinite(uv).all(axis=(1, 2))))


def _showing_depth(camera: KnownCamera, poses: NDArray[np.float64], group: TrackGroup) -> TrackGroup | None:
    linear = linear_tracks(camera, poses, PointTracks(group.frames, group.points))
    information = np.swapaxes(linear.by_point, 1, 2) @ linear.by_point
    finite, ahead = np.isfinite(information).all(axis=(1, 2)), (linear.magnification > 0.0).all(axis=1)
    usable = np.asarray(finite & ahead)
    safe = np.where(usable[:, None, None], information, np.eye(3))
    distance = np.linalg.norm(linear.rays, axis=1)
    along = linear.rays / distance[:, None]
    variance = np.einsum("ti,tij,tj->t", along, np.linalg.pinv(safe, hermitian=True), along)
    known = np.linalg.cond(safe) < 1e12
    return _chosen(group, np.flatnonzero(usable & known & (np.sqrt(variance) <= _UNCERTAIN * distance)))


def _drawn(groups: Sequence[TrackGroup], most: int, random: np.random.Generator) -> list[TrackGroup]:
    """At most so many tracks of all groups."""
    owner = np.repeat(np.arange(len(groups)), [len(group.points) for group in groups])
    kept = np.sort(random.permutation(len(owner))[:most])
    first = np.concatenate([[0], np.cumsum([len(group.points) for group in groups])])
    parts = [_chosen(group, kept[owner[kept] == place] - first[place]) for place, group in enumerate(groups)]
    return [part for part in parts if part is not None]


def _chosen(group: TrackGroup, tracks: NDArray[np.intp]) -> TrackGroup | None:
    """Some tracks of a group; None without any."""
    if not len(tracks):
        return None
    return replace(
        group,
        **{name: getattr(group, name)[tracks] for name in ("frames", "uv", "points", "born")},
        quality={name: values[tracks] for name, values in group.quality.items()},
    )


_LEAST_SCENES, _LEAST_TIMES = 2, 2
_SAME_SCENES = "The model was fitted to all scenes with windows, so that the gain of whole tracks may be too large."
_ONE_SCENE = "There is one scene. Its first half was learned from, its second half tried. One scene decides nothing."
_SAME_GROUPS = "Scenes of one group are not independent of each other: what is found holds for these groups only."


@dataclass(frozen=True, slots=True, eq=False)
class Division:
    """Windows of training scenes, and of the others."""

    learned_from: list[Problem]
    tested: list[Problem]
    limits: tuple[str, ...]  # sentences on what the division does not separate


def divided(folder: RunFolder, problems: Sequence[Problem], training: Training) -> Division:
    """Windows of a run, divided.

    Scenes that the model was fitted to are used for training if there are others. If it was fitted to none of them or
    to all, every second scene is, or every second group where these count as scenes. One scene is cut in two.
    """
    scenes = scenes_of(problems)
    dataset, groups = _dataset(folder), groups_of_run(folder)
    fitted = fitted_scenes(training, dataset)
    if len(scenes) < _LEAST_SCENES:
        return _halves(folder, problems, is_fitted=not fitted.isdisjoint(scenes))
    learned = fitted.intersection(scenes)
    if len(learned) in (0, len(scenes)):
        joined = JoinedScenes.of({dataset: scenes}, groups)
        learned = _every_second([joined.names.get((dataset, scene), scene) for scene in scenes], scenes)
    tested = sorted(set(scenes) - learned)
    others = sorted((learned | fitted).difference(tested))
    limits = {
        _SAME_SCENES: bool(fitted.intersection(tested)),
        _SAME_GROUPS: _are_alike(JoinedScenes.of({dataset: tested}, groups), groups, dataset, tested, others),
    }
    return Division(
        learned_from=[problem for problem in problems if problem.scene in learned],
        tested=[problem for problem in problems if problem.scene in tested],
        limits=tuple(limit for limit, applies in limits.items() if applies),
    )


def _halves(folder: RunFolder, problems: Sequence[Problem], *, is_fitted: bool) -> Division:
    """The earlier windows of one scene, and the later ones; the model may be fitted to it."""
    starts = sorted({problem.start for problem in problems})
    if len(starts) < _LEAST_TIMES:
        found = f"usable windows at {count(len(starts), 'time')} in {count(len(scenes_of(problems)), 'scene')}"
        raise SettingsError(f"{folder.path}: found {found}, expected two times or scenes; shorter windows may help")
    middle = starts[len(starts) // 2]
    return Division(
        learned_from=[problem for problem in problems if problem.start < middle],
        tested=[problem for problem in problems if problem.start >= middle],
        limits=(_ONE_SCENE, _SAME_SCENES) if is_fitted else (_ONE_SCENE,),
    )


def with_joined_scenes(folder: RunFolder, problems: Sequence[Problem]) -> list[Problem]:
    """Windows whose scenes are named by their groups, where these count as scenes."""
    dataset = _dataset(folder)
    names = JoinedScenes.of({dataset: scenes_of(problems)}, groups_of_run(folder)).names
    return [replace(problem, scene=names.get((dataset, problem.scene), problem.scene)) for problem in problems]


def scenes_of(problems: Sequence[Problem]) -> tuple[str, ...]:
    """Names of the scenes of windows, sorted."""
    return tuple(sorted({problem.scene for problem in problems}))


def _dataset(folder: RunFolder) -> str:
    """Name of the dataset: a run has one."""
    return next(iter(folder.manifest().sequences.values())).sequence.dataset


def _every_second(names: Sequence[str], scenes: Sequence[str]) -> frozenset[str]:
    """Scenes whose names, which several may share, are every second one."""
    chosen = set(list(dict.fromkeys(names))[::2])
    return frozenset(scene for scene, name in zip(scenes, names, strict=True) if name in chosen)


def _are_alike(
    joined: JoinedScenes, groups: SceneGroups, dataset: str, tested: Sequence[str], others: Sequence[str]
) -> bool:
    """Whether tested scenes that are not joined are of one group, or of one that something was learned from."""
    number = groups.of(dataset, [*tested, *others]).tolist()
    own, learned = number[: len(tested)], number[len(tested) :]
    return (not joined.names and len({*own}) < len(own)) or not {*own}.isdisjoint(learned)
