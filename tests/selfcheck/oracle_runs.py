"""Statistics of a finished run of oracles, beside their expected values."""

from collections.abc import Collection, Iterator, Mapping
from typing import Any

import polars as pl
from tests.selfcheck.known_errors import Known, curve_point, share

from tracknoise.experiments.settings import parse_experiment
from tracknoise.tables.enumerations import Trimming, Weighting
from tracknoise.tables.findings_schema import COUNTS, CURVES, OUTLIERS
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.oracle import Oracle
from tracknoise.trackers.tracker_registry import make_tracker

_COORDINATES = {"nu": ("u", "v"), "eta": ("u", "v"), "Phi": ("u", "v", "uv"), "central": ("u", "v", "uv")}


def compare(run: RunFolder, *, curves: Collection[str] = (), ages: Collection[int] = ()) -> pl.DataFrame:
    """Curves (untrimmed, each feature counts once) and rates: statistic, coordinate, at, expected, measured, z."""
    experiment = parse_experiment(run.experiment_toml(), place=str(run.path))
    made = {choice.label: make_tracker(choice.kind, choice.options) for choice in experiment.trackers}
    oracles = {name: tracker for name, tracker in made.items() if isinstance(tracker, Oracle)}
    points = run.statistics(CURVES).filter(
        pl.col("statistic").is_in(list(curves)),
        pl.col("at").is_in(list(ages)),
        population=experiment.truth.population,
    )
    rows = [*_curve_rows(points, oracles), *_rate_rows(run, oracles)]
    return pl.DataFrame(rows).with_columns(z=(pl.col("measured") - pl.col("expected")) / pl.col("standard_error"))


def _curve_rows(curves: pl.DataFrame, oracles: Mapping[str, Oracle]) -> Iterator[dict[str, Any]]:
    points = curves.filter(
        pl.col("tracker").is_in(list(oracles)),
        pl.col("n") > 1,
        trimming=Trimming.untrimmed,
        weighting=Weighting.features,
    )
    for point in points.iter_rows(named=True):
        statistic, age, oracle = point["statistic"], point["at"], oracles[point["tracker"]]
        for coordinate in _COORDINATES[statistic]:
            known = curve_point(oracle, statistic=statistic, coordinate=coordinate, age=age, n=point["n"])
            where = {"statistic": statistic, "coordinate": coordinate, "at": age, "unit": point["unit"]}
            yield _row(point, known, point[coordinate], **where)


def _rate_rows(run: RunFolder, oracles: Mapping[str, Oracle]) -> Iterator[dict[str, Any]]:
    """Outlier ratio and loss ratio: counts divided by the features offered to all steps."""
    lost = run.statistics(COUNTS).filter(kind="end", name="lost").select("tracker", "speed", lost="n")
    offered = run.statistics(OUTLIERS).filter(pl.col("tracker").is_in(list(oracles)))
    for condition in offered.join(lost, on=["tracker", "speed"]).iter_rows(named=True):
        oracle, n = oracles[condition["tracker"]], condition["offered"]
        yield _row(condition, share(oracle.outlier_rate, n), condition["pooled_ratio"], statistic="outlier_ratio")
        yield _row(condition, share(oracle.loss_rate, n), condition["lost"] / n, statistic="loss_ratio")


def _row(condition: Mapping[str, Any], known: Known, measured: float | None, **where: Any) -> dict[str, Any]:
    place = {"coordinate": None, "at": None, "unit": None, **where}
    values = {"expected": known.value, "measured": measured, "standard_error": known.standard_error}
    return {"setting": condition["tracker"], "speed": condition["speed"], **place, **values}
