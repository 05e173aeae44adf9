"""Headlines that limit what the others mean: few scenes, and a truth that was measured."""

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.headlines.headline import Headline, RunTables
from tracknoise.findings.headlines.reported_conditions import ReportedConditions
from tracknoise.findings.sampling.units import MIN_SCENES
from tracknoise.findings.wording import count

ENOUGH_SCENES = 8
"""With fewer scenes than this, intervals contain the true value less often than their level says."""


def few_scenes(tables: RunTables, _conditions: ReportedConditions) -> Headline | None:
    """Warn if there are so few scenes that intervals are less reliable, or hold for these scenes only."""
    measured = tables["summary"].drop_nulls("n_scenes")
    few = measured.filter(pl.col("n_scenes") < ENOUGH_SCENES)
    if few.is_empty():
        return None
    numbers: list[int] = few["n_scenes"].unique().sort().to_list()
    whose = (
        "Every condition has" if few.height == measured.height else f"{few.height} of {measured.height} conditions have"
    )
    there = count(numbers[0], "scene") if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]} scenes"
    if numbers[0] >= MIN_SCENES:
        limits = f"Intervals from fewer than {ENOUGH_SCENES} scenes are less reliable."
    else:
        limits = (
            f"With fewer than {MIN_SCENES} scenes, intervals come from blocks of tracks within the scenes. They hold "
            "for these scenes only. Tests of the mean error and of factors at the 5 % level are then not possible."
        )
    text = f"{whose} only {there}. {limits}"
    return Headline("scenes", text, "measured", "summary", Estimate(numbers[0], unit="scenes"))


def recorded_truth(_tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Warn where the truth was measured too."""
    text = (
        "True positions come from recorded poses, depth and calibration. Their own errors are part of every number and "
        "are not yet separated. The errors of the trackers alone may be smaller."
    )
    return Headline("truth", text, "limits", "counts") if conditions.recorded else None
