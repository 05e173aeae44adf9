"""What is resampled, as arrays of sums that add up: scenes, or blocks of tracks within them where scenes are few.

The scene is the unit of everything: what is said of a condition is said of scenes like those that were measured. With
fewer than `MIN_SCENES` of them no such thing can be said. What is resampled then is blocks, within each scene, and
what follows from that holds for these very scenes only: how much another one would differ is not in it.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.sampling.resampling import MIN_SCENES, N_DRAWS, draws, draws_within
from tracknoise.statistics.blocks import BLOCKS
from tracknoise.statistics.cells import ABOUT_ZERO
from tracknoise.statistics.grouping import group_rows

SUMS = ("n", "u", "v", "uu", "uv", "vv", "abs_u", "abs_v")
"""What `additive` makes of moments: the count, and sums of du, dv, their products about zero, and |du|, |dv|."""


@dataclass(frozen=True, slots=True)
class Units:
    """Sums of every unit of one condition.

    Attributes
    ----------
    sums : (units, points, columns) float64
        0 where a unit has nothing.
    points
        What tells the points apart: a row each, sorted.
    scenes
        Names of the scenes that have anything, sorted.
    scene : (units,) intp
        Place of each unit's scene in `scenes`, never decreasing.
    resampled
        `scenes` or `blocks`; None if neither can be: too few scenes, and no blocks.
    """

    sums: NDArray[np.float64]
    points: pl.DataFrame
    scenes: tuple[str, ...]
    scene: NDArray[np.intp]
    resampled: str | None

    def contributing(self, present: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """How many units, and how many scenes, take part in each number.

        Parameters
        ----------
        present : (..., units)
            Whether a unit does.

        Returns
        -------
        n_units, n_scenes : (...) intp
        """
        if not self.scenes:
            nothing = np.zeros(present.shape[:-1], dtype=np.intp)
            return nothing, nothing
        starts = np.searchsorted(self.scene, np.arange(len(self.scenes)))
        by_scene = np.logical_or.reduceat(present, starts, axis=-1)
        return present.sum(axis=-1), by_scene.sum(axis=-1)


class Draws:
    """Draws of all scenes of a dataset, shared by its conditions: a scene is drawn with all that belongs to it.

    Parameters
    ----------
    scenes
        Names of all scenes of the dataset, in any order.
    n_draws, seed
        As in `tracknoise.findings.sampling.resampling.draws`.
    """

    def __init__(self, scenes: Sequence[str], *, n_draws: int = N_DRAWS, seed: int = 0) -> None:
        self._place = {scene: place for place, scene in enumerate(sorted(scenes))}
        self._n_draws, self._seed = n_draws, seed

    def weights(self, units: Units) -> NDArray[np.float64]:
        """How often each unit of a condition was drawn, (draws, units)."""
        places = np.array([self._place[scene] for scene in units.scenes], dtype=np.intp)
        if units.resampled != "blocks":
            return self._of_scenes[:, places]
        return self._of_blocks[:, places].reshape(self._n_draws, len(places) * BLOCKS)

    @cached_property
    def _of_scenes(self) -> NDArray[np.float64]:
        return draws(len(self._place), n_draws=self._n_draws, seed=self._seed)

    @cached_property
    def _of_blocks(self) -> NDArray[np.float64]:
        """(draws, scenes, blocks)."""
        sizes = [BLOCKS] * len(self._place)
        return draws_within(sizes, n_draws=self._n_draws, seed=self._seed).reshape(self._n_draws, len(sizes), BLOCKS)


def draws_by_dataset(scenes: Mapping[str, Iterable[str]], *, n_draws: int, seed: int) -> dict[str, Draws]:
    """Draws of the scenes of each dataset."""
    return {dataset: Draws(list(names), n_draws=n_draws, seed=seed) for dataset, names in scenes.items()}


def additive(moments: pl.DataFrame) -> pl.DataFrame:
    """Return a table of moments with the columns of `SUMS` in place of means and central sums.

    Parameters
    ----------
    moments
        Of scenes (`MOMENTS`, `ASPECTS`) or blocks (`BLOCKS`); whatever else it has stays.
    """
    absolute = {f"abs_{axis}": pl.col("n") * pl.col(f"mean_abs_{axis}").fill_null(0.0) for axis in "uv"}
    return moments.with_columns(**ABOUT_ZERO, **absolute).select(pl.exclude("^m_.*$", "^mean_.*$"))


def units_of(
    scenes: pl.DataFrame, blocks: pl.DataFrame | None = None, *, points: Sequence[str], columns: Sequence[str]
) -> Units:
    """Sums by unit of one condition: by scene if there are at least `MIN_SCENES`, else by block.

    Parameters
    ----------
    scenes
        Columns scene, `points` and `columns`; rows that agree in scene and point are added up.
    blocks
        The same with a column block, under `BLOCKS`; what it holds adds up to what `scenes` holds.
    points
        Columns that tell apart the points at which there are sums; none makes one point.
    columns
        What is summed.
    """
    names = scenes["scene"].unique().sort().to_list()
    if len(names) >= MIN_SCENES:
        return _scattered(scenes, names, None, points, columns, "scenes")
    if blocks is None or blocks.is_empty():
        return _scattered(scenes, names, None, points, columns, None)
    return _scattered(blocks, names, "block", points, columns, "blocks")


def _scattered(
    table: pl.DataFrame,
    names: list[str],
    block: str | None,
    points: Sequence[str],
    columns: Sequence[str],
    resampled: str | None,
) -> Units:
    """Rows put, and added up, where they belong."""
    one_point = table.with_columns(pl.lit(0, dtype=pl.UInt8).alias("point")) if not points else table
    groups = group_rows(one_point, points or ["point"])
    scene = group_rows(table, ["scene"])
    place = np.searchsorted(names, scene.keys["scene"].to_list())[scene.index]
    each = 1 if block is None else BLOCKS
    unit = place * each + (0 if block is None else table[block].to_numpy().astype(np.intp))
    shape = (len(names) * each, groups.count)
    flat = unit * groups.count + groups.index
    sums = [np.bincount(flat, table[column].to_numpy(), shape[0] * shape[1]).reshape(shape) for column in columns]
    keys = groups.keys if points else pl.DataFrame()
    return Units(np.stack(sums, axis=-1), keys, tuple(names), np.repeat(np.arange(len(names)), each), resampled)
