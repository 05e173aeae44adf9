"""What a comparison reads of one run: errors, ends, counts and numbers of single scenes, by condition."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import polars as pl

from tracknoise.experiments.comparing.comparable import OpenedRun
from tracknoise.findings.comparison.error_values import RunErrors
from tracknoise.findings.comparison.number_values import NUMBERS
from tracknoise.findings.factors.scene_values import scene_values
from tracknoise.noise_models.window_noise import scene_quantities
from tracknoise.statistics.conditions import TablesByCondition, by_condition
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.schema import POINT_TRACKING, WINDOW_NOISE
from tracknoise.tables.store import SEQUENCE_TABLES, RunFolder

LEAST_WINDOWS = 10
"""Fewest windows that a quantity of a scene rests on."""
_RASTER = "256x256"
_WINDOWS = {
    "consistent_sigma": "consistent_sigma",
    "residual_sigma": "residual_core",
    "overconfidence": "core_overconfidence",
}
_TAP = {
    "tap_delta_avg": "delta_avg",
    "tap_average_jaccard": "average_jaccard",
    "tap_occlusion_accuracy": "occlusion_accuracy",
    "expected_feature_age": "expected_feature_age",
}


@dataclass(frozen=True, slots=True)
class RunTables:
    """Tables of one run.

    Attributes
    ----------
    errors
        Errors of single scenes.
    ends, frames
        `ENDS` and `FRAME_COUNTS`, by condition.
    numbers
        Tables of `NUMBERS`, by statistic and condition.
    """

    errors: RunErrors
    ends: TablesByCondition
    frames: TablesByCondition
    numbers: Mapping[str, TablesByCondition]


def read_run(run: OpenedRun, keys: Sequence[str], scenes: Mapping[str, Sequence[str]]) -> RunTables:
    """Read the sequences that both runs have.

    Parameters
    ----------
    run
        One of the runs.
    keys
        Of the sequences.
    scenes
        Names of their scenes, sorted, by dataset.

    Raises
    ------
    StoreError, SchemaError
        If a table is damaged.
    """
    population = run.settings["truth"]["population"]
    errors = {"population": population, "trimming": Trimming.untrimmed}
    frames = _read(run.folder, "frames", keys)
    return RunTables(
        _errors(run, keys, scenes, errors),
        _read(run.folder, "ends", keys),
        frames,
        {
            "feature_count": {key: _feature_counts(table) for key, table in frames.items()},
            **_windows(run.folder, keys),
            **_point_tracking(run.folder, keys),
        },
    )


def _errors(
    run: OpenedRun, keys: Sequence[str], scenes: Mapping[str, Sequence[str]], errors: Mapping[str, str]
) -> RunErrors:
    def chosen(table: pl.DataFrame) -> pl.DataFrame:
        return table.filter(pl.col("n") > 0, **errors)

    moments, scales = (_read(run.folder, name, keys, chosen) for name in ("moments", "scales"))
    entries = run.manifest.sequences.values()
    zeros = {str(entry.sequence.direction): entry.key_frame for entry in entries if entry.key_frame is not None}
    values = scene_values(
        moments, scales, run.folder.statistics("curves"), errors=errors, key_frames=zeros, scenes=scenes
    )
    return RunErrors(values, scales, zeros)


def _read(
    folder: RunFolder,
    name: str,
    keys: Sequence[str],
    reduce: Callable[[pl.DataFrame], pl.DataFrame] = lambda table: table,
) -> TablesByCondition:
    return by_condition(folder.stacked_tables(name, keys), SEQUENCE_TABLES[name], name, reduce)


def _feature_counts(frames: pl.DataFrame) -> pl.DataFrame:
    """Mean number of features per frame."""
    return _numbers(frames.group_by("scene").agg(value=pl.col("alive").mean()))


def _windows(folder: RunFolder, keys: Sequence[str]) -> dict[str, TablesByCondition]:
    """Quantities of windows of each length."""
    kept = (folder.sequence_table("window_noise", key).filter(trimming=Trimming.untrimmed) for key in keys)
    found = {
        key: scene_quantities(table).filter(pl.col("n") >= LEAST_WINDOWS).rename({"window": "at"})
        for key, table in by_condition(kept, WINDOW_NOISE, "window noise").items()
    }
    return {
        name: {key: _numbers(table.filter(quantity=quantity)) for key, table in found.items()}
        for name, quantity in _WINDOWS.items()
    }


def _point_tracking(folder: RunFolder, keys: Sequence[str]) -> dict[str, TablesByCondition]:
    """Metrics of point trackers, where the run has them."""
    entries = folder.manifest().sequences
    there = (folder.sequence_table("point_tracking", key) for key in keys if "point_tracking" in entries[key].sha256)
    tables = by_condition((table.filter(raster=_RASTER) for table in there), POINT_TRACKING, "point tracking")
    return {
        name: {key: _numbers(table.with_columns(value=column)) for key, table in tables.items()}
        for name, column in _TAP.items()
        if tables
    }


def _numbers(table: pl.DataFrame) -> pl.DataFrame:
    """Columns of `NUMBERS`, of a table that has a scene, a value and maybe places."""
    placed = table if "at" in table.columns else table.with_columns(at=None)
    return placed.select(pl.col(name).cast(kind) for name, kind in NUMBERS.items())
