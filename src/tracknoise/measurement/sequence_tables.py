"""Tables of sequences: what trackers reported, and its errors by one truth or two."""

from collections.abc import Iterator, Mapping
from collections.abc import Sequence as Items
from dataclasses import dataclass, field, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, NothingToMeasureError, SettingsError
from tracknoise.geometry.surroundings import Surroundings, unknown_surroundings
from tracknoise.measurement.floors import TruthFloor
from tracknoise.measurement.recording import Recording
from tracknoise.measurement.tracking import Progress, TrackerSetup, TrackingResult, run_trackers
from tracknoise.processes import release_memory
from tracknoise.sequences.poses import has_pose, require_some_poses
from tracknoise.sequences.second_camera import Beside, pair_of
from tracknoise.sequences.sequence import SWEPT, TRIANGULATED, Sequence
from tracknoise.tables import schema
from tracknoise.tables.enumerations import EdgeSide
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import TrackEnd, TruthStatus
from tracknoise.text import counted
from tracknoise.trackers.tracker import StatedPoints, reports_causes, sees_second_camera
from tracknoise.truth.accuracies import DEFAULT_RULE, AccuracyRule
from tracknoise.truth.anchored import AnchoredTruth
from tracknoise.truth.beside import beside
from tracknoise.truth.scan import SCAN_RULE, ScanRule
from tracknoise.truth.truth import TruePositions, Truth, notes_of
from tracknoise.truth.truth_registry import make_truth, make_truths

Tables = tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame, pl.DataFrame]
"""`OBSERVATIONS`, `TRACKS`, `FRAME_COUNTS` and `FLOORS` of `tracknoise.tables.schema`."""


def setup_tables(
    sequence: SequenceId,
    setup: TrackerSetup,
    recording: Recording,
    positions: TruePositions,
    floors: dict[str, pl.Series],
    second: TruePositions | None = None,
    of_second: Beside | None = None,
) -> Tables:
    """Tables of one tracker setup on one sequence, with the columns of its `FLOORS` after those of the origin.

    The true positions of a second truth are among the observations, if there is one. `of_second`: the sequence as its
    second camera sees it, for trackers of that.
    """
    of_other = _named(None if second is None else second.uv, schema.SECOND_TRUTH)
    further = {**of_other, **_pair(recording, positions, of_second)}
    return (
        _table({**_observations(recording, positions), **further}, schema.OBSERVATIONS, sequence, setup),
        _table(_tracks(recording, positions, reports_causes(setup.settings)), schema.TRACKS, sequence, setup),
        _table(_frames(recording, reports_causes(setup.settings)), schema.FRAME_COUNTS, sequence, setup),
        _table(floors, schema.FLOORS, sequence, setup),
    )


ROUNDING_PX = 1e-9
"""Smaller differences between positions are rounding, and no errors."""


def _observations(recording: Recording, positions: TruePositions) -> dict[str, pl.Series]:
    error = recording.uv - positions.uv
    error[np.abs(error) < ROUNDING_PX] = 0.0
    return {
        "track": pl.Series(recording.track),
        "frame": pl.Series(recording.frame),
        "age": pl.Series(recording.frame - recording.first_frame[recording.track]),
        "u_px": pl.Series(recording.uv[:, 0]),
        "v_px": pl.Series(recording.uv[:, 1]),
        "u_true_px": _nullable(positions.uv[:, 0]),
        "v_true_px": _nullable(positions.uv[:, 1]),
        "truth": _names(positions.status, TruthStatus),
        "du_px": _nullable(error[:, 0]),
        "dv_px": _nullable(error[:, 1]),
        "kept": pl.repeat(True, len(error), eager=True),
        **_covariance(positions.covariance, schema.TRUE_COVARIANCE),
        **_covariance(positions.leverage, schema.LEVERAGE),
        **_named(positions.epipolar, schema.EPIPOLAR),
        **{schema.QUALITY_PREFIX + name: _nullable(values) for name, values in recording.quality.items()},
    }


def _covariance(covariance: NDArray[np.float64] | None, names: schema.Schema) -> dict[str, pl.Series]:
    if covariance is None:
        return {}
    return _named(covariance[:, [0, 0, 1], [0, 1, 1]], names)


def _pair(recording: Recording, positions: TruePositions, view: Beside | None) -> dict[str, pl.Series]:
    if recording.first_uv is None or positions.first_uv is None or view is None:
        return {}
    pair = pair_of(view.sequence, view.camera_beside)
    error = recording.first_uv - positions.first_uv
    error[np.abs(error) < ROUNDING_PX] = 0.0
    values = (
        *error.T,
        *pair.errors_px(recording.first_uv, recording.uv, positions.first_uv, positions.uv),
        pair.depth_m(recording.first_uv, recording.uv),
        pair.depth_m(positions.first_uv, positions.uv),
    )
    return {name: _nullable(column) for name, column in zip(schema.PAIR, values, strict=True)}


def _named(values: NDArray[np.float64] | None, names: schema.Schema) -> dict[str, pl.Series]:
    """Columns of values (n, k) by their names; none where there are no values."""
    if values is None:
        return {}
    return {name: _nullable(column) for name, column in zip(names, values.T, strict=True)}


def _tracks(recording: Recording, positions: TruePositions, has_causes: bool) -> dict[str, pl.Series]:
    count = len(recording.first_frame)
    has_end = has_causes | (recording.end == TrackEnd.sequence_end)
    return {
        "track": pl.Series(np.arange(count, dtype=np.uint32)),
        "first_frame": pl.Series(recording.first_frame),
        "lifetime": pl.Series(recording.found),
        "end": _names(recording.end, TrackEnd).set(pl.Series(~has_end), None),
        "response": _nullable(recording.response),
        "depth_m": _nullable(positions.depth_m),
        "gradient_rad": _nullable(recording.gradient_rad),
        **_surroundings(positions.surroundings or unknown_surroundings(count)),
        "max_error_px": pl.repeat(None, count, dtype=pl.Float64, eager=True),
        "kept": pl.repeat(True, count, eager=True),
    }


def _surroundings(surroundings: Surroundings) -> dict[str, pl.Series]:
    edge, side = pl.col("edge_px"), {name: pl.lit(name, dtype=schema.EDGE_SIDE) for name in EdgeSide}
    edges_px = pl.Series(surroundings.edge_px, nan_to_null=True)  # infinite where there is no edge
    table = pl.DataFrame({"edge_px": edges_px, "incidence_deg": _nullable(surroundings.incidence_deg)})
    return table.select(
        pl.when(edge.is_finite()).then(edge).cast(pl.Float32),
        edge_side=pl.when(edge.is_infinite())
        .then(side[EdgeSide.none])
        .when(edge > 0)
        .then(side[EdgeSide.near])
        .when(edge < 0)
        .then(side[EdgeSide.far]),
        incidence_deg=pl.col("incidence_deg").cast(pl.Float32),
    ).to_dict()


def _frames(recording: Recording, has_causes: bool) -> dict[str, pl.Series]:
    names = ("frame", "offered", "matched", "outliers", "new", "alive")
    counts = {name: pl.Series(recording.frames[:, column]) for column, name in enumerate(names)}
    unknown = pl.repeat(None, len(recording.frames), dtype=pl.UInt32, eager=True)
    return counts if has_causes else {**counts, "outliers": unknown}


def _table(
    columns: dict[str, pl.Series], layout: schema.Schema, sequence: SequenceId, setup: TrackerSetup
) -> pl.DataFrame:
    names = {name: getattr(sequence, name) for name in schema.SEQUENCE}
    origin = {**names, "tracker": setup.tracker, "speed": setup.speed}
    literals = [pl.lit(value, dtype=schema.ORIGIN[name]).alias(name) for name, value in origin.items()]
    table = pl.DataFrame(columns).with_columns(literals)
    return schema.check(table.select(list(schema.layout_of(layout, table.columns))), layout, setup.tracker)


def _nullable(values: NDArray[np.floating]) -> pl.Series:
    """A column in which what is not finite is unknown."""
    return pl.Series(np.where(np.isfinite(values), values, np.nan).astype(values.dtype), nan_to_null=True)


def _names(values: NDArray[np.int8], kind: type[TruthStatus] | type[TrackEnd]) -> pl.Series:
    """Enumeration values as the enumeration's column type."""
    names = [member.name for member in kind]
    return pl.Series(names, dtype=pl.Enum(names)).gather(values)


def open_second_truths(
    sequences: Items[Sequence], truths: Items[Truth], second: Items[Sequence], *, scan_rule: ScanRule
) -> list[Truth] | None:
    """The second truth of each sequence, positions only, of the same kind as its first; None where there is none."""
    if not second:
        return None
    for sequence, other in zip(sequences, second, strict=True):
        found, expected = _frames_and_size(other), _frames_and_size(sequence)
        if found != expected:
            raise DataError(other.source, f"a second truth of {found}", f"{expected}, as the first")
    made = [make_truth(other, truth.kind, scan_rule=scan_rule) for other, truth in zip(second, truths, strict=True)]
    return [truth.positions_only() if isinstance(truth, AnchoredTruth) else truth for truth in made]


def second_notes(sequence: Sequence, other: Sequence) -> tuple[str, ...]:
    """The notes that only the second truth has."""
    return tuple(f"second truth: {note}" for note in other.notes if note not in sequence.notes)


def _frames_and_size(sequence: Sequence) -> str:
    return f"{counted(len(sequence), 'frame')} of {sequence.camera.width}x{sequence.camera.height}"


@dataclass(frozen=True, slots=True)
class SequenceTables:
    """What was measured in one sequence, before trimming."""

    # observations, tracks, frames, floors: tables of `tracknoise.tables.schema`; `max_error_px` is null and `kept` true
    observations: pl.DataFrame
    tracks: pl.DataFrame
    frames: pl.DataFrame
    floors: pl.DataFrame
    truth: str  # the kind of truth used
    key_frame: int | None  # the frame in which features were associated with a scan; None for other kinds of truth
    n_frames: int  # number of frames read
    # snapshot_frame, snapshot: one frame, (height, width) uint8, for figures that show the tracks
    snapshot_frame: int
    snapshot: NDArray[np.uint8]
    # what trackers state about their results, what is known of the errors of the truth, and the notes of the second
    # truth, one sentence each
    notes: tuple[str, ...] = ()
    # whether the errors of its poses, and of its depths where they count, are stated; 0 where they are exact
    states_accuracy: bool = False
    # images of the first frames, (height, width) uint8, as far as they were to be kept
    images: Mapping[int, NDArray[np.uint8]] = field(default_factory=dict, repr=False)
    # by tracker and speed: all positions of trackers that state some of points that they say are not visible
    points: Mapping[tuple[str, int], StatedPoints] = field(default_factory=dict, repr=False)


def measure_sequences(
    sequences: Items[Sequence],
    setups: Items[TrackerSetup],
    *,
    truth: str | None = None,
    scan_rule: ScanRule = SCAN_RULE,
    accuracy: AccuracyRule = DEFAULT_RULE,
    max_frames: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    second: Items[Sequence] = (),
    kept_bytes: int = 0,
) -> Iterator[SequenceTables]:
    """Run trackers on sequences that advance together, and compute the error of each observation.

    Parameters
    ----------
    sequences
        Images of known geometry, all with the same number of frames.
    setups
        Trackers and speeds.
    truth
        Kind of truth, a name of `tracknoise.truth.truth_registry.TRUTHS`; by default the best that a sequence offers.
    scan_rule
        How features are associated with a scan, for the kind ``scan``.
    accuracy
        What the user says about the errors of the truth.
    max_frames
        Read no more frames than this; by default all.
    seed
        Random seed, for trackers that need one.
    progress
        Called after each frame of all sequences.
    second
        The same sequences with another truth, such as other poses, in the same order. Their images are read only
        where depth is computed from them. By default there is none.
    kept_bytes
        Size of the images of each sequence that are kept; by default none is.

    Yields
    ------
    SequenceTables
        One per sequence, in order. Each is made on demand, as the tables of all together may be large.

    Raises
    ------
    DataError
        If a sequence is too short for a speed or has fewer than 2 poses, an image, depth map or pose cannot be used,
        no tracker finds a feature, or no feature has a true position.
    SettingsError
        If a speed skips the key frame of a scan.
    UnknownNameError
        If there is no such kind of truth.
    """
    n_frames = min(len(sequences[0]), max_frames or len(sequences[0]))
    truths = make_truths(sequences, truth, scan_rule=scan_rule)
    for sequence, its_truth in zip(sequences, truths, strict=True):
        require_length(sequence, n_frames, [setup.speed for setup in setups])
        _check_key_frame(sequence, n_frames, setups, its_truth.key_frame)
    second_truths = open_second_truths(sequences, truths, second, scan_rule=scan_rule)
    results = run_trackers(
        sequences,
        setups,
        truths,
        n_frames=n_frames,
        seed=seed,
        progress=progress,
        second_truths=second_truths,
        kept_bytes=kept_bytes,
    )
    release_memory()
    notes = [second_notes(*pair) for pair in zip(sequences, second, strict=True)] if second else [()] * len(sequences)
    for sequence, its_truth, result, more in zip(sequences, truths, results, notes, strict=True):
        _check_features(sequence, result, its_truth)
        floors = [TruthFloor.of(sequence, its_truth, accuracy)]
        if any(sees_second_camera(setup.settings) for setup in setups):
            floors.append(TruthFloor.of(beside(sequence), its_truth, accuracy))
        tables = _sequence_tables(sequence, setups, floors, result, n_frames, its_truth.kind)
        release_memory()
        yield replace(tables, notes=(*tables.notes, *notes_of(its_truth), *more))


def _sequence_tables(
    sequence: Sequence,
    setups: Items[TrackerSetup],
    floors: Items[TruthFloor],
    result: TrackingResult,
    n_frames: int,
    truth: str,
) -> SequenceTables:
    """Tables of one sequence. What was tracked is taken out of `result`, so that it is not held twice.

    `floors`: of the first camera, and of the second where trackers see that.
    """
    parts, floor = [], floors[0]
    for setup in setups:  # whose arrays are released as soon as their tables are made
        recording, positions = result.recordings.pop(0), result.positions.pop(0)
        second = result.second_positions.pop(0) if result.second_positions else None
        own = floors[-1] if sees_second_camera(setup.settings) else floor
        with_covariance, added = own.add(recording, positions)
        view = own.sequence if isinstance(own.sequence, Beside) else None
        parts.append(setup_tables(sequence.id, setup, recording, with_covariance, added.to_dict(), second, view))
        del recording, positions, second, with_covariance
    return SequenceTables(
        observations=schema.joined([part[0] for part in parts], schema.OBSERVATIONS),
        tracks=schema.joined([part[1] for part in parts], schema.TRACKS),
        frames=schema.joined([part[2] for part in parts], schema.FRAME_COUNTS),
        floors=schema.joined([part[3] for part in parts], schema.FLOORS),
        truth=truth,
        key_frame=floor.key_frame,
        n_frames=n_frames,
        snapshot_frame=result.snapshot_frame,
        snapshot=result.snapshot,
        notes=(*result.notes, *floor.notes),
        states_accuracy=floor.is_stated,
        images=result.images,
        points=result.points,
    )


def require_length(sequence: Sequence, n_frames: int, speeds: Items[int]) -> None:
    """Refuse so many frames of a sequence, where they are too few for a speed or have no poses."""
    if n_frames < 2:
        raise DataError(
            sequence.source, f"a sequence of {n_frames} frame", "at least 2, so that features can be tracked"
        )
    for speed in speeds:
        if speed >= n_frames:
            found = f"speed {speed} for a sequence of {counted(n_frames, 'frame')}"
            raise DataError(sequence.source, found, f"a speed of at most {n_frames - 1}")
    require_some_poses(sequence.world_from_camera[:n_frames], sequence.source)


def _check_key_frame(sequence: Sequence, n_frames: int, setups: Items[TrackerSetup], key_frame: int | None) -> None:
    if key_frame is None:
        return
    if not 0 <= key_frame < n_frames:
        least = key_frame + 1 if key_frame >= 0 else n_frames - key_frame  # negative if played backward
        raise DataError(sequence.source, counted(n_frames, "frame"), f"at least {least}, to reach the key frame")
    for setup in setups:
        if key_frame % setup.speed:
            problem = f"speed {setup.speed}, which skips the key frame {key_frame}"
            raise SettingsError(f"{sequence.source}: found {problem}, expected a speed that divides {key_frame}")


def _is_known(positions: TruePositions) -> bool:
    """Whether any feature has a true position, or a distance from an epipolar line."""
    measured = (positions.uv, positions.epipolar)
    return any(values is not None and bool(np.isfinite(values).any()) for values in measured)


def _of_poses(sequence: Sequence) -> str:
    """How many poses there are, and how far apart: ``50 poses at most 0.8 m apart``."""
    poses = sequence.world_from_camera[has_pose(sequence.world_from_camera)]
    apart = float(np.linalg.norm(np.ptp(poses[:, :3, 3], axis=0))) if len(poses) else 0.0
    of_frames = "" if len(poses) == len(sequence) else f" for {counted(len(sequence), 'frame')}"
    return f"{counted(len(poses), 'pose')}{of_frames} at most {apart:.3g} m apart"


def _check_features(sequence: Sequence, result: TrackingResult, truth: Truth) -> None:
    if not any(len(recording.first_frame) for recording in result.recordings):
        raise NothingToMeasureError(
            sequence.source,
            "no tracker found a feature in any image",
            "images with texture, or tracks in the frames read",
        )
    if any(_is_known(positions) for positions in result.positions):
        return
    if any(positions.epipolar is not None for positions in result.positions):
        found = f"no feature with a fitted point or an epipolar line, with {_of_poses(sequence)}"
        raise NothingToMeasureError(
            sequence.source, found, "a camera that changes its position, and poses that fit the images"
        )
    if truth.kind == SWEPT:
        found = f"no depth from the images of other frames for any feature, with {_of_poses(sequence)}"
        expected = f"a camera that changes its position, and texture; or the kind of truth {TRIANGULATED!r}"
        raise NothingToMeasureError(sequence.source, found, expected)
    if truth.key_frame is None:
        raise NothingToMeasureError(
            sequence.source, "no depth for any feature", "depth for some, so that their true positions are known"
        )
    found = f"no feature of the key frame {truth.key_frame} on the scan"
    raise NothingToMeasureError(
        sequence.source, found, "features where it has points; it must be in metres, as the poses are"
    )
