"""Whether a factor changes a statistic by more than a margin, and which trackers are better than others.

A cell is one factor with all others held, such as one tracker at one speed, and its levels are conditions. For each
statistic of a cell, the differences between levels are compared with the margin (`tracknoise.analysis.paired_tests`).

An option is a factor for trackers of one kind that differ in exactly this option, such as the detector. The difference
between two such trackers is the effect of the option. Trackers that differ in several options are compared as trackers
only.

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

Ranks
-----

Every two trackers are compared like the levels of a factor of two. A tracker of n is between the ranks

    best = 1 + number of trackers that are shown to be better,  worst = n - number that are shown to be worse    (ranks)

where a difference within the margin counts as none, and one at a single age neither. Of all pairs that are said to
differ by one statistic, at most 1 - level are alike, on average.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.paired_tests import (
    AT_LEAST,
    DISAGREE,
    N_DRAWS,
    Answer,
    Family,
    Question,
    Unit,
    answer,
    ask,
    decided,
    why_not_asked,
    why_open,
)
from tracknoise.analysis.scene_values import SIGNED, RunValues, differences_of
from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.multiple_tests import benjamini_hochberg, hochberg, in_families
from tracknoise.inference.paired_differences import Differences
from tracknoise.inference.units import MIN_SCENES, NO_GROUPS, SceneGroups
from tracknoise.statistics.definitions import NAMES, POOLED
from tracknoise.statistics.grouping import Condition
from tracknoise.tables.defaults import MARGIN
from tracknoise.tables.enumerations import EffectIntervalKind, Verdict
from tracknoise.tables.findings_schema import EFFECT_INTERVAL_KIND, EFFECTS, OF_LEVELS, RESAMPLED
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import ALL_ROWS, OF_CONDITION, Rows, RunTable, Value, same
from tracknoise.tables.schema import CONDITION, VERDICT, check, empty, typed
from tracknoise.words import STATISTICS, only


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
    return Rows("factors", keys, values)


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
    verdicts=ALL_ROWS,
    quantities={
        "effect": Quantity(
            None, "Largest difference that a factor makes, paired within scenes: a ratio, or px for means."
        ),
        "effect_bound": Quantity(None, "Upper bound of the difference of any two levels at any age."),
        "effect_margin": Quantity(None, "Effect above which a factor matters."),
        "effect_p": Quantity(
            "1", "p-value: yes (no difference exceeds the margin) and no (some difference is at least the margin)."
        ),
        "effect_q": Quantity(
            "1", "The same adjusted for the other questions of its family, and for the other cells of the factor."
        ),
        "effect_horizon": Quantity("frames", "Horizon to which lifetimes are restricted."),
    },
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

CORE = "core"
"""Name of the robust scale, which is compared although `EFFECTS` lacks it."""
_ROLES: Mapping[str, str] = {
    **{name: role for names in NAMES.values() for role, name in names.items()},
    **{name: name for name in (CORE, "lifetime", "outlier_ratio")},
}
ROLES: Mapping[str, str] = {name: role for name, role in _ROLES.items() if role in STATISTICS}
"""Role of each statistic, by its name in the tables."""
RANKED = (CORE, "second", "lifetime", "outlier_ratio")
"""Roles of the statistics that trackers are ranked by."""
LEAST_TRACKERS = 3


def family(statistic: str) -> Family:
    """Family of questions that a statistic, or a role of one, belongs to."""
    return Family.of_role(ROLES.get(statistic, statistic))


_LEFT_OUT = "central"
"""Central second moments: the comparison of second moments and of means says what they say."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One factor, with all others held."""

    factor: str
    held: Mapping[str, object]  # values of the other columns of the condition, and of `dataset`
    axis: str | None  # of the curves; None for numbers without one
    levels: Mapping[object, Condition]  # the conditions to compare, by the value of the factor, sorted
    statistics: Mapping[str, str]  # name of each statistic that is asked about, by its role

    @property
    def dataset(self) -> str:
        """Name of the dataset."""
        return str(self.held["dataset"])

    @property
    def key(self) -> dict[str, object]:
        """The columns of the table that identify the cell."""
        names = {name: self.held.get(name) for name in CONDITION}
        return {"dataset": self.held["dataset"], "factor": self.factor, **names, "axis": self.axis}


def cells(effects: pl.DataFrame, conditions: Sequence[Condition]) -> Iterator[Cell]:
    """The cells of a table of effects, in its order. `conditions`: all that were measured, sorted."""
    rows = check(effects, EFFECTS, "effects").filter(pl.col("statistic") != _LEFT_OUT)
    for (dataset, factor, *values, axis), part in rows.group_by(
        ["dataset", "factor", *CONDITION, "axis"], maintain_order=True
    ):
        held = {"dataset": dataset, **dict(zip(CONDITION, values, strict=True))}
        del held[str(factor)]
        levels = {key[POOLED.index(str(factor))]: key for key in conditions if _agrees(key, held)}
        statistics = {_ROLES[name]: name for name in part["statistic"]}
        if axis is not None:
            statistics[CORE] = CORE
        yield Cell(str(factor), held, axis, levels, statistics)


def _agrees(condition: Condition, held: Mapping[str, object]) -> bool:
    named = dict(zip(POOLED, condition, strict=True))
    return all(named[name] == value for name, value in held.items())


Options = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class OptionFactor:
    """An option in which alone some trackers differ."""

    name: str  # of the option; those of nested settings with a dot, such as ``detection.detector``
    # kind of the trackers. Where the same option varies among several sets of trackers of this kind, their names
    of: str
    levels: Mapping[str, str]  # name of the tracker with each value of the option, in the order of the trackers


def option_factors(trackers: Mapping[str, tuple[str, Options]]) -> list[OptionFactor]:
    """The options in which alone trackers differ, sorted by name.

    Parameters
    ----------
    trackers
        Kind and options by the name of each tracker. All options are given, also those that have their defaults.
    """
    flat = {name: (kind, dict(_flat(options))) for name, (kind, options) in trackers.items()}
    paths = sorted({path for _, options in flat.values() for path in options})
    return [factor for path in paths for factor in _varied(path, flat)]


def _flat(options: Options, within: str = "") -> Iterator[tuple[str, str]]:
    """Values as text by the dotted names of their options."""
    for name, value in options.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{within}{name}.")
        else:
            yield f"{within}{name}", str(value)


def _varied(path: str, trackers: Mapping[str, tuple[str, dict[str, str]]]) -> list[OptionFactor]:
    """Sets of trackers that differ in an option alone."""
    alike = defaultdict[tuple[str, tuple[tuple[str, str], ...]], dict[str, str]](dict)
    for tracker, (kind, options) in trackers.items():
        others = tuple(sorted((name, value) for name, value in options.items() if name != path))
        alike[kind, others].setdefault(options.get(path, "none"), tracker)
    varied = [(kind, levels) for (kind, _), levels in alike.items() if len(levels) > 1]
    kinds = [kind for kind, _ in varied]
    return [
        OptionFactor(path, kind if kinds.count(kind) == 1 else ", ".join(levels.values()), levels)
        for kind, levels in varied
    ]


def option_cells(cells: Iterable[Cell], factors: Sequence[OptionFactor]) -> Iterator[Cell]:
    """The cells about options: those about trackers, of the trackers that differ in one option alone."""
    for cell in cells:
        for factor in factors if cell.factor == "tracker" else ():
            names = {value: name for value, name in factor.levels.items() if name in cell.levels}
            levels: dict[object, Condition] = {value: cell.levels[name] for value, name in names.items()}
            if len(levels) > 1:
                held = {**cell.held, "tracker": factor.of}
                yield Cell(factor.name, held, cell.axis, levels, cell.statistics)


def pairs_of_trackers(cells: Iterable[Cell]) -> Iterator[Cell]:
    """Every two trackers, at the lowest speed at which three or more are compared."""
    many = [cell for cell in cells if cell.factor == "tracker" and len(cell.levels) >= LEAST_TRACKERS]
    slowest = min((cell.held["speed"] for cell in many), key=lambda speed: int(str(speed)), default=None)
    for cell in many:
        if cell.held["speed"] == slowest:
            asked = {role: name for role, name in cell.statistics.items() if role in RANKED}
            for pair in combinations(cell.levels.items(), 2):
                yield replace(cell, levels=dict(pair), statistics=asked)


Row: TypeAlias = dict[str, Any]
"""Columns of `DEPENDENCE` without q-values and verdict; `gap`, why there can be no `no`, if so; `apart`, that kinds of
references disagree, if so; and `pair`, which levels alone are compared, if so."""
_LARGER_IS_BETTER = "lifetime"


@dataclass(frozen=True, slots=True)
class _Asked:
    """One statistic of a cell."""

    cell: Cell
    role: str
    differences: Differences
    group: NDArray[np.intp]  # (scenes,): number of the group of each scene
    margin: float  # NaN where it is unknown
    question: Question | None  # None where too few scenes were measured, or the margin is unknown

    @property
    def unit(self) -> Unit:
        """Unit of the effect."""
        return _unit(self.role)

    @property
    def levels(self) -> list[str]:
        """Names of the levels."""
        return [str(level) for level in self.cell.levels]

    def row(self) -> Row:
        """What is known about it."""
        answered = None if self.question is None else answer(self.differences, self.question)
        shared = self.differences.both.sum(axis=0)
        row: Row = {
            **self.cell.key,
            "statistic": self.cell.statistics[self.role],
            "unit": str(self.unit),
            "n_levels": len(self.levels),
            "n_pairs": 0 if answered is None else int(answered.compared.any(axis=1).sum()),
            "n_scenes": int(shared.min(initial=shared.max(initial=0))),
            "margin": None if np.isnan(self.margin) else self.unit.of(self.margin),
            "gap": self._gap(answered),
            "resampled": None if self.question is None else self.question.resampled,
        }
        return row if answered is None else row | self._answered(answered)

    def _answered(self, answered: Answer) -> Row:
        """The reported pair: its effect is that of its larger level over, or minus, its smaller one."""
        asked, of = self.differences, self.unit.of
        a, b = (self.levels[number] for number in asked.pairs[answered.pair])
        larger, smaller = (a, b) if answered.difference > 0 else (b, a) if answered.difference < 0 else (None, None)
        low, high = (answered.low, answered.high) if answered.difference >= 0 else (-answered.high, -answered.low)
        is_scarce = asked.scarce[answered.pair, 1 if answered.difference >= 0 else 0]
        is_signed, horizon = self.role == SIGNED, float(asked.horizon[answered.pair])
        places = [asked.place(point) for point in np.flatnonzero(answered.compared.any(axis=0)).tolist()]
        compared = {"n_places": len({*places}), "at_low": places[0], "at_high": places[-1]} if len(asked.places) else {}
        at_point = (
            {}
            if answered.point is None
            else {"coordinate": asked.coordinate(answered.point), "at": asked.place(answered.point)}
        )
        return {
            "level_a": a,
            "level_b": b,
            "larger": larger,
            "better": None if is_signed else larger if self.role == _LARGER_IS_BETTER else smaller,
            "effect": of(abs(answered.difference)),
            "low": max(low, 0.0) if is_signed else of(low),
            "high": None if is_scarce else of(high),
            "most": None if asked.scarce.any() else of(answered.most),
            "p_yes": answered.p_yes,
            "p_no": answered.p_no,
            "apart": f"{DISAGREE} {a} and {b}" if answered.kinds_disagree else None,
            "more_scenes": answered.more_scenes,
            "horizon": None if np.isnan(horizon) else horizon,
            **compared,
            **at_point,
        }

    def _gap(self, answered: Answer | None) -> str | None:
        """What is missing for a `no`; None if nothing is."""
        factor, levels, asked = self.cell.factor, self.levels, self.differences
        if len(levels) < 2:
            return f"only one {factor} was measured: {''.join(levels)}"
        if answered is not None and answered.compared.any(axis=1).all():
            unlike = (asked.unlike & answered.compared).any()
            return "a value of 0 at one of two levels, which has no ratio" if unlike else asked.gap
        fewest = int(asked.both.sum(axis=0).min())
        if fewest < MIN_SCENES:
            return f"two levels share {only(fewest, 'scene')}; {AT_LEAST}"
        if self.question is None:
            return why_not_asked(asked.both, self.group)
        if answered is None:
            return asked.gap or f"no age or frame has {MIN_SCENES} scenes with data at two levels"
        compared = set(asked.pairs[answered.compared.any(axis=1)].ravel().tolist())
        if missing := [level for number, level in enumerate(levels) if number not in compared]:
            return f"nothing to compare {factor} {', '.join(missing)} by"
        return "some pairs of levels have too few scenes with data at both levels"


def _unit(role: str) -> Unit:
    return Unit.px if role == SIGNED else Unit.ratio


def judged(rows: Sequence[Row], level: float) -> pl.DataFrame:
    """The table (`DEPENDENCE`) of rows, with q-values, verdicts, and why one is undecided."""
    cell = ("dataset", "factor", *CONDITION, "pair")
    of_cell = _numbers([(*map(row.get, cell), family(row["statistic"])) for row in rows])
    of_statistic = _numbers([tuple(row[name] for name in ("dataset", "factor", "statistic")) for row in rows])
    p_yes, p_no = ([row.get(name) for row in rows] for name in ("p_yes", "p_no"))
    q_yes = in_families(benjamini_hochberg, in_families(hochberg, p_yes, of_cell), of_statistic)
    q_no = in_families(benjamini_hochberg, p_no, of_statistic)
    made = [
        {**row, **_verdict(row, float(yes), float(no), level), "level": level, "kind": EffectIntervalKind.paired}
        for row, yes, no in zip(rows, q_yes, q_no, strict=True)
    ]
    columns = [{name: row.get(name) for name in DEPENDENCE} for row in made]
    return check(pl.DataFrame(columns, schema=dict(DEPENDENCE), orient="row"), DEPENDENCE, "dependence")


def _numbers(keys: Sequence[tuple[object, ...]]) -> list[int]:
    """A number for each key, the same for equal ones."""
    order = {key: number for number, key in enumerate(dict.fromkeys(keys))}
    return [order[key] for key in keys]


def _verdict(row: Row, q_yes: float, q_no: float, level: float) -> Row:
    """The columns that depend on what else is asked."""
    p_yes, p_no, gap = row.get("p_yes"), row.get("p_no"), row["gap"]
    adjusted = {name: None if math.isnan(q) else q for name, q in (("q_yes", q_yes), ("q_no", q_no))}
    verdict = decided(p_no, q_yes, q_no, level, has_gap=gap is not None)
    if verdict != Verdict.undecided:
        return {**adjusted, "verdict": verdict, "more_scenes": None}
    why = row.get("apart") or gap
    if why is None and p_yes is not None and p_no is not None:
        low, margin = row.get("low"), row.get("margin")
        high = math.inf if row.get("high") is None else row["high"]
        contains = low is not None and margin is not None and low <= margin <= high
        why = why_open(p_yes, p_no, level, contains=contains, otherwise=_EXCEEDS)
    return {**adjusted, "verdict": verdict, "why": why}


_EXCEEDS = "at some age, a difference above the margin cannot be excluded"


def dependence(
    run: RunValues,
    effects: pl.DataFrame,
    *,
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
    run
        What its scenes measured.
    effects
        What `tracknoise.statistics.yardstick.effects` made of it. It says which factors are asked about, and where the
        others are held.
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
        Whether every two trackers are compared, by `pairs_of_trackers`, and nothing else.

    Returns
    -------
    polars.DataFrame
        Schema `DEPENDENCE`: for each cell of `effects`, all of its statistics but central covariances, and the core.
        Ages (or frames) at which fewer than `MIN_SCENES` scenes have values at both levels are left out. Bounds and
        p-values are null where no two levels share enough scenes, or too few groups of scenes.

    Raises
    ------
    SchemaError
        If `effects` has other columns.
    """
    every = list(cells(effects, run.keys))
    wanted = pairs_of_trackers(every) if pairs else [*every, *option_cells(every, options)]
    rows: list[Row] = []
    for cell in wanted:
        only_pair = _named_pair(cell) if pairs else {}
        for role in cell.statistics:
            asked = _asked(cell, role, run, groups, margin, level=level, n_draws=n_draws, seed=seed)
            rows.append({**only_pair, **asked.row()})
    return judged(rows, level)


def _named_pair(cell: Cell) -> Row:
    """Two levels, which are named where they could not be compared too."""
    first, second = map(str, cell.levels)
    return {"level_a": first, "level_b": second, "pair": f"{first} {second}"}


def _asked(cell: Cell, role: str, run: RunValues, groups: SceneGroups, margin: float, **options: Any) -> _Asked:
    scenes = run.scenes.get(cell.dataset, [])
    group = groups.of(cell.dataset, scenes)
    values = differences_of(role, [(run, key) for key in cell.levels.values()], cell.axis, scenes)
    limit = _unit(role).margin(margin, values.scale_px)
    question = ask(values.both, group, margin=limit, cancels=role == SIGNED, **options)
    return _Asked(cell, role, values, group, limit, question)


RANKS = RunTable(
    "ranks",
    {
        "dataset": pl.String,
        **{name: kind for name, kind in CONDITION.items() if name != "tracker"},
        "statistic": pl.String,
        "axis": pl.String,
        "tracker": pl.String,
        "best": pl.Int32,
        "worst": pl.Int32,
        "n_trackers": pl.Int32,
        "n_scenes": pl.Int32,
        "level": pl.Float64,
        "why": pl.String,
    },
    Rows(
        "ranks",
        {**OF_CONDITION, "axis": "axis", "of": "statistic"},
        [
            *(
                Value("rank", name, {"part": name}, carried=same("n_scenes", "level", "why"))
                for name in ("best", "worst")
            ),
            Value("rank_count", "n_trackers"),
        ],
    ),
    quantities={
        "rank": Quantity("1", "Best and worst rank among trackers, by a statistic, by shown differences."),
        "rank_count": Quantity("1", "Number of trackers that were ranked."),
    },
)
"""Ranks of trackers at the lowest speed, one row per statistic and tracker, where three or more are compared.

A tracker is between the ranks best and worst of n_trackers, by (ranks). n_scenes is the smallest number of scenes that
it shares with another tracker. level is that of the comparisons. why names the trackers about which references of the
two kinds disagree, if any.
"""


def compared_pairs(
    trackers: Sequence[str],
    differences: Callable[[str, tuple[str, str]], Differences],
    group: NDArray[np.intp],
    *,
    margin: float = MARGIN,
    level: float = LEVEL,
) -> pl.DataFrame:
    """Every two trackers compared by each of `RANKED`, where their differences within scenes are known otherwise.

    Parameters
    ----------
    trackers
        Names.
    differences
        Makes the differences of two trackers by the role of a statistic.
    group : (scenes,)
        Number of the group of each scene.
    margin, level
        As of `dependence`.

    Returns
    -------
    polars.DataFrame
        Schema `DEPENDENCE`; statistics are named by their roles.
    """
    rows: list[Row] = []
    for pair in combinations(trackers, 2):
        cell = Cell("tracker", {"dataset": ""}, None, dict.fromkeys(pair, ()), dict(zip(RANKED, RANKED, strict=True)))
        for role in RANKED:
            values = differences(role, pair)
            limit = _unit(role).margin(margin, values.scale_px)
            question = ask(values.both, group, margin=limit, level=level)
            rows.append({**_named_pair(cell), **_Asked(cell, role, values, group, limit, question).row()})
    return judged(rows, level)


def ranking(pairs: pl.DataFrame) -> pl.DataFrame:
    """Ranks by (ranks) from comparisons of every two trackers.

    Parameters
    ----------
    pairs
        Schema `DEPENDENCE`, of the cells of `pairs_of_trackers`: every pair has a row.

    Returns
    -------
    polars.DataFrame
        Schema `RANKS`, by statistic and tracker, the best first. Nothing of statistics by which no pair was tested.
    """
    held = ["dataset", *(name for name in CONDITION if name != "tracker"), "statistic", "axis"]
    tested = pairs.filter(pl.col("p_yes").is_not_null().any().over(held))
    if tested.is_empty():
        return empty(RANKS)
    shown = (pl.col("verdict") == Verdict.yes) & pl.col("at").is_null()
    disputed = pl.when(pl.col("why").str.starts_with(DISAGREE))
    sides = pl.concat(
        tested.select(
            *held,
            "n_scenes",
            "level",
            shown=shown,
            tracker=own,
            better=pl.col("better") == pl.col(other),
            disputed=disputed.then(other),
        )
        for own, other in (("level_a", "level_b"), ("level_b", "level_a"))
    )
    worse = pl.col("shown") & pl.col("better").not_()
    counted = sides.group_by(*held, "tracker", maintain_order=True).agg(
        best=1 + (pl.col("shown") & pl.col("better")).sum(),
        beaten=worse.sum(),
        n_trackers=1 + pl.len(),
        n_scenes=pl.col("n_scenes").min(),
        level=pl.col("level").first(),
        disputed=pl.col("disputed").drop_nulls().str.join(", "),
    )
    why = pl.format("{} {} and {}", pl.lit(DISAGREE), "tracker", "disputed")
    ranks = counted.with_columns(
        worst=pl.col("n_trackers") - pl.col("beaten"), why=pl.when(pl.col("disputed") != "").then(why)
    )
    ordered = ranks.sort(*held, pl.col("best") + pl.col("worst"), "best", "tracker", nulls_last=True)
    return typed(ordered, RANKS)
