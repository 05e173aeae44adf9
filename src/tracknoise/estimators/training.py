"""What a noise model is fitted to: tables of one tracker and speed in one view of each scene, and windows of them."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any
from zlib import crc32

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import groups_of_run
from tracknoise.estimators.linear_window import (
    CAMERA,
    LinearTracks,
    Motion,
    Rig,
    determines_poses,
    linear_tracks,
    simulated_tracks,
    trajectory,
)
from tracknoise.estimators.model import TOLERANCE, CameraOfModel
from tracknoise.exceptions import SettingsError, StoreError, UnknownNameError
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import from_quaternion
from tracknoise.inference.units import SceneGroups, scheme
from tracknoise.statistics.grouping import without_blocks
from tracknoise.tables.identity import SequenceId, readable
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.schema import NOISE_PAIRS, NOISE_SUMS, ORIGIN, PAIR_TRACKS, TRACK_ERRORS, empty
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import TruthVerdict
from tracknoise.tables.truth_audit import AuditTables


def reference_view(table: pl.DataFrame) -> dict[str, Any]:
    """The least turned images, played forward if there are such.

    Errors of turned images have other axes, and a drift changes its sign where frames are played backward: they cannot
    be added to others. Returns: values of these columns, for `polars.DataFrame.filter`. `table`: of any sequences, with
    rows and the columns rotation and direction.
    """
    rotation = table["rotation"].min()
    return {"rotation": rotation, "direction": table.filter(rotation=rotation)["direction"].max()}


def recorded_camera(cameras: Mapping[str, pl.DataFrame]) -> CameraOfModel:
    """The camera of recordings. What differs by more than `TOLERANCE` is not known of the model, and noted.

    The focal length is the geometric mean of those in u and v: estimators in normalised units take one number for both.
    `cameras`: schema `CAMERAS`, at least one row each, by the key of the sequence.
    """
    both = (pl.col("fx_px") * pl.col("fy_px")).sqrt()
    focal = [value for table in cameras.values() for value in table.select(both).to_series().unique().to_list()]
    if not any(focal):
        key = next(iter(cameras))
        raise SettingsError(
            f"noise model: found no focal length of {readable(key)}, expected a camera with a known lens"
        )
    rates = [_rate_hz(table) for table in cameras.values()]
    sizes = {size for table in cameras.values() for size in table.select("width", "height").unique().iter_rows()}
    width, height = next(iter(cameras.values())).select("width", "height").row(0)
    return CameraOfModel(
        width=width,
        height=height,
        focal_px=_common(focal),
        rate_hz=_common(rates),
        notes=(*_differing("focal lengths", focal, "px"), *_differing("rates", rates, "Hz"), *_size_note(sizes)),
    )


def _rate_hz(table: pl.DataFrame) -> float | None:
    step = table["time_s"].diff().median()
    return 1.0 / step if isinstance(step, float) and step > 0.0 else None


def _common(values: Sequence[float | None]) -> float | None:
    """The first of values that are equal to `TOLERANCE`; None where they differ or one is unknown."""
    known = [value for value in values if value is not None]
    same = len(known) == len(values) and max(known) <= (1.0 + TOLERANCE) * min(known)
    return known[0] if same else None


def _differing(what: str, values: Sequence[float | None], unit: str) -> Iterable[str]:
    """A sentence where values differ, or only some are known."""
    known = [value for value in values if value is not None]
    if known and _common(values) is None:
        unknown = "" if len(known) == len(values) else ", and unknown ones"
        shown = f"{min(known):.4g} to {max(known):.4g} {unit}" if min(known) < max(known) else f"{known[0]:.4g} {unit}"
        yield f"It was fitted to recordings with different {what}, {shown}{unknown}: it has none of its own."


def _size_note(sizes: set[tuple[int, int]]) -> Iterable[str]:
    if len(sizes) > 1:
        shown = ", ".join(f"{width} x {height}" for width, height in sorted(sizes))
        yield f"It was fitted to images of different sizes: {shown} px."


_NEEDED, _PAIRS, _TRACK_ERRORS = "noise_sums", "noise_pairs", "track_errors"
_PAIR_TRACKS, _RIG = "pair_tracks", "rig"
_OTHERS = ("noise_outliers", "noise_covariates", "samples", "ends", "window_noise", "noise_tracks", "floors", "rigid")
_USED = {
    "samples": ("dataset", "scene", "rotation", "direction", "tracker", "speed", "at", "du_px", "dv_px"),
    "noise_tracks": (*ORIGIN, "track", "stands_for", "age", "du_px", "dv_px"),
}  # fmt: skip
"""Columns that are read of large tables."""


@dataclass(frozen=True, slots=True, eq=False)
class RunTruth:
    """What is known of a run's truth: the verdict on it, and its errors before and after corrections."""

    verdict: TruthVerdict
    audit_curves: pl.DataFrame

    @classmethod
    def of(cls, folder: RunFolder) -> "RunTruth":
        """That of a run."""
        return cls(TruthVerdict.of_run(folder), AuditTables.of_run(folder).audit_curves)


@dataclass(frozen=True, slots=True, eq=False)
class TrainingTables:
    """Tables of all scenes that a model is fitted to."""

    # tracker, speed: name, and frames of the recording per frame that it saw
    tracker: str
    speed: int
    settings: dict[str, object]  # its options
    scenes: tuple[str, ...]  # names, sorted
    keys: tuple[str, ...]  # of the sequences
    groups: SceneGroups  # of scenes that are not independent of each other
    tables: dict[str, pl.DataFrame]  # tables of all sequences together, of the tracker at the speed, by name
    folder: RunFolder  # of the run
    truth: RunTruth  # what is known of its truth

    def __getitem__(self, name: str) -> pl.DataFrame:
        return self.tables[name]

    def of_sequence(self, name: str, key: str) -> pl.DataFrame:
        """A table of one sequence."""
        return self.folder.sequence_table(name, key)

    def of_scenes(self, scenes: Collection[str]) -> "TrainingTables":
        """The same of some of the scenes: of all, or of all of one group."""
        of_scenes = self._of(pl.col("scene").is_in(list(scenes)), lambda sequence: sequence.scene in scenes)
        return replace(of_scenes, scenes=tuple(sorted(scenes)))

    def of_reference_view(self) -> "TrainingTables":
        """The same of one view of each scene."""
        view = reference_view(self[_NEEDED])
        rows = pl.all_horizontal(pl.col(name) == value for name, value in view.items())
        of_view = self._of(rows, lambda found: all(getattr(found, name) == value for name, value in view.items()))
        return replace(of_view, scenes=tuple(sorted(of_view[_NEEDED]["scene"].unique())))

    def _of(self, rows: pl.Expr, includes: Callable[[SequenceId], bool]) -> "TrainingTables":
        entries = self.folder.manifest().sequences
        return replace(
            self,
            keys=tuple(key for key in self.keys if includes(entries[key].sequence)),
            tables={name: table.filter(rows) for name, table in self.tables.items()},
        )


def conditions(folder: RunFolder) -> list[tuple[str, int]]:
    """Trackers and speeds that noise models can be fitted to, sorted."""
    found = [table.unique() for table in folder.stored_tables(_NEEDED, only=["tracker", "speed"])]
    rows = sorted(pl.concat(found).unique().iter_rows()) if found else []
    if not rows:
        raise _without_sums(folder)
    return rows


def chosen_conditions(
    folder: RunFolder, *, trackers: Collection[str] | None = None, speeds: Collection[int] | None = None
) -> list[tuple[str, int]]:
    """The same of some trackers and speeds; by default of all.

    Raises
    ------
    UnknownNameError
        If one of the trackers is not among them.
    SettingsError
        If one of the speeds is not, or no such tracker has such a speed.
    StoreError
        If there are none.
    """
    known = conditions(folder)
    names, every = {name for name, _ in known}, sorted({speed for _, speed in known})
    for tracker in trackers or ():
        if tracker not in names:
            raise UnknownNameError("tracker", tracker, names)
    for speed in speeds or ():
        if speed not in every:
            raise SettingsError(f"{folder.path}: found no speed {speed}, expected one of {', '.join(map(str, every))}")
    wanted = [(name, speed) for name, speed in known if name in (trackers or names) and speed in (speeds or every)]
    if not wanted:
        expected = ", ".join(f"{name}@{speed}" for name, speed in known)
        raise SettingsError(f"{folder.path}: found none of the wanted trackers and speeds, expected some of {expected}")
    return wanted


def _without_sums(folder: RunFolder) -> StoreError:
    kinds = {entry.truth for entry in folder.manifest().sequences.values()}
    expected = "a run of this version whose truth is known for each first position (neither scan nor triangulated)"
    if not kinds <= {"scan", "triangulated"}:
        expected = f"{expected}, and in successive frames: poses or depths of too many may be missing"
    return StoreError(f"{folder.path}: holds no sums for noise models, expected {expected}")


def training_tables(
    folder: RunFolder, *, tracker: str, speed: int, scenes: Collection[str] | None = None
) -> TrainingTables:
    """Read what a model is fitted to."""
    return all_training_tables(folder, [(tracker, speed)], scenes=scenes)[0]


def all_training_tables(
    folder: RunFolder,
    wanted: Sequence[tuple[str, int]],
    *,
    scenes: Collection[str] | None = None,
    truth: RunTruth | None = None,
) -> list[TrainingTables]:
    """The same for several models. Each table of the run is read once. `truth`: by default that of the run."""
    entries = folder.manifest().sequences
    _require_scenes({entry.sequence.scene for entry in entries.values()}, scenes)
    chosen = {
        key: entry
        for key, entry in sorted(entries.items())
        if _NEEDED in entry.sha256 and (scenes is None or entry.sequence.scene in scenes)
    }
    if not chosen:
        raise _without_sums(folder)
    has_pairs = all(_PAIRS in entry.sha256 for entry in chosen.values())  # scenes of an earlier version have none
    names = [*_OTHERS, *([_PAIRS] if has_pairs else [])]
    groups, known = groups_of_run(folder), truth or RunTruth.of(folder)
    of = {_NEEDED: _pooled(folder, _NEEDED, tuple(chosen), wanted, _without_blocks(chosen.values(), groups))}
    if any(table.is_empty() for table in of[_NEEDED]):
        _require_conditions(folder, wanted)
    of |= {name: _pooled(folder, name, tuple(chosen), wanted) for name in names}
    if not has_pairs:
        of[_PAIRS] = [empty(NOISE_PAIRS)] * len(wanted)
    of[_TRACK_ERRORS] = _of_tracks(folder, chosen, wanted)
    has_rig = all({_PAIR_TRACKS, _RIG} <= set(entry.sha256) for entry in chosen.values())  # a second camera is measured
    pairs = _pooled(folder, _PAIR_TRACKS, tuple(chosen), wanted) if has_rig else [empty(PAIR_TRACKS)] * len(wanted)
    of[_PAIR_TRACKS] = pairs
    read = [
        TrainingTables(
            tracker=tracker,
            speed=speed,
            settings=_settings(folder, tracker),
            scenes=tuple(sorted(of[_NEEDED][place]["scene"].unique())),
            keys=tuple(chosen),
            groups=groups,
            tables={name: tables[place] for name, tables in of.items()},
            folder=folder,
            truth=known,
        )
        for place, (tracker, speed) in enumerate(wanted)
    ]
    return [tables.of_reference_view() for tables in read]


def _require_conditions(folder: RunFolder, wanted: Sequence[tuple[str, int]]) -> None:
    known = conditions(folder)
    names = {name for name, _ in known}
    for tracker, speed in wanted:
        if tracker not in names:
            raise UnknownNameError("tracker", tracker, names)
        if (tracker, speed) not in known:
            speeds = ", ".join(str(one) for name, one in known if name == tracker)
            raise SettingsError(f"{folder.path}: found no speed {speed} of {tracker}, expected one of {speeds}")


def _require_scenes(known: set[str], wanted: Collection[str] | None) -> None:
    for scene in wanted or ():
        if scene not in known:
            raise UnknownNameError("scene", scene, known)
    if wanted is not None and not wanted:
        raise SettingsError("noise model: found no scenes to fit to, expected at least one")


def _pooled(
    folder: RunFolder,
    name: str,
    keys: Sequence[str],
    wanted: Sequence[tuple[str, int]],
    reduce: Callable[[pl.DataFrame], pl.DataFrame] = lambda table: table,
) -> list[pl.DataFrame]:
    """Rows of each tracker and speed, of all sequences. `reduce` makes fewer rows of those of a few sequences."""
    rows = [(pl.col("tracker") == tracker) & (pl.col("speed") == speed) for tracker, speed in wanted]
    parts = (
        [reduce(table.filter(mine)) for mine in rows]
        for table in folder.stacked_tables(name, keys, only=_USED.get(name))
    )
    return [pl.concat(own) for own in zip(*parts, strict=True)]


def _of_tracks(
    folder: RunFolder, entries: Mapping[str, SequenceEntry], wanted: Sequence[tuple[str, int]]
) -> list[pl.DataFrame]:
    """Errors of tracks of each tracker and speed, with the qualities that it reports; none of an earlier version."""
    if not all(_TRACK_ERRORS in entry.sha256 for entry in entries.values()):
        return [empty(TRACK_ERRORS)] * len(wanted)
    rows = [(pl.col("tracker") == tracker) & (pl.col("speed") == speed) for tracker, speed in wanted]
    parts = [
        [table.filter(mine) for mine in rows]
        for table in (folder.sequence_table(_TRACK_ERRORS, key) for key in entries)
    ]
    found = [pl.concat(own, how="diagonal") for own in zip(*parts, strict=True)]
    return [table.select(one for one in table if one.name in TRACK_ERRORS or one.count()) for table in found]


def _without_blocks(entries: Iterable[SequenceEntry], groups: SceneGroups) -> Callable[[pl.DataFrame], pl.DataFrame]:
    """What adds up the blocks of sums, where scenes, or groups of them, are resampled in all and in each group."""
    sequences = [entry.sequence for entry in entries]
    scenes, dataset = sorted({sequence.scene for sequence in sequences}), sequences[0].dataset
    known = [scene for scene in scenes if (dataset, scene) in groups.names]
    of_group = [[scene for scene in known if groups.names[dataset, scene] == name] for name in {*groups.names.values()}]
    if all(scheme(groups.of(dataset, some)) is not None for some in (scenes, *filter(None, of_group))):
        return partial(without_blocks, by=[*ORIGIN, "product", "age"], schema=NOISE_SUMS)
    return lambda sums: sums


def _settings(folder: RunFolder, tracker: str) -> dict[str, object]:
    """Settings of the tracker in the experiment; empty if they are not there."""
    for settings in folder.settings()["trackers"]:
        if settings.get("name", settings["kind"]) == tracker:
            return dict(settings)
    return {}


_LEAST_MOTION = 0.01
"""Least distance of the first and the last camera of a window, as a share of the median depth."""
_TRACKS, _LEAST_TRACKS = 20, 15
"""Tracks in each frame of a window, and fewest in all of it."""
_MORE = (1, 4, 16)
"""How many times as many tracks are drawn, until they determine the poses of a window."""
_MOST_BEFORE = 100
"""Frames before a window in which its tracks may begin."""
MOST_RECORDINGS, _ENOUGH = 24, 12
"""Recordings that windows are of, and windows: few recordings have more of each."""


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One sequence."""

    scene: str  # its name
    poses: pl.DataFrame  # schema `POSES`
    camera: pl.DataFrame  # schema `CAMERAS`, with at least one row
    sights: NDArray[np.float64]  # (n, 3) float64: u, v (px) and depth (m) of points at first sight
    lifetimes: NDArray[np.int64]  # (n,): lengths of tracks, frames of the tracker
    rig: Rig | None = None  # the second camera, of a tracker of it


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """Windows of one length."""

    each: Sequence[Sequence[LinearTracks]]
    scenes: Sequence[str | None]  # of each the scene that it is of; None of simulated ones

    @property
    def simulated(self) -> bool:
        """Whether they are simulated."""
        return None in self.scenes

    def of_scene(self, scene: str) -> list[int]:
        """Places of those of a scene; of all where it has none."""
        own = [place for place, name in enumerate(self.scenes) if name == scene]
        return own or list(range(len(self.each)))


def windows(recordings: Sequence[Recording], *, speed: int, length: int, lifetimes: NDArray[np.int64]) -> Windows:
    """Windows of so many frames, spread evenly over each recording that is long enough and moves.

    Tracks may begin before a window, where they were first seen.

    If there is none, a simulated window of sideways and one of forward motion, with tracks of these lifetimes, and the
    second camera beside the first as it is in the recordings.
    """
    count = max(1, -(-_ENOUGH // max(len(recordings), 1)))
    found = [
        (one.scene, window) for one in recordings for window in windows_of(one, speed=speed, length=length, count=count)
    ]
    if found:
        return Windows([window for _, window in found], [scene for scene, _ in found])
    poses = [trajectory(motion, length) for motion in Motion]
    recorded = next((one.rig for one in recordings if one.rig is not None), None)
    rig = None if recorded is None else replace(recorded, camera=CAMERA)
    made = [window for each in poses if (window := _linear(CAMERA, each, lifetimes, None, rig=rig))]
    return Windows(made, [None] * len(made))


def windows_of(recording: Recording, *, speed: int, length: int, count: int) -> Iterator[Sequence[LinearTracks]]:
    """At most so many windows of one recording: none where it is too short, or does not move."""
    if not len(recording.sights):
        return
    of_scene = crc32(recording.scene.encode())  # else all scenes would have the same draws of lengths
    for place, (poses, before) in enumerate(_spread(recording.poses, speed, length, count)):
        apart = np.linalg.norm(poses[-1, :3, 3] - poses[0, :3, 3])
        if apart < _LEAST_MOTION * np.median(recording.sights[:, 2]):
            continue
        camera, seed = pinhole(recording.camera), of_scene + place
        tracks = _linear(camera, poses, recording.lifetimes, recording.sights, before, seed=seed, rig=recording.rig)
        if sum(len(one.rays) for one in tracks) >= _LEAST_TRACKS:
            yield tracks


def _linear(
    camera: Camera,
    poses: NDArray[np.float64],
    lifetimes: NDArray[np.int64],
    sights: NDArray[np.float64] | None,
    before: NDArray[np.float64] | None = None,
    *,
    seed: int = 0,
    rig: Rig | None = None,
) -> Sequence[LinearTracks]:
    """Tracks of one window, more of them where they do not determine its poses; none where more do not either."""
    length = len(poses)
    mean = np.clip(lifetimes, 3, length).mean()
    count = int(np.ceil(_TRACKS * (length + mean) / mean))
    for more in _MORE:
        drawn = simulated_tracks(
            poses, n_tracks=more * count, lengths=lifetimes, seed=seed, camera=camera, sights=sights, before=before
        )
        window = [linear_tracks(camera, poses, tracks, rig=rig) for tracks in drawn]
        if determines_poses(window):
            return window
    return []


def _spread(
    poses: pl.DataFrame, speed: int, length: int, count: int
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Poses of so many parts of a recording, at most, none of which is missing, (length, 4, 4), and those before."""
    used = poses.sort("frame").gather_every(speed)
    latest = used.height - length
    if latest < 0:
        return
    known = used.select(pl.all_horizontal(pl.all().is_not_null())).to_series().to_numpy()
    position, quaternion = (
        used.select(names).to_numpy() for names in (("x_m", "y_m", "z_m"), ("qx", "qy", "qz", "qw"))
    )
    for start in np.unique(np.linspace(0, latest, count + 2)[1:-1].round().astype(int)).tolist():
        if known[start : start + length].all():
            missing = np.flatnonzero(~known[:start])
            begin = max(int(missing[-1]) + 1 if len(missing) else 0, start - _MOST_BEFORE)
            found = from_quaternion(position[begin : start + length], quaternion[begin : start + length])
            yield found[start - begin :], found[: start - begin]


def pinhole(table: pl.DataFrame) -> Camera:
    """The camera of a table without its distortion."""
    names = ("width", "height", "fx_px", "fy_px", "cx_px", "cy_px")
    return Camera(*table.select(names).row(0))
