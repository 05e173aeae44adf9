"""Whether a factor changes a statistic by more than a margin: differences paired within scenes, and a verdict.

A cell is a factor with all others held, such as one tracker at one speed. For each statistic of a cell, the differences
between levels are compared with the margin. P-values are then adjusted for everything that is asked, and lead to a
verdict.

Differences
-----------

Scenes are the sampling units. A scene is seen at all levels of a factor, so that what the levels have in common cancels
in their difference. Scales of errors, lifetimes and outlier ratios are compared as ratios: the mean over scenes of the
difference of logarithms, and thus the geometric mean over scenes of the ratio. Mean errors have a sign, and their
differences are in px. Every scene has the same weight.

Differences are averaged over scenes at each point: a pair of levels at one age and coordinate. Points that too few
scenes have are left out.

- Does any pair differ by more than the margin? For scales this is asked in two stages. First, each scene's mean over
  all ages and both coordinates that it has is tested, one for each pair, at 80 % of the level. Second, the single
  points are tested, at 20 %: p_yes = min(p_1 / 0.8, p_2 / 0.2) (two-stage). Means of a signed error may cancel, so that
  for them only the points are tested.
- Do all pairs differ by less than the margin? Only if each single point does: p_no is the largest p-value of all points
  (intersection and union).

The pair with the clearest overall difference is reported, or the clearest point where only that exceeds the margin. Its
interval holds for all pairs, or all points, together.

Verdicts
--------

The questions of a cell form families, each with the whole level: sizes (core and second moment), ends of tracks
(lifetime and outlier ratio), and the others (mean and mean absolute error). q_yes is p_yes by Hochberg in the family of
a cell, and then by Benjamini and Hochberg over the cells of a factor that ask the same. q_no is p_no by Benjamini and
Hochberg over the cells.

- `yes`: q_yes is at most 1 - level. In one family of one cell, any false `yes` then has at most that probability. Of
  all `yes` about one factor and statistic, at most that share is false on average.
- `no`: every pair of levels was compared, and every difference at every age is below the margin. This requires that
  p_no is at most half of 1 - level, so that any false `no` in a family of two has at most the probability 1 - level,
  and that q_no is at most 1 - level.
- `undecided`: all other cases.

Kinds of reference tracks
-------------------------

Poses that are refined by tracks may favour trackers that are like these. Reference tracks are of two kinds. Where poses
were refined, differences between trackers are asked about by each kind alone too, and every answer has to hold: p_yes
and p_no are the largest of the three, and p_yes is 1 where kinds order the reported pair differently.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.factor_values import (
    DISAGREE,
    SIGNED,
    AllValues,
    Cell,
    OptionFactor,
    cells,
    lifetime_differences,
    option_cells,
    outlier_differences,
    scene_values,
)
from tracknoise.analysis.ranking import pairs_of_trackers
from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.multiple_tests import benjamini_hochberg, hochberg, in_families, rotations
from tracknoise.inference.paired_differences import (
    Averages,
    Differences,
    average,
    best_of_few,
    best_of_many,
    differences,
    half_widths,
    half_widths_alone,
    more_scenes,
    p_below,
)
from tracknoise.inference.units import MIN_SCENES, MIN_WITHIN, NO_GROUPS, Resampled, SceneGroups, scheme
from tracknoise.statistics.definitions import NAMES, POOLED
from tracknoise.statistics.grouping import Tables, TablesByCondition, by_condition, group_rows, scenes_by_dataset
from tracknoise.tables.defaults import MARGIN, POPULATION, TRIMMING
from tracknoise.tables.enumerations import EffectIntervalKind, Verdict
from tracknoise.tables.findings_schema import EFFECT_INTERVAL_KIND, OF_LEVELS, RESAMPLED
from tracknoise.tables.quantities import ResultTopic
from tracknoise.tables.run_table import OF_CONDITION, Rows, RunTable, Value, same
from tracknoise.tables.schema import CONDITION, ENDS, FRAME_COUNTS, MOMENTS, SCALES, VERDICT, Schema, check, empty
from tracknoise.words import STATISTICS, count, only


def _factors() -> Rows:
    """Effects of factors."""
    carried = OF_LEVELS | same(
        *("unit", "low", "high", "level", "resampled", "n_scenes", "verdict", "why", "larger", "better")
    )
    counts = ("n_levels", "n_pairs", "n_places", "at_low", "at_high", "more_scenes")
    values = [
        Value("effect", "effect", carried=carried | {"interval": "kind"}),
        Value("effect_bound", "most", carried=same("unit")),
        Value("effect_margin", "margin", carried=same("unit")),
        *(Value("effect_p", f"p_{part}", {"part": part}) for part in ("yes", "no")),
        *(Value("effect_q", f"q_{part}", {"part": part}) for part in ("yes", "no")),
        *(Value("effect_count", name, {"part": name}) for name in counts),
        Value("effect_horizon", "horizon"),
    ]
    keys = {**OF_CONDITION, **same("factor", "axis", "coordinate", "at"), "of": "statistic"}
    return Rows(ResultTopic.factors, keys, values)


DEPENDENCE = RunTable(
    "dependence",
    {
        "dataset": pl.String,
        "factor": pl.String,
        **CONDITION,
        **dict.fromkeys(
            ("statistic", "axis", "unit", "level_a", "level_b", "larger", "better", "coordinate"), pl.String
        ),
        "at": pl.Int64,
        **dict.fromkeys(("effect", "low", "high", "most"), pl.Float64),
        "kind": EFFECT_INTERVAL_KIND,
        "level": pl.Float64,
        "resampled": RESAMPLED,
        **dict.fromkeys(("margin", "p_yes", "q_yes", "p_no", "q_no"), pl.Float64),
        **dict.fromkeys(("n_levels", "n_pairs", "n_scenes", "n_places"), pl.Int32),
        "at_low": pl.Int64,
        "at_high": pl.Int64,
        "horizon": pl.Float64,
        "more_scenes": pl.Int32,
        "verdict": VERDICT,
        "why": pl.String,
    },
    _factors(),
    title="verdicts on factors, with intervals",
)
"""Does a factor change a statistic: one row per factor, condition that was held, and statistic.

Levels are compared in pairs, within each scene. The row reports the pair level_a and level_b, and the size of its
difference:

- unit `ratio`: effect is the larger level over the smaller one, as geometric mean over scenes, ages (or frames) and
  both coordinates. low and high are bounds of the same ratio, and below 1 if the order may be the other way round. high
  and most are null for a ratio of outlier ratios of which one rests on fewer than five outliers per scene.
- unit `px` (mean errors): effect is the size of the difference at one age and coordinate.

coordinate and at are null unless a single age decides. most bounds the difference of any two levels at any age. margin
is in the unit of the effect. larger is the level with the larger value, better that with smaller errors, fewer
outliers or longer lifetimes; null for mean errors. n_pairs counts the pairs that were compared. n_scenes is the fewest
scenes that two levels share, n_places the number of ages that were compared, from at_low to at_high. Lifetimes are
restricted means to the common horizon (frames that the tracker saw). more_scenes is how many more scenes would settle
an `undecided` with a probability of 80 %, where that is known.

p_yes is the p-value of the hypothesis that no difference exceeds the margin, p_no of the hypothesis that some
difference is at least the margin. q_yes and q_no are adjusted p-values: q_yes by Hochberg in a family (core and second
moment; lifetime and outlier ratio; the others) of one cell, such as one tracker at one speed, and both by Benjamini and
Hochberg over the rows of a factor about the same statistic.
"""

ROLES: Mapping[str, str] = {
    **{name: role for names in NAMES.values() for role, name in names.items() if role in STATISTICS},
    "core": "core",
    "lifetime": "lifetime",
    "outlier_ratio": "outlier_ratio",
}
"""Role of each statistic, by its name in the tables."""
_OTHERS = "others"
_FAMILIES: Mapping[str, str] = {
    **dict.fromkeys(("core", "second", "second_moment", "consistent_sigma"), "sizes"),
    **dict.fromkeys(("lifetime", "outlier_ratio"), "ends"),
}


def family(statistic: str) -> str:
    """Family of questions that a statistic, or a role of one, belongs to: `sizes`, `ends` or `others`."""
    return _FAMILIES.get(ROLES.get(statistic, statistic), _OTHERS)


OVERALL_SHARE = 0.8
"""Share of the level that the overall differences are tested at; the rest is for single points."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What was found about one question.

    Attributes
    ----------
    pair
        Which pair of levels is reported.
    point
        Which point of it is reported; None for the mean over all of them.
    difference, low, high
        Signed difference of the pair and its interval.
    most
        Largest bound of the size of any difference at any point.
    p_yes, p_no
        By (two-stage) and (intersection and union).
    compared : (pairs, points) bool
        Points that enough scenes have.
    more_scenes
        How many more scenes would settle the question; None where this is unknown.
    """

    pair: int
    point: int | None
    difference: float
    low: float
    high: float
    most: float
    p_yes: float
    p_no: float
    compared: NDArray[np.bool_]
    more_scenes: int | None


@dataclass(frozen=True, slots=True)
class Question:
    """What is asked of all differences.

    Parameters
    ----------
    margin
        Largest difference that counts as no effect: of logarithms, or in px.
    level
        Probability that an interval contains the true difference.
    group : (scenes,)
        Number of the group of each scene.
    resampled
        What is averaged: `scenes`, `groups` or `within`.
    directions : (draws, dimensions)
        See `tracknoise.inference.multiple_tests.rotations`; there are as many dimensions as the parts of averages.
    cancels
        Whether differences at several points may cancel, so that their mean is no measure of them.
    """

    margin: float
    level: float
    group: NDArray[np.intp]
    resampled: Resampled
    directions: NDArray[np.float64]
    cancels: bool = False


@dataclass(frozen=True, slots=True)
class _Clearest:
    """The clearest of several differences, and the p-value of the hypothesis that none of them exceeds the margin."""

    found: Averages
    chosen: int
    p: float
    pair: int
    point: int | None

    @property
    def difference(self) -> float:
        return float(self.found.mean[self.chosen])

    def half_width(self, question: Question) -> float:
        """Half width of the interval, which holds for all differences together."""
        return float(half_widths(self.found, question.directions, 1 - question.level)[self.chosen])


def answer(asked: Differences, question: Question) -> Answer | None:
    """Compare all pairs; None where no point has enough scenes."""
    n_scenes, n_pairs, n_points = asked.values.shape
    every = average(asked.values.reshape(n_scenes, n_pairs * n_points), question.group, question.resampled)
    enough = enough_scenes(every, question.resampled)
    if not enough.any():
        return None
    points, compared = every.of(enough), enough.reshape(n_pairs, n_points)
    if question.cancels:
        reported = _clearest_point(points, compared, question, needed=np.inf)
    else:
        reported = _of_two_stages(asked.values, points, compared, question)
    half_width = reported.half_width(question)
    largest = np.abs(points.mean) + half_widths_alone(points, 1 - question.level)
    return Answer(
        pair=reported.pair,
        point=reported.point,
        difference=reported.difference,
        low=reported.difference - half_width,
        high=reported.difference + half_width,
        most=float(largest.max()),
        p_yes=reported.p,
        p_no=p_below(points, question.margin),
        compared=compared,
        more_scenes=more_scenes(reported.found, reported.chosen, points, margin=question.margin, level=question.level),
    )


def enough_scenes(found: Averages, resampled: Resampled) -> NDArray[np.bool_]:
    """Where there are enough scenes or groups for an interval, as in `tracknoise.inference.units.scheme`."""
    least = MIN_WITHIN if resampled == Resampled.within else 0
    return np.asarray((found.n_units >= MIN_SCENES) & (found.degrees >= least), dtype=np.bool_)


def _of_two_stages(
    values: NDArray[np.float64], points: Averages, compared: NDArray[np.bool_], question: Question
) -> _Clearest:
    """The clearest difference, with the p-value of (two-stage); of numbers without ages there is one stage only."""
    overall = _clearest_pair(values, compared, question)
    if compared.shape[1] == 1:
        return overall
    rest = 1 - OVERALL_SHARE
    p_overall = min(overall.p / OVERALL_SHARE, 1.0)
    single = _clearest_point(points, compared, question, needed=rest * p_overall)
    p_single = single.p / rest
    at_point = p_single <= 1 - question.level < p_overall
    return replace(single if at_point else overall, p=min(p_overall, p_single))


def _clearest_pair(values: NDArray[np.float64], compared: NDArray[np.bool_], question: Question) -> _Clearest:
    """Of the means over the points of each pair."""
    there = ~np.isnan(values) & compared
    count = there.sum(axis=2)
    means = np.where(there, values, 0.0).sum(axis=2) / np.where(count > 0, count, np.nan)
    pairs = np.flatnonzero(compared.any(axis=1))
    found = average(means[:, pairs], question.group, question.resampled)
    best = best_of_few(found, question.margin, question.directions)
    return _Clearest(found, best.chosen, best.p, int(pairs[best.chosen]), None)


def _clearest_point(points: Averages, compared: NDArray[np.bool_], question: Question, *, needed: float) -> _Clearest:
    """Of single points; a p-value of `needed` or more need not be exact."""
    best = best_of_many(points, question.margin, question.directions, needed=needed)
    pair, point = np.argwhere(compared)[best.chosen]
    return _Clearest(points, best.chosen, best.p, int(pair), int(point))


N_DRAWS = 499
"""Rotations: enough to distinguish p-values of a few percent."""


def ask(
    both: NDArray[np.bool_],
    group: NDArray[np.intp],
    *,
    margin: float,
    level: float,
    n_draws: int = N_DRAWS,
    seed: int = 0,
    cancels: bool = False,
) -> Question | None:
    """The question about differences; None where scenes or groups are too few, or the margin is unknown.

    Shapes: both (scenes, pairs), group (scenes,). `margin`: NaN where it is unknown.
    """
    resampled = scheme(group[both.any(axis=1)])
    if resampled is None or not np.isfinite(margin):
        return None
    n_groups = len(np.unique(group))
    within = len(group) - n_groups + 1
    dimensions = {Resampled.scenes: len(group), Resampled.groups: n_groups}.get(resampled, within)
    directions = rotations(dimensions, n_draws=n_draws, seed=seed)
    return Question(margin, level, group, resampled, directions, cancels=cancels)


Row: TypeAlias = dict[str, Any]
"""Columns of `DEPENDENCE`, without q-values and verdict, and `gap`: why there can be no `no`, if so."""
_SIGNED = "mean"
_LARGER_IS_BETTER = "lifetime"
_ROUNDING = 1e-12
_FEW = f"at least {MIN_SCENES} are needed"


def row_of(
    cell: Cell,
    role: str,
    statistic: str,
    places: NDArray[np.int64],
    asked: Differences,
    question: Question | None,
    margin: float,
    group: NDArray[np.intp],
    by_kind: Sequence[Differences] = (),
) -> Row:
    """What is known about one statistic of a cell.

    `asked, question`: None where too few scenes were measured. `margin`: NaN where it is unknown. `by_kind`: the same
    differences by each kind of reference tracks alone.
    """
    levels = [str(level) for level in cell.levels]
    found = None if question is None else answer(asked, question)
    shared = asked.both.sum(axis=0)
    row: Row = {
        **cell.key,
        "statistic": statistic,
        "unit": "px" if role == _SIGNED else "ratio",
        "n_levels": len(levels),
        "n_pairs": 0 if found is None else int(found.compared.any(axis=1).sum()),
        "n_scenes": int(shared.min(initial=shared.max(initial=0))),
        "margin": None if np.isnan(margin) else _size(margin, role),
        "gap": _gap(cell.factor, levels, asked, found, group, question),
    }
    if question is not None:
        row |= {"resampled": question.resampled}
    if found is not None:
        row |= _compared(found, places, asked) | _pair(found, levels, asked, role) | _point(found, places)
        row |= _sizes(found, role, asked)
    if found is not None and question is not None and by_kind:
        row |= _by_each_kind(found, by_kind, question, f"{DISAGREE} {row['level_a']} and {row['level_b']}")
    return row


def _by_each_kind(found: Answer, by_kind: Sequence[Differences], question: Question, apart: str) -> Row:
    """p-values that hold by references of each kind alone, and the reason where these differ in what they decide."""
    every = [found, *filter(None, (answer(one, question) for one in by_kind))]
    yes, no = ([one.p_yes for one in every], [one.p_no for one in every])
    order = [found.difference, *(_difference(one, found) for one in by_kind)]
    opposed = min(order) < 0.0 < max(order)
    missing = len(every) <= len(by_kind)
    p_yes, p_no = (1.0 if missing or opposed else max(yes), 1.0 if missing else max(no))
    wrong = 1.0 - question.level
    is_lost = yes[0] <= wrong < p_yes or no[0] <= wrong / 2 < p_no
    disagree = is_lost or (opposed and max(yes[1:], default=1.0) <= wrong)
    return {"p_yes": p_yes, "p_no": p_no, "apart": apart if disagree else None}


def _difference(asked: Differences, of: Answer) -> float:
    """Mean over scenes of the pair and the point that an answer reports, or of all points that it compares."""
    values = asked.values[:, of.pair]
    chosen = values[:, of.compared[of.pair]] if of.point is None else values[:, of.point]
    known = chosen[np.isfinite(chosen)]
    return float(known.mean()) if len(known) else 0.0


def _size(difference: float, role: str) -> float:
    """A difference in the unit of the effect."""
    return difference if role == _SIGNED else float(np.exp(difference))


def _sizes(found: Answer, role: str, asked: Differences) -> Row:
    """Effect and bounds of the reported pair, of its larger level over, or minus, its smaller one."""
    low, high = (found.low, found.high) if found.difference >= 0 else (-found.high, -found.low)
    smaller = 1 if found.difference >= 0 else 0
    return {
        "effect": _size(abs(found.difference), role),
        "low": max(low, 0.0) if role == _SIGNED else _size(low, role),
        "high": None if asked.scarce[found.pair, smaller] else _size(high, role),
        "most": None if asked.scarce.any() else _size(found.most, role),
        "p_yes": found.p_yes,
        "p_no": found.p_no,
        "more_scenes": found.more_scenes,
    }


def _pair(found: Answer, levels: Sequence[str], asked: Differences, role: str) -> Row:
    """Levels of the reported pair, and which of them is larger and which is better."""
    a, b = (levels[number] for number in asked.pairs[found.pair])
    horizon = asked.horizon[found.pair]
    larger, smaller = (a, b) if found.difference > 0 else (b, a) if found.difference < 0 else (None, None)
    better = None if role == _SIGNED else larger if role == _LARGER_IS_BETTER else smaller
    until = None if np.isnan(horizon) else float(horizon)
    return {"level_a": a, "level_b": b, "larger": larger, "better": better, "horizon": until}


def _point(found: Answer, places: NDArray[np.int64]) -> Row:
    """Coordinate and age that decide, if a single one does."""
    if found.point is None:
        return {}
    place, coordinate = divmod(found.point, 2)
    return {"coordinate": "uv"[coordinate], "at": int(places[place])}


def _compared(found: Answer, places: NDArray[np.int64], asked: Differences) -> Row:
    """How many ages were compared, and from which to which."""
    if asked.values.shape[2] == 1:
        return {}
    there = places[found.compared.reshape(-1, len(places), 2).any(axis=(0, 2))]
    return {"n_places": len(there), "at_low": int(there.min()), "at_high": int(there.max())}


def _gap(
    factor: str,
    levels: Sequence[str],
    asked: Differences,
    found: Answer | None,
    group: NDArray[np.intp],
    question: Question | None,
) -> str | None:
    """What is missing for a `no`; None if nothing is."""
    if len(levels) < 2:
        return f"only one {factor} was measured: {''.join(levels)}"
    if found is not None and found.compared.any(axis=1).all():
        unlike = (asked.unlike & found.compared).any()
        return "a value of 0 at one of two levels, which has no ratio" if unlike else asked.gap
    fewest = int(asked.both.sum(axis=0).min())
    if fewest < MIN_SCENES:
        return f"two levels share {only(fewest, 'scene')}; {_FEW}"
    if question is None:
        return _few_groups(asked, group)
    if found is None:
        return f"no age or frame has {MIN_SCENES} scenes with data at two levels"
    missing = _never_compared(levels, asked, found)
    if missing:
        return f"nothing to compare {factor} {', '.join(missing)} by"
    return "some pairs of levels have too few scenes with data at both levels"


def _few_groups(asked: Differences, group: NDArray[np.intp]) -> str:
    """Why nothing could be asked of enough scenes."""
    part = group[asked.both.any(axis=1)]
    n_groups = len(np.unique(part))
    if n_groups < MIN_SCENES and len(part) - n_groups < MIN_WITHIN:
        return f"the scenes form only {count(n_groups, 'group')}; {_FEW}, or {MIN_WITHIN} more scenes than groups"
    return "errors have no scale that a margin could be a share of"


def _never_compared(levels: Sequence[str], asked: Differences, found: Answer) -> list[str]:
    """Levels that are in no pair that was compared."""
    known = set(asked.pairs[found.compared.any(axis=1)].ravel().tolist())
    return [level for number, level in enumerate(levels) if number not in known]


def judged(rows: Sequence[Row], level: float) -> pl.DataFrame:
    """The table (`DEPENDENCE`) of rows, with q-values, verdicts, and why one is undecided."""
    known: Mapping[str, Any] = {name: kind for name, kind in DEPENDENCE.items() if name not in ("verdict", "why")}
    # why no difference is shown; which levels alone are compared; where references of the two kinds disagree
    internal = {"gap": pl.String, "pair": pl.String, "apart": pl.String}
    table = pl.DataFrame(rows, schema={**known, **internal}, orient="row").with_columns_seq(
        pl.lit(level).alias("level"), kind=pl.lit(EffectIntervalKind.paired, dtype=DEPENDENCE["kind"])
    )
    table = table.with_columns_seq(_q_values(table)).with_columns_seq(verdict=_verdict(level))
    table = table.with_columns_seq(why=_why(level), more_scenes=pl.when(_is_open()).then("more_scenes"))
    return check(
        table.select_seq(pl.col(name).cast(kind) for name, kind in DEPENDENCE.items()), DEPENDENCE, "dependence"
    )


def _q_values(table: pl.DataFrame) -> list[pl.Series]:
    """q_yes and q_no: adjusted in the families of a cell, and over the cells of a factor that ask the same."""
    families = table.with_columns_seq(family=pl.col("statistic").map_elements(family, return_dtype=pl.String))
    of_cell, of_statistic = (
        group_rows(families, keys).index
        for keys in (["dataset", "factor", *CONDITION, "pair", "family"], ["dataset", "factor", "statistic"])
    )
    yes, no = (table[name].to_numpy().astype(np.float64) for name in ("p_yes", "p_no"))
    adjusted = {"q_yes": in_families(hochberg, yes, of_cell), "q_no": no}
    return [
        pl.Series(name, in_families(benjamini_hochberg, p, of_statistic)).fill_nan(None) for name, p in adjusted.items()
    ]


def _is_open() -> pl.Expr:
    return pl.col("verdict") == Verdict.undecided


def _all_below(level: float) -> pl.Expr:
    return pl.col("p_no") <= (1 - level) / 2 + _ROUNDING


def _verdict(level: float) -> pl.Expr:
    largest_q = 1 - level + _ROUNDING
    exceeds = pl.col("q_yes") <= largest_q
    none_does = pl.col("gap").is_null() & _all_below(level) & (pl.col("q_no") <= largest_q)
    answer = pl.when(exceeds).then(pl.lit(Verdict.yes)).when(none_does).then(pl.lit(Verdict.no))
    return answer.otherwise(pl.lit(Verdict.undecided)).cast(VERDICT)


def _why(level: float) -> pl.Expr:
    """Why a verdict is undecided; null for the others."""
    shown = (pl.col("p_yes") <= 1 - level) | _all_below(level)
    holds = (pl.col("low") <= pl.col("margin")) & (pl.col("high").fill_null(math.inf) >= pl.col("margin"))
    return (
        pl.when(~_is_open())
        .then(None)
        .when(pl.col("apart").is_not_null())
        .then("apart")
        .when(pl.col("gap").is_not_null())
        .then("gap")
        .when(shown)
        .then(pl.lit("not significant after the correction for multiple tests"))
        .when(holds)
        .then(pl.lit("the interval contains the margin"))
        .otherwise(pl.lit("at some age, a difference above the margin cannot be excluded"))
    )


@dataclass(frozen=True, slots=True)
class _Options:
    groups: SceneGroups
    margin: float
    level: float
    n_draws: int
    seed: int


def dependence(
    moments: Tables,
    scales: Tables,
    ends: Tables,
    frames: Tables,
    curves: pl.DataFrame,
    effects: pl.DataFrame,
    *,
    by_kind: Mapping[str, Mapping[str, Tables]] = MappingProxyType({}),
    key_frames: Mapping[str, int] | None = None,
    population: str = POPULATION,
    trimming: str = TRIMMING,
    options: Sequence[OptionFactor] = (),
    groups: SceneGroups = NO_GROUPS,
    margin: float = MARGIN,
    level: float = LEVEL,
    n_draws: int = N_DRAWS,
    seed: int = 0,
    pairs: bool = False,
) -> pl.DataFrame:
    """Ratios and differences between the levels of all factors, with intervals and verdicts.

    Parameters
    ----------
    moments, scales, ends, frames
        Of all sequences: `MOMENTS`, `SCALES`, `ENDS` and `FRAME_COUNTS`.
    curves, effects
        What the functions of these names made of them. `curves` says where they are cut, `effects` which factors are
        asked about, and where the others are held.
    by_kind
        `moments` and `scales` of all sequences by the poses of each kind of reference tracks alone.
    key_frames
        Where curves run along frames: the one in which errors are zero, by direction.
    population, trimming
        Which errors.
    options
        Options in which alone trackers differ. They are compared like trackers, as factors of their own.
    groups
        Scenes that are not independent of each other.
    margin
        Largest relative difference that counts as no effect: 0.1 for ratios of 1.1, and for differences of means that
        are 10 % of the core (geometric mean over levels, ages and scenes; of the rms where there is no core).
    level
        Probability that an interval contains the true difference; q-values may be at most 1 - level.
    n_draws, seed
        Number of rotations, and their seed.
    pairs
        Whether every two trackers are compared, by `tracknoise.analysis.ranking.pairs_of_trackers`, and nothing else.

    Returns
    -------
    polars.DataFrame
        Schema `DEPENDENCE`: for each cell of `effects`, all of its statistics but central covariances, and the core.
        Ages (or frames) at which fewer than `MIN_SCENES` scenes have values at both levels are left out. Bounds and
        p-values are null where no two levels share enough scenes, or too few groups of scenes.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    tables = {
        name: by_condition(given, schema, name)
        for name, given, schema in (
            ("moments", moments, MOMENTS),
            ("scales", scales, SCALES),
            ("ends", ends, ENDS),
            ("frames", frames, FRAME_COUNTS),
        )
    }
    every = list(cells(effects, sorted({key for table in tables.values() for key in table})))
    wanted = list(pairs_of_trackers(every)) if pairs else [*every, *option_cells(every, options)]
    if pairs and not wanted:
        return judged([], level)
    found = scenes_by_dataset(item for each in tables.values() for item in each.items())
    scenes = {dataset: sorted(names) for dataset, names in found.items()}

    def values_of(moments: TablesByCondition, scales: TablesByCondition) -> AllValues:
        errors = {"population": population, "trimming": trimming}
        return scene_values(moments, scales, curves, errors=errors, key_frames=key_frames or {}, scenes=scenes)

    values = values_of(tables["moments"], tables["scales"])
    alone = [
        values_of(by_condition(one["moments"], MOMENTS, "moments"), by_condition(one["scales"], SCALES, "scales"))
        for one in by_kind.values()
    ]
    asked = _Options(groups, margin, level, n_draws, seed)
    rows: list[Row] = []
    for cell in wanted:
        names = scenes.get(cell.dataset, [])
        made = _rows(cell, tables, values, alone, names, groups.of(cell.dataset, names), asked)
        rows.extend(_of_pair(cell, row) if pairs else row for row in made)
    return judged(rows, level)


def _of_pair(cell: Cell, row: Row) -> Row:
    """The row of a cell of two levels, which are named where they could not be compared too."""
    first, second = map(str, cell.levels)
    return {"level_a": first, "level_b": second, "pair": f"{first} {second}", **row}


def _rows(
    cell: Cell,
    tables: Mapping[str, TablesByCondition],
    values: AllValues,
    alone: Sequence[AllValues],
    scenes: Sequence[str],
    group: NDArray[np.intp],
    options: _Options,
) -> Iterator[Row]:
    """Rows of all statistics of a cell."""
    places = values.places.get((cell.dataset, str(cell.axis)), np.zeros(0, dtype=np.int64))
    shape = len(scenes), len(places)
    of_trackers = len({key[_TRACKER] for key in cell.levels.values()}) > 1
    for role, name in cell.statistics.items():
        by_kind: list[Differences] = []
        if role == "lifetime":
            asked = lifetime_differences(_tables(cell, tables["ends"], ENDS), scenes)
        elif role == "outlier_ratio":
            asked = outlier_differences(_tables(cell, tables["frames"], FRAME_COUNTS), scenes)
        else:
            asked = _differences(cell, role, values, shape)
            by_kind = [_differences(cell, role, one, shape) for one in alone] if of_trackers else []
        margin = _margin_px(cell, values, options.margin) if role == SIGNED else float(np.log1p(options.margin))
        question = ask(
            asked.both,
            group,
            margin=margin,
            level=options.level,
            n_draws=options.n_draws,
            seed=options.seed,
            cancels=role == SIGNED,
        )
        yield row_of(cell, role, name, places, asked, question, margin, group, by_kind)


_TRACKER = POOLED.index("tracker")


def _tables(cell: Cell, tables: TablesByCondition, schema: Schema) -> list[pl.DataFrame]:
    """The table of each level, without rows where it has none."""
    return [tables.get(key, empty(schema)) for key in cell.levels.values()]


def _differences(cell: Cell, role: str, values: AllValues, shape: tuple[int, int]) -> Differences:
    """Differences of errors between all levels. `shape`: scenes and places."""
    levels = np.full((shape[0], len(cell.levels), shape[1], 2), np.nan)
    measured = np.zeros(levels.shape[:2], dtype=np.bool_)
    for number, key in enumerate(cell.levels.values()):
        found = values.conditions.get((key, str(cell.axis)))
        if found is not None:
            measured[:, number] = found.measured
            levels[:, number] = found.values.get(role, np.nan)
    return differences(levels.reshape(*measured.shape, -1), measured, logarithms=role != SIGNED)


def _margin_px(cell: Cell, values: AllValues, margin: float) -> float:
    """Margin of mean errors: a share of the core, geometric mean over levels, ages and scenes; else of the rms."""
    for role, power in (("core", 1), ("second", 2)):
        found = [values.conditions.get((key, str(cell.axis))) for key in cell.levels.values()]
        logs = [one.values[role].ravel() for one in found if one is not None and role in one.values]
        finite = [each[np.isfinite(each)] for each in logs]
        if sum(map(len, finite)):
            return margin * float(np.exp(np.concatenate(finite).mean() / power))
    return float("nan")
