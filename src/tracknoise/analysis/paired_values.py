"""The values of statistics in two runs, paired by scene."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.factor_values import LEAST_FEATURES, LEAST_OUTLIERS, SIGNED, AllValues, SceneValues
from tracknoise.inference.paired_differences import Differences, differences
from tracknoise.inference.units import MIN_SCENES
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import Condition, TablesByCondition
from tracknoise.tables.enumerations import Axis


@dataclass(frozen=True, slots=True)
class PairedValues:
    """What changed in every scene from the first run to the second.

    Points are places (ages, frames or lengths of windows) times coordinates, the coordinate running fastest.

    Attributes
    ----------
    change : (scenes, points) float64
        Second run minus first run: of logarithms for ratios, otherwise in the unit. NaN where a scene lacks one.
    both : (scenes,) bool
        Which scenes were measured in both runs, whether or not they have a value.
    unlike : (points,) bool
        Where a scene has a value of 0 in one of the runs only, so that there is no ratio.
    places : (places,) int64
        Empty for a statistic that is a single number.
    n_coordinates
        2 if u and v have points of their own, else 1.
    total : (scenes, points) float64 or None
        Sum of both runs, for mean errors.
    horizon
        Common horizon of lifetimes, frames.
    scarce
        Whether the first run, and whether the second, has so few events that its value is too large.
    scale_px
        For mean errors: the error that a margin is a share of; None where it is unknown.
    """

    change: NDArray[np.float64]
    both: NDArray[np.bool_]
    unlike: NDArray[np.bool_]
    places: NDArray[np.int64]
    n_coordinates: int = 1
    total: NDArray[np.float64] | None = None
    horizon: float | None = None
    scarce: tuple[bool, bool] = (False, False)
    scale_px: float | None = None

    def place(self, point: int) -> int | None:
        """Age, frame or window of a point; None for a single number."""
        return int(self.places[point // self.n_coordinates]) if len(self.places) else None

    def coordinate(self, point: int) -> str | None:
        """Coordinate of a point; None where both have one value."""
        return "uv"[point % 2] if self.n_coordinates > 1 else None


NO_PLACES = np.zeros(0, dtype=np.int64)


def of_differences(found: Differences) -> PairedValues:
    """What `Differences` of two levels, the second run before the first, hold of a single number."""
    horizon = None if np.isnan(found.horizon[0]) else float(found.horizon[0])
    second, first = found.scarce[0].tolist()
    return PairedValues(
        found.values[:, 0], found.both[:, 0], found.unlike[0], NO_PLACES, horizon=horizon, scarce=(first, second)
    )


def paired(
    levels: tuple[NDArray[np.float64], NDArray[np.float64]],
    measured: NDArray[np.bool_],
    places: NDArray[np.int64] = NO_PLACES,
    *,
    n_coordinates: int = 1,
    logarithms: bool = True,
) -> PairedValues:
    """Changes of values that every run has on its own.

    Shapes: measured (scenes, 2). `levels`: first and second run: values of a scene, or their logarithms: -inf where a
    value is 0, NaN where there is none.
    """
    first, second = levels
    found = differences(np.stack([second, first], axis=1), measured, logarithms=logarithms)
    return PairedValues(found.values[:, 0], found.both[:, 0], found.unlike[0], places, n_coordinates)


NUMBERS = {"scene": pl.String, "at": pl.Int64, "value": pl.Float64}
"""Columns of a table of numbers: null where a scene has none. `at` is null for single numbers."""


def number_values(
    first: pl.DataFrame, second: pl.DataFrame, scenes: Sequence[str], *, logarithms: bool
) -> PairedValues:
    """Changes of numbers, at every place that both runs have.

    Parameters
    ----------
    first, second
        Columns of `NUMBERS`, one row per scene and place.
    scenes
        Names of all scenes, in the order of the result.
    logarithms
        Whether logarithms are compared.
    """
    known, other = (table["at"].drop_nulls().unique().to_numpy() for table in (first, second))
    places = np.intersect1d(known, other).astype(np.int64)
    placed = bool(len(known) or len(other))
    with np.errstate(divide="ignore"):
        values = [_levels(table, places if placed else None, scenes) for table in (first, second)]
        before, after = (np.log(array) if logarithms else array for array in values)
    measured = np.stack([np.isin(scenes, table["scene"].to_numpy()) for table in (first, second)], axis=1)
    return paired((before, after), measured, places, logarithms=logarithms)


def _levels(table: pl.DataFrame, places: NDArray[np.int64] | None, scenes: Sequence[str]) -> NDArray[np.float64]:
    """Values (scenes, places), or (scenes, 1) of single numbers, which have no places; NaN where there are none."""
    values = np.full((len(scenes), 1 if places is None else max(len(places), 1)), np.nan)
    rows = table if places is None else table.filter(pl.col("at").is_in(places.tolist()))
    scene = rows["scene"].cast(pl.Enum(scenes)).to_physical().to_numpy().astype(np.intp)
    at = np.zeros(rows.height, dtype=np.intp) if places is None else np.searchsorted(places, rows["at"].to_numpy())
    values[scene, at] = rows["value"].cast(pl.Float64).fill_null(np.nan).to_numpy()
    return values


_LEAST_AGES = 3
"""Fewest ages of a scene through which a line is fitted."""
_Values = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RunErrors:
    """Errors of one run.

    Attributes
    ----------
    values
        What single scenes measured. Both runs have the same scenes in the same order.
    scales
        `SCALES` of the same errors, by condition.
    key_frames
        Where curves run along frames: the one in which errors are zero, by direction.
    """

    values: AllValues
    scales: TablesByCondition
    key_frames: Mapping[str, int]


def error_values(
    runs: tuple[RunErrors, RunErrors], keys: tuple[Condition, Condition], scenes: Sequence[str]
) -> Iterator[tuple[str, Axis, PairedValues]]:
    """Statistics of errors of one condition.

    Parameters
    ----------
    runs
        First and second run.
    keys
        The condition in each of them; they may differ in the tracker.
    scenes
        Names of all scenes of the dataset, in the order of the arrays.

    Yields
    ------
    str, Axis, PairedValues
        Name of the statistic, what its places are, and its values.
    """
    for axis in Axis:
        first, second = (run.values.conditions.get((key, axis)) for run, key in zip(runs, keys, strict=True))
        if first is None or second is None:
            continue
        known, other = (run.values.places.get((str(keys[0][0]), axis), NO_PLACES) for run in runs)
        places, of_first, of_second = np.intersect1d(known, other, assume_unique=True, return_indices=True)
        found = _at(first, of_first), _at(second, of_second)
        measured = np.stack([first.measured, second.measured], axis=1)
        yield from ((name, axis, values) for name, values in _of_curves(found, measured, places, axis))
        yield "tails", axis, _tails(runs, keys, axis, places, scenes, measured)


def _at(values: SceneValues, places: NDArray[np.intp]) -> dict[str, _Values]:
    """Values at some places, (scenes, points), by role."""
    return {role: array[:, places].reshape(len(array), -1) for role, array in values.values.items()}


def _of_curves(
    found: tuple[dict[str, _Values], dict[str, _Values]],
    measured: NDArray[np.bool_],
    places: NDArray[np.int64],
    axis: Axis,
) -> Iterator[tuple[str, PairedValues]]:
    """Statistics that have a value at every place, and the growth with age."""
    missing = np.full((len(measured), 2 * len(places)), np.nan)

    def levels(role: str) -> tuple[_Values, _Values]:
        return found[0].get(role, missing), found[1].get(role, missing)

    yield "core", paired(levels("core"), measured, places, n_coordinates=2)
    second = paired(levels("second"), measured, places, n_coordinates=2)
    yield "second_moment", second
    signed = paired(levels(SIGNED), measured, places, n_coordinates=2, logarithms=False)
    scale_px = _scale_px(levels("core"), 1) or _scale_px(levels("second"), 2)
    yield "bias", replace(signed, total=np.add(*levels(SIGNED)), scale_px=scale_px)
    if axis == Axis.age:
        yield "growth", _growth(second)


def _scale_px(levels: tuple[_Values, _Values], power: int) -> float | None:
    """Geometric mean over runs, scenes and places, of logarithms of a power of a length; None where there is none."""
    logs = np.concatenate([array.ravel() for array in levels])
    finite = logs[np.isfinite(logs)]
    return float(np.exp(finite.mean() / power)) if len(finite) else None


def _growth(second: PairedValues) -> PairedValues:
    """Change of the logarithm of the growth of second moments, by lines through the logarithms of each scene.

    Both runs have values at the same ages, so that the difference of both slopes is the slope of the difference.
    """
    change = second.change.reshape(len(second.change), -1, 2)
    common = (~np.isnan(change)).any(axis=2).sum(axis=0) >= MIN_SCENES
    logs, change = np.log(second.places[common]), change[:, common]
    there = ~np.isnan(change)
    count = np.maximum(there.sum(axis=1), 1)
    centred = np.where(there, logs[:, None] - (there * logs[:, None]).sum(axis=1, keepdims=True) / count[:, None], 0.0)
    spread = (centred**2).sum(axis=1)
    enough = (there.sum(axis=1) >= _LEAST_AGES) & (spread > 0)
    slope = (centred * np.where(there, change, 0.0)).sum(axis=1) / np.where(enough, spread, np.nan)
    span = float(np.ptp(logs)) if len(logs) else np.nan
    return PairedValues(slope * span, second.both, np.zeros(2, dtype=np.bool_), NO_PLACES, 2)


def _tails(
    runs: tuple[RunErrors, RunErrors],
    keys: tuple[Condition, Condition],
    axis: Axis,
    places: NDArray[np.int64],
    scenes: Sequence[str],
    measured: NDArray[np.bool_],
) -> PairedValues:
    """Change of the logarithm of the share of errors beyond three cores, at ages where both runs have a core."""
    first, second = (_counts(run, key, axis, places) for run, key in zip(runs, keys, strict=True))
    both = first.join(second, on=["scene", "at"], suffix="_second").group_by("scene").agg(pl.exclude("at").sum())
    place = both["scene"].cast(pl.Enum(scenes)).to_physical().to_numpy().astype(np.intp)
    counts = np.zeros((2, 3, len(scenes)))
    for side, suffix in enumerate(("", "_second")):
        for column, name in enumerate(("n", "beyond_u", "beyond_v")):
            counts[side, column, place] = both[f"{name}{suffix}"].to_numpy()
    n, beyond = counts[:, :1], counts[:, 1:]
    share = beyond.sum(axis=0) / np.maximum(n.sum(axis=0), 1.0)
    enough = share * n.min(axis=0) >= LEAST_OUTLIERS
    logs = np.where(enough, np.log((beyond + 0.5) / (n + 1.0)), np.nan)
    return paired((logs[0].T, logs[1].T), measured, n_coordinates=2)


def _counts(run: RunErrors, key: Condition, axis: Axis, places: NDArray[np.int64]) -> pl.DataFrame:
    """Columns scene, at, n, beyond_u and beyond_v of the rows that have a core."""
    table = run.scales[key].filter(pl.col("n") >= LEAST_FEATURES["core"], axis=axis)
    zero = run.key_frames.get(str(key[POOLED.index("direction")]), 0) if axis == Axis.frame else 0
    rows = table.select_seq("scene", pl.col("at").cast(pl.Int64) - zero, "n", "beyond_u", "beyond_v").drop_nulls()
    return rows.filter(pl.col("at").is_in(places.tolist()))
