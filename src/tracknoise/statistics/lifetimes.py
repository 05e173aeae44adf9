"""Lifetimes of tracks. Those that were alive at the end of the sequence are censored.

A lifetime is the number of consecutive frames, of those that its tracker saw, in which a feature was found; the first
counts. Every track counts, whether or not its true position is known and whether or not trimming keeps it.
"""

from collections.abc import Iterable

import numpy as np
import polars as pl

from tracknoise.inference.survival import area_under, kaplan_meier
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import (
    group_runs,
    in_chunks,
    number_combinations,
    tables_of,
    total_if_known,
)
from tracknoise.statistics.prepared import blocks_of
from tracknoise.tables.findings_schema import LIFETIMES
from tracknoise.tables.schema import BY_CAUSE, ENDS, FAILURES, ORIGIN, TRACKS, Schema, TrackEnd, check, empty

MEAN_LIFETIMES: Schema = {
    **{column: LIFETIMES[column] for column in POOLED},
    "n_tracks": pl.Int64,
    "n_censored": pl.Int64,
    "mean_lifetime": pl.Float64,
    "frames_per_end": pl.Float64,
    "restricted_to": pl.UInt32,
    "restricted_mean_lifetime": pl.Float64,
    "restricted_mean_until_failure": pl.Float64,
}
MEDIAN_SURVIVALS: Schema = {
    **{column: LIFETIMES[column] for column in POOLED},
    "median_lifetime": pl.UInt32,
    "median_until_failure": pl.UInt32,
}
SURVIVING: Schema = {
    **{column: LIFETIMES[column] for column in POOLED},
    "lifetime": pl.UInt32,
    "age": pl.UInt32,
    "n": pl.Int64,
}
RESTRICTED = {
    "restricted_mean_lifetime": "survival",
    "restricted_mean_until_failure": "survival_until_failure",
}
"""Restricted means by the survival curve under which they are areas."""
_SHARED = ["dataset", "speed"]
_HAS_CAUSES = pl.col(next(iter(BY_CAUSE))).is_not_null()
COUNTS = ("n_ended", "n_censored", *BY_CAUSE)
"""Columns of counts of `ENDS`."""
_CURVES = ["at_risk", "survival", "survival_until_failure"]
_POOLED_END = [*POOLED, "lifetime", *COUNTS]


def count_ends(tracks: pl.DataFrame) -> pl.DataFrame:
    """Count the tracks that ended, or were censored, at each lifetime; statistics of lifetimes need no more.

    Parameters
    ----------
    tracks
        All tracks of any number of sequences and conditions.

    Returns
    -------
    polars.DataFrame
        Schema `ENDS`, sorted by all columns but the counts; blocks are those of `tracknoise.statistics.prepared`.
        Counts by cause are null in a sequence and condition with tracks whose end is null.

    Raises
    ------
    SchemaError
        If the table has other columns.
    """
    (groups,) = group_runs([check(tracks, TRACKS, "tracks")], list(ORIGIN))
    block = blocks_of(tracks, pl.Series(groups.index)).to_numpy()
    (condition, *keys), index = number_combinations([groups.index, block, tracks["lifetime"].to_numpy()])
    end = tracks["end"].to_physical().to_numpy()
    by_end = {kind: np.bincount(index[end == kind], minlength=len(condition)) for kind in TrackEnd}
    censored = by_end.pop(TrackEnd.sequence_end)
    columns = dict(zip(("block", "lifetime"), keys, strict=True))
    columns |= {"n_ended": np.bincount(index, minlength=len(condition)) - censored, "n_censored": censored}
    columns |= {f"n_{kind.name}": count for kind, count in by_end.items()}
    counts = pl.DataFrame(columns).select(pl.col(name).cast(ENDS[name]) for name in columns)
    unknown = np.bincount(groups.index, tracks["end"].is_null().to_numpy(), groups.count) > 0
    where_known = pl.when(pl.Series(~unknown[condition]))
    counts = counts.with_columns(where_known.then(pl.col(name)).alias(name) for name in BY_CAUSE)
    return check(groups.keys[condition].hstack(counts), ENDS, "ends")


def lifetimes(tracks: pl.DataFrame | Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Histogram of lifetimes and Kaplan-Meier survival of every condition, pooled over scenes.

    Parameters
    ----------
    tracks
        One tracks table, or any number of them, read one at a time.

    Returns
    -------
    polars.DataFrame
        What `lifetimes_of_ends` makes of their `count_ends`.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    return lifetimes_of_ends(count_ends(table) for table in tables_of(tracks, "tracks"))


def lifetimes_of_ends(ends: pl.DataFrame | Iterable[pl.DataFrame]) -> pl.DataFrame:
    """Histogram of lifetimes and Kaplan-Meier survival of every condition, pooled over scenes, from counts alone.

    `survival` is the estimated probability that a lifetime exceeds `lifetime`: the product, over all lifetimes up to
    it, of 1 - n_ended / at_risk. A track that was alive in the last frame of its sequence is censored. It was not
    searched for in another frame and could not end at the lifetime it reached, so that it is not at risk there.
    `at_risk` is therefore the tracks that lived longer plus those that ended at this lifetime. This is the Kaplan-Meier
    estimate of any library, if an end at L is coded as an event at L and a censoring at L as one at L - 1.

    `survival_until_failure` is the same for the lifetime until a track is lost or rejected as an outlier. A track that
    was displaced or masked is then censored, but at risk at its lifetime, because it was searched for once more. This
    assumes that such tracks would have failed no sooner or later than the others.

    Parameters
    ----------
    ends
        One table that `count_ends` returned, or any number of them, read one at a time.

    Returns
    -------
    polars.DataFrame
        Schema `LIFETIMES`, sorted by condition and lifetime: one row for each lifetime at which a track ended or was
        censored. `survival` is null where no track was at risk, which is possible at the longest lifetime only. Counts
        by cause and `survival_until_failure` are null in conditions whose tracker does not report causes.
        `n_scenes` counts the scenes of the condition, the same in each of its rows.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    pooled, scenes = _pooled(ends)
    table = pooled.join(scenes, on=POOLED).sort(*POOLED, "lifetime")
    table = table.with_columns(total_if_known(name, pl.col(name)).over(POOLED) for name in BY_CAUSE)
    conditions = table.partition_by(POOLED, maintain_order=True)
    curves = pl.concat([empty(LIFETIMES).select(_CURVES), *(_curves(condition) for condition in conditions)])
    return check(table.hstack(curves).select(*LIFETIMES), LIFETIMES, "lifetimes")


def mean_lifetime(lifetimes: pl.DataFrame) -> pl.DataFrame:
    """Mean lifetime of every condition, in frames that its tracker saw.

    Returns schema `MEAN_LIFETIMES`, sorted by condition. `mean_lifetime` is the paper's: frames found over tracks. A
    censored track counts as if it had ended, so that the value is too low where many are censored. It is the mean
    lifetime only if all tracks end with the same probability at any age.
    """
    ordered = check(lifetimes, LIFETIMES, "lifetimes").sort(*POOLED, "lifetime")
    ordered = ordered.join(horizons(ordered), on=_SHARED, maintain_order="left")
    length = pl.col("lifetime").cast(pl.Int64)
    n_tracks = pl.col("n_ended") + pl.col("n_censored")
    counted = ordered.with_columns(found=n_tracks, frames=n_tracks * length)
    n_ended = pl.col("n_ended").sum()
    totals = counted.group_by(POOLED).agg(
        n_tracks=pl.col("found").sum(),
        n_censored=pl.col("n_censored").sum(),
        mean_lifetime=pl.col("frames").sum() / pl.col("found").sum(),
        frames_per_end=pl.when(n_ended > 0).then((pl.col("frames").sum() - pl.col("n_censored").sum()) / n_ended),
        restricted_to=pl.col("restricted_to").first(),
        has_causes=_HAS_CAUSES.all(),
    )
    conditions = ordered.partition_by(POOLED, maintain_order=True)
    restricted = {
        name: pl.Series([_area(condition, curve) for condition in conditions], dtype=pl.Float64)
        for name, curve in RESTRICTED.items()
    }
    table = totals.sort(POOLED).with_columns(**restricted)
    until_failure = pl.when("has_causes").then("restricted_mean_until_failure").alias("restricted_mean_until_failure")
    table = table.with_columns(until_failure)
    return check(table.select(*MEAN_LIFETIMES), MEAN_LIFETIMES, "mean lifetimes")


def horizons(lifetimes: pl.DataFrame) -> pl.DataFrame:
    """Horizon of restricted means of each data set and speed: the largest that all scenes and conditions reach.

    Parameters
    ----------
    lifetimes
        What `lifetimes` returned.

    Returns
    -------
    polars.DataFrame
        Columns dataset, speed and restricted_to, in frames that trackers saw. If no scene limits the follow-up, the
        horizon is the longest lifetime.
    """
    reached = pl.coalesce(pl.col("followed_to").min(), pl.col("lifetime").max())
    return lifetimes.group_by(_SHARED).agg(restricted_to=reached)


def median_survival(lifetimes: pl.DataFrame) -> pl.DataFrame:
    """Shortest lifetime that at most half of the tracks exceed, by the Kaplan-Meier estimate, of every condition.

    Parameters
    ----------
    lifetimes
        What `lifetimes` returned.

    Returns
    -------
    polars.DataFrame
        Schema `MEDIAN_SURVIVALS`, sorted by condition, in frames that its tracker saw. `median_until_failure` is of the
        lifetime until a track is lost or rejected as an outlier. A median is null where its survival curve does not
        reach one half.
    """
    half = 0.5 + 1e-12  # the product that is exactly a half on paper may be rounded up
    curves = {"median_lifetime": "survival", "median_until_failure": "survival_until_failure"}
    reached = {name: pl.col("lifetime").filter(pl.col(curve) <= half).min() for name, curve in curves.items()}
    groups = check(lifetimes, LIFETIMES, "lifetimes").group_by(POOLED).agg(**reached)
    return check(groups.sort(POOLED), MEDIAN_SURVIVALS, "median survivals")


def surviving(lifetimes: pl.DataFrame) -> pl.DataFrame:
    """How many tracks were found often enough to reach each age: Psi(k), with or without a known true position.

    A lifetime is the number of frames in which a track was found, not which. The age follows from it if the tracker
    drops a feature in the first frame in which it is not found. For a tracker that keeps searching (correspondence
    with ``max_missed_frames > 0``) it is the smallest possible age, and the track may have been older.

    Parameters
    ----------
    lifetimes
        What `lifetimes` returned.

    Returns
    -------
    polars.DataFrame
        Schema `SURVIVING`, sorted by condition and lifetime: for every lifetime from 1 to the longest, the age, in
        frames of the nominal sequence, of a track when found that often without a gap, and the number of tracks that
        were found as often.
    """
    lengths = pl.int_range(1, pl.col("lifetime").max().cast(pl.Int64) + 1, dtype=pl.UInt32)
    dense = check(lifetimes, LIFETIMES, "lifetimes").group_by(POOLED).agg(lifetime=lengths).explode("lifetime")
    counts = lifetimes.select(*POOLED, "lifetime", n=pl.col("n_ended") + pl.col("n_censored"))
    table = dense.join(counts, on=[*POOLED, "lifetime"], how="left").sort(*POOLED, "lifetime")
    age = (pl.col("lifetime") - 1) * pl.col("speed").cast(pl.UInt32)
    table = table.with_columns(age=age, n=_total_from(pl.col("n").fill_null(0)))
    return check(table.select(*SURVIVING), SURVIVING, "surviving")


def _pooled(ends: pl.DataFrame | Iterable[pl.DataFrame]) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Counts of each condition and lifetime, and `n_scenes` and `followed_to` of each condition."""
    histogram = empty(ENDS).select(_POOLED_END)
    longest = empty(ENDS).select("scene", *_POOLED_END)
    for chunk in in_chunks(ends, ENDS, "ends"):
        counts = pl.concat([histogram, chunk.select(_POOLED_END)])
        histogram = counts.group_by(*POOLED, "lifetime").agg(
            total_if_known(name, pl.col(name).sum()) for name in COUNTS
        )
        longest = _longest(pl.concat([longest, chunk.select("scene", *_POOLED_END)]))
    end = pl.col("n_ended") > 0
    failed = _failed().fill_null(pl.col("n_ended"))
    followed = pl.when(~end | (failed < pl.col("n_ended"))).then(pl.col("lifetime") + end.cast(pl.UInt32))
    scenes = longest.group_by(POOLED).agg(n_scenes=pl.len().cast(pl.Int32), followed_to=followed.min())
    return histogram, scenes


def _longest(counts: pl.DataFrame) -> pl.DataFrame:
    """Counts of each scene and condition at its longest lifetime only."""
    keys = ["scene", *POOLED]
    last = counts.filter(pl.col("lifetime") == pl.col("lifetime").max().over(keys))
    totals = (total_if_known(name, pl.col(name).sum()) for name in COUNTS)
    return last.group_by(*keys, "lifetime").agg(totals).select(counts.columns)


def _failed() -> pl.Expr:
    """Number of tracks that were lost or rejected as outliers; null where causes are unknown."""
    return pl.sum_horizontal((f"n_{cause}" for cause in FAILURES), ignore_nulls=False)


def _curves(table: pl.DataFrame) -> pl.DataFrame:
    """Columns `_CURVES` of one condition, in a table sorted by lifetime."""
    counts = table.select("n_ended", "n_censored", n_failed=_failed())
    ended, censored, failed = counts.get_columns()
    at_risk, survival = kaplan_meier(ended, censored)
    until_failure = kaplan_meier(ended, censored, n_events=failed.fill_null(0)).beyond
    curves = counts.with_columns(at_risk=at_risk.astype(np.int64), survival=survival, until_failure=until_failure)
    where_at_risk = pl.when(pl.col("at_risk") > 0)
    return curves.select(
        "at_risk",
        where_at_risk.then("survival").alias("survival"),
        where_at_risk.then(pl.when(pl.col("n_failed").is_not_null()).then("until_failure")).alias(
            "survival_until_failure"
        ),
    )


def _area(table: pl.DataFrame, curve: str) -> float:
    """Area under a survival curve of one condition up to its horizon, in a table sorted by lifetime.

    A curve that is null where no track is at risk is so at the horizon or beyond it.
    """
    survival, lifetimes = (table[name].fill_null(0.0).cast(pl.Float64).to_numpy() for name in (curve, "lifetime"))
    return float(area_under(survival, lifetimes, table["restricted_to"][0]))


def _total_from(count: pl.Expr) -> pl.Expr:
    """Sum of a count over this and all longer lifetimes of a condition, in a table sorted by lifetime."""
    return count.cum_sum(reverse=True).over(POOLED)
