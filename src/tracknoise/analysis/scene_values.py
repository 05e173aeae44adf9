"""What single scenes measured at some levels of a factor, and how the levels differ in each of them.

A level is a condition of a run: levels of the factors of a run are conditions of it, and two runs are two levels too.

At each age (or frame) and coordinate, a scene has the mean of its errors (px), and the logarithms of their mean
absolute value, their second moment about zero and their core (scene value). A value that rests on fewer features than
`LEAST_FEATURES` counts as missing. Turned images are in the axes of the upright image.

The logarithm of the mean of n squares is too small on average, the more so the heavier their tails. By the fourth and
second moments about zero of all scenes at the same age, m_4 and m_2, it is increased by

    (m_4 / m_2^2 - 1) / (2 n)    (scene shortfall)

This is the first term of a series. Two levels are not compared at an age of a scene where it is above `MOST_SHORTFALL`
for either of them, in u or in v. Where it is so for one of them alone, its outliers may be what differs: if these are
more than `SOME_HEAVY` of the ages of scenes, nothing shows that levels are alike, and above `MOST_HEAVY` nothing is
shown.

- An outlier ratio is (outliers + 1/2) / (offered + 1) (scene ratio), and levels differ by its logarithm. A scene takes
  no part in a pair if its counts are too small: if both levels had the same ratio, at least `LEAST_OUTLIERS` outliers
  must be expected at each of them. A level with fewer than `SCARCE` outliers per scene is scarce: the 1/2 makes its
  ratio too large, so that the other level may differ by more than any bound.
- A lifetime is the mean of min(lifetime, horizon) by Kaplan and Meier, in frames that the tracker saw (scene lifetime),
  and levels differ by its logarithm. The horizon is the largest lifetime up to which all scenes of a pair have
  follow-up at both levels. Without it, a lifetime would depend on where sequences end. Scenes whose follow-up is less
  than `LEAST_FOLLOW_UP` of the longest lifetimes of a typical scene take no part. If most tracks outlive a short
  horizon, this does not show that lifetimes are alike: nothing is shown then.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from types import MappingProxyType

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import FOURTH_SUMS, additive, with_fourth
from tracknoise.inference.paired_differences import (
    NO_PLACES,
    Differences,
    at_both,
    differences,
    none_scarce,
    pairs_of,
)
from tracknoise.inference.survival import follow_up, restricted_mean
from tracknoise.inference.units import MIN_SCENES
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import (
    Condition,
    Tables,
    TablesByCondition,
    by_condition,
    scenes_by_dataset,
    total_if_known,
)
from tracknoise.statistics.scales import LEAST_ERRORS
from tracknoise.statistics.yardstick import comparable
from tracknoise.tables.defaults import POPULATION, TRIMMING
from tracknoise.tables.enumerations import Axis, Weighting
from tracknoise.tables.findings_schema import CURVES
from tracknoise.tables.schema import ENDS, FRAME_COUNTS, MOMENTS, SCALES, check, empty

LEAST_FEATURES: Mapping[str, int] = {
    "mean": 10,
    "absolute": 10,
    "second": 30,
    "shortfall": 30,
    "core": LEAST_ERRORS,
}
"""Fewest features that a value at one age rests on, by role of the statistic."""
MOST_SHORTFALL = 0.2
"""By how much the logarithm of a second moment may have to be increased.

With 3 % of outliers, the first term is right to .02 from there on.
"""
SOME_HEAVY, MOST_HEAVY = 0.1, 0.5
_HEAVY = "tails of one of both are too heavy for so few errors"
SIGNED = "mean"
"""Role of the statistic that has a sign and therefore no logarithm."""
NUMBERS = {"scene": pl.String, "at": pl.Int64, "value": pl.Float64}
"""Columns of a table of numbers: null where a scene has none. `at` is null for single numbers."""
_SCHEMAS = {"moments": MOMENTS, "scales": SCALES, "ends": ENDS, "frames": FRAME_COUNTS}
_ROTATION, _DIRECTION, _TRACKER = (POOLED.index(name) for name in ("rotation", "direction", "tracker"))
_Columns = Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True, slots=True)
class SceneValues:
    """Values of the scenes of one dataset in one condition, along one axis."""

    # (scenes, places, 2) by the role of the statistic, in u and v: px of the mean, otherwise logarithms, -inf where a
    # value is 0. NaN where it is missing
    values: Mapping[str, NDArray[np.float64]]
    measured: NDArray[np.bool_]  # (scenes,): which were measured in this condition, whether or not they have any value


@dataclass(frozen=True, slots=True)
class RunErrors:
    """Errors of all conditions of a run, by one set of poses."""

    places: Mapping[tuple[str, str], NDArray[np.int64]]  # ages or frames of each dataset and axis, sorted
    conditions: Mapping[tuple[Condition, str], SceneValues]  # what single scenes measured, by condition and axis
    scales: TablesByCondition
    errors: Mapping[str, str]  # which errors: population and trimming
    key_frames: Mapping[str, int]


@dataclass(frozen=True, slots=True)
class RunValues:
    """What the scenes of a run measured, as `run_values` returns it."""

    scenes: Mapping[str, Sequence[str]]  # names by dataset, in the order of the arrays
    keys: Sequence[Condition]  # all conditions, sorted
    errors: RunErrors  # by the poses of all reference tracks
    by_kind: Mapping[str, RunErrors]  # by those of each kind alone; none where poses were not refined
    ends: TablesByCondition
    frames: TablesByCondition


Level = tuple[RunValues, Condition]


def run_values(
    moments: Tables,
    scales: Tables,
    ends: Tables,
    frames: Tables,
    curves: pl.DataFrame,
    *,
    by_kind: Mapping[str, Mapping[str, Tables]] = MappingProxyType({}),
    key_frames: Mapping[str, int] = MappingProxyType({}),
    population: str = POPULATION,
    trimming: str = TRIMMING,
    scenes: Mapping[str, Sequence[str]] | None = None,
) -> RunValues:
    """What the scenes of a run measured, at the points of curves that may be compared.

    Parameters
    ----------
    moments, scales, ends, frames
        Of all sequences: `MOMENTS`, `SCALES`, `ENDS` and `FRAME_COUNTS`.
    curves
        What was made of the same scenes; it says where curves are cut.
    by_kind
        `moments` and `scales` of all sequences by the poses of each kind of reference tracks alone.
    key_frames
        Where curves run along frames: the one in which errors are zero, by direction.
    population, trimming
        Which errors.
    scenes
        Names of the scenes of each dataset, sorted; None for those that the tables have.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    given = {"moments": moments, "scales": scales, "ends": ends, "frames": frames}
    tables = {name: by_condition(table, _SCHEMAS[name], name) for name, table in given.items()}
    if scenes is None:
        found = scenes_by_dataset(item for each in tables.values() for item in each.items())
        scenes = {dataset: sorted(names) for dataset, names in found.items()}
    which = {"population": population, "trimming": trimming}
    errors, *alone = (
        _run_errors(
            by_condition(of["moments"], MOMENTS, "moments"),
            by_condition(of["scales"], SCALES, "scales"),
            curves,
            which,
            key_frames,
            scenes,
        )
        for of in (tables, *by_kind.values())
    )
    keys = sorted({key for table in tables.values() for key in table})
    kinds = dict(zip(by_kind, alone, strict=True))
    return RunValues(scenes, keys, errors, kinds, tables["ends"], tables["frames"])


def _run_errors(
    moments: TablesByCondition,
    scales: TablesByCondition,
    curves: pl.DataFrame,
    errors: Mapping[str, str],
    key_frames: Mapping[str, int],
    scenes: Mapping[str, Sequence[str]],
) -> RunErrors:
    """Values by (scene value)."""
    known = check(curves, CURVES, "curves").filter(**errors, weighting=Weighting.features)
    points = comparable(known.select_seq(*POOLED, "axis", "at", "cut", there="at").unique(), key_frames)
    places = {
        (str(dataset), str(axis)): part["at"].unique().sort().to_numpy()
        for (dataset, axis), part in points.partition_by("dataset", "axis", as_dict=True).items()
    }
    there = points.partition_by([*POOLED, "axis"], as_dict=True)
    errors_of_scenes = {}
    for *names, axis in known.select_seq(*POOLED, "axis").unique().sort(*POOLED, "axis").rows():
        key, at = tuple(names), places.get((str(names[0]), str(axis)), np.zeros(0, dtype=np.int64))
        rows = [table[key].filter(**errors, axis=axis) if key in table else None for table in (moments, scales)]
        part = there.get((*key, axis), points.clear())
        numbered = part.select_seq(at="there", place=pl.Series(np.searchsorted(at, part["at"].to_numpy())))
        errors_of_scenes[key, str(axis)] = _of_condition(key, rows, numbered, scenes[str(key[0])], len(at))
    return RunErrors(places, errors_of_scenes, scales, errors, key_frames)


def _of_condition(
    key: Condition, rows: Sequence[pl.DataFrame | None], places: pl.DataFrame, scenes: Sequence[str], n_places: int
) -> SceneValues:
    """Values of one condition, from its rows of moments and of scales."""
    number = pl.col("scene").cast(pl.Enum(scenes)).to_physical().cast(pl.Int64).alias("scene")
    measured = np.zeros(len(scenes), dtype=np.bool_)
    values = {}
    for table, read in zip(rows, (_of_moments, _of_scales), strict=True):
        if table is not None:
            numbered = table.with_columns_seq(number)
            measured[numbered["scene"].to_numpy()] = True
            there = numbered.join(places, on="at", maintain_order="left")
            at = there["scene"].to_numpy(), there["place"].to_numpy()
            for role, columns in read(there).items():
                values[role] = np.full((len(scenes), n_places, 2), np.nan)
                values[role][at] = np.where(there["n"].to_numpy()[:, None] >= LEAST_FEATURES[role], columns, np.nan)
    return SceneValues({role: _upright(array, key, role) for role, array in values.items()}, measured)


def _of_moments(table: pl.DataFrame) -> _Columns:
    """Values in u and v, (rows, 2), of rows of moments; NaN where there is no feature."""
    sums, n = additive(with_fourth(table)), table["n"].to_numpy()[:, None]
    squares = _columns(sums, "uu", "vv")
    with np.errstate(divide="ignore", invalid="ignore"):
        mean, absolute = (_columns(sums, *names) / n for names in (("u", "v"), ("abs_u", "abs_v")))
        short = _shortfall(n, squares, _columns(sums, *FOURTH_SUMS), table["at"].to_numpy())
        second = np.log(squares / n) + short
        return {SIGNED: mean, "absolute": np.log(absolute), "second": second, "shortfall": short}


def _shortfall(
    n: NDArray[np.int64], squares: NDArray[np.float64], fourth: NDArray[np.float64], at: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(scene shortfall) of rows of n errors with these sums at places, (rows, 2)."""
    _, place = np.unique(at, return_inverse=True)
    whole, all_squares, all_fourth = (
        np.stack([np.bincount(place, column) for column in np.nan_to_num(part).T], axis=1)
        for part in (n, squares, fourth)
    )
    ratio = whole * all_fourth / np.where(all_squares > 0.0, all_squares, np.inf) ** 2
    return np.asarray(np.maximum(ratio[place] - 1.0, 0.0) / (2.0 * n), dtype=np.float64)


def _of_scales(table: pl.DataFrame) -> _Columns:
    """The same of rows of scales."""
    return {"core": np.log(_columns(table, "core_u_px", "core_v_px"))}


def _columns(table: pl.DataFrame, u: str, v: str) -> NDArray[np.float64]:
    return table.select_seq(pl.col(u, v).cast(pl.Float64).fill_null(np.nan)).to_numpy()


def _upright(values: NDArray[np.float64], key: Condition, role: str) -> NDArray[np.float64]:
    """Values in the axes of the upright image, as in `tracknoise.statistics.definitions`."""
    sign = -1.0 if role == SIGNED else 1.0
    for _ in range(int(key[_ROTATION]) // 90):
        values = np.stack([sign * values[..., 1], values[..., 0]], axis=-1)
    return values


LEAST_OUTLIERS = 2.0
SCARCE = 5.0
_FEW = "too few outliers for an upper bound"
LEAST_FOLLOW_UP = 0.5
_LEAST_HORIZON = 2.0
"""Every track has a lifetime of one frame, so that a horizon of one frame compares nothing."""
_MOST_ALIVE = 0.5
"""Share of tracks that may live to the last frame of a horizon, where lifetimes up to it show that levels are alike."""
_OUTLIVED = "more than half of the tracks live to the common horizon"
_LEAST_AGES = 3
"""Fewest ages of a scene through which a line is fitted."""


def differences_of(role: str, levels: Sequence[Level], axis: str | None, scenes: Sequence[str]) -> Differences:
    """Differences of a statistic between every two levels.

    Poses that are refined by tracks may favour trackers or runs whose tracks are like these. Differences between such
    levels are returned by references of each kind alone, too.

    Parameters
    ----------
    role
        `lifetime`, `outlier_ratio`, a key of `LEAST_FEATURES`, or, of two levels, `growth` or `tails`.
    levels, axis
        The conditions, and what their errors are along.
    scenes
        Names of all scenes of the dataset, in the order of the arrays.
    """
    if role == "lifetime":
        return lifetime_differences([run.ends.get(key, empty(ENDS)) for run, key in levels], scenes)
    if role == "outlier_ratio":
        return outlier_differences([run.frames.get(key, empty(FRAME_COUNTS)) for run, key in levels], scenes)
    errors = [(run.errors, key) for run, key in levels]
    are_alike = len({(id(run), key[_TRACKER]) for run, key in levels}) < 2
    kinds = () if are_alike else dict.fromkeys(kind for run, _ in levels for kind in run.by_kind)
    alone = [[(run.by_kind.get(kind, run.errors), key) for run, key in levels] for kind in kinds]
    all_references, *by_kind = (_of_errors(role, each, str(axis), scenes) for each in (errors, *alone))
    return replace(all_references, by_kind=tuple(by_kind))


_Errors = Sequence[tuple[RunErrors, Condition]]


def _of_errors(role: str, levels: _Errors, axis: str, scenes: Sequence[str]) -> Differences:
    if role in ("second", "growth"):
        second = _second(levels, axis, scenes)
        return second if role == "second" else _growth(second)
    return _tails(levels, axis, scenes) if role == "tails" else _curves(role, levels, axis, scenes)


def _at_levels(
    role: str, levels: _Errors, axis: str, scenes: Sequence[str]
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.int64]]:
    """Values (scenes, levels, places, 2) at the places that all runs have, who was measured, and these places."""
    places_of_levels = [run.places.get((str(key[0]), axis), NO_PLACES) for run, key in levels]
    places = reduce(np.intersect1d, places_of_levels)
    values = np.full((len(scenes), len(levels), len(places), 2), np.nan)
    measured = np.zeros(values.shape[:2], dtype=np.bool_)
    for number, (run, key) in enumerate(levels):
        if (table := run.conditions.get((key, axis))) is not None:
            measured[:, number] = table.measured
            if role in table.values:
                values[:, number] = table.values[role][:, np.isin(places_of_levels[number], places)]
    return values, measured, places


def _curves(role: str, levels: _Errors, axis: str, scenes: Sequence[str]) -> Differences:
    """Differences of a statistic that has a value at every place."""
    values, measured, places = _at_levels(role, levels, axis, scenes)
    points = values.reshape(*measured.shape, -1)
    differing = differences(points, measured, logarithms=role != SIGNED, places=places, n_coordinates=2)
    if role != SIGNED:
        return differing
    total = points[:, differing.pairs[:, 0]] + points[:, differing.pairs[:, 1]]
    return replace(differing, total=total, scale_px=_scale_px(levels, axis, scenes))


def _second(levels: _Errors, axis: str, scenes: Sequence[str]) -> Differences:
    """Differences of second moments, at ages where tails of neither level are too heavy."""
    every = _curves("second", levels, axis, scenes)
    short = _at_levels("shortfall", levels, axis, scenes)[0]
    of_level = np.asarray((short > MOST_SHORTFALL).any(axis=3))  # (scenes, levels, places)
    first, second = (of_level[:, every.pairs[:, side]] for side in (0, 1))
    there = np.asarray((~np.isnan(every.values)).reshape(*first.shape, 2).any(axis=3))
    share = ((first ^ second) & there).sum(axis=(0, 2)) / np.maximum(there.sum(axis=(0, 2)), 1)
    left_out = np.repeat(first | second, 2, axis=2) | (share > MOST_HEAVY)[:, None]
    gap = _HEAVY if (share > SOME_HEAVY).any() else None
    return replace(every, values=np.where(left_out, np.nan, every.values), gap=gap)


def _scale_px(levels: _Errors, axis: str, scenes: Sequence[str]) -> float | None:
    """Geometric mean of the core over levels, scenes and places, else of the rms; None where there is neither."""
    for role, power in (("core", 1), ("second", 2)):
        logs = _at_levels(role, levels, axis, scenes)[0].swapaxes(0, 1).ravel()
        finite = logs[np.isfinite(logs)]
        if len(finite):
            return float(np.exp(finite.mean() / power))
    return None


def _growth(second: Differences) -> Differences:
    """Difference between two levels in the logarithm of the growth of second moments, by lines through logarithms.

    Both levels have values at the same ages, so that the difference of both slopes is the slope of the difference.
    """
    change = second.values[:, 0].reshape(len(second.values), -1, 2)
    common = (~np.isnan(change)).any(axis=2).sum(axis=0) >= MIN_SCENES
    logs, change = np.log(second.places[common]), change[:, common]
    there = ~np.isnan(change)
    count = np.maximum(there.sum(axis=1), 1)
    centred = np.where(there, logs[:, None] - (there * logs[:, None]).sum(axis=1, keepdims=True) / count[:, None], 0.0)
    spread = (centred**2).sum(axis=1)
    enough = (there.sum(axis=1) >= _LEAST_AGES) & (spread > 0)
    slope = (centred * np.where(there, change, 0.0)).sum(axis=1) / np.where(enough, spread, np.nan)
    span = float(np.ptp(logs)) if len(logs) else np.nan
    no_zero = np.zeros((1, 2), dtype=np.bool_)
    return replace(second, values=(slope * span)[:, None], unlike=no_zero, places=NO_PLACES)


def _tails(levels: _Errors, axis: str, scenes: Sequence[str]) -> Differences:
    """The same in the logarithm of the share of errors beyond three cores, at ages where both levels have a core."""
    _, measured, places = _at_levels("core", levels, axis, scenes)
    first, second = (_beyond_cores(run, key, axis, places) for run, key in levels)
    both = first.join(second, on=["scene", "at"], suffix="_second").group_by("scene").agg(pl.exclude("at").sum())
    counts = np.zeros((2, 3, len(scenes)))
    for side, suffix in enumerate(("", "_second")):
        for column, name in enumerate(("n", "beyond_u", "beyond_v")):
            counts[side, column, _numbers(both, scenes)] = both[f"{name}{suffix}"].to_numpy()
    n, beyond = counts[:, :1], counts[:, 1:]
    share = beyond.sum(axis=0) / np.maximum(n.sum(axis=0), 1.0)
    enough = share * n.min(axis=0) >= LEAST_OUTLIERS
    logs = np.where(enough, np.log((beyond + 0.5) / (n + 1.0)), np.nan)
    return differences(logs.transpose(2, 0, 1), measured, logarithms=True, n_coordinates=2)


def _beyond_cores(run: RunErrors, key: Condition, axis: str, places: NDArray[np.int64]) -> pl.DataFrame:
    """Columns scene, at, n, beyond_u and beyond_v of the rows that have a core."""
    table = run.scales[key].filter(pl.col("n") >= LEAST_FEATURES["core"], axis=axis, **run.errors)
    zero = run.key_frames.get(str(key[_DIRECTION]), 0) if axis == Axis.frame else 0
    rows = table.select_seq("scene", pl.col("at").cast(pl.Int64) - zero, "n", "beyond_u", "beyond_v").drop_nulls()
    return rows.filter(pl.col("at").is_in(places.tolist()))


def number_differences(tables: Sequence[pl.DataFrame], scenes: Sequence[str], *, logarithms: bool) -> Differences:
    """Differences of numbers, or of their logarithms, at every place that all levels have.

    Parameters
    ----------
    tables
        Columns of `NUMBERS`, one row per scene and place.
    scenes
        Names of all scenes, in the order of the result.
    """
    placed_at = [table["at"].drop_nulls().unique().to_numpy() for table in tables]
    places = reduce(np.intersect1d, placed_at).astype(np.int64)
    placed = places if any(map(len, placed_at)) else None
    values = np.stack([_of_places(table, placed, scenes) for table in tables], axis=1)
    with np.errstate(divide="ignore"):
        levels = np.log(values) if logarithms else values
    measured = np.stack([_are_in(table, scenes) for table in tables], axis=1)
    return differences(levels, measured, logarithms=logarithms, places=places)


def _of_places(table: pl.DataFrame, places: NDArray[np.int64] | None, scenes: Sequence[str]) -> NDArray[np.float64]:
    """Values (scenes, places), or (scenes, 1) of single numbers, which have no places; NaN where there are none."""
    values = np.full((len(scenes), 1 if places is None else max(len(places), 1)), np.nan)
    rows = table if places is None else table.filter(pl.col("at").is_in(places.tolist()))
    at = np.zeros(rows.height, dtype=np.intp) if places is None else np.searchsorted(places, rows["at"].to_numpy())
    values[_numbers(rows, scenes), at] = rows["value"].cast(pl.Float64).fill_null(np.nan).to_numpy()
    return values


def outlier_differences(tables: Sequence[pl.DataFrame], scenes: Sequence[str]) -> Differences:
    """Differences between the logarithms of (scene ratio), with a single point. `scenes`: of the dataset, sorted.

    `tables`: `FRAME_COUNTS` of each level. A level whose tracker does not report outliers takes no part.
    """
    counts = [total_if_known(name, pl.col(name).cast(pl.Int64).sum()) for name in ("offered", "outliers")]
    sums = [table.group_by("scene").agg(counts) for table in tables]
    offered, outliers = (_of_scenes(sums, name, scenes) for name in ("offered", "outliers"))
    pairs = pairs_of(len(tables))
    log_ratio = np.log((outliers + 0.5) / (offered + 1))
    ratio = outliers[:, pairs].sum(axis=2) / np.maximum(offered[:, pairs].sum(axis=2), 1)
    expected = ratio * offered[:, pairs].min(axis=2)
    values = np.where(expected >= LEAST_OUTLIERS, log_ratio[:, pairs[:, 0]] - log_ratio[:, pairs[:, 1]], np.nan)
    measured = np.stack([_are_in(table, scenes) for table in tables], axis=1)
    of_ratios = _of_numbers(values, measured, np.full(len(pairs), np.nan))
    scarce = np.asarray(_mean_of_scenes(outliers[:, pairs], ~np.isnan(values)) < SCARCE, dtype=np.bool_)
    return replace(of_ratios, scarce=scarce, gap=_FEW if scarce.any() else None)


def lifetime_differences(tables: Sequence[pl.DataFrame], scenes: Sequence[str]) -> Differences:
    """The same of (scene lifetime). `tables`: `ENDS` of each level."""
    lifetimes = np.unique(np.concatenate([table["lifetime"].to_numpy() for table in tables]))
    ended, censored = (_by_lifetime(tables, name, scenes, lifetimes) for name in ("n_ended", "n_censored"))
    followed = follow_up(ended, censored, lifetimes=lifetimes)
    measured = np.asarray(~np.isnan(followed), dtype=np.bool_)
    pairs = pairs_of(len(tables))
    longest = ((ended + censored > 0) * lifetimes).max(axis=2, initial=0)
    reached = followed[:, pairs].min(axis=2)
    compared = _long_enough(reached, longest[:, pairs].min(axis=2), at_both(measured))
    limits = np.where(compared, reached, np.inf).min(axis=0, initial=np.inf)
    horizon = np.minimum(limits, lifetimes.max(initial=0))
    compared = np.asarray(compared & (horizon >= _LEAST_HORIZON), dtype=np.bool_)
    until = [
        _until(ended[:, pair], censored[:, pair], frames, lifetimes)
        for pair, frames in zip(pairs, horizon, strict=True)
    ]
    means, alive = np.array(until).reshape(len(pairs), 2, len(scenes), 2).transpose(1, 2, 0, 3)
    logs = np.log(np.where(compared[..., None], means, np.nan))
    of_lifetimes = _of_numbers(logs[..., 0] - logs[..., 1], measured, horizon)
    outlived = (_mean_of_scenes(alive, compared) > _MOST_ALIVE).any()
    return replace(of_lifetimes, gap=_OUTLIVED if outlived else None)


def _long_enough(
    reached: NDArray[np.float64], longest: NDArray[np.float64], both: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Scenes that take part (scenes, pairs): all, if enough of them do not have a follow-up that is not too short."""
    typical = [
        np.median(column[there]) if there.any() else 0.0 for column, there in zip(longest.T, both.T, strict=True)
    ]
    enough = both & (reached >= LEAST_FOLLOW_UP * np.array(typical))
    return np.asarray(np.where(enough.sum(axis=0) >= MIN_SCENES, enough, both), dtype=np.bool_)


def _until(
    ended: NDArray[np.float64], censored: NDArray[np.float64], horizon: float, lifetimes: NDArray[np.integer]
) -> NDArray[np.float64]:
    """Restricted means to a horizon, and shares of tracks that live to its last frame, (2, scenes, levels)."""
    before, mean = (restricted_mean(ended, censored, frames, lifetimes=lifetimes) for frames in (horizon - 1, horizon))
    return np.stack([mean, mean - before])


def _mean_of_scenes(values: NDArray[np.float64], there: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Means of values (scenes, pairs, 2) over the scenes that are there, (pairs, 2); 0 without any."""
    count = np.maximum(there.sum(axis=0), 1)[:, None]
    return np.asarray(np.where(there[..., None], values, 0.0).sum(axis=0) / count)


def _of_numbers(values: NDArray[np.float64], measured: NDArray[np.bool_], horizon: NDArray[np.float64]) -> Differences:
    """Differences (scenes, pairs) that have a single point."""
    pairs = pairs_of(measured.shape[1])
    unlike = np.zeros((len(pairs), 1), dtype=np.bool_)
    return Differences(values[..., None], pairs, at_both(measured), unlike, horizon, none_scarce(pairs))


def _numbers(table: pl.DataFrame, scenes: Sequence[str]) -> NDArray[np.int64]:
    """Place of the scene of each row."""
    return table["scene"].cast(pl.Enum(scenes)).to_physical().to_numpy().astype(np.int64)


def _are_in(table: pl.DataFrame, scenes: Sequence[str]) -> NDArray[np.bool_]:
    present = np.zeros(len(scenes), dtype=np.bool_)
    present[_numbers(table, scenes)] = True
    return present


def _of_scenes(tables: Sequence[pl.DataFrame], column: str, scenes: Sequence[str]) -> NDArray[np.float64]:
    """Counts of a column, (scenes, levels)."""
    counts = np.zeros((len(scenes), len(tables)))
    for level, table in enumerate(tables):
        counts[_numbers(table, scenes), level] = table[column].to_numpy()
    return counts


def _by_lifetime(
    tables: Sequence[pl.DataFrame], column: str, scenes: Sequence[str], lifetimes: NDArray[np.integer]
) -> NDArray[np.float64]:
    """Counts of a column, (scenes, levels, lifetimes), blocks added up."""
    shape = len(scenes), len(lifetimes)
    counts = np.empty((shape[0], len(tables), shape[1]))
    for level, table in enumerate(tables):
        place = _numbers(table, scenes) * shape[1] + np.searchsorted(lifetimes, table["lifetime"].to_numpy())
        counts[:, level] = np.bincount(place, table[column].to_numpy(), shape[0] * shape[1]).reshape(shape)
    return counts
