"""Measure sequences: tables of observations and tracks, trimmed, and their moments."""

from collections.abc import Iterator, Mapping
from collections.abc import Sequence as Items
from dataclasses import dataclass, field

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.experiments.arguments import Trackers, checked_speeds, named_trackers, require_sequences
from tracknoise.geometry.corrections import UNCORRECTED, Corrections
from tracknoise.measurement.sequence_tables import SequenceTables, measure_sequences
from tracknoise.measurement.tracking import Progress, TrackerSetup
from tracknoise.sequences.corrected import corrected
from tracknoise.sequences.sequence import Sequence
from tracknoise.sequences.views import chosen_frames
from tracknoise.statistics.errors.moments import scene_moments
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.statistics.trimming import trim
from tracknoise.statistics.truth.pose_differences import pose_differences
from tracknoise.tables.defaults import POPULATION, TRIM_AMONG, TRIM_PERCENTILE
from tracknoise.tables.schema import POSE_DIFFERENCES, empty
from tracknoise.truth.accuracies import DEFAULT_RULE, AccuracyRule
from tracknoise.truth.scan_rule import SCAN_RULE, ScanRule


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
    images
        Images of the first frames, (height, width) uint8, as far as they were to be kept.
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
    images: Mapping[int, NDArray[np.uint8]] = field(default_factory=dict, repr=False)


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
    seed: int = 0,
    progress: Progress | None = None,
) -> Measurement:
    """Run trackers on a sequence of known geometry and compute the error of every observation.

    See `measure_together` for the parameters.
    """
    measured = measure_together(
        [sequence],
        trackers,
        speeds=speeds,
        truth=truth,
        scan_rule=scan_rule,
        corrections=corrections,
        accuracy=accuracy,
        population=population,
        trim_percentile=trim_percentile,
        trim_among=trim_among,
        frames=frames,
        max_frames=max_frames,
        second_truth=() if second_truth is None else [second_truth],
        seed=seed,
        progress=progress,
    )
    return next(measured)


def measure_together(
    sequences: Items[Sequence],
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
    second_truth: Items[Sequence] = (),
    seed: int = 0,
    progress: Progress | None = None,
    kept_bytes: int = 0,
) -> Iterator[Measurement]:
    """Run trackers on sequences that advance together, because they share what they read.

    Parameters
    ----------
    sequences
        From `tracknoise.open_sequence`, or other implementations of `tracknoise.sequences.sequence.Sequence`; all with
        the same number of frames.
    trackers
        Settings of one tracker or several, or names of trackers with default settings. A mapping names them;
        otherwise each is named by its kind.
    speeds
        At speed s a tracker sees frames 0, s, 2s, ...
    truth
        Kind of truth: ``birth``, ``raycast``, ``scan``, ``triangulated`` or one of another package; by default the
        best that a sequence offers.
    scan_rule
        How features are associated with a scan, for the kind ``scan``.
    corrections
        What to change in the stated camera, poses, depths and clock before true positions are computed: by default
        nothing. `Measurement.sequence` has them in its notes.
    accuracy
        What is known of the errors of the truth: ``AccuracyRule(TruthAccuracy(...))``. It counts before what the
        sequence states and before the figures that come with tracknoise.
    population
        Which observations trimming looks at: ``visible`` ones, or all that can be ``projected``.
    trim_percentile
        Tracks whose largest error is above this percentile are marked ``kept = false``; 100 keeps all.
    trim_among
        The tracks whose percentile it is: ``all`` that have an error, or those that were ``followed``, which have an
        error in a frame other than the one in which it is zero by construction.
    frames
        First, last and step of the frames that are measured, the last included; by default all. They are numbered
        from 0 again, and nothing is read of the others.
    max_frames
        Read no more frames than this, from the first of `frames`; by default all.
    second_truth
        The same sequences with a second truth, such as other poses, in the same order. Trackers run once. The
        observations get a second true position, and `POSE_DIFFERENCES` says how the poses differ. By default there is
        no second truth.
    seed
        Random seed, for trackers that need one.
    progress
        Called after each frame with the number of frames done, and of all frames.
    kept_bytes
        Size of the images of each sequence that `Measurement.images` keeps; by default none is kept.

    Yields
    ------
    Measurement
        One per sequence, in order.

    Raises
    ------
    TracknoiseError
        If two trackers share a name, the sequence is too short for a speed or cannot be read, it does not offer
        the kind of truth, or no tracker finds a feature.
    """
    require_sequences(sequences)
    setups = _setups(trackers, speeds)
    sequences, second = (_as_measured(given, corrections, frames) for given in (sequences, second_truth))
    measured = measure_sequences(
        sequences,
        setups,
        truth=truth,
        scan_rule=scan_rule,
        max_frames=max_frames,
        seed=seed,
        progress=progress,
        second=second,
        accuracy=accuracy,
        kept_bytes=kept_bytes,
    )
    others: Items[Sequence | None] = second or [None for _ in sequences]
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


def _as_measured(sequences: Items[Sequence], corrections: Corrections, frames: Items[int] | None) -> list[Sequence]:
    """The sequences with corrections, and those frames only that are measured."""
    return [chosen_frames(corrected(sequence, corrections), frames) for sequence in sequences]


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
        pose_differences=_pose_differences(sequence, second_truth, measured.n_frames),
        notes=measured.notes,
        images=measured.images,
    )


def _pose_differences(sequence: Sequence, second: Sequence | None, n_frames: int) -> pl.DataFrame:
    """How the poses of the frames that were read differ."""
    if second is None:
        return empty(POSE_DIFFERENCES)
    return pose_differences(sequence.id, *(one.world_from_camera[:n_frames] for one in (sequence, second)))
