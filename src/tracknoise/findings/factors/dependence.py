"""Factor effects: differences between the levels of a factor, paired by scene, with intervals, tests and verdicts.

Scenes are the sampling units. A scene is seen at all levels of a factor, so that what the levels have in common cancels
in their difference. Scales of errors, lifetimes and outlier ratios are compared as ratios: the mean over scenes of the
difference of logarithms, and thus the geometric mean over scenes of the ratio. Every scene has the same weight. Mean
errors have a sign; their differences are in px (`tracknoise.findings.factors.answers`).

q-values are computed over the rows of a factor, for all trackers and speeds together. The verdict is `yes` if q_yes
is at most 1 - level. It is `no` if every difference
at every age is below the margin: p_no is at most half of 1 - level, q_no is at most 1 - level, and every pair of levels
was compared. Otherwise it is `undecided`.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.findings.factors.asking import N_DRAWS, ask
from tracknoise.findings.factors.differences import differences
from tracknoise.findings.factors.questions import Cell, cells
from tracknoise.findings.factors.rows import Row, judged, row_of
from tracknoise.findings.factors.scene_counts import lifetime_differences, outlier_differences
from tracknoise.findings.factors.scene_values import SIGNED, AllValues, scene_values
from tracknoise.findings.factors.tracker_options import OptionFactor, option_cells
from tracknoise.findings.sampling.groups import NO_GROUPS, SceneGroups
from tracknoise.statistics.conditions import Tables, TablesByCondition, by_condition, scenes_by_dataset
from tracknoise.tables.defaults import LEVEL, MARGIN, POPULATION, TRIMMING
from tracknoise.tables.schema import ENDS, FRAME_COUNTS, MOMENTS, SCALES, Schema, empty


@dataclass(frozen=True, slots=True)
class _Options:
    groups: SceneGroups
    margin: float
    level: float
    n_draws: int
    seed: int


def dependence(
    moments: Tables,
    scales: Tables,
    ends: Tables,
    frames: Tables,
    curves: pl.DataFrame,
    effects: pl.DataFrame,
    *,
    key_frames: Mapping[str, int] | None = None,
    population: str = POPULATION,
    trimming: str = TRIMMING,
    options: Sequence[OptionFactor] = (),
    groups: SceneGroups = NO_GROUPS,
    margin: float = MARGIN,
    level: float = LEVEL,
    n_draws: int = N_DRAWS,
    seed: int = 0,
) -> pl.DataFrame:
    """Ratios and differences between the levels of all factors, with intervals and verdicts.

    Parameters
    ----------
    moments, scales, ends, frames
        Of all sequences: `MOMENTS`, `SCALES`, `ENDS` and `FRAME_COUNTS`.
    curves, effects
        What the functions of these names made of them. `curves` says where they are cut, `effects` which factors are
        asked about, and where the others are held.
    key_frames
        Where curves run along frames: the one in which errors are zero, by direction.
    population, trimming
        Which errors.
    options
        Options in which alone trackers differ. They are compared like trackers, as factors of their own.
    groups
        Scenes that are not independent of each other.
    margin
        Largest relative difference that counts as no effect: 0.1 for ratios of 1.1, and for differences of means that
        are 10 % of the core (geometric mean over levels, ages and scenes; of the rms where there is no core).
    level
        Probability that an interval contains the true difference; q-values may be at most 1 - level.
    n_draws, seed
        Number of rotations, and their seed.

    Returns
    -------
    polars.DataFrame
        Schema `DEPENDENCE`: for each cell of `effects`, all of its statistics but central covariances, and the core.
        Ages (or frames) at which fewer than `MIN_SCENES` scenes have values at both levels are left out. Bounds and
        p-values are null where no two levels share enough scenes, or too few groups of scenes.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    tables = {
        name: by_condition(given, schema, name)
        for name, given, schema in (
            ("moments", moments, MOMENTS),
            ("scales", scales, SCALES),
            ("ends", ends, ENDS),
            ("frames", frames, FRAME_COUNTS),
        )
    }
    found = scenes_by_dataset(item for each in tables.values() for item in each.items())
    scenes = {dataset: sorted(names) for dataset, names in found.items()}
    values = scene_values(
        tables["moments"],
        tables["scales"],
        curves,
        errors={"population": population, "trimming": trimming},
        key_frames=key_frames or {},
        scenes=scenes,
    )
    asked = _Options(groups, margin, level, n_draws, seed)
    every = list(cells(effects, sorted({key for table in tables.values() for key in table})))
    rows: list[Row] = []
    for cell in [*every, *option_cells(every, options)]:
        names = scenes.get(cell.dataset, [])
        rows.extend(_rows(cell, tables, values, names, groups.of(cell.dataset, names), asked))
    return judged(rows, level)


def _rows(
    cell: Cell,
    tables: Mapping[str, TablesByCondition],
    values: AllValues,
    scenes: Sequence[str],
    group: NDArray[np.intp],
    options: _Options,
) -> Iterator[Row]:
    """Rows of all statistics of a cell."""
    places = values.places.get((cell.dataset, str(cell.axis)), np.zeros(0, dtype=np.int64))
    for role, name in cell.statistics.items():
        if role == "lifetime":
            asked = lifetime_differences(_tables(cell, tables["ends"], ENDS), scenes)
        elif role == "outlier_ratio":
            asked = outlier_differences(_tables(cell, tables["frames"], FRAME_COUNTS), scenes)
        else:
            levels, measured = _levels(cell, role, values, (len(scenes), len(places)))
            asked = differences(levels, measured, logarithms=role != SIGNED)
        margin = _margin_px(cell, values, options.margin) if role == SIGNED else float(np.log1p(options.margin))
        question = ask(
            asked.both,
            group,
            margin=margin,
            level=options.level,
            n_draws=options.n_draws,
            seed=options.seed,
            cancels=role == SIGNED,
        )
        yield row_of(cell, role, name, places, asked, question, margin, group)


def _tables(cell: Cell, tables: TablesByCondition, schema: Schema) -> list[pl.DataFrame]:
    """The table of each level, without rows where it has none."""
    return [tables.get(key, empty(schema)) for key in cell.levels.values()]


def _levels(
    cell: Cell, role: str, values: AllValues, shape: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Values of all levels, (scenes, levels, places x 2), and which scenes were measured at them, (scenes, levels)."""
    levels = np.full((shape[0], len(cell.levels), shape[1], 2), np.nan)
    measured = np.zeros(levels.shape[:2], dtype=np.bool_)
    for number, key in enumerate(cell.levels.values()):
        found = values.conditions.get((key, str(cell.axis)))
        if found is not None:
            measured[:, number] = found.measured
            levels[:, number] = found.values.get(role, np.nan)
    return levels.reshape(*measured.shape, -1), measured


def _margin_px(cell: Cell, values: AllValues, margin: float) -> float:
    """Margin of mean errors: a share of the core, geometric mean over levels, ages and scenes; else of the rms."""
    for role, power in (("core", 1), ("second", 2)):
        found = [values.conditions.get((key, str(cell.axis))) for key in cell.levels.values()]
        logs = [one.values[role].ravel() for one in found if one is not None and role in one.values]
        finite = [each[np.isfinite(each)] for each in logs]
        if sum(map(len, finite)):
            return margin * float(np.exp(np.concatenate(finite).mean() / power))
    return float("nan")
