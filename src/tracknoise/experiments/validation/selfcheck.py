"""Self-test: measure errors of known size, and compare the measured values with the expected ones.

Oracles track simulated scenes like any other tracker. The statistics of the run are then compared with their expected
values. The self-test has two criteria.

- Is a number *off*? It is off if it lies too many known standard errors from its expected value. The limit is such that
  a correct program has any number off in one of 1000 self-tests, if numbers are Gaussian, as they nearly are.
- Do the intervals of the run contain the expected values as often as they claim?
"""

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import polars as pl
from scipy.stats import norm

from tracknoise.experiments.settings import (
    DatasetSettings,
    Experiment,
    StatisticsSettings,
    TrackerChoice,
    ViewSettings,
    parse_experiment,
)
from tracknoise.experiments.validation.known_errors import Known, curve_point, mean_lifetime, share, survival
from tracknoise.tables.defaults import LEVEL
from tracknoise.tables.enumerations import Aspect, Trimming, Weighting
from tracknoise.tables.identity import Direction
from tracknoise.tables.schema import Schema, check
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.oracle import Oracle
from tracknoise.trackers.registry import make_tracker

SPEEDS = (1, 2)
AGES = (4, 12)
"""Ages at which curves are compared: frames of the nominal sequence, seen at every speed."""
CURVES = ("nu", "eta", "Phi")
"""Curves that are compared."""
LIFETIMES = (2, 6)
"""Lifetimes at which survival is compared: frames that the tracker saw."""
ALARM = 0.001
"""Probability that the self-test fails although the program is correct, for each of the two criteria."""
_USUAL: Mapping[str, Any] = {"n_features": 300, "loss_rate": 0.02, "outlier_rate": 0.02}
_SETTINGS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "white noise": {},
        "bias": {"bias_px": [0.4, -0.2]},
        "drift": {"drift_px_per_frame": [0.05, -0.03]},
        "anisotropic": {"covariance_px2": [[0.64, -0.18], [-0.18, 0.16]]},
        "outliers": {"outlier_rate": 0.2},
        "losses": {"loss_rate": 0.15},
    }
)
"""Options of each oracle beyond the common ones. Tracks end in all of them, so that new tracks begin in every frame."""
_COORDINATES = {"nu": ("u", "v"), "eta": ("u", "v"), "Phi": ("u", "v", "uv"), "central": ("u", "v", "uv")}
_RATES = ("outlier_ratio", "loss_ratio", "mean_lifetime")
N_NUMBERS = (
    len(_SETTINGS)
    * len(SPEEDS)
    * (len(AGES) * sum(len(_COORDINATES[name]) for name in CURVES) + len(_RATES) + len(LIFETIMES))
)
"""Number of values that a self-test compares."""
COMPARISON: Schema = {
    "setting": pl.String,
    "speed": pl.Int32,
    "statistic": pl.String,
    "coordinate": pl.String,
    "at": pl.Int64,
    "unit": pl.String,
    "expected": pl.Float64,
    "measured": pl.Float64,
    "standard_error": pl.Float64,
    "low": pl.Float64,
    "high": pl.Float64,
    "within": pl.Boolean,
    "off": pl.Boolean,
}
"""One row per number: expected and measured value, known standard error, and the interval if the run has one."""
_KEY = ["setting", "speed", "statistic", "coordinate", "at"]


@dataclass(frozen=True, slots=True)
class SelfTestResult:
    """Result of a self-test.

    Attributes
    ----------
    n_numbers, n_off, n_missing
        Count of numbers that were compared, that are off, and that are missing.
    n_intervals, n_within
        Count of numbers that have an interval, and of intervals that contain the expected value.
    n_least
        Smallest `n_within` that passes.
    """

    n_numbers: int
    n_off: int
    n_missing: int
    n_intervals: int
    n_within: int
    n_least: int

    @property
    def passes(self) -> bool:
        """Whether no number is off or missing, and enough intervals contain the expected value."""
        return not self.n_off and not self.n_missing and self.n_within >= self.n_least


def selfcheck_experiment(*, scenes: int, seed: int = 0) -> Experiment:
    """Experiment of the self-test: oracles with several kinds of known errors, two speeds, small simulated scenes.

    The camera moves backward, so that no feature leaves the image. Tracks end only where the oracle ends them.

    Parameters
    ----------
    scenes
        Number of scenes.
    seed
        Random seed of worlds, paths and errors. Settings and speeds are independent of each other.
    """
    options = {"motions": ["forward"], "worlds": scenes, "frames": 25, "width": 96, "height": 72, "supersampling": 1}
    return Experiment(
        name="selfcheck",
        dataset=DatasetSettings(reader="simulated", options={**options, "seed": seed}),
        trackers=[
            TrackerChoice(kind=Oracle.kind, name=name, options={**_USUAL, **setting, "seed": number})
            for number, (name, setting) in enumerate(_SETTINGS.items())
        ],
        speeds=list(SPEEDS),
        views=[ViewSettings(direction=Direction.backward)],
        seed=seed,
        statistics=StatisticsSettings(min_features=2),
    )


def compare(run: RunFolder, *, curves: Collection[str] = CURVES, ages: Collection[int] = AGES) -> pl.DataFrame:
    """Compare the statistics of a finished run of oracles with their expected values.

    Parameters
    ----------
    run
        A run of one view. No feature of an oracle may leave the image: the expected lifetimes assume that.
    curves
        Curves to compare: some of nu, eta, Phi and central. Errors are untrimmed, and each feature counts once.
    ages
        Ages to compare, in frames of the nominal sequence, at least 1. Ages that a speed skips are left out.

    Returns
    -------
    polars.DataFrame
        Schema `COMPARISON`, settings in the order of the experiment. `low`, `high` and `within` are null for numbers
        without an interval.

    Raises
    ------
    StoreError, SchemaError
        If the run has no usable statistics.
    """
    experiment = parse_experiment(run.experiment_toml(), place=str(run.path))
    made = {choice.label: make_tracker(choice.kind, choice.options) for choice in experiment.trackers}
    oracles = {name: tracker for name, tracker in made.items() if isinstance(tracker, Oracle)}
    points = run.statistics("curves").filter(
        pl.col("statistic").is_in(list(curves)),
        pl.col("at").is_in(list(ages)),
        population=experiment.truth.population,
    )
    rows = [*_curve_rows(points, oracles), *_rate_rows(run, oracles), *_lifetime_rows(run, oracles)]
    order = {name: place for place, name in enumerate([*oracles, *curves])}
    table = pl.DataFrame(rows, schema={name: kind for name, kind in COMPARISON.items() if name in rows[0]})
    sorting = [pl.col(name).replace_strict(order, default=len(order)) for name in ("setting", "statistic")]
    table = table.sort(sorting[0], "speed", sorting[1], maintain_order=True)
    table = table.join(_intervals(run), on=_KEY, how="left", nulls_equal=True, maintain_order="left")
    near = (pl.col("measured") - pl.col("expected")).abs() <= furthest(table.height) * pl.col("standard_error")
    table = table.with_columns(
        within=pl.col("expected").is_between("low", "high"), off=near.fill_null(value=False).not_()
    )
    return check(table.select(*COMPARISON), COMPARISON, "comparison")


def furthest(n_numbers: int) -> float:
    """Number of standard errors above which one of `n_numbers` numbers is off (Bonferroni)."""
    return float(norm.isf(ALARM / n_numbers / 2))


def judge(comparison: pl.DataFrame) -> SelfTestResult:
    """Decide whether the self-test passes, for the experiment of `selfcheck_experiment`.

    Numbers of one setting, speed and age are computed from the same features. The allowed number of intervals that miss
    the expected value is therefore computed as if those intervals missed it together.

    Parameters
    ----------
    comparison
        Result of `compare` with its default arguments.
    """
    judged = check(comparison, COMPARISON, "comparison").drop_nulls("within")
    together = judged.group_by("setting", "speed", "at").len()["len"].to_list()
    spread = math.sqrt(LEVEL * (1 - LEVEL) * sum(count * count for count in together))
    most_missed = (1 - LEVEL) * judged.height + float(norm.isf(ALARM)) * spread
    return SelfTestResult(
        n_numbers=comparison.height,
        n_off=int(comparison["off"].sum()),
        n_missing=max(N_NUMBERS - comparison.height, 0),
        n_intervals=judged.height,
        n_within=int(judged["within"].sum()),
        n_least=max(judged.height - math.floor(most_missed), 0),
    )


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
    lost = run.statistics("counts").filter(kind="end", name="lost").select("tracker", "speed", lost="n")
    offered = run.statistics("outliers").filter(pl.col("tracker").is_in(list(oracles)))
    for condition in offered.join(lost, on=["tracker", "speed"]).iter_rows(named=True):
        oracle, n = oracles[condition["tracker"]], condition["offered"]
        yield _row(condition, share(oracle.outlier_rate, n), condition["pooled_ratio"], statistic="outlier_ratio")
        yield _row(condition, share(oracle.loss_rate, n), condition["lost"] / n, statistic="loss_ratio")


def _lifetime_rows(run: RunFolder, oracles: Mapping[str, Oracle]) -> Iterator[dict[str, Any]]:
    frames = max(entry.n_frames for entry in run.manifest().sequences.values())
    survivals = run.statistics("lifetimes")
    for condition in run.statistics("summary").filter(pl.col("tracker").is_in(list(oracles))).iter_rows(named=True):
        oracle, speed = oracles[condition["tracker"]], condition["speed"]
        known = mean_lifetime(oracle, frames=math.ceil(frames / speed), n_scenes=condition["n_scenes"])
        yield _row(condition, known, condition["mean_lifetime"], statistic="mean_lifetime", unit="frames")
        lived = survivals.filter(tracker=condition["tracker"], speed=speed).sort("lifetime")
        for lifetime in LIFETIMES:
            until = lived.filter(pl.col("lifetime") <= lifetime)
            known = survival(oracle, until["at_risk"])
            yield _row(condition, known, until["survival"][-1], statistic="survival", at=lifetime)


def _intervals(run: RunFolder) -> pl.DataFrame:
    """Intervals of the run: columns of `_KEY`, `low` and `high`."""
    chosen = run.statistics("intervals").filter(
        pl.col("aspect") == Aspect.all,
        pl.col("trimming").fill_null(Trimming.untrimmed) == Trimming.untrimmed,
        pl.col("weighting").fill_null(Weighting.features) == Weighting.features,
    )
    return chosen.select(pl.col("tracker").alias("setting"), *_KEY[1:], "low", "high")


def _row(condition: Mapping[str, Any], known: Known, measured: float | None, **where: Any) -> dict[str, Any]:
    place = {"coordinate": None, "at": None, "unit": None, **where}
    values = {"expected": known.value, "measured": measured, "standard_error": known.standard_error}
    return {"setting": condition["tracker"], "speed": condition["speed"], **place, **values}
