"""How well tables of noise by tracker, speed and motion predict scenes that were left out.

The motion of a scene is its group.

Gains
-----

Each scene is predicted by the other scenes, looked up by tracker, by tracker and speed, or by tracker, speed and
motion. A second moment about zero S of n errors at one age, of which the table says C, has the log likelihood of a
Gaussian

    l = -n (log |C| + tr(C^-1 S)) / 2    (lookup.likelihood)

without its constant. The gain of one table over another is the difference of the sums of l over scenes, conditions and
ages, per error, in nat. Tables are compared at equal ages, where every one of them rests on `LEAST` errors of other
scenes.

By which factor the second moment of a scene in one condition typically differs from the table is

    exp(mean of |log(tr S / tr C)|)    (lookup.factor)

where S and C are summed over ages. Every scene and condition counts the same.

Intervals are Student's. They are over groups of scenes if there are at least `MIN_SCENES` of these, if any group has
two scenes, which predict each other, so that their gains are the same but for chance, or if scenes are too few to be
compared within groups. Such an interval contains the differences between motions. Otherwise intervals are over scenes,
within their groups if there are any, and then hold for these groups only. Gains of n scenes of one group are correlated
by 1 / (n - 1)^2, as squared distances from the means of the others are, so that these intervals are wider by the root
of n / (n - 1) of the smallest group. A group with one scene has no other scene of its motion.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import prod
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.estimators.training import reference_view
from tracknoise.inference.conventions import LEVEL, IntervalKind
from tracknoise.inference.jackknife import student_interval
from tracknoise.inference.units import NO_GROUPS, Resampled, SceneGroups, by_number, scheme
from tracknoise.statistics.grouping import group_rows
from tracknoise.tables.enumerations import Lookup, Product
from tracknoise.tables.findings_schema import INTERVAL_COLUMNS, LOOKUP
from tracknoise.tables.quantities import Quantity
from tracknoise.tables.run_table import ESTIMATED, Rows, RunTable, Value, bounds_of
from tracknoise.tables.schema import PRODUCT, check, empty


def _lookup() -> Rows:
    gain = ESTIMATED | {"n": "n", "verdict": "established", "why": "why"}
    values = [
        Value("noise_gain", "gain_nats", carried=gain),
        *(
            Value("noise_spread", f"factor{table}", {"at_low": place}, carried=bounds_of(f"factor{table}"))
            for place, table in enumerate(("", "_against"))
        ),
    ]
    keys = {"dataset": "dataset", "of": "product", "part": "lookup", "against": "against"}
    return Rows("lookup", keys, values)


NOISE_LOOKUP = RunTable(
    "noise_lookup",
    {
        "dataset": pl.String,
        "product": PRODUCT,
        "lookup": LOOKUP,
        "against": LOOKUP,
        "n": pl.Int64,
        "gain_nats": pl.Float64,
        **INTERVAL_COLUMNS,
        "established": pl.Boolean,
        **{f"factor{table}{bound}": pl.Float64 for table in ("", "_against") for bound in ("", "_low", "_high")},
        "why": pl.String,
    },
    _lookup(),
    title="gain of tables of noise by tracker, speed and motion",
    quantities={
        "noise_gain": Quantity(
            "nat", "Gain of a table of second moments over a coarser one on scenes that were left out, per error."
        ),
        "noise_spread": Quantity("1", "Factor by which the second moment of a scene typically differs from the table."),
    },
)
"""How much better a table of covariances predicts scenes that were left out (`tracknoise.estimators.lookup_table`).

product is `error`, the error about the first position, or `change`, what it changes from one observation to the next.
Both are second moments about zero, without the outliers that `NOISE_OUTLIERS` counts. gain_nats is the gain of the
table `lookup` over the table `against`, nat per error, with low and high as its bounds. established states whether the
gain is above 0 at the level of the row; it is null without an interval, and why says what is missing. factor is by how
much the second moment of a scene typically differs from the table `lookup`, as a ratio, factor_against from the other
one. n counts errors.
"""

Array = NDArray[np.float64]

_SUMS = ("n", "uu", "uv", "vv")
_KEYS = ("dataset", "scene", "rotation", "direction", "tracker", "speed", "product", "age")
_LOOKED_UP = (Product.error, Product.change)
USED = (*_KEYS, *_SUMS)
"""Columns of `tracknoise.tables.schema.NOISE_SUMS` that are read."""


@dataclass(frozen=True, slots=True, eq=False)
class SceneSums:
    """Sums of one product of one dataset."""

    scenes: tuple[str, ...]  # names, sorted
    # (scenes,): Number of the group of each scene. A scene without a group has a number of its own.
    motion: NDArray[np.intp]
    # (scenes,): number of the unit of intervals that each scene is part of: its group, or the scene itself
    unit: NDArray[np.intp]
    resampled: Resampled  # what the units are
    conditions: tuple[tuple[str, int], ...]  # trackers and speeds, sorted
    sums: Array  # (scenes, conditions, ages, 4): count, and sums of uu, uv and vv, px^2

    def count(self, lookup: Lookup) -> int:
        """Number of rows of a table."""
        motions = len(np.unique(self.motion)) if lookup is Lookup.motion else 1
        return (int(self._row(lookup).max()) + 1) * motions

    def left_out(self, lookup: Lookup) -> Array:
        """What a table was made of without the scene that is looked up in it, (scenes, conditions, ages, 4)."""
        row = self._row(lookup)
        own = np.stack([self.sums[:, row == one].sum(axis=1) for one in range(row.max() + 1)], axis=1)
        motion = self.motion if lookup is Lookup.motion else np.zeros_like(self.motion)
        every = np.empty_like(own)
        for one in np.unique(motion):
            every[motion == one] = own[motion == one].sum(axis=0)
        return np.asarray((every - own)[:, row])

    def _row(self, lookup: Lookup) -> NDArray[np.intp]:
        """Number of the row that each condition is looked up in, among those of one motion, (conditions,)."""
        if lookup is Lookup.one:
            return np.zeros(len(self.conditions), dtype=np.intp)
        if lookup is Lookup.tracker:
            return np.unique([name for name, _ in self.conditions], return_inverse=True)[1]
        return np.arange(len(self.conditions))

    def alone(self, lookup: Lookup) -> NDArray[np.bool_]:
        """Scenes that are the only ones of all of their rows, (scenes,)."""
        return np.asarray((self.left_out(lookup)[..., 0].sum(axis=-1) == 0.0).all(axis=1))


def condensed(sums: pl.DataFrame) -> pl.DataFrame:
    """Sums of the products `error` and `change`, all lightings and cameras together.

    Returns: columns `USED`. `sums`: with at least the columns `USED`.
    """
    some = sums.filter(pl.col("product").is_in(_LOOKED_UP))
    groups = group_rows(some, _KEYS)
    return groups.keys.hstack(groups.sums(some, _SUMS))


def scene_sums(sums: pl.DataFrame, groups: SceneGroups) -> Iterator[tuple[str, Product, SceneSums]]:
    """Sums of each dataset and product."""
    for dataset in sums["dataset"].unique().sort():
        for product in _LOOKED_UP:
            some = sums.filter(dataset=dataset, product=product)
            if some.height:
                yield dataset, product, _dense(some, dataset, groups)


def _dense(table: pl.DataFrame, dataset: str, groups: SceneGroups) -> SceneSums:
    scene, condition, age = (group_rows(table, by) for by in (["scene"], ["tracker", "speed"], ["age"]))
    shape = scene.count, condition.count, age.count
    cell = np.ravel_multi_index((scene.index, condition.index, age.index), shape)
    columns = [np.bincount(cell, table[name].to_numpy(), prod(shape)).reshape(shape) for name in _SUMS]
    scenes = scene.keys["scene"].to_list()
    named = [groups.names.get((dataset, name), name) for name in scenes]
    motion = np.unique(named, return_inverse=True)[1]
    units = _units(groups.of(dataset, scenes))
    return SceneSums(tuple(scenes), motion, *units, tuple(condition.keys.rows()), np.stack(columns, axis=-1))


def _units(group: NDArray[np.intp]) -> tuple[NDArray[np.intp], Resampled]:
    """Units of intervals, and what they are.

    Of two scenes in a group, each predicts the other one, so that their gains are the same but for chance.
    """
    sizes, kind = np.bincount(group), scheme(group)
    if (kind is None and sizes.max() > 1) or (kind == Resampled.within and (sizes == 2).any()):
        kind = Resampled.groups
    units = group if kind == Resampled.groups else np.arange(len(group))
    return np.asarray(units, dtype=np.intp), kind or Resampled.scenes


LEAST = 50
"""Fewest errors at one age that a covariance rests on."""
LEAST_UNITS = 4
"""Fewest groups, or scenes, for an interval."""


@dataclass(frozen=True, slots=True, eq=False)
class _Predicted:
    """What a table predicts of each scene that is left out."""

    # (scenes, conditions, ages): (lookup.likelihood), nat; NaN where the table rests on too few errors
    likelihood: Array
    trace: Array  # (scenes, conditions, ages): sum of tr C over the errors of the scene, px^2


def noise_lookup(
    sums: Iterable[pl.DataFrame], *, groups: SceneGroups = NO_GROUPS, level: float = LEVEL
) -> pl.DataFrame:
    """Gains of tables, each over one covariance for all and over the next coarser table.

    Parameters
    ----------
    sums
        Tables of all scenes, schema `NOISE_SUMS`.
    groups
        Groups of scenes, such as those of one motion.
    level
        Of the intervals.

    Returns
    -------
    polars.DataFrame
        Schema `NOISE_LOOKUP`. A table that has no more rows than a coarser one is left out. Without rows if there is
        nothing to look up by.
    """
    tables = [condensed(table) for table in sums if not table.is_empty()]
    if not tables:
        return empty(NOISE_LOOKUP)
    together = pl.concat(tables)
    rows = [
        {"dataset": dataset, "product": product, "level": level, **row}
        for dataset, product, found in scene_sums(together.filter(**reference_view(together)), groups)
        for row in _comparisons(found, level)
    ]
    return check(pl.DataFrame(rows, schema=dict(NOISE_LOOKUP), orient="row"), NOISE_LOOKUP, "noise lookup")


def _comparisons(sums: SceneSums, level: float) -> Iterator[dict[str, Any]]:
    """Rows of one product, the coarsest table first."""
    lookups = _that_differ(sums)
    predicted = {lookup: _predicted(sums, lookup) for lookup in lookups}
    for before, lookup in pairwise(lookups):
        for against in dict.fromkeys((Lookup.one, before)):
            row = _compared(sums, predicted[lookup], predicted[against], level)
            yield {"lookup": lookup, "against": against, **row, "why": _why(sums, lookup, row)}


def _that_differ(sums: SceneSums) -> list[Lookup]:
    """Tables each of which has more rows than the one before."""
    counts = {lookup: sums.count(lookup) for lookup in Lookup}
    return [one for place, one in enumerate(Lookup) if not place or counts[one] > counts[list(Lookup)[place - 1]]]


def _predicted(sums: SceneSums, lookup: Lookup) -> _Predicted:
    trained, own = sums.left_out(lookup), sums.sums
    n = np.where(trained[..., 0] >= LEAST, trained[..., 0], np.nan)
    uu, uv, vv = (trained[..., place] / n for place in (1, 2, 3))
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = uu * vv - uv**2
        squares = (vv * own[..., 1] - 2.0 * uv * own[..., 2] + uu * own[..., 3]) / determinant
        likelihood = -0.5 * (own[..., 0] * np.log(determinant) + squares)
    return _Predicted(np.where(np.isfinite(likelihood), likelihood, np.nan), own[..., 0] * (uu + vv))


def _compared(sums: SceneSums, table: _Predicted, other: _Predicted, level: float) -> dict[str, Any]:
    """What one table gains over another one, with intervals."""
    n = sums.sums[..., 0]
    there = ~np.isnan(table.likelihood) & ~np.isnan(other.likelihood) & (n > 0)
    gain = np.where(there, table.likelihood - other.likelihood, 0.0).sum(axis=(1, 2))
    gained = _mean(sums, gain, np.where(there, n, 0.0).sum(axis=(1, 2)), level)
    factors = [_factor(sums, one, there, level) for one in (table, other)]
    known = there.any(axis=(1, 2))
    return {
        "n": int(n[there].sum()),
        "n_scenes": int(known.sum()),
        "n_units": len(np.unique(sums.unit[known])),
        "resampled": sums.resampled,
        "kind": IntervalKind.student,
        **dict(zip(("gain_nats", "low", "high"), gained, strict=True)),
        **dict(zip(("factor", "factor_low", "factor_high"), factors[0], strict=True)),
        **dict(zip(("factor_against", "factor_against_low", "factor_against_high"), factors[1], strict=True)),
        "established": None if gained[1] is None else gained[1] > 0.0,
    }


def _factor(
    sums: SceneSums, table: _Predicted, there: NDArray[np.bool_], level: float
) -> tuple[float | None, float | None, float | None]:
    """(lookup.factor), with bounds."""
    measured = np.where(there, sums.sums[..., 1] + sums.sums[..., 3], 0.0).sum(axis=2)
    expected = np.where(there, table.trace, 0.0).sum(axis=2)
    known = (measured > 0.0) & (expected > 0.0)
    logs = np.abs(np.log(np.where(known, measured, 1.0) / np.where(known, expected, 1.0))).sum(axis=1)
    found = _mean(sums, logs, known.sum(axis=1).astype(np.float64), level)
    value, low, high = (None if bound is None else float(np.exp(max(bound, 0.0))) for bound in found)
    return value, low, high


def _mean(sums: SceneSums, total: Array, count: Array, level: float) -> tuple[float | None, float | None, float | None]:
    """Sum of totals over sum of counts, (scenes,) each, with bounds; None where there is none."""
    held, gained = by_number(sums.unit, count), by_number(sums.unit, total)
    some = held > 0.0
    held, gained = held[some], gained[some]
    if not len(held):
        return None, None, None
    value = gained.sum() / held.sum()
    group = sums.motion[some] if sums.resampled == Resampled.within else None
    if len(held) < LEAST_UNITS or not _vary(group):
        return float(value), None, None
    without = (gained.sum() - gained) / (held.sum() - held)
    bounds = student_interval(value, without, level=level, sizes=held, groups=group)
    low, high = (float(value + _wider(group) * (bound - value)) for bound in bounds)
    return float(value), low, high


def _vary(group: NDArray[np.intp] | None) -> bool:
    """Whether there are units to resample: within groups, at least one of several scenes."""
    return group is None or len(np.unique(group)) < len(group)


def _wider(group: NDArray[np.intp] | None) -> float:
    """By which factor intervals within groups are wider, as scenes of a group predict each other."""
    if group is None:
        return 1.0
    sizes = np.unique(group, return_counts=True)[1]
    least = sizes[sizes > 1].min()
    return float(np.sqrt(least / (least - 1)))


def _why(sums: SceneSums, lookup: Lookup, row: dict[str, Any]) -> str | None:
    """Why nothing, or no interval, is known; None if both are."""
    if row["gain_nats"] is None:
        alone = lookup is Lookup.motion and sums.alone(lookup).all()
        return _ALONE if alone else f"no covariance rests on {LEAST} errors of other scenes"
    if row["low"] is None:
        units = "groups of scenes" if sums.resampled == Resampled.groups else "scenes"
        return f"only {row['n_units']} {units} can be left out; at least {LEAST_UNITS} are needed"
    return None


_ALONE = "each motion has only one scene, so that none can be left out"
