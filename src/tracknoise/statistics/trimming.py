"""Trimming: tracks with the largest errors are marked as dropped, scene by scene."""

from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.statistics.prepared import PreparedSequence, check_population, prepare_sequence
from tracknoise.tables.defaults import POPULATION, TRIM_AMONG
from tracknoise.tables.enumerations import TrimAmong
from tracknoise.tables.findings_schema import TRIMS
from tracknoise.tables.schema import AMONG, check


@dataclass(frozen=True, slots=True)
class Trimmed:
    """A sequence in which every track is marked as kept or dropped; no row is removed."""

    # its observations and tracks in the order given; `kept` and `max_error_px` are filled in
    sequence: PreparedSequence
    trims: pl.DataFrame  # schema `TRIMS`, with one row for each scene and condition that has tracks, sorted by these

    @property
    def observations(self) -> pl.DataFrame:
        """The observations, with `kept` as their track's."""
        return self.sequence.observations

    @property
    def tracks(self) -> pl.DataFrame:
        """The tracks, with `max_error_px` and `kept`."""
        return self.sequence.tracks


@dataclass(frozen=True, slots=True)
class _Largest:
    """Largest error of every track."""

    error_px: NDArray[np.float64]  # (tracks,): NaN where a track has no error
    # (tracks,): whether a track has an error in a frame other than the one that fixes its true position
    followed: NDArray[np.bool_]

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Whether a track has an error, (tracks,)."""
        return ~np.isnan(self.error_px)


def trim(
    observations: pl.DataFrame,
    tracks: pl.DataFrame,
    *,
    percentile: float | None,
    population: str = POPULATION,
    among: str = TRIM_AMONG,
    key_frame: int | None = None,
) -> Trimmed:
    """Prepare a sequence, and mark as dropped the tracks whose largest error exceeds a percentile of their condition.

    The largest error of a track is the maximum over its observations of `population` of the L2 norm of (du, dv), px. It
    is null where there is no such observation, and such a track is kept. The threshold of a scene and condition is
    NumPy's linearly interpolated percentile of its largest errors that are not null.

    The true position of a track is fixed in one frame, its anchor, where the error is 0 or nearly so. A track that has
    no other error lowers the threshold. As in the paper such tracks count, unless `among` excludes them.

    `kept` and `max_error_px` of the tables are not read; `percentile`: from 0 to 100; None keeps every track;
    `population`: which observations count: `visible` or `projected`; `among`: of which tracks the percentile is taken:
    of `all` that have a largest error, or of those that were `followed`, which have an error in another frame than
    their anchor.

    Raises
    ------
    SettingsError, UnknownNameError
        If the percentile is not from 0 to 100, or there is no such population or choice of tracks.
    SchemaError
        If a table has other columns, or an observation does not belong to exactly one track.
    """
    sequence = prepare_sequence(observations, tracks, key_frame=key_frame)
    if percentile is not None and not 0 <= percentile <= 100:
        raise SettingsError(f"trimming percentile is {percentile}, expected 0 to 100")
    if among not in AMONG.categories:
        raise UnknownNameError("choice of tracks", among, AMONG.categories)
    largest = _largest(sequence, check_population(population))
    counted = largest.followed if among == TrimAmong.followed else largest.measured
    threshold_px = _thresholds(sequence, largest.error_px, counted, percentile)
    kept = ~(largest.error_px > threshold_px[sequence.track_condition])
    return Trimmed(_marked(sequence, largest, kept), _account(sequence, largest, kept, threshold_px, percentile, among))


def _largest(sequence: PreparedSequence, population: str) -> _Largest:
    seen = sequence.seen
    chosen = seen.members(population)
    du, dv = seen.error_px[chosen].T
    row = sequence.track_row[chosen]
    error_px = np.full(sequence.tracks.height, np.nan)
    np.fmax.at(error_px, row, np.sqrt(du**2 + dv**2))
    away = seen.age[chosen] > 0 if sequence.key_frame is None else seen.frame[chosen] != sequence.key_frame
    followed = np.zeros(sequence.tracks.height, dtype=bool)
    followed[row[away]] = True
    return _Largest(error_px, followed)


def _thresholds(
    sequence: PreparedSequence, error_px: NDArray[np.float64], counted: NDArray[np.bool_], percentile: float | None
) -> NDArray[np.float64]:
    """The threshold of each condition, px; NaN where nothing is dropped or no track was measured."""
    thresholds = np.full(sequence.seen.conditions.height, np.nan)
    for place in range(len(thresholds)):
        errors = error_px[counted & (sequence.track_condition == place)]
        if percentile is not None and errors.size:
            thresholds[place] = np.percentile(errors, percentile)
    return thresholds


def _marked(sequence: PreparedSequence, largest: _Largest, kept: NDArray[np.bool_]) -> PreparedSequence:
    """The sequence with `kept` and `max_error_px` filled in."""
    of_observations = kept[sequence.track_row]
    return replace(
        sequence,
        observations=sequence.observations.with_columns(kept=pl.Series(of_observations)),
        tracks=sequence.tracks.with_columns(
            max_error_px=pl.Series(largest.error_px, nan_to_null=True), kept=pl.Series(kept)
        ),
        seen=replace(sequence.seen, kept=of_observations),
    )


DROPPED_SHARE = pl.when(pl.col("n_measured") > 0).then(pl.col("n_dropped") / pl.col("n_measured"))
"""Of the measured tracks; null where there are none."""


def _account(
    sequence: PreparedSequence,
    largest: _Largest,
    kept: NDArray[np.bool_],
    threshold_px: NDArray[np.float64],
    percentile: float | None,
    among: str,
) -> pl.DataFrame:
    """What was dropped; the share is of the measured tracks, null where there are none."""
    chosen = {
        "n_tracks": np.ones_like(kept),
        "n_measured": largest.measured,
        "n_anchor_only": largest.measured & ~largest.followed,
        "n_dropped": ~kept,
        "n_followed_dropped": ~kept & largest.followed,
    }
    n = {
        name: np.bincount(sequence.track_condition[rows], minlength=len(threshold_px)) for name, rows in chosen.items()
    }
    table = sequence.seen.conditions.with_columns(
        pl.lit(percentile, dtype=pl.Float64).alias("percentile"),
        pl.lit(among, dtype=AMONG).alias("among"),
        pl.Series("threshold_px", threshold_px, nan_to_null=True),
        *(pl.Series(name, values, dtype=pl.Int64) for name, values in n.items()),
    )
    return check(table.filter(pl.col("n_tracks") > 0).with_columns(dropped_share=DROPPED_SHARE), TRIMS, "trims")
