"""What single scenes measured in each condition: the values that the levels of a factor are compared by, as arrays.

At each age (or frame) and coordinate, a scene has the mean of its errors (px), and the logarithms of their mean
absolute value, their second moment about zero and their core (scene value). A value that rests on fewer features than
`LEAST_FEATURES` counts as missing: the logarithm of a second moment of few errors is too small, the more so the heavier
their tails. Turned images are in the axes of the upright image.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.sampling.units import additive
from tracknoise.statistics.conditions import Condition, TablesByCondition
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.errors.scales import LEAST_ERRORS
from tracknoise.statistics.factors.differences import comparable
from tracknoise.tables.enumerations import Weighting
from tracknoise.tables.schema import CURVES, check

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
        As in `tracknoise.statistics.factors.differences.comparable`, which says where curves may be compared.
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
    """Values in u and v, (rows, 2), of rows of moments; NaN where there is at most one feature."""
    sums, n = additive(table), table["n"].to_numpy()[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        mean, absolute = (_columns(sums, *names) / n for names in (("u", "v"), ("abs_u", "abs_v")))
        second = _columns(sums, "uu", "vv") / (n - 1)
        return {SIGNED: mean, "absolute": np.log(absolute), "second": np.log(second)}


def _of_scales(table: pl.DataFrame) -> _Columns:
    """The same of rows of scales."""
    return {"core": np.log(_columns(table, "core_u_px", "core_v_px"))}


def _columns(table: pl.DataFrame, u: str, v: str) -> NDArray[np.float64]:
    return table.select_seq(pl.col(u, v).cast(pl.Float64).fill_null(np.nan)).to_numpy()


def _upright(values: NDArray[np.float64], key: Condition, role: str) -> NDArray[np.float64]:
    """Values in the axes of the upright image, as in `tracknoise.statistics.upright`."""
    sign = -1.0 if role == SIGNED else 1.0
    for _ in range(int(key[_ROTATION]) // 90):
        values = np.stack([sign * values[..., 1], values[..., 0]], axis=-1)
    return values
