"""What factors are compared by: which conditions are their levels, and what single scenes measured in each.

A cell is one factor with all others held, and its levels are conditions.

At each age (or frame) and coordinate, a scene has the mean of its errors (px), and the logarithms of their mean
absolute value, their second moment about zero and their core (scene value). A value that rests on fewer features than
`LEAST_FEATURES` counts as missing: the logarithm of a second moment of few errors is too small, the more so the heavier
their tails. Turned images are in the axes of the upright image.

- An outlier ratio is (outliers + 1/2) / (offered + 1) (scene ratio), and levels differ by its logarithm. A scene takes
  no part in a pair if its counts are too small: if both levels had the same ratio, at least `LEAST_OUTLIERS` outliers
  must be expected at each of them. A level with fewer than `SCARCE` outliers per scene is scarce: the 1/2 makes its
  ratio too large, so that the other level may differ by more than any bound.
- A lifetime is the mean of min(lifetime, horizon) by Kaplan and Meier, in frames that the tracker saw (scene lifetime),
  and levels differ by its logarithm. The horizon is the largest lifetime up to which all scenes of a pair have
  follow-up at both levels. Without it, a lifetime would depend on where sequences end. Scenes whose follow-up is less
  than `LEAST_FOLLOW_UP` of the longest lifetimes of a typical scene take no part. If most tracks outlive a short
  horizon, this does not show that lifetimes are alike: nothing is shown then.

An option is a factor for trackers of one kind that differ in exactly this option, such as the detector. The difference
between two such trackers is the effect of the option. Trackers that differ in several options are compared as trackers
only.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import additive
from tracknoise.inference.paired_differences import Differences, at_both, none_scarce, pairs_of
from tracknoise.inference.survival import follow_up, restricted_mean
from tracknoise.inference.units import MIN_SCENES
from tracknoise.statistics.definitions import NAMES, POOLED
from tracknoise.statistics.grouping import Condition, TablesByCondition, total_if_known
from tracknoise.statistics.scales import LEAST_ERRORS
from tracknoise.statistics.yardstick import comparable
from tracknoise.tables.enumerations import Weighting
from tracknoise.tables.schema import CONDITION, CURVES, EFFECTS, check

CORE = "core"
"""Name of the robust scale, which is compared although `EFFECTS` lacks it."""
_ROLES: Mapping[str, str] = {
    **{name: role for names in NAMES.values() for role, name in names.items()},
    CORE: CORE,
    "lifetime": "lifetime",
    "outlier_ratio": "outlier_ratio",
}
DISAGREE = "references of the two kinds disagree about"
"""How a reason begins why a comparison is undecided that references together, or each kind in its own way, decide."""
_LEFT_OUT = "central"
"""Central second moments: the comparison of second moments and of means says what they say."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One factor, with all others held.

    Attributes
    ----------
    factor, held
        The factor, and the values of the other columns of the condition, and of `dataset`.
    axis
        Axis of the curves; None for numbers without one.
    levels
        The conditions to compare, by the value of the factor, sorted.
    statistics
        Name of each statistic that is asked about, by its role.
    """

    factor: str
    held: Mapping[str, object]
    axis: str | None
    levels: Mapping[object, Condition]
    statistics: Mapping[str, str]

    @property
    def dataset(self) -> str:
        """Name of the dataset."""
        return str(self.held["dataset"])

    @property
    def key(self) -> dict[str, object]:
        """The columns of the table that identify the cell."""
        names = {name: self.held.get(name) for name in CONDITION}
        return {"dataset": self.held["dataset"], "factor": self.factor, **names, "axis": self.axis}


def cells(effects: pl.DataFrame, conditions: list[Condition]) -> Iterator[Cell]:
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


LEAST_FEATURES: Mapping[str, int] = {"mean": 10, "absolute": 10, "second": 30, "core": LEAST_ERRORS}
"""Fewest features that a value at one age rests on, by role of the statistic."""
SIGNED = "mean"
"""Role of the statistic that has a sign and therefore no logarithm."""
_ROTATION = POOLED.index("rotation")
_Columns = Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True, slots=True)
class SceneValues:
    """Values of the scenes of one dataset in one condition, along one axis.

    Attributes
    ----------
    values : (scenes, places, 2) float64
        By the role of the statistic, in u and v: px of the mean, otherwise logarithms, -inf where a value is 0. NaN
        where it is missing.
    measured : (scenes,) bool
        Which scenes were measured in this condition, whether or not they have any value.
    """

    values: Mapping[str, NDArray[np.float64]]
    measured: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class AllValues:
    """Values of all conditions of all datasets.

    Attributes
    ----------
    places
        Ages, or frames from the key frame on, of each dataset and axis, sorted.
    conditions
        By condition and axis.
    """

    places: Mapping[tuple[str, str], NDArray[np.int64]]
    conditions: Mapping[tuple[Condition, str], SceneValues]


def scene_values(
    moments: TablesByCondition,
    scales: TablesByCondition,
    curves: pl.DataFrame,
    *,
    errors: Mapping[str, str],
    key_frames: Mapping[str, int],
    scenes: Mapping[str, Sequence[str]],
) -> AllValues:
    """Values by (scene value), at the points of curves that may be compared.

    Parameters
    ----------
    moments, scales
        `MOMENTS` and `SCALES` of all scenes.
    curves
        What was made of the same scenes; it says where curves are cut.
    errors
        Which errors: population and trimming.
    key_frames
        As in `tracknoise.statistics.yardstick.comparable`, which says where curves may be compared.
    scenes
        Names of the scenes of each dataset, in the order of the arrays.

    Raises
    ------
    SchemaError
        If curves have other columns.
    """
    known = check(curves, CURVES, "curves").filter(**errors, weighting=Weighting.features)
    points = comparable(known.select_seq(*POOLED, "axis", "at", "cut", there="at").unique(), key_frames)
    places = {
        (str(dataset), str(axis)): part["at"].unique().sort().to_numpy()
        for (dataset, axis), part in points.partition_by("dataset", "axis", as_dict=True).items()
    }
    there = points.partition_by([*POOLED, "axis"], as_dict=True)
    found = {}
    for *names, axis in known.select_seq(*POOLED, "axis").unique().sort(*POOLED, "axis").rows():
        key, at = tuple(names), places.get((str(names[0]), str(axis)), np.zeros(0, dtype=np.int64))
        rows = [table[key].filter(**errors, axis=axis) if key in table else None for table in (moments, scales)]
        part = there.get((*key, axis), points.clear())
        numbered = part.select_seq(at="there", place=pl.Series(np.searchsorted(at, part["at"].to_numpy())))
        found[key, str(axis)] = _of_condition(key, rows, numbered, scenes[str(key[0])], len(at))
    return AllValues(places, found)


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
    sums, n = additive(table), table["n"].to_numpy()[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        mean, absolute = (_columns(sums, *names) / n for names in (("u", "v"), ("abs_u", "abs_v")))
        second = _columns(sums, "uu", "vv") / n
        return {SIGNED: mean, "absolute": np.log(absolute), "second": np.log(second)}


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


def outlier_differences(tables: Sequence[pl.DataFrame], scenes: Sequence[str]) -> Differences:
    """Differences between the logarithms of (scene ratio), with a single point.

    Parameters
    ----------
    tables
        `FRAME_COUNTS` of each level. A level whose tracker does not report outliers takes no part.
    scenes
        Names of all scenes of the dataset, sorted.
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
    found = _of_numbers(values, measured, np.full(len(pairs), np.nan))
    scarce = np.asarray(_mean_of_scenes(outliers[:, pairs], ~np.isnan(values)) < SCARCE, dtype=np.bool_)
    return replace(found, scarce=scarce, gap=_FEW if scarce.any() else None)


def lifetime_differences(tables: Sequence[pl.DataFrame], scenes: Sequence[str]) -> Differences:
    """Differences between the logarithms of (scene lifetime), with a single point.

    Parameters
    ----------
    tables
        `ENDS` of each level.
    scenes
        Names of all scenes of the dataset, sorted.
    """
    lifetimes = np.unique(np.concatenate([table["lifetime"].to_numpy() for table in tables]))
    ended, censored = (_by_lifetime(tables, name, scenes, lifetimes) for name in ("n_ended", "n_censored"))
    known = follow_up(ended, censored, lifetimes=lifetimes)
    measured = np.asarray(~np.isnan(known), dtype=np.bool_)
    pairs = pairs_of(len(tables))
    longest = ((ended + censored > 0) * lifetimes).max(axis=2, initial=0)
    reached = known[:, pairs].min(axis=2)
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
    found = _of_numbers(logs[..., 0] - logs[..., 1], measured, horizon)
    outlived = (_mean_of_scenes(alive, compared) > _MOST_ALIVE).any()
    return replace(found, gap=_OUTLIVED if outlived else None)


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
    found = np.zeros(len(scenes), dtype=np.bool_)
    found[_numbers(table, scenes)] = True
    return found


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


Options = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class OptionFactor:
    """An option in which alone some trackers differ.

    Attributes
    ----------
    name
        Of the option; those of nested settings with a dot, such as ``detection.detector``.
    of
        Kind of the trackers. Where the same option varies among several sets of trackers of this kind, their names.
    levels
        Name of the tracker with each value of the option, in the order of the trackers.
    """

    name: str
    of: str
    levels: Mapping[str, str]


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
    found = [(kind, levels) for (kind, _), levels in alike.items() if len(levels) > 1]
    kinds = [kind for kind, _ in found]
    return [
        OptionFactor(path, kind if kinds.count(kind) == 1 else ", ".join(levels.values()), levels)
        for kind, levels in found
    ]


def option_cells(cells: Iterable[Cell], factors: Sequence[OptionFactor]) -> Iterator[Cell]:
    """The cells about options: those about trackers, of the trackers that differ in one option alone."""
    for cell in cells:
        for factor in factors if cell.factor == "tracker" else ():
            known = {value: name for value, name in factor.levels.items() if name in cell.levels}
            levels: dict[object, Condition] = {value: cell.levels[name] for value, name in known.items()}
            if len(levels) > 1:
                held = {**cell.held, "tracker": factor.of}
                yield Cell(factor.name, held, cell.axis, levels, cell.statistics)
