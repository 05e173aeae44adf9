"""Measure sequences: tables of observations and tracks, trimmed, and their moments."""

from collections.abc import Iterator, Mapping
from collections.abc import Sequence as Items
from dataclasses import dataclass, field

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import SettingsError
from tracknoise.experiments.settings import Population, TrimAmong
from tracknoise.measurement.scene import SceneTables, measure_scenes
from tracknoise.measurement.tracking import Progress, TrackerSetup
from tracknoise.sequences.sequence import Sequence, TruthKind
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.prepared import PreparedSequence, prepare_sequence
from tracknoise.statistics.trimming import trim_sequence
from tracknoise.trackers.tracker import TrackerSettings
from tracknoise.truth.scan import ScanRule
from tracknoise.truth.truth import SCAN_RULE


@dataclass(frozen=True, slots=True)
class Measurement:
    """Everything measured in one sequence.

    Attributes
    ----------
    observations, tracks, frames, moments, trims
        Tables of `tracknoise.tables.schema`. Errors `du_px`, `dv_px` are observed minus true, px; ages count
        frames of the nominal sequence.
    truth
        The kind of truth used.
    key_frame
        Where that is a scan, the frame in which features were associated with it.
    n_frames
        Count of frames read.
    snapshot_frame, snapshot
        One frame, (height, width) uint8, to draw the tracks on.
    prepared
        Observations and tracks, checked and grouped: what further statistics are computed from.
    """

    observations: pl.DataFrame
    tracks: pl.DataFrame
    frames: pl.DataFrame
    moments: pl.DataFrame
    trims: pl.DataFrame
    truth: TruthKind
    key_frame: int | None
    n_frames: int
    snapshot_frame: int
    snapshot: NDArray[np.uint8]
    prepared: PreparedSequence = field(repr=False)


def measure(
    sequence: Sequence,
    trackers: TrackerSettings | Items[TrackerSettings] | Mapping[str, TrackerSettings],
    *,
    speeds: Items[int] = (1,),
    truth: TruthKind | None = None,
    scan_rule: ScanRule = SCAN_RULE,
    population: Population = "visible",
    trim_percentile: float = 90.0,
    trim_among: TrimAmong = "all",
    max_frames: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Measurement:
    """Run trackers over a sequence of known geometry and work out the error of every observation.

    See `measure_together` for the parameters.
    """
    measured = measure_together(
        [sequence],
        trackers,
        speeds=speeds,
        truth=truth,
        scan_rule=scan_rule,
        population=population,
        trim_percentile=trim_percentile,
        trim_among=trim_among,
        max_frames=max_frames,
        seed=seed,
        progress=progress,
    )
    return next(measured)


def measure_together(
    sequences: Items[Sequence],
    trackers: TrackerSettings | Items[TrackerSettings] | Mapping[str, TrackerSettings],
    *,
    speeds: Items[int] = (1,),
    truth: TruthKind | None = None,
    scan_rule: ScanRule = SCAN_RULE,
    population: Population = "visible",
    trim_percentile: float = 90.0,
    trim_among: TrimAmong = "all",
    max_frames: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Iterator[Measurement]:
    """Run trackers over sequences that go in step, because they share what they read.

    Parameters
    ----------
    sequences
        From `tracknoise.open_sequence`, or anything of the same protocol; all of as many frames.
    trackers
        Settings of one tracker or several; a mapping gives them names, otherwise they go by their kind.
    speeds
        At speed s a tracker sees frames 0, s, 2s, ...
    truth
        How features are fixed in the world; by default the best that a sequence offers.
    scan_rule
        How features are associated with a scan, where that fixes them.
    population
        Which observations trimming looks at: ``visible`` ones, or all that can be ``projected``.
    trim_percentile
        Tracks whose largest error is above this percentile are marked ``kept = false``; 100 keeps all.
    trim_among
        Of which tracks it is the percentile: of ``all`` that have an error, or of those that were ``followed``, which
        have one away from the frame that fixes their true position.
    max_frames
        Read no more frames than this; by default all.
    seed
        For trackers that need randomness.
    progress
        Called after each frame with the count of frames done and of all.

    Yields
    ------
    Measurement
        One a sequence, in order.

    Raises
    ------
    TracknoiseError
        If two trackers share a name, the sequence is too short for a speed or cannot be read, it does not offer
        the truth asked for, or no tracker finds a feature.
    """
    conditions = [
        TrackerSetup(name, settings, speed) for name, settings in _named(trackers).items() for speed in speeds
    ]
    scenes = measure_scenes(
        sequences, conditions, truth=truth, scan_rule=scan_rule, max_frames=max_frames, seed=seed, progress=progress
    )
    for scene in scenes:
        yield complete(scene, trim_percentile=trim_percentile, trim_among=trim_among, population=population)


def complete(
    scene: SceneTables,
    *,
    trim_percentile: float = 90.0,
    trim_among: TrimAmong = "all",
    population: Population = "visible",
) -> Measurement:
    """Trim what was measured in a sequence, and work out its moments; see `measure_together` for the parameters."""
    prepared = prepare_sequence(scene.observations, scene.tracks, key_frame=scene.key_frame)
    trimmed = trim_sequence(prepared, percentile=trim_percentile, population=population, among=trim_among)
    return Measurement(
        observations=trimmed.observations,
        tracks=trimmed.tracks,
        frames=scene.frames,
        moments=scene_moments(trimmed.sequence.seen),
        trims=trimmed.trims,
        truth=scene.truth,
        key_frame=scene.key_frame,
        n_frames=scene.n_frames,
        snapshot_frame=scene.snapshot_frame,
        snapshot=scene.snapshot,
        prepared=trimmed.sequence,
    )


def _named(
    trackers: TrackerSettings | Items[TrackerSettings] | Mapping[str, TrackerSettings],
) -> Mapping[str, TrackerSettings]:
    if isinstance(trackers, Mapping):
        return trackers
    listed = list(trackers) if isinstance(trackers, Items) else [trackers]
    named = {settings.kind: settings for settings in listed}
    if len(named) < len(listed):
        raise SettingsError("two trackers of one kind, expected a mapping that gives them names")
    return named
