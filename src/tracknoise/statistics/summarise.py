"""All statistics of a sequence, from its observations and tracks in one pass."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from types import MappingProxyType

import polars as pl

from tracknoise.statistics.aspects import aspect_blocks, aspects
from tracknoise.statistics.changes import increments
from tracknoise.statistics.histograms import error_histogram
from tracknoise.statistics.lifetimes import count_ends
from tracknoise.statistics.moments import block_moments, scene_moments
from tracknoise.statistics.own_covariances import covariance_sums
from tracknoise.statistics.places import image_speeds, surroundings
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.statistics.ratios import ratio_sums
from tracknoise.statistics.samples import samples
from tracknoise.statistics.scales import scale_blocks, scales
from tracknoise.statistics.track_counts import counts
from tracknoise.statistics.trimming import trim
from tracknoise.statistics.truth_errors import between_trackers, truth_differences
from tracknoise.statistics.windows import fitted_noise
from tracknoise.tables.defaults import POPULATION, TRIM_AMONG
from tracknoise.tables.enumerations import Population
from tracknoise.tables.schema import FRAME_COUNTS, check

STATISTICS: Mapping[str, Callable[[PreparedSequence], pl.DataFrame]] = MappingProxyType(
    {
        "moments": lambda sequence: scene_moments(sequence.seen),
        "counts": counts,
        "ends": lambda sequence: count_ends(sequence.tracks),
        "errors": lambda sequence: error_histogram(sequence.tracks),
        "scales": scales,
        "blocks": block_moments,
        "scale_blocks": scale_blocks,
        "aspects": aspects,
        "aspect_blocks": aspect_blocks,
        "increments": increments,
        "samples": samples,
        "fitted_noise": fitted_noise,
        "truth_differences": truth_differences,
        "surroundings": surroundings,
        "image_speeds": image_speeds,
        "ratio_sums": ratio_sums,
        "covariance_sums": covariance_sums,
        "between_trackers": between_trackers,
    }
)
"""Tables of a sequence that are computed from its trimmed observations and tracks, by name."""


def statistics_of(
    sequence: PreparedSequence,
    names: Collection[str] = tuple(STATISTICS),
    *,
    population: str = POPULATION,
    slowest: int | None = None,
) -> dict[str, pl.DataFrame]:
    """Tables of statistics by name.

    Parameters
    ----------
    sequence
        Trimmed.
    names
        Names of `STATISTICS`. Default: all.
    population
        Blocks hold this one and the visible observations.
    slowest
        Speed at which the blocks of aspects are measured. Default: all speeds.
    """
    populations = tuple(dict.fromkeys([Population.visible, population]))
    asked = replace(sequence, populations=populations, slowest=slowest)
    return {name: STATISTICS[name](asked) for name in names}


def summarise_sequence(
    observations: pl.DataFrame,
    tracks: pl.DataFrame,
    frames: pl.DataFrame,
    *,
    key_frame: int | None = None,
    population: str = POPULATION,
    trim_percentile: float | None = None,
    trim_among: str = TRIM_AMONG,
    slowest: int | None = None,
    statistics: Collection[str] = tuple(STATISTICS),
) -> dict[str, pl.DataFrame]:
    """Trim a sequence and compute its statistics.

    Parameters
    ----------
    observations, tracks, frames
        Tables `OBSERVATIONS`, `TRACKS` and `FRAME_COUNTS` of one sequence under any number of conditions, as measured.
        Their `kept` and `max_error_px` are not read.
    key_frame
        Frame in which a scan makes errors zero. Moments are then by frame. By default they are by age.
    population
        Observations that trimming uses: `visible` or `projected`. Blocks hold these and the visible ones.
    trim_percentile, trim_among
        See `tracknoise.statistics.trimming.trim`; by default every track is kept.
    slowest
        Speed at which the blocks of aspects are computed. Default: all speeds.
    statistics
        Names in `STATISTICS` to compute.

    Returns
    -------
    dict of polars.DataFrame
        Tables by name: `observations` and `tracks` with `kept` and `max_error_px` filled in, `frames`, `trims`, and
        the statistics.

    Raises
    ------
    SettingsError
        If `trim_percentile` is not between 0 and 100.
    UnknownNameError
        If there is no such population, or no such choice of tracks.
    SchemaError
        If a table has other columns, an error is missing where the true position is known, or an observation does not
        belong to exactly one track.
    """
    trimmed = trim(
        observations, tracks, percentile=trim_percentile, population=population, among=trim_among, key_frame=key_frame
    )
    return {
        "observations": trimmed.observations,
        "tracks": trimmed.tracks,
        "frames": check(frames, FRAME_COUNTS, "frames"),
        "trims": trimmed.trims,
        **statistics_of(trimmed.sequence, statistics, population=population, slowest=slowest),
    }
