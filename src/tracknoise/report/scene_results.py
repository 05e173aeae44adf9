"""What single scenes of a run measured of each tracker, at the lowest speed."""

from collections.abc import Iterator

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.condition_units import groups_of_scenes
from tracknoise.analysis.run_inputs import has_errors
from tracknoise.analysis.scene_values import RunValues, run_values
from tracknoise.analysis.shared_scenes import SceneNumbers, scene_numbers
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import POOLED
from tracknoise.tables.findings_schema import CURVES


def scene_results(data: ReportData) -> tuple[dict[str, int], dict[str, dict[str, SceneNumbers]]]:
    """The number of the group of each scene, and the numbers of each scene, in the same order, by tracker."""
    values = _values(data)
    reference = data.conditions().reference
    of_reference = {
        str(named["tracker"]): condition
        for condition in values.keys
        for named in [dict(zip(POOLED, condition, strict=True))]
        if all(named[name] == getattr(reference, name) for name in named if name not in ("dataset", "tracker"))
    }
    dataset = next((str(condition[0]) for condition in of_reference.values()), "")
    scenes = values.scenes.get(dataset, [])
    groups = groups_of_scenes(data.manifest.sequences, data.settings["dataset"].get("groups"))
    numbers = {tracker: scene_numbers(values, condition) for tracker, condition in of_reference.items()}
    return dict(zip(scenes, groups.of(dataset, scenes).tolist(), strict=True)), numbers


def group_array(groups: dict[str, int]) -> NDArray[np.intp]:
    """The numbers of groups, (scenes,)."""
    return np.array([*groups.values()], dtype=np.intp)


def _values(data: ReportData) -> RunValues:
    keys = sorted(data.manifest.sequences)

    def of_errors(name: str) -> Iterator[pl.DataFrame]:
        chosen = has_errors(data.population), pl.col("population") == data.population
        return (table.filter(*chosen) for table in data.run.stacked_tables(name, keys))

    return run_values(
        of_errors("moments"),
        of_errors("scales"),
        data.run.stacked_tables("ends", keys),
        data.run.stacked_tables("frames", keys),
        data.run.statistics(CURVES),
        population=data.population,
    )
