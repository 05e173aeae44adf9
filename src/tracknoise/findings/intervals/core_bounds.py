"""Intervals of the robust scale of errors: the geometric mean over scenes of each scene's own core.

A core comes from a median, which does not add up over scenes or blocks. Its logarithm is what is averaged over scenes.
With too few scenes, the logarithms of the cores of blocks are resampled within each scene. The width of the interval is
then theirs, and its centre is the geometric mean of the cores of the scenes.
"""

from dataclasses import replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.intervals.between_scenes import between_scenes, geometric_rows
from tracknoise.findings.sampling.bounds import LabelledEstimates, Method, geometric
from tracknoise.findings.sampling.draws import Draws
from tracknoise.findings.sampling.groups import NO_GROUPS, SceneGroups
from tracknoise.findings.sampling.units import Units, units_of
from tracknoise.tables.enumerations import Resampled, Weighting

CORE = "core"
_AXES = ("u", "v")
_POINT = ["trimming", "axis", "at"]
_SUMS = ("known_u", "log_u", "known_v", "log_v")


def core_bounds(
    scales: pl.DataFrame,
    blocks: pl.DataFrame | None,
    draws: Draws,
    method: Method,
    groups: SceneGroups = NO_GROUPS,
) -> LabelledEstimates:
    """Geometric mean over scenes of their cores, of u and of v at every point.

    Parameters
    ----------
    scales
        Columns of `SCALES`, rows of one condition and population.
    blocks
        The same of `SCALE_BLOCKS`, for conditions of too few scenes.
    draws
        Of all scenes of the dataset.
    method
        How to make intervals.
    groups
        Groups of scenes that are not independent of each other.
    """
    by_scene = _units(scales, None, groups)
    units = by_scene if by_scene.resampled or blocks is None else _units(scales, blocks, groups)
    held = np.transpose(units.sums[..., 0::2], (2, 1, 0))
    found = geometric(units, draws.weights(units), _logarithms, method, sizes=held)
    if units.resampled == Resampled.blocks:
        value = geometric(by_scene, np.empty((0, len(by_scene.sums))), _logarithms, Method()).value
        moved = value / np.where(found.value > 0, found.value, np.nan)
        found = replace(found, value=value, low=found.low * moved, high=found.high * moved)
    between = between_scenes(by_scene, _cores, ["log"] * len(_AXES), found)
    labels = pl.DataFrame({"coordinate": _AXES}).join(by_scene.points, how="cross")
    named = labels.with_columns_seq(statistic=pl.lit(CORE), weighting=pl.lit(Weighting.geometric))
    return LabelledEstimates(named, found, units, geometric_rows(between, range(len(_AXES))))


def _units(scales: pl.DataFrame, blocks: pl.DataFrame | None, groups: SceneGroups) -> Units:
    """Units by scene, or by block at the same points."""
    if blocks is None:
        return units_of(_sums(scales), points=_POINT, columns=_SUMS, groups=groups)
    everywhere = scales.select_seq(_POINT).unique().join(scales.select_seq("scene").unique(), how="cross")
    missing = everywhere.with_columns_seq(block=pl.lit(0, dtype=pl.UInt8), **{name: pl.lit(0.0) for name in _SUMS})
    known = _sums(blocks).join(everywhere, on=[*_POINT, "scene"], how="semi")
    columns = [*_POINT, "scene", "block", *_SUMS]
    every = pl.concat([known.select_seq(columns), missing.select_seq(columns)])
    return units_of(_sums(scales), every, points=_POINT, columns=_SUMS, groups=groups)


def _sums(scales: pl.DataFrame) -> pl.DataFrame:
    """Rows with the columns of `_SUMS`, 0 where a scene has no core."""
    parts = {}
    for axis in _AXES:
        core = pl.col(f"core_{axis}_px")
        parts[f"known_{axis}"] = core.is_not_null().cast(pl.Float64)
        parts[f"log_{axis}"] = core.log().fill_null(0.0)
    return scales.with_columns_seq(**parts)


def _logarithms(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean logarithm of u and of v from `_SUMS`, (2, points, ...), NaN where there is none."""
    known, total = sums[0::2], sums[1::2]
    return np.asarray(total / np.where(known > 0, known, np.nan))


def _cores(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.exp(_logarithms(sums))
