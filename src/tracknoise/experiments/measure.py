"""Measure sequences: tables of observations and tracks, trimmed, their moments, and metrics of point trackers."""

from __future__ import annotations  # signatures name types such as `Trackers` instead of listing what they are made of

from collections.abc import Iterable, Iterator, Mapping
from collections.abc import Sequence as Items
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Protocol, TypeAlias, cast, get_args, runtime_checkable

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.checks import require
from tracknoise.exceptions import SettingsError
from tracknoise.geometry.corrections import UNCORRECTED, Corrections
from tracknoise.measurement.refined_poses import Leading
from tracknoise.measurement.sequence_tables import SequenceTables, measure_sequences, require_length
from tracknoise.measurement.tracking import Progress, TrackerSetup
from tracknoise.sequences.corrected import corrected
from tracknoise.sequences.likely_times import require_likely_times
from tracknoise.sequences.sequence import Sequence
from tracknoise.sequences.views import chosen_frames
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.statistics.tap import PointTracks, expected_feature_age, tap_vid
from tracknoise.statistics.trimming import trim
from tracknoise.statistics.truth_errors import pose_differences
from tracknoise.tables.defaults import POPULATION, TRIM_AMONG, TRIM_PERCENTILE
from tracknoise.tables.identity import readable
from tracknoise.tables.manifest import PoseFit
from tracknoise.tables.schema import ORIGIN, POINT_TRACKING, POSE_DIFFERENCES, TruthStatus, empty
from tracknoise.text import html_card, html_table, one_line
from tracknoise.trackers.function import Follow, Function
from tracknoise.trackers.tracker import StatedPoints, TrackerSettings
from tracknoise.trackers.tracker_registry import make_tracker
from tracknoise.truth.accuracies import DEFAULT_RULE, AccuracyRule
from tracknoise.truth.scan import SCAN_RULE, ScanRule
from tracknoise.truth.truth_registry import make_truth

Tracker: TypeAlias = TrackerSettings | str | Follow
"""Settings of a tracker, the name of a tracker or preset of `tracknoise trackers` with its default settings, or a
function that follows points: see `tracknoise.trackers.function.Function`."""
Poses: TypeAlias = Literal["refined", "stated"]
"""Which poses lead: those refined by reference tracks, where these are determined and the stated ones are not stated to
be better; or the stated ones in any case."""
Trackers: TypeAlias = Tracker | Items[Tracker] | Mapping[str, Tracker]


def named_trackers(trackers: Trackers) -> dict[str, TrackerSettings]:
    """Settings of trackers by their names; others are named by their preset, function or kind."""
    if isinstance(trackers, Mapping):
        named = {name: _settings(tracker) for name, tracker in trackers.items()}
    else:
        listed = list(_several(trackers))
        named = {_label(tracker): _settings(tracker) for tracker in listed}
        if len(named) < len(listed):
            raise SettingsError("two trackers of one name, expected a mapping that names them")
    if not named:
        raise SettingsError("no trackers, expected at least one")
    return named


def checked_speeds(speeds: object) -> list[int]:
    """Speeds as a list."""
    if not isinstance(speeds, Iterable) or isinstance(speeds, str):
        raise SettingsError(f"speeds = {speeds!r}, expected a list, such as [1] or [1, 2]")
    listed = list(speeds)
    whole = [int(speed) for speed in listed if type(speed) is int or isinstance(speed, np.integer)]
    if not whole or len(set(whole)) < len(listed) or min(whole) < 1:
        raise SettingsError(f"speeds = {listed}, expected different whole numbers of 1 or more, such as [1, 2]")
    return whole


def require_sequences(sequences: Items[object]) -> None:
    """Check that what is measured are sequences."""
    for sequence in sequences:
        if isinstance(sequence, str | type) or not hasattr(sequence, "image"):
            expected = "a sequence, from tracknoise.open_sequence or tracknoise.Sequence.from_arrays"
            raise SettingsError(f"found {sequence!r}, expected {expected}")


def require_options(corrections: object, accuracy: object, max_frames: object, seed: object) -> None:
    """Check options that have another type in an experiment file."""
    for name, value, kind in (("corrections", corrections, Corrections), ("accuracy", accuracy, AccuracyRule)):
        if not isinstance(value, kind):
            raise SettingsError(f"{name} = {value!r}, expected tracknoise.{kind.__name__}(...)")
    if max_frames is not None and (not isinstance(max_frames, int | np.integer) or max_frames < 2):
        raise SettingsError(f"max_frames = {max_frames!r}, expected a whole number of 2 or more")
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise SettingsError(f"seed = {seed!r}, expected a whole number of 0 or more")


def _several(trackers: object) -> Iterable[object]:
    return trackers if isinstance(trackers, Iterable) and not isinstance(trackers, str | type) else [trackers]


def _label(tracker: object) -> str:
    """The name of a tracker that was given none."""
    settings = _settings(tracker)
    return tracker if isinstance(tracker, str) else settings.name if isinstance(settings, Function) else settings.kind


def _settings(tracker: object) -> TrackerSettings:
    if isinstance(tracker, str):
        return make_tracker(tracker)
    if isinstance(tracker, type):
        raise SettingsError(f"found the class {tracker.__name__}, expected an instance: {tracker.__name__}()")
    if callable(tracker) and not hasattr(tracker, "start"):
        return Function(tracker)
    if not hasattr(tracker, "start") or not hasattr(tracker, "kind"):
        raise SettingsError(f"found {tracker!r}, expected settings of a tracker, such as tracknoise.LucasKanade()")
    return cast(TrackerSettings, tracker)


@dataclass(frozen=True, slots=True)
class Measurement:
    """Everything measured in one sequence.

    Attributes
    ----------
    sequence
        What was measured.
    observations, tracks, frames, moments, trims, floors
        Tables of `tracknoise.tables.schema`. Errors `du_px`, `dv_px` are observed minus true, px; ages count
        frames of the nominal sequence.
    population
        The observations that trimming looked at.
    truth
        The kind of truth used.
    key_frame
        The frame in which features were associated with a scan; None for other kinds of truth.
    n_frames
        Number of frames read.
    snapshot_frame, snapshot
        One frame, (height, width) uint8, for figures that show the tracks.
    prepared
        Observations and tracks, checked and grouped: what further statistics are computed from.
    pose_differences
        Differences of the poses of two truths, schema `POSE_DIFFERENCES`; without rows unless there is a second truth.
    notes
        What trackers state about their results, and what is known of the errors of the truth, one sentence each.
        `sequence` has the notes of the reader.
    states_accuracy
        Whether the errors of its poses, and of its depths where they count, are stated; 0 where they are exact.
    images
        Images of the first frames, (height, width) uint8, as far as they were to be kept.
    points
        By tracker and speed: all positions of trackers that state some of points that they say are not visible.
    pose_fit
        Which poses are those of `sequence`, and what reference tracks say of the stated ones; None if they were not
        asked.
    """

    sequence: Sequence = field(repr=False)
    observations: pl.DataFrame
    tracks: pl.DataFrame
    frames: pl.DataFrame
    moments: pl.DataFrame
    trims: pl.DataFrame
    floors: pl.DataFrame
    population: str
    truth: str
    key_frame: int | None
    n_frames: int
    snapshot_frame: int
    snapshot: NDArray[np.uint8]
    prepared: PreparedSequence = field(repr=False)
    pose_differences: pl.DataFrame = field(repr=False)
    notes: tuple[str, ...] = ()
    states_accuracy: bool = False
    images: Mapping[int, NDArray[np.uint8]] = field(default_factory=dict, repr=False)
    points: Mapping[tuple[str, int], StatedPoints] = field(default_factory=dict, repr=False)
    pose_fit: PoseFit | None = None

    def __repr__(self) -> str:
        return one_line("Measurement", readable(self.sequence.id.key), self._facts)

    def _repr_html_(self) -> str:
        """What was measured, and a row for each tracker and speed."""
        counts = self.tracks.group_by("tracker", "speed", maintain_order=True).agg(tracks=pl.len())
        with_truth = pl.col("du_px").is_not_null().sum()
        errors = self.observations.group_by("tracker", "speed").agg(observations=pl.len(), known=with_truth)
        rows = counts.join(errors, on=["tracker", "speed"], how="left", maintain_order="left")
        headings = ["tracker", "speed", "tracks", "observations", "with a true position"]
        card = html_card(f"Measurement of {readable(self.sequence.id.key)}", self._facts)
        return f"{card}{html_table(headings, rows.rows())}"

    def image(self, index: int) -> NDArray[np.uint8]:
        """The image of a frame, (height, width): one that was kept, or read again."""
        kept = self.images.get(index)
        return self.sequence.image(index) if kept is None else kept

    @property
    def _facts(self) -> dict[str, object]:
        """What it shows of itself, by name."""
        return {
            "frames": self.n_frames,
            "trackers": ", ".join(self.frames["tracker"].unique(maintain_order=True)),
            "speeds": ", ".join(map(str, self.frames["speed"].unique().sort())),
            "observations": f"{self.observations.height:,}",
            "truth": self.truth,
        }


def measure(
    sequence: Sequence,
    trackers: Trackers,
    *,
    speeds: Items[int] = (1,),
    truth: str | None = None,
    scan_rule: ScanRule = SCAN_RULE,
    corrections: Corrections = UNCORRECTED,
    accuracy: AccuracyRule = DEFAULT_RULE,
    population: str = POPULATION,
    trim_percentile: float = TRIM_PERCENTILE,
    trim_among: str = TRIM_AMONG,
    frames: Items[int] | None = None,
    max_frames: int | None = None,
    second_truth: Sequence | None = None,
    poses: Poses = "stated",
    seed: int = 0,
    progress: Progress | None = None,
) -> Measurement:
    """Run trackers on a sequence of known geometry and compute the error of every observation.

    See `measure_together` for the parameters.
    """
    given = [sequence] if second_truth is None else [sequence, second_truth]
    require_sequences(given)
    require_options(corrections, accuracy, max_frames, seed)
    require(poses in get_args(Poses), "poses", poses, "refined or stated")
    first, *second = (chosen_frames(corrected(view, corrections), frames) for view in given)
    require_length(first, min(len(first), max_frames or len(first)), checked_speeds(speeds))
    led = Leading.of([first], second, kind=truth, rule=accuracy, n_frames=max_frames, only_stated=poses == "stated")
    (measured,) = measure_together(
        led.sequences,
        trackers,
        speeds=speeds,
        truth=truth,
        scan_rule=scan_rule,
        accuracy=accuracy,
        population=population,
        trim_percentile=trim_percentile,
        trim_among=trim_among,
        max_frames=max_frames,
        second_truth=led.second,
        seed=seed,
        progress=progress,
    )
    return replace(measured, pose_fit=led.fits[0])


def measure_together(
    sequences: Items[Sequence],
    trackers: Trackers,
    *,
    speeds: Items[int] = (1,),
    truth: str | None = None,
    scan_rule: ScanRule = SCAN_RULE,
    accuracy: AccuracyRule = DEFAULT_RULE,
    population: str = POPULATION,
    trim_percentile: float = TRIM_PERCENTILE,
    trim_among: str = TRIM_AMONG,
    max_frames: int | None = None,
    second_truth: Items[Sequence] = (),
    seed: int = 0,
    progress: Progress | None = None,
    kept_bytes: int = 0,
) -> Iterator[Measurement]:
    """Run trackers on sequences that advance together, because they share what they read."""
    require_sequences([*sequences, *second_truth])
    for given in (*sequences, *second_truth):
        require_likely_times(given)
    require_options(UNCORRECTED, accuracy, max_frames, seed)
    measured = measure_sequences(
        sequences,
        _setups(trackers, speeds),
        truth=truth,
        scan_rule=scan_rule,
        max_frames=max_frames,
        seed=seed,
        progress=progress,
        second=second_truth,
        accuracy=accuracy,
        kept_bytes=kept_bytes,
    )
    others: Items[Sequence | None] = second_truth or [None for _ in sequences]
    for sequence, other, tables in zip(sequences, others, measured, strict=True):
        yield complete(
            sequence,
            tables,
            trim_percentile=trim_percentile,
            trim_among=trim_among,
            population=population,
            second_truth=other,
        )


def _setups(trackers: Trackers, speeds: Items[int]) -> list[TrackerSetup]:
    """Each tracker at each speed."""
    named, played = named_trackers(trackers), checked_speeds(speeds)
    return [TrackerSetup(name, settings, speed) for name, settings in named.items() for speed in played]


def complete(
    sequence: Sequence,
    measured: SequenceTables,
    *,
    trim_percentile: float = TRIM_PERCENTILE,
    trim_among: str = TRIM_AMONG,
    population: str = POPULATION,
    second_truth: Sequence | None = None,
) -> Measurement:
    """Trim what was measured in a sequence, and compute its moments; see `measure_together` for the parameters."""
    trimmed = trim(
        measured.observations,
        measured.tracks,
        percentile=trim_percentile,
        population=population,
        among=trim_among,
        key_frame=measured.key_frame,
    )
    return Measurement(
        sequence=sequence,
        observations=trimmed.observations,
        tracks=trimmed.tracks,
        frames=measured.frames,
        moments=scene_moments(trimmed.sequence.seen),
        trims=trimmed.trims,
        floors=measured.floors,
        population=population,
        truth=measured.truth,
        key_frame=measured.key_frame,
        n_frames=measured.n_frames,
        snapshot_frame=measured.snapshot_frame,
        snapshot=measured.snapshot,
        prepared=trimmed.sequence,
        pose_differences=poses_of_two(sequence, second_truth, measured.n_frames),
        notes=measured.notes,
        states_accuracy=measured.states_accuracy,
        images=measured.images,
        points=measured.points,
    )


def poses_of_two(sequence: Sequence, second: Sequence | None, n_frames: int) -> pl.DataFrame:
    """How the poses of the frames that were read differ."""
    if second is None:
        return empty(POSE_DIFFERENCES)
    return pose_differences(sequence.id, *(view.world_from_camera[:n_frames] for view in (sequence, second)))


RASTER_PX = 256
"""Side of the images to which TAP-Vid scales positions."""
_METRICS = (*POINT_TRACKING,)[list(POINT_TRACKING).index("delta_avg") :]


@runtime_checkable
class LocatingTruth(Protocol):
    """A truth that knows where points are, and whether they are visible, in frames in which nothing observed them."""

    def anchor(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
        """World points (n, 3) of features in a frame, and their status."""
        ...

    def locate(self, index: int, points_world: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
        """Positions (n, 2) of world points in a frame, and their status."""
        ...


def require_measurement(value: object) -> None:
    """Refuse what is no measurement."""
    require(isinstance(value, Measurement), "measurement", value, "what tracknoise.measure returns")


def tap_metrics(measurement: Measurement) -> pl.DataFrame:
    """Metrics of TAP-Vid and expected feature age of every tracker and speed of a measured sequence.

    Parameters
    ----------
    measurement
        Of one sequence, whose truth is from depth maps (``birth``) or the exact surface (``raycast``).

    Returns
    -------
    polars.DataFrame
        Schema `POINT_TRACKING`, two rows per tracker and speed. `delta_avg`, `average_jaccard` and `occlusion_accuracy`
        are those of TAP-Vid (`tracknoise.statistics.tap.tap_vid`), followed by `expected_feature_age` and the values of
        each threshold. `delta_avg` is null for trackers without positions under predicted occlusion, and
        `delta_avg_reported` counts none of them. Benchmarks report means over sequences.

    Raises
    ------
    SettingsError
        If it is no measurement, or the truth cannot locate points in frames in which they were not observed.
    DataError
        If a depth map cannot be read.
    """
    require_measurement(measurement)
    truth = make_truth(measurement.sequence, measurement.truth)
    if not isinstance(truth, LocatingTruth):
        expected = "birth or raycast, which locate points where they were not observed"
        raise SettingsError(f"{measurement.sequence.source}: found truth = {measurement.truth!r}, expected {expected}")
    camera = measurement.sequence.camera
    scales = {"256x256": (RASTER_PX / camera.width, RASTER_PX / camera.height), "image": (1.0, 1.0)}
    rows = []
    for condition, seen in measurement.observations.group_by(list(ORIGIN), maintain_order=True):
        labels = dict(zip(ORIGIN, condition, strict=True))
        stated = measurement.points.get((labels["tracker"], int(labels["speed"])))
        points = point_tracks(truth, seen, stated, speed=int(labels["speed"]), n_frames=measurement.n_frames)
        rows += [labels | {"raster": name} | _metrics(points, scale) for name, scale in scales.items()]
    return pl.DataFrame(rows, schema=dict(POINT_TRACKING)).with_columns(pl.col(_METRICS).fill_nan(None))


def point_tracks(
    truth: LocatingTruth, seen: pl.DataFrame, stated: StatedPoints | None = None, *, speed: int, n_frames: int
) -> PointTracks:
    """True positions of all tracks with a known point, in every frame that the tracker saw.

    `stated`: the positions of a tracker that states some of points that are not visible; its points count, which it may
    see again, and not its tracks, which end where they are not seen.
    """
    of_frame = stated or _as_stated(seen)
    kept = (of_frame.frame % speed == 0) & (of_frame.frame < n_frames)
    column, uv, visible = of_frame.frame[kept] // speed, of_frame.uv[kept], of_frame.visible[kept]
    point = np.unique(of_frame.point[kept], return_inverse=True)[1]
    shape = int(point.max(initial=-1)) + 1, -(-n_frames // speed)
    predicted, reported = np.full((*shape, 2), np.nan), np.full((*shape, 2), np.nan)
    predicted[point, column] = uv
    reported[point[visible], column[visible]] = uv[visible]
    there = np.isfinite(reported[..., 0])
    first = there.argmax(axis=1)
    world, true_px = np.full((shape[0], 3), np.nan), np.full((*shape, 2), np.nan)
    status = np.full(shape, TruthStatus.no_pose, dtype=np.int8)
    anchored = np.zeros(shape[0], dtype=np.bool_)
    for place in range(shape[1]):
        new = np.flatnonzero(there.any(axis=1) & (first == place))
        world[new], status_at_birth = truth.anchor(place * speed, reported[new, place])
        anchored[new] = status_at_birth == TruthStatus.valid
        begun = np.flatnonzero(anchored & (first <= place))
        true_px[begun, place], status[begun, place] = truth.locate(place * speed, world[begun])
    after = np.arange(shape[1]) > first[anchored, None]
    complete = stated is not None and bool(np.isfinite(predicted[anchored, :, 0])[after].all())
    return PointTracks(
        reported[anchored],
        true_px[anchored],
        (status == TruthStatus.valid)[anchored],
        (status != TruthStatus.no_pose)[anchored],
        first[anchored],
        predicted[anchored] if complete else None,
    )


def _as_stated(seen: pl.DataFrame) -> StatedPoints:
    """Observations as positions of points, one point for each track."""
    track, frame = (seen[name].to_numpy().astype(np.int64) for name in ("track", "frame"))
    return StatedPoints(track, frame, seen.select("u_px", "v_px").to_numpy(), np.ones(len(track), dtype=np.bool_))


def _metrics(points: PointTracks, scale: tuple[float, float]) -> dict[str, Any]:
    age = expected_feature_age(points, scale)
    return {"n_points": len(points.first), "expected_feature_age": age, **tap_vid(points, scale)}
