"""The findings of a run in a handful of sentences: caveats first, then what an estimator needs to know."""

from collections.abc import Callable

import polars as pl

from tracknoise.findings.headlines import errors
from tracknoise.findings.headlines.factors import factors
from tracknoise.findings.headlines.headline import Headline, Said, Tables, by_tracker, capitalised, told
from tracknoise.findings.headlines.scope import Estimate, Scope, scalar_bounds
from tracknoise.findings.sampling.resampling import MIN_SCENES
from tracknoise.findings.wording import count
from tracknoise.tables.findings_schema import FINDINGS
from tracknoise.tables.schema import check

ENOUGH_SCENES = 8
"""With fewer scenes than this intervals cover less surely what they say they do."""


def headlines(tables: Tables, scope: Scope) -> pl.DataFrame:
    """Sentences about what was found, the most important first.

    Parameters
    ----------
    tables
        By their names: summary, effects, intervals, zero_mean, gaussianity, time_structure and dependence. One without
        rows has no sentence.
    scope
        Which conditions the sentences are about.

    Returns
    -------
    polars.DataFrame
        Schema `FINDINGS`. value, low and high are those of the first number in the sentence that has an interval.
        `figure` names a section of the report; `table` the table that holds the numbers.
    """
    found = [headline for make in _TOPICS if (headline := make(tables, scope))]
    rows = [
        {
            "rank": rank,
            **{name: getattr(one, name) for name in ("topic", "text", "figure", "table")},
            **{name: getattr(one.estimate, name, None) for name in ("value", "low", "high", "unit")},
        }
        for rank, one in enumerate(found, start=1)
    ]
    return check(pl.DataFrame(rows, schema=dict(FINDINGS)), FINDINGS, "findings")


def _few_scenes(tables: Tables, scope: Scope) -> Headline | None:
    """Warn where scenes are so few that intervals hold for these scenes alone, or are less sure than they say."""
    measured = tables["summary"].drop_nulls("n_scenes")
    if measured.is_empty():
        return None
    few = measured.filter(pl.col("n_scenes") < ENOUGH_SCENES)
    if few.is_empty():
        return None
    numbers: list[int] = few["n_scenes"].unique().sort().to_list()
    whose = "every condition" if few.height == measured.height else f"{few.height} of {measured.height} conditions"
    there = count(numbers[0], "scene") if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]} scenes"
    opening = f"In {whose} there {'is' if numbers == [1] else 'are'} only {there}"
    if numbers[0] >= MIN_SCENES:
        text = f"{opening}: intervals that rest on fewer than {ENOUGH_SCENES} scenes are less reliable than the others."
    else:
        text = (
            f"{opening}. Where there are fewer than {MIN_SCENES}, intervals come from blocks of tracks within the "
            "scenes: they hold for these scenes, and say nothing of others; and whether the mean error is zero, or a "
            "factor matters, cannot be tested at 5 %."
        )
    return Headline("scenes", text, "measured", "summary", Estimate(numbers[0], unit="scenes"))


def _recorded_truth(tables: Tables, scope: Scope) -> Headline | None:
    """Warn where the truth was measured too."""
    text = (
        "The true positions come from recorded poses, depth and calibration: the truth's own error is inside every "
        "number and not yet separated, so that errors of the trackers alone may be smaller than what stands here."
    )
    return Headline("truth", text, "limits", "counts") if scope.recorded else None


def _outliers(tables: Tables, scope: Scope) -> Headline | None:
    """What share of its features each tracker rejects."""

    def write(parts: list[str]) -> str:
        return f"Of the features carried into a frame {scope.where(tables['summary'])}, {'; '.join(parts)}."

    return by_tracker(tables, scope, _outliers_of, write, topic="outliers", figure="outlier-ratio", table="intervals")


def _outliers_of(tables: Tables, scope: Scope, tracker: str) -> Said | None:
    ratio = _value(scope.of(tables["summary"], tracker), "outlier_ratio")
    if ratio is None:
        return None
    bounds = scalar_bounds(scope.of(tables["intervals"], tracker), "outlier_ratio")
    estimate = Estimate.of(ratio, bounds, "share")
    return f"{tracker} rejects {told(estimate)} as outliers", [estimate]


def _lifetimes(tables: Tables, scope: Scope) -> Headline | None:
    """How long half of the tracks live."""

    def write(parts: list[str]) -> str:
        return f"How long do tracks live {scope.where(tables['summary'])} (Kaplan-Meier)? {capitalised(parts)}."

    return by_tracker(tables, scope, _lifetime_of, write, topic="lifetimes", figure="lifetimes", table="intervals")


def _lifetime_of(tables: Tables, scope: Scope, tracker: str) -> Said | None:
    rows = scope.of(tables["summary"], tracker)
    if not _value(rows, "n_tracks"):
        return None
    median = _value(rows, "median_lifetime")
    if median is None:
        return f"more than half of the tracks of {tracker} outlive the data", []
    bounds = scalar_bounds(scope.of(tables["intervals"], tracker), "median_lifetime")
    estimate = Estimate.of(median, bounds, "frames")
    return f"half of the tracks of {tracker} live no longer than {told(estimate)}", [estimate]


def _value(rows: pl.DataFrame, column: str) -> float | None:
    value: float | None = rows[column][0] if rows.height else None
    return value


_TOPICS: tuple[Callable[[Tables, Scope], Headline | None], ...] = (
    _few_scenes,
    _recorded_truth,
    errors.noise,
    errors.bias,
    errors.shape,
    errors.growth,
    factors,
    errors.survivors,
    _outliers,
    _lifetimes,
)
"""Makes a sentence each, the most important first; none where the tables have nothing to say of it."""
