"""Factor effects: the effects of `tracknoise.statistics.effects` with intervals, tests and verdicts.

Scenes are the sampling units. A scene is seen at all levels of a factor, so what the levels have in common cancels in
their difference. For every row of the table of effects, the curves of the levels are compared at the same points
(`tracknoise.findings.factors.paired`). The largest effect gets an interval and two p-values
(`tracknoise.findings.factors.largest`). q-values are computed over the cells of a factor's table, for all trackers and
speeds together. Central covariances are in no table. They get q-values among themselves.

The verdict is `yes` if the interval is above the margin and q_yes is at most 1 - level. It is `no` if the interval is
below the margin, q_no is at most 1 - level, and every pair of levels was compared. Otherwise it is `undecided`.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.factors.largest import largest
from tracknoise.findings.factors.paired import Levels, Paired, pair_curves, pair_numbers
from tracknoise.findings.factors.paired_sums import CURVE_SUMS, curve_sums, lifetime_sums, outlier_sums
from tracknoise.findings.factors.rotation import rotations
from tracknoise.findings.sampling.multiplicity import benjamini_hochberg
from tracknoise.findings.sampling.units import MIN_SCENES
from tracknoise.findings.wording import scenes_counted
from tracknoise.statistics.conditions import Tables, by_condition
from tracknoise.statistics.definitions import NAMES, POOLED
from tracknoise.statistics.factors import SCALARS
from tracknoise.statistics.grouping import group_rows
from tracknoise.tables.defaults import LEVEL, POPULATION
from tracknoise.tables.enumerations import EffectIntervalKind, Verdict
from tracknoise.tables.findings_schema import DEPENDENCE
from tracknoise.tables.schema import EFFECTS, ENDS, FRAME_COUNTS, MOMENTS, VERDICT, Schema, check

N_DRAWS = 499
"""Rotations: enough to distinguish p-values of a few percent."""
_FOUND: Schema = {
    "order": pl.UInt32,
    **{column: DEPENDENCE[column] for column in ("low", "high", "p_yes", "p_no")},
    **{column: DEPENDENCE[column] for column in ("n_scenes", "n_places", "at_low", "at_high")},
    "n_bounded": pl.Int32,
}
"""What is found for each row of the effects; n_bounded counts the pairs of levels in the interval."""


@dataclass(frozen=True, slots=True)
class _Test:
    directions: NDArray[np.float64]
    margin: float
    level: float


def dependence(
    moments: Tables,
    ends: Tables,
    frames: Tables,
    curves: pl.DataFrame,
    effects: pl.DataFrame,
    *,
    key_frames: Mapping[str, int] | None = None,
    population: str = POPULATION,
    level: float = LEVEL,
    n_draws: int = N_DRAWS,
    seed: int = 0,
) -> pl.DataFrame:
    """Intervals and verdicts of all effects.

    Parameters
    ----------
    moments, ends, frames
        Of all sequences: `MOMENTS`, `ENDS` and `FRAME_COUNTS`.
    curves, effects
        What the functions of these names made of them; `curves` says where they are cut.
    key_frames
        Where curves run along frames: the one in which errors are zero, by direction.
    population
        That of `effects`.
    level
        Probability that an interval contains the effect; q-values may be at most 1 - level.
    n_draws, seed
        Number of rotations, and their seed.

    Returns
    -------
    polars.DataFrame
        Schema `DEPENDENCE`: the rows of `effects`, in their order. `n_scenes` is the fewest that two levels share.
        `at_low` to `at_high` are the ages (or frames from the key frame on) that the interval holds for, `n_places`
        of them: where fewer than `MIN_SCENES` scenes have data at both levels of a pair, their scatter is
        unknown. The interval is widened to contain the effect if that uses other scenes or places too.
        Bounds and p-values are null where no two levels share enough scenes; `high` is infinite where what the effect
        is relative to may be zero.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    questions = check(effects, EFFECTS, "effects").with_row_index("order")
    errors = by_condition(moments, MOMENTS, "moments")
    sums = {
        None: curve_sums(errors, curves, population=population, key_frames=key_frames or {}),
        "lifetime": lifetime_sums(by_condition(ends, ENDS, "ends")),
        "outlier_ratio": outlier_sums(by_condition(frames, FRAME_COUNTS, "frames")),
    }
    answers: list[tuple[object, ...]] = []
    for (dataset,), asked in questions.partition_by("dataset", as_dict=True, maintain_order=True).items():
        placed, n_scenes = _placed(sums, str(dataset))
        test = _Test(rotations(n_scenes, n_draws=n_draws, seed=seed), asked["margin"].item(0), level)
        for (factor,), rows in asked.partition_by("factor", as_dict=True, maintain_order=True).items():
            answers.extend(_answers(rows, str(factor), placed, test))
    found = pl.DataFrame(answers, schema=dict(_FOUND), orient="row")
    return _judged(questions.join(found, on="order", how="left", maintain_order="left"), level)


def _placed(sums: Mapping[str | None, pl.DataFrame], dataset: str) -> tuple[dict[str | None, pl.DataFrame], int]:
    """Sums of one dataset, with the place of each scene among all of its scenes, and how many there are."""
    chosen = {name: table.filter(dataset=dataset) for name, table in sums.items()}
    scenes = pl.concat([table.select("scene") for table in chosen.values()]).unique().sort("scene")
    places = scenes.with_row_index("place")
    return {
        name: table.join(places, on="scene", maintain_order="left") for name, table in chosen.items()
    }, places.height


def _answers(
    rows: pl.DataFrame, factor: str, sums: Mapping[str | None, pl.DataFrame], test: _Test
) -> Iterator[tuple[object, ...]]:
    """What was found (`_FOUND`) for rows of the effects of one factor."""
    others = [column for column in POOLED if column != factor]
    single = pl.when(pl.col("statistic").is_in(list(SCALARS))).then("statistic")  # null: curves
    for keys, asked in rows.group_by([single.alias("single"), "axis", *others], maintain_order=True):
        conditions = dict(zip(["axis", *others], keys[1:], strict=True))
        table = sums[keys[0]]
        cell = table.filter(**{name: value for name, value in conditions.items() if name in table.columns})
        if not cell.is_empty():
            yield from _cell(cell, factor, asked, test)


def _cell(cell: pl.DataFrame, factor: str, asked: pl.DataFrame, test: _Test) -> Iterator[tuple[object, ...]]:
    """What was found for all statistics that come from the same sums."""
    curved = "total" not in cell.columns
    levels, at = _levels(cell, factor, CURVE_SUMS if curved else ["total"], len(test.directions[0]))
    paired = pair_curves(levels) if curved else pair_numbers(levels)
    names = [*NAMES[asked["axis"].item(0)].values()] if curved else asked["statistic"].to_list()
    places = at[paired.places] if curved else at[:0]
    span = (int(places.min()), int(places.max())) if len(places) else (None, None)
    for order, statistic in asked.select("order", "statistic").rows():
        bounds = _bounds(paired, names.index(statistic), test)
        n_places = int(paired.places.sum())
        yield order, *bounds, paired.n_scenes, n_places, *span, paired.n_pairs


def _bounds(paired: Paired, statistic: int, test: _Test) -> tuple[float | None, ...]:
    if not paired.ratios:
        return (None,) * 4
    found = largest(paired.ratios[statistic], test.directions, margin=test.margin, level=test.level)
    return found.low, found.high, found.p_yes, found.p_no


def _levels(cell: pl.DataFrame, factor: str, columns: list[str], n_scenes: int) -> tuple[Levels, NDArray[np.int64]]:
    """Sums of a cell as arrays, and where their places are."""
    level, at = group_rows(cell, [factor]), group_rows(cell.filter(pl.col("at").is_not_null()), ["at"])
    measured = np.zeros((n_scenes, level.count), dtype=np.bool_)
    measured[cell["place"].to_numpy(), level.index] = True
    there = cell["at"].is_not_null().to_numpy()
    rows = (cell["place"].to_numpy()[there], level.index[there], at.index)
    n = np.zeros((n_scenes, level.count, at.count))
    sums = np.zeros((*n.shape, len(columns)))
    n[rows] = cell["n"].to_numpy()[there]
    sums[rows] = cell.select(columns).to_numpy()[there]
    return Levels(n, sums, measured), at.keys["at"].to_numpy()


def _judged(table: pl.DataFrame, level: float) -> pl.DataFrame:
    """Rows with intervals that contain the effect, q-values, verdicts, and why one is undecided."""
    bounded = pl.col("low").is_not_null()
    table = table.with_columns(
        pl.lit(level).alias("level"),
        kind=pl.lit(EffectIntervalKind.fieller),
        low=pl.when(bounded).then(pl.min_horizontal("low", "effect")),
        high=pl.when(bounded).then(pl.max_horizontal("high", "effect")),
        **{f"q_{name}": _q(table, f"p_{name}") for name in ("yes", "no")},
    )
    table = table.with_columns(verdict=_verdict(level)).with_columns(why=_why())
    return check(table.select(pl.col(name).cast(kind) for name, kind in DEPENDENCE.items()), DEPENDENCE, "dependence")


def _q(table: pl.DataFrame, p: str) -> pl.Series:
    """q-values over the cells of the table of each dataset and factor, and over what is in no table."""
    values = table[p].to_numpy().astype(np.float64)
    families = group_rows(
        table.with_columns(is_cell=pl.col("statistic") != "central"), ["dataset", "factor", "is_cell"]
    )
    for family in range(families.count):
        rows = families.index == family
        values[rows] = benjamini_hochberg(values[rows])
    return pl.Series(values).fill_nan(None)


def _verdict(level: float) -> pl.Expr:
    largest_q = 1 - level + 1e-12
    matters = (pl.col("low") > pl.col("margin")) & (pl.col("q_yes") <= largest_q)
    complete = pl.col("why").is_null() & (pl.col("n_bounded") == pl.col("n_pairs"))
    not_so = complete & (pl.col("high") < pl.col("margin")) & (pl.col("q_no") <= largest_q)
    answer = pl.when(matters).then(pl.lit(Verdict.yes)).when(not_so).then(pl.lit(Verdict.no))
    return answer.otherwise(pl.lit(Verdict.undecided)).cast(VERDICT)


def _why() -> pl.Expr:
    """Why a verdict is undecided; null for the others."""
    few = pl.format(f"two levels share only {{}}; at least {MIN_SCENES} are needed", scenes_counted("n_scenes"))
    nowhere = pl.lit(f"no age or frame has {MIN_SCENES} scenes with data at two levels")
    holds = (pl.col("low") <= pl.col("margin")) & (pl.col("high") >= pl.col("margin"))
    return (
        pl.when(pl.col("verdict") != Verdict.undecided)
        .then(None)
        .when(pl.col("why").is_not_null())
        .then("why")
        .when((pl.col("n_scenes") < MIN_SCENES) & (pl.col("n_bounded") < pl.col("n_pairs")))
        .then(few)
        .when(pl.col("n_bounded") == 0)
        .then(nowhere)
        .when(holds)
        .then(pl.lit("the interval contains the margin"))
        .when(pl.col("n_bounded") < pl.col("n_pairs"))
        .then(pl.lit("some pairs of levels have too few scenes with data at both levels"))
        .otherwise(pl.lit("not significant after the correction for multiple tests"))
    )
