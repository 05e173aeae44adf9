"""Sequences in, tables out."""

from collections.abc import Iterator
from collections.abc import Sequence as Items
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.measurement.errors import TruePaths, true_paths
from tracknoise.measurement.recording import Recording
from tracknoise.measurement.tracking import Progress, TrackerSetup, TrackingResult, run_trackers
from tracknoise.sequences.sequence import Sequence, TruthKind
from tracknoise.tables import schema
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import TrackEnd, TruthStatus
from tracknoise.truth.scan import ScanRule
from tracknoise.truth.truth import SCAN_RULE, Truth, make_truths


@dataclass(frozen=True, slots=True)
class SceneTables:
    """What was measured in one sequence, before trimming.

    Attributes
    ----------
    observations, tracks, frames
        Tables of `tracknoise.tables.schema`; `max_error_px` is null and `kept` true.
    truth
        The kind of truth used.
    key_frame
        Where that is a scan, the frame in which features were associated with it.
    n_frames
        Count of frames read.
    snapshot_frame, snapshot
        One frame, (height, width) uint8, to draw the tracks on.
    """

    observations: pl.DataFrame
    tracks: pl.DataFrame
    frames: pl.DataFrame
    truth: TruthKind
    key_frame: int | None
    n_frames: int
    snapshot_frame: int
    snapshot: NDArray[np.uint8]


def measure_scene(
    sequence: Sequence,
    conditions: Items[TrackerSetup],
    *,
    truth: TruthKind | None = None,
    scan_rule: ScanRule = SCAN_RULE,
    max_frames: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> SceneTables:
    """Run every condition over a sequence and work out the error of each observation: see `measure_scenes`."""
    scenes = measure_scenes(
        [sequence], conditions, truth=truth, scan_rule=scan_rule, max_frames=max_frames, seed=seed, progress=progress
    )
    return next(scenes)


def measure_scenes(
    sequences: Items[Sequence],
    conditions: Items[TrackerSetup],
    *,
    truth: TruthKind | None = None,
    scan_rule: ScanRule = SCAN_RULE,
    max_frames: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Iterator[SceneTables]:
    """Run every condition over sequences that go in step, and work out the error of each observation.

    Parameters
    ----------
    sequences
        Images of known geometry, all of as many frames.
    conditions
        Trackers and speeds.
    truth
        How features are anchored; by default the best that a sequence offers.
    scan_rule
        How features are associated with a scan, where that anchors them.
    max_frames
        Read no more frames than this; by default all.
    seed
        For trackers that need randomness.
    progress
        Told after each frame of all sequences.

    Yields
    ------
    SceneTables
        One a sequence, in order, made when asked for: the tables of all together may be large.

    Raises
    ------
    DataError
        If a sequence is too short for a speed, an image, depth map or pose cannot be used, or no condition
        finds a single feature, or none whose depth is known.
    SettingsError
        If a speed passes over the key frame of a scan.
    """
    n_frames = min(len(sequences[0]), max_frames or len(sequences[0]))
    truths = make_truths(sequences, truth, scan_rule=scan_rule)
    for sequence, known in zip(sequences, truths, strict=True):
        _check_length(sequence, n_frames, conditions)
        _check_key_frame(sequence, n_frames, conditions, known.key_frame)
    swept = run_trackers(sequences, conditions, truths, n_frames=n_frames, seed=seed, progress=progress)
    for sequence, known, one in zip(sequences, truths, swept, strict=True):
        _check_features(sequence, one.recordings, known.key_frame)
        yield _scene_tables(sequence, conditions, known, one, n_frames)


def _scene_tables(
    sequence: Sequence, conditions: Items[TrackerSetup], known: Truth, swept: TrackingResult, n_frames: int
) -> SceneTables:
    parts = [
        _tables(sequence, condition, recording)
        for condition, recording in zip(conditions, swept.recordings, strict=True)
    ]
    return SceneTables(
        observations=pl.concat([part[0] for part in parts], rechunk=True),
        tracks=pl.concat([part[1] for part in parts], rechunk=True),
        frames=pl.concat([part[2] for part in parts], rechunk=True),
        truth=known.kind,
        key_frame=known.key_frame,
        n_frames=n_frames,
        snapshot_frame=swept.snapshot_frame,
        snapshot=swept.snapshot,
    )


def _check_length(sequence: Sequence, n_frames: int, conditions: Items[TrackerSetup]) -> None:
    if n_frames < 2:
        raise DataError(sequence.source, f"a sequence of {n_frames} frame", "at least 2, for a feature to be tracked")
    for condition in conditions:
        if condition.speed >= n_frames:
            raise DataError(
                sequence.source,
                f"speed {condition.speed} for a sequence of {n_frames} frames",
                f"a speed of at most {n_frames - 1}",
            )


def _check_key_frame(sequence: Sequence, n_frames: int, conditions: Items[TrackerSetup], key_frame: int | None) -> None:
    if key_frame is None:
        return
    if not 0 <= key_frame < n_frames:
        least = key_frame + 1 if key_frame >= 0 else n_frames - key_frame  # backward, it would lie before the first
        raise DataError(sequence.source, f"{n_frames} frames", f"at least {least}, to reach the key frame")
    for condition in conditions:
        if key_frame % condition.speed:
            found = f"speed {condition.speed}, which passes over the key frame {key_frame}"
            raise SettingsError(f"{sequence.source}: found {found}, expected a speed that divides its number")


def _check_features(sequence: Sequence, recordings: Items[Recording], key_frame: int | None) -> None:
    if not any(len(recording.first_frame) for recording in recordings):
        raise DataError(
            sequence.source,
            "no tracker found a feature in any image",
            "images with texture, or tracks in the frames read",
        )
    if any(np.isfinite(recording.points_world).any() for recording in recordings):
        return
    if key_frame is None:
        raise DataError(sequence.source, "no depth for any feature", "depth for some, to know where they are")
    found = f"no feature of the key frame {key_frame} on the scan"
    raise DataError(sequence.source, found, "features where it has points; it must be in metres, as the poses are")


def _tables(
    sequence: Sequence, condition: TrackerSetup, recording: Recording
) -> tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]:
    paths = true_paths(recording, sequence)
    return (
        _table(_observations(recording, paths), schema.OBSERVATIONS, sequence.id, condition),
        _table(_tracks(recording, paths), schema.TRACKS, sequence.id, condition),
        _table(_frames(recording), schema.FRAME_COUNTS, sequence.id, condition),
    )


def _observations(recording: Recording, paths: TruePaths) -> dict[str, pl.Series]:
    error = recording.uv - paths.uv
    return {
        "track": pl.Series(recording.track),
        "frame": pl.Series(recording.frame),
        "age": pl.Series(recording.frame - recording.first_frame[recording.track]),
        "u_px": pl.Series(recording.uv[:, 0]),
        "v_px": pl.Series(recording.uv[:, 1]),
        "u_true_px": _nullable(paths.uv[:, 0]),
        "v_true_px": _nullable(paths.uv[:, 1]),
        "truth": _names(recording.visibility, TruthStatus),
        "du_px": _nullable(error[:, 0]),
        "dv_px": _nullable(error[:, 1]),
        "kept": pl.repeat(True, len(error), eager=True),
    }


def _tracks(recording: Recording, paths: TruePaths) -> dict[str, pl.Series]:
    count = len(recording.first_frame)
    return {
        "track": pl.Series(np.arange(count, dtype=np.uint32)),
        "first_frame": pl.Series(recording.first_frame),
        "lifetime": pl.Series(recording.found),
        "end": _names(recording.end, TrackEnd),
        "response": _nullable(recording.response),
        "depth_m": _nullable(paths.depth_m),
        "gradient_rad": _nullable(recording.gradient_rad),
        "max_error_px": pl.repeat(None, count, dtype=pl.Float64, eager=True),
        "kept": pl.repeat(True, count, eager=True),
    }


def _frames(recording: Recording) -> dict[str, pl.Series]:
    names = ("frame", "offered", "matched", "outliers", "new", "alive")
    return {name: pl.Series(recording.frames[:, column]) for column, name in enumerate(names)}


def _table(
    columns: dict[str, pl.Series], layout: schema.Schema, sequence: SequenceId, condition: TrackerSetup
) -> pl.DataFrame:
    origin = {
        "dataset": sequence.dataset,
        "scene": sequence.scene,
        "lighting": sequence.lighting,
        "rotation": sequence.rotation,
        "direction": str(sequence.direction),
        "tracker": condition.tracker,
        "speed": condition.speed,
    }
    literals = [
        pl.lit(value, dtype=pl.Int16 if name == "rotation" else None).alias(name) for name, value in origin.items()
    ]
    return schema.check(pl.DataFrame(columns).with_columns(literals).select(list(layout)), layout, condition.tracker)


def _nullable(values: NDArray[np.floating]) -> pl.Series:
    return pl.Series(values, nan_to_null=True)


def _names(values: NDArray[np.int8], kind: type[TruthStatus] | type[TrackEnd]) -> pl.Series:
    """Enumeration values as the enumeration's column type."""
    names = [member.name for member in kind]
    return pl.Series(names, dtype=pl.Enum(names)).gather(values)
