"""Measure sequences: tables of what trackers reported, and of its errors."""

from collections.abc import Iterator, Mapping
from collections.abc import Sequence as Items
from dataclasses import dataclass, field, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.measurement.columns import setup_tables
from tracknoise.measurement.second_truth import open_second_truths, second_notes
from tracknoise.measurement.tracking import Progress, TrackerSetup, TrackingResult, run_trackers
from tracknoise.measurement.truth_floor import TruthFloor
from tracknoise.printable import counted
from tracknoise.sequences.poses import require_some_poses
from tracknoise.sequences.sequence import Sequence
from tracknoise.tables import schema
from tracknoise.truth.accuracies import DEFAULT_RULE, AccuracyRule
from tracknoise.truth.registry import make_truths
from tracknoise.truth.scan_rule import SCAN_RULE, ScanRule
from tracknoise.truth.truth import TruePositions


@dataclass(frozen=True, slots=True)
class SequenceTables:
    """What was measured in one sequence, before trimming.

    Attributes
    ----------
    observations, tracks, frames, floors
        Tables of `tracknoise.tables.schema`; `max_error_px` is null and `kept` true.
    truth
        The kind of truth used.
    key_frame
        The frame in which features were associated with a scan; None for other kinds of truth.
    n_frames
        Number of frames read.
    snapshot_frame, snapshot
        One frame, (height, width) uint8, for figures that show the tracks.
    notes
        What trackers state about their results, what is known of the errors of the truth, and the notes of the second
        truth, one sentence each.
    images
        Images of the first frames, (height, width) uint8, as far as they were to be kept.
    """

    observations: pl.DataFrame
    tracks: pl.DataFrame
    frames: pl.DataFrame
    floors: pl.DataFrame
    truth: str
    key_frame: int | None
    n_frames: int
    snapshot_frame: int
    snapshot: NDArray[np.uint8]
    notes: tuple[str, ...] = ()
    images: Mapping[int, NDArray[np.uint8]] = field(default_factory=dict, repr=False)


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
        Kind of truth, a name of `tracknoise.truth.registry.TRUTHS`; by default the best that a sequence offers.
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
        The same sequences with another truth, such as other poses, in the same order. Their images are not read. By
        default there is none.
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
    for sequence, known in zip(sequences, truths, strict=True):
        _check_length(sequence, n_frames, setups)
        _check_key_frame(sequence, n_frames, setups, known.key_frame)
    others = open_second_truths(sequences, truths, second, scan_rule=scan_rule)
    results = run_trackers(
        sequences,
        setups,
        truths,
        n_frames=n_frames,
        seed=seed,
        progress=progress,
        second_truths=others,
        kept_bytes=kept_bytes,
    )
    notes = [second_notes(*pair) for pair in zip(sequences, second, strict=True)] if second else [()] * len(sequences)
    for sequence, known, result, more in zip(sequences, truths, results, notes, strict=True):
        _check_features(sequence, result, known.key_frame)
        floor = TruthFloor.of(sequence, known, accuracy)
        tables = _sequence_tables(sequence, setups, floor, result, n_frames, known.kind)
        yield replace(tables, notes=(*tables.notes, *more))


def _sequence_tables(
    sequence: Sequence,
    setups: Items[TrackerSetup],
    floor: TruthFloor,
    result: TrackingResult,
    n_frames: int,
    truth: str,
) -> SequenceTables:
    seconds: Items[TruePositions | None] = result.second_positions or [None for _ in setups]
    parts = []
    for setup, recording, positions, second in zip(setups, result.recordings, result.positions, seconds, strict=True):
        known, floors = floor.add(recording, positions)
        parts.append(setup_tables(sequence.id, setup, recording, known, floors.to_dict(), second))
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
        images=result.images,
    )


def _check_length(sequence: Sequence, n_frames: int, setups: Items[TrackerSetup]) -> None:
    if n_frames < 2:
        raise DataError(
            sequence.source, f"a sequence of {n_frames} frame", "at least 2, so that features can be tracked"
        )
    for setup in setups:
        if setup.speed >= n_frames:
            raise DataError(
                sequence.source,
                f"speed {setup.speed} for a sequence of {counted(n_frames, 'frame')}",
                f"a speed of at most {n_frames - 1}",
            )
    require_some_poses(sequence.world_from_camera[:n_frames], sequence.source)


def _check_key_frame(sequence: Sequence, n_frames: int, setups: Items[TrackerSetup], key_frame: int | None) -> None:
    if key_frame is None:
        return
    if not 0 <= key_frame < n_frames:
        least = key_frame + 1 if key_frame >= 0 else n_frames - key_frame  # negative if played backward
        raise DataError(sequence.source, counted(n_frames, "frame"), f"at least {least}, to reach the key frame")
    for setup in setups:
        if key_frame % setup.speed:
            found = f"speed {setup.speed}, which skips the key frame {key_frame}"
            raise SettingsError(f"{sequence.source}: found {found}, expected a speed that divides {key_frame}")


def _is_known(positions: TruePositions) -> bool:
    """Whether any feature has a true position, or a distance from an epipolar line."""
    found = (positions.uv, positions.epipolar)
    return any(values is not None and bool(np.isfinite(values).any()) for values in found)


def _check_features(sequence: Sequence, result: TrackingResult, key_frame: int | None) -> None:
    if not any(len(recording.first_frame) for recording in result.recordings):
        raise DataError(
            sequence.source,
            "no tracker found a feature in any image",
            "images with texture, or tracks in the frames read",
        )
    if any(_is_known(positions) for positions in result.positions):
        return
    if any(positions.epipolar is not None for positions in result.positions):
        found = "no feature with a fitted point or an epipolar line"
        raise DataError(sequence.source, found, "a camera that changes its position, and poses that fit the images")
    if key_frame is None:
        raise DataError(
            sequence.source, "no depth for any feature", "depth for some, so that their true positions are known"
        )
    found = f"no feature of the key frame {key_frame} on the scan"
    raise DataError(sequence.source, found, "features where it has points; it must be in metres, as the poses are")
