"""From tables of a run to units that are resampled, and back to tables of estimates by condition.

Scenes are the sampling units: findings about a condition hold for scenes like those that were measured. If scenes come
in groups, such as pieces of one recording, whole groups are resampled, or scenes within their groups
(`tracknoise.inference.units`). With fewer than `MIN_SCENES` scenes no such finding is possible. Blocks are
then resampled within each scene. The findings hold for these scenes only, because they do not include the variation
between scenes.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.inference.bootstrap import N_DRAWS, Draws, draws_by_dataset
from tracknoise.inference.conventions import KIND_OF_INTERVAL, LEVEL, IntervalKind
from tracknoise.inference.estimates import EstimateArray
from tracknoise.inference.intervals import Method
from tracknoise.inference.units import BLOCKS, NO_GROUPS, Resampled, SceneGroups, Units, scheme
from tracknoise.statistics.grouping import Groups, TablesByCondition, group_rows, names, number_names, scenes_by_dataset
from tracknoise.statistics.moments import ABOUT_ZERO
from tracknoise.tables.enumerations import Aspect
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.schema import BLOCKS as BLOCKS_SCHEMA
from tracknoise.tables.schema import Schema, empty, typed
from tracknoise.tables.store import RunFolder

SUMS = ("n", "u", "v", "uu", "uv", "vv", "abs_u", "abs_v")
"""What `additive` makes of moments: the count, and sums of du, dv, their products about zero, and |du|, |dv|."""


@dataclass(frozen=True, slots=True)
class UnitPlaces:
    """Where the rows of a table of one condition are added up.

    Attributes
    ----------
    points
        The rows by point.
    scenes
        Names of the scenes that have anything, sorted.
    unit : (rows,) intp
        Unit of each row. Every scene has `each` of them, one scene after the other.
    each
        How many units a scene has.
    resampled, group
        As in `Units`.
    """

    points: Groups
    scenes: tuple[str, ...]
    unit: NDArray[np.intp]
    each: int
    resampled: Resampled | None
    group: NDArray[np.intp] | None = None

    def units(self, columns: Sequence[NDArray[Any]]) -> Units:
        """Sums of `columns`, (rows,) each, by unit and point."""
        shape = len(self.scenes) * self.each, self.points.count
        flat = self.unit * self.points.count + self.points.index
        sums = [np.bincount(flat, column, shape[0] * shape[1]).reshape(shape) for column in columns]
        scene = np.repeat(np.arange(len(self.scenes)), self.each)
        return Units(np.stack(sums, axis=-1), self.points.keys, self.scenes, scene, self.resampled, self.group)

    def across_groups(self) -> "UnitPlaces":
        """The same, with units as from `Units.across_groups`."""
        return replace(self, resampled=Resampled.scenes, group=None) if self.resampled == Resampled.within else self


def additive(moments: pl.DataFrame) -> pl.DataFrame:
    """Return a table of moments with the columns of `SUMS` in place of means and central sums."""
    absolute = {f"abs_{axis}": pl.col("n") * pl.col(f"mean_abs_{axis}").fill_null(0.0) for axis in "uv"}
    others = [name for name in moments.columns if not name.startswith(("m_", "mean_"))]
    return moments.select_seq(*others, **ABOUT_ZERO, **absolute)


FOURTH_SUMS = ("fourth_u", "fourth_v")
"""Sums of the fourth powers of errors."""


def with_fourth(moments: pl.DataFrame) -> pl.DataFrame:
    """Rows of `MOMENTS` with the columns `FOURTH_SUMS`."""
    return moments.with_columns_seq(_fourth(axis).alias(name) for axis, name in zip("uv", FOURTH_SUMS, strict=True))


def _fourth(axis: str) -> pl.Expr:
    """Sum of fourth powers about zero, from that about the mean."""
    second, third, fourth = (pl.col(f"m_{power * axis}") for power in (2, 3, 4))
    mean = pl.col(f"mean_{axis}")
    return fourth + 4 * mean * third + 6 * mean**2 * second + pl.col("n") * mean**4


def units_of(
    scenes: pl.DataFrame,
    blocks: pl.DataFrame | None = None,
    *,
    points: Sequence[str],
    columns: Sequence[str],
    groups: SceneGroups = NO_GROUPS,
) -> Units:
    """Sums by unit of one condition: by scene if there are enough (`scheme`), else by block.

    Parameters
    ----------
    scenes
        Columns scene, `points` and `columns`; rows that agree in scene and point are added up.
    blocks
        The same with a column block, under `BLOCKS`; what it holds adds up to what `scenes` holds.
    points
        Columns that identify the points at which there are sums; without any there is one point.
    columns
        What is summed.
    groups
        Groups of scenes that are not independent of each other. `scenes` then has a column dataset.
    """
    table, places = _placed(scenes, blocks, points, groups)
    return places.units([table[column].to_numpy() for column in columns])


def unit_places(rows: pl.DataFrame, *, points: Sequence[str], groups: SceneGroups = NO_GROUPS) -> UnitPlaces:
    """Where rows of one condition belong: of use where several things are summed over the same rows.

    `rows`: columns scene, block and `points`.
    """
    return _placed(rows, rows, points, groups)[1]


def _placed(
    scenes: pl.DataFrame, blocks: pl.DataFrame | None, points: Sequence[str], groups: SceneGroups
) -> tuple[pl.DataFrame, UnitPlaces]:
    """The table whose rows are summed, and where they belong."""
    names, scene = number_names(scenes["scene"])
    group = groups.of(scenes["dataset"][0], names) if groups.names and names else np.arange(len(names))
    resampled = scheme(group)
    if resampled is not None or blocks is None or blocks.is_empty():
        of_groups = None if resampled is None else group
        return scenes, UnitPlaces(_points(scenes, points), tuple(names), scene, 1, resampled, of_groups)
    with_blocks, index = number_names(blocks["scene"])
    scene = np.searchsorted(names, with_blocks)[index]
    unit = scene * BLOCKS + blocks["block"].to_numpy().astype(np.intp)
    return blocks, UnitPlaces(_points(blocks, points), tuple(names), unit, BLOCKS, Resampled.blocks)


def _points(table: pl.DataFrame, points: Sequence[str]) -> Groups:
    """The rows by point; one point, unless there are no rows, where nothing identifies them."""
    if points:
        return group_rows(table, points)
    return Groups(pl.DataFrame(height=min(table.height, 1)), np.zeros(table.height, dtype=np.intp))


def groups_of_run(folder: RunFolder) -> SceneGroups:
    """Groups of the scenes of a run, as its experiment declares them.

    Parameters
    ----------
    folder
        Of the run.

    Raises
    ------
    StoreError
        If its manifest or its settings are missing or damaged.
    """
    settings = folder.settings()
    return groups_of_scenes(folder.manifest().sequences, settings["dataset"].get("groups"))


def groups_of_scenes(
    sequences: Mapping[str, SequenceEntry], declared: Mapping[str, Sequence[str]] | None
) -> SceneGroups:
    """Group of each scene that has one, and the scenes that are copies. Groups of readers get copies from elsewhere.

    Parameters
    ----------
    sequences
        Of the manifest.
    declared
        Patterns of the names of scenes by group, the first that fits counts; None for what the readers know.
    """
    names: dict[tuple[str, str], str] = {}
    for entry in sequences.values():
        scene = entry.sequence.scene
        group = entry.group if declared is None else _declared(scene, declared)
        if group is not None:
            names[entry.sequence.dataset, scene] = group
    copies = _copies(sequences)
    if declared is None:
        for (dataset, scene), original in copies.items():
            names[dataset, scene] = names.setdefault((dataset, original), f"copies of {original}")
    return SceneGroups(names, copies)


def _copies(sequences: Mapping[str, SequenceEntry]) -> dict[tuple[str, str], str]:
    """Scenes whose image in the run folder has the pixels of that of an earlier scene, and the earlier one."""
    first: dict[tuple[str, str], str] = {}
    groups: dict[tuple[str, str], str] = {}
    for _, entry in sorted(sequences.items()):
        dataset, scene = entry.sequence.dataset, entry.sequence.scene
        original = first.setdefault((dataset, entry.image), scene) if entry.image else scene
        if original != scene:
            groups.setdefault((dataset, scene), groups.get((dataset, original), original))
    return groups


def _declared(scene: str, groups: Mapping[str, Sequence[str]]) -> str | None:
    fitting = (group for group, patterns in groups.items() if any(fnmatchcase(scene, pattern) for pattern in patterns))
    return next(fitting, None)


CurveSums = tuple[tuple[Any, ...], pl.DataFrame, pl.DataFrame | None]
"""Condition, aspect, `at_least` and population; sums by scene; and by block, if there are any."""
_WHICH = ["aspect", "at_least", "population"]
_TO_ORDER_2 = ["aspect", "at_least", *(column for column in BLOCKS_SCHEMA if column != "block")]


def moments_to_order_2(aspects: pl.DataFrame) -> pl.DataFrame:
    """Of `ASPECTS` the columns that are needed, which are those of blocks, too."""
    return aspects.select_seq(_TO_ORDER_2)


def error_sums(errors: TablesByCondition, blocks: TablesByCondition, population: str) -> Iterator[CurveSums]:
    """Of the errors of every track in image axes; `errors` are of `MOMENTS`, `blocks` of `BLOCKS`."""
    for key, part in errors.items():
        scenes = additive(part.filter(pl.col("n") > 0, population=population))
        if not scenes.is_empty():
            within = additive(blocks[key].filter(population=population)) if key in blocks else None
            yield (*key, Aspect.all, None, population), scenes, within


def aspect_sums(aspects: TablesByCondition, blocks: TablesByCondition) -> Iterator[CurveSums]:
    """Of each aspect of the errors; `blocks` are of `ASPECT_BLOCKS`."""
    for key, part in aspects.items():
        seen = part.filter(pl.col("n") > 0)
        for which in seen.select_seq(_WHICH).unique().rows():
            chosen = [pl.col(name).eq_missing(value) for name, value in zip(_WHICH, which, strict=True)]
            within = additive(blocks[key].filter(chosen)) if key in blocks else None
            yield (*key, *which), additive(seen.filter(chosen)), within


_NUMBERS = ("low", "high", "n_units", "n_scenes")


@dataclass(frozen=True, slots=True)
class Sampling:
    """How the scenes of every condition are resampled.

    Parameters
    ----------
    kind, level
        As in `tracknoise.inference.intervals.Method`.
    groups
        Groups of scenes that are not independent of each other.
    n_draws, seed
        As in `tracknoise.inference.bootstrap.draws`; Student's intervals need no draws.
    """

    kind: str = KIND_OF_INTERVAL
    level: float = LEVEL
    groups: SceneGroups = NO_GROUPS
    n_draws: int = N_DRAWS
    seed: int = 0

    def draws(self, scenes: Mapping[str, Iterable[str]]) -> dict[str, Draws]:
        """Draws of the scenes of each dataset."""
        return draws_by_dataset(scenes, n_draws=self.n_draws, seed=self.seed, groups=self.groups)


USUAL = Sampling()
"""Student's intervals over independent scenes."""


def condition_table(
    conditions: TablesByCondition,
    schema: Schema,
    rows: Callable[[pl.DataFrame, Draws, Method], pl.DataFrame],
    sampling: Sampling,
) -> pl.DataFrame:
    """Rows of every condition that has a table, with its names, in columns of a schema; not sorted.

    Parameters
    ----------
    conditions
        Table of each condition.
    schema
        Columns of the result.
    rows
        Makes the rows of a condition, but for its names.
    sampling
        How scenes are resampled.

    Raises
    ------
    SchemaError
        If a table has other columns; of the tables that `by_condition` makes conditions of.
    SettingsError
        If there is no such kind of interval, or the level is not between 0 and 1.
    """
    method = Method(sampling.kind, sampling.level)
    needed = sampling if method.kind != IntervalKind.student else replace(sampling, n_draws=0)
    drawn = needed.draws(scenes_by_dataset(conditions.items()))
    parts = [
        rows(part, drawn[key[0]], method).with_columns_seq(names(key, schema))
        for key, part in conditions.items()
        if part.height
    ]
    return pl.concat([empty(schema), *(typed(part, schema) for part in parts)])


def estimated(
    labels: pl.DataFrame, estimates: EstimateArray, units: Units, schema: Schema, *, value: str
) -> pl.DataFrame:
    """Labels with the estimates that they are of, in a column named `value`, their bounds, and how these were made.

    Numbers that are unknown are null.
    """
    columns = {value: "value", **{name: name for name in _NUMBERS}}
    arrays = {name: getattr(estimates, source).ravel() for name, source in columns.items()}
    numbers = pl.DataFrame(arrays, nan_to_null=True)
    made = {"kind": estimates.kind, "level": estimates.level, "resampled": units.resampled}
    return labels.hstack(numbers).with_columns_seq(
        pl.lit(text, dtype=schema[name]).alias(name) for name, text in made.items()
    )


def estimates_by_point(
    estimates: EstimateArray,
    units: Units,
    schema: Schema,
    *,
    value: str = "value",
    statistics: pl.DataFrame | None = None,
) -> pl.DataFrame:
    """Rows of every statistic at every point as `estimated` makes them, and n.

    `statistics`: their labels, a row for each, where there are several. n is the sum of the first column of `units`.
    """
    labels = units.points if statistics is None else statistics.join(units.points, how="cross")
    n = np.tile(units.sums[..., 0].sum(axis=0), len(estimates.value))
    return estimated(labels, estimates, units, schema, value=value).with_columns_seq(
        pl.Series("n", n, dtype=pl.Float64)
    )
