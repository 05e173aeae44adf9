"""What the models of growth are fitted to and compared with, by unit: one condition and trimming."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.growth.grown import GROWTH_SUMS
from tracknoise.findings.growth.scene_curves import UnitSums
from tracknoise.findings.intervals.change_bounds import CHANGE_SUMS
from tracknoise.findings.sampling.groups import SceneGroups
from tracknoise.findings.sampling.units import Units, units_of
from tracknoise.statistics.definitions import LAGS
from tracknoise.tables.enumerations import Resampled

Array = NDArray[np.float64]
FOURTH_SUMS = ("fourth_u", "fourth_v")
"""Sums of the fourth powers of errors."""
_LIVED = ["at_least", "since"]


@dataclass(frozen=True, slots=True)
class GrowthUnits:
    """Sums of the same units: of errors, of changes, and of long-lived tracks.

    Attributes
    ----------
    errors
        Points by `since`; columns `GROWTH_SUMS`.
    changes : (units, lags, columns)
        Columns `CHANGE_SUMS`; 0 where there are none.
    lived : (units, ages, columns)
        Columns `GROWTH_SUMS`, by the age that tracks live to.
    fourth : (units, ages, 2)
        Sums of the fourth powers of u and v, where units are scenes.
    """

    errors: Units
    changes: Array
    lived: Mapping[int, Array]
    fourth: Array | None = None

    def of(self, coordinate: int) -> UnitSums:
        """Sums of one coordinate, u or v."""
        lagged, squares = (
            self.changes[..., CHANGE_SUMS.index(f"{name}_{'uv'[coordinate] * 2}")] for name in ("lagged", "squares")
        )
        sums = self.errors.sums
        n_units = len(sums) // max(len(self.errors.scenes), 1)
        scene = np.repeat(np.arange(len(self.errors.scenes)), n_units)
        return UnitSums(sums[..., 0], sums[..., 1 + coordinate], lagged, squares, scene)

    def lived_of(self, coordinate: int) -> dict[int, tuple[Array, Array]]:
        """Number of errors and sum of their squares of one coordinate, (units, ages), by the age tracks live to."""
        return {age: (sums[..., 0], sums[..., 1 + coordinate]) for age, sums in self.lived.items()}


def with_fourth(moments: pl.DataFrame) -> pl.DataFrame:
    """Rows of `MOMENTS` with the columns `FOURTH_SUMS`."""
    return moments.with_columns_seq(_fourth(axis).alias(name) for axis, name in zip("uv", FOURTH_SUMS, strict=True))


def _fourth(axis: str) -> pl.Expr:
    """Sum of fourth powers about zero, from that about the mean."""
    second, third, fourth = (pl.col(f"m_{power * axis}") for power in (2, 3, 4))
    mean = pl.col(f"mean_{axis}")
    return fourth + 4 * mean * third + 6 * mean**2 * second + pl.col("n") * mean**4


def growth_units(
    scenes: pl.DataFrame,
    blocks: pl.DataFrame | None,
    changes: pl.DataFrame | None,
    lived: pl.DataFrame | None,
    lived_blocks: pl.DataFrame | None,
    groups: SceneGroups,
) -> GrowthUnits:
    """Sums of errors by unit, with those of changes and of long-lived tracks of the same units.

    Parameters
    ----------
    scenes, blocks
        Of errors, by scene and by block: columns dataset, scene (and block), since and `GROWTH_SUMS`; of scenes
        `FOURTH_SUMS`.
    changes
        Columns dataset, scene, block, lag and `CHANGE_SUMS`.
    lived, lived_blocks
        Of long-lived tracks, by scene and by block: columns scene (and block), at_least, since and `GROWTH_SUMS`.
    groups
        Groups of scenes that are not independent of each other.
    """
    errors = units_of(scenes, blocks, points=["since"], columns=GROWTH_SUMS, groups=groups).across_groups()
    by_block = errors.resampled == Resampled.blocks
    of_changes = np.zeros((len(errors.sums), LAGS, len(CHANGE_SUMS)))
    if changes is not None:
        own = changes if by_block else None
        units = units_of(changes, own, points=["lag"], columns=CHANGE_SUMS, groups=groups)
        of_changes[:, units.points["lag"].to_numpy().astype(np.intp) - 1] = _aligned(units, errors)
    if lived is None or (by_block and lived_blocks is None):
        return GrowthUnits(errors, of_changes, {})
    units = units_of(lived, lived_blocks if by_block else None, points=_LIVED, columns=GROWTH_SUMS, groups=groups)
    fourth = None if by_block else units_of(scenes, points=["since"], columns=FOURTH_SUMS).sums
    return GrowthUnits(errors, of_changes, _by_age(units, errors), fourth)


def _aligned(units: Units, like: Units) -> Array:
    """Sums of units in the order of others; 0 for a scene that is missing."""
    each = len(units.sums) // max(len(units.scenes), 1)
    by_scene = units.sums.reshape(len(units.scenes), each, *units.sums.shape[1:])
    placed = np.zeros((len(like.scenes), *by_scene.shape[1:]))
    known = [place for place, scene in enumerate(units.scenes) if scene in like.scenes]
    placed[[like.scenes.index(units.scenes[place]) for place in known]] = by_scene[known]
    return placed.reshape(-1, *units.sums.shape[1:])


def _by_age(units: Units, errors: Units) -> dict[int, Array]:
    """Sums of long-lived tracks at the ages of all errors, by the age that tracks live to."""
    aligned = _aligned(units, errors)
    ages = errors.points["since"].to_numpy()
    found: dict[int, Array] = {}
    for key, part in units.points.with_row_index("place").partition_by("at_least", as_dict=True).items():
        there = part.filter(pl.col("since").is_in(ages.tolist()))
        sums = np.zeros((len(aligned), len(ages), len(GROWTH_SUMS)))
        sums[:, np.searchsorted(ages, there["since"].to_numpy())] = aligned[:, there["place"].to_numpy()]
        found[int(key[0])] = sums
    return found
