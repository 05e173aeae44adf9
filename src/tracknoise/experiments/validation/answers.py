"""Findings about pools of scenes, compared with what is known about the pools.

Single intervals and p-values are wrong by chance now and then, so that limits apply to all of them together. A correct
program exceeds a limit with a probability of at most `ALARM`. Limits allow intervals to contain the true value in
`LEAST` to `MOST` of all cases, and to be wider or narrower than Student's by `SLACK` (mean errors) or `LOOSE_SLACK`
(second moments, whose intervals have no exact width).

Half the width of Student's interval of a mean is t s / sqrt(n), where s has n - 1 degrees of freedom d. The expected
value of log s is log sigma + (psi(d / 2) + log(2 / d)) / 2, and its variance psi'(d / 2) / 4 (width).
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import polars as pl
from scipy.special import polygamma, psi, stdtrit
from scipy.stats import binom, kstwo, norm

from tracknoise.experiments.validation.checks import Area, answer, within
from tracknoise.experiments.validation.pools import (
    LOG_SPREAD,
    MEAN_SPREAD_PX,
    N_TRACKS,
    NOISE_PX,
    REPLICATES,
)
from tracknoise.tables.defaults import LEVEL
from tracknoise.tables.enumerations import Behaviour, Shape, Verdict
from tracknoise.tables.store import RunFolder

ALARM = 1e-4
"""Probability that a correct program exceeds one limit."""
LEAST, MOST = 0.93, 0.97
"""Shares of intervals that contain the true value, between which a method counts as correct."""
SLACK, LOOSE_SLACK = 1.1, 1.35
_NULL = [f"{kind} {number}" for kind in ("mean", "scale") for number in range(REPLICATES)]
_GROWTH = {"white": Behaviour.white, "walk": Behaviour.random_walk, "drift": Behaviour.drift}
_LARGER = {"eta": Verdict.yes, "Phi": Verdict.yes, "outlier_ratio": Verdict.yes, "lifetime": Verdict.no}
_SAME = {"eta": Verdict.no, "outlier_ratio": Verdict.no, "lifetime": Verdict.no}
"""Verdicts on the second lighting, of `rough` and of `calm`."""


def pool_checks(run: RunFolder, *, scenes: int) -> Iterator[pl.DataFrame]:
    """Compare intervals and verdicts of `pool` with what is known.

    Parameters
    ----------
    run
        What `tracknoise.experiments.validation.pools.measure_pool` wrote, with its findings.
    scenes
        Its number of scenes.

    Yields
    ------
    polars.DataFrame
        Schema `CHECKS`.
    """
    yield from interval_checks(run.statistics("intervals"), scenes=scenes)
    yield from zero_mean_checks(run.statistics("zero_mean").filter(trimming="untrimmed"))
    yield from _growth(run.statistics("time_structure").filter(trimming="untrimmed"))
    yield from _shape(run.statistics("gaussianity").filter(trimming="untrimmed"))


def factor_checks(run: RunFolder) -> Iterator[pl.DataFrame]:
    """Compare verdicts on factors in `factors` with what is known: see `pool_checks`."""
    verdicts = run.statistics("dependence")
    for tracker, known in (("rough", _LARGER), ("calm", _SAME)):
        for statistic, verdict in known.items():
            found = verdicts.filter(factor="lighting", tracker=tracker, statistic=statistic)["verdict"].to_list()
            quantity = f"lighting changes {statistic} of {tracker}"
            yield answer(Area.factors, "factors", quantity, found, allowed=[verdict])
    few = verdicts.filter(factor="rotation")["verdict"].to_list()
    yield answer(Area.factors, "factors", "rotation, too few scenes", few, allowed=[Verdict.undecided])


def interval_checks(intervals: pl.DataFrame, *, scenes: int) -> Iterator[pl.DataFrame]:
    """Coverage and width of the intervals of mean errors and second moments.

    Parameters
    ----------
    intervals
        Statistics table of that name, of `pool`.
    scenes
        Its number of scenes.
    """
    chosen = intervals.filter(
        pl.col("at") > 0, aspect="all", population="visible", trimming="untrimmed", weighting="features"
    )
    means = chosen.filter(pl.col("tracker").str.starts_with("mean"), statistic="nu")
    n = N_TRACKS * scenes
    second = NOISE_PX**2 * math.exp(2 * LOG_SPREAD**2) * n / (n - 1)
    scales = chosen.filter(pl.col("tracker").str.starts_with("scale"), pl.col("coordinate") != "uv", statistic="Phi")
    covered = [(part["low"] <= value) & (part["high"] >= value) for part, value in ((means, 0.0), (scales, second))]
    yield from _coverage(pl.concat(covered).drop_nulls().to_list())
    apart_px = math.sqrt(MEAN_SPREAD_PX**2 + NOISE_PX**2 / N_TRACKS)
    half = (means["high"] - means["low"]) / 2
    yield _width("mean error", half, apart_px, scenes, slack=SLACK)
    apart = math.sqrt(math.exp(4 * LOG_SPREAD**2) * (1 + 2 / N_TRACKS) - 1)
    yield _width("second moment", (scales["high"] / scales["low"]).log() / 2, apart, scenes, slack=LOOSE_SLACK)


def _coverage(covered: Sequence[bool]) -> Iterator[pl.DataFrame]:
    n = len(covered)
    low, high = binom.ppf(ALARM, n, LEAST) / max(n, 1), binom.isf(ALARM, n, MOST) / max(n, 1)
    share = float(np.mean(covered)) if covered else None
    yield within(Area.intervals, "pool", "share of intervals with the true value", share, low=low, high=high, n=n)


def _width(quantity: str, half: pl.Series, apart: float, scenes: int, *, slack: float) -> pl.DataFrame:
    """Geometric mean of half the widths, relative to (width) for scenes whose values are `apart`."""
    freedom, n = scenes - 1, half.len()
    student = float(stdtrit(freedom, (1 + LEVEL) / 2)) * apart / math.sqrt(scenes)
    expected = math.log(student) + (float(psi(freedom / 2)) + math.log(2 / freedom)) / 2
    error = float(norm.isf(ALARM / 2)) * math.sqrt(float(polygamma(1, freedom / 2)) / 4 / max(n, 1))
    mean = half.log().mean()
    ratio = None if mean is None or half.null_count() else math.exp(float(mean) - expected)  # type: ignore[arg-type]
    limit = slack * math.exp(error)
    what = f"width of intervals of the {quantity}, over Student's"
    return within(Area.intervals, "pool", what, ratio, low=1 / limit, high=limit, n=n)


def zero_mean_checks(tests: pl.DataFrame) -> Iterator[pl.DataFrame]:
    """Verdicts of true zeros and of a mean that is not zero, and the distribution of p-values of true zeros.

    Parameters
    ----------
    tests
        Statistics table `zero_mean`, of `pool`, untrimmed.
    """
    zeros = tests.filter(pl.col("tracker").is_in(_NULL))
    overall = zeros.filter(pl.col("at").is_null())["verdict"].cast(pl.String)
    yes, most = int((overall == Verdict.yes).sum()), int(binom.isf(ALARM, overall.len(), 1 - LEVEL))
    yield within(Area.zero_mean, "pool", "true zeros that are rejected", yes, low=0, high=most, n=overall.len())
    p = zeros.filter(pl.col("at").is_not_null())["sign_flip_p"].drop_nulls().sort().to_numpy()
    places = np.arange(len(p)) / max(len(p), 1)
    distance = float(np.max(np.maximum(p - places, places + 1 / len(p) - p))) if len(p) else None
    limit = float(kstwo.isf(ALARM, max(len(p), 1)))
    what = "distance of p-values from uniform (Kolmogorov)"
    yield within(Area.zero_mean, "pool", what, distance, low=0, high=limit, n=len(p))
    found = tests.filter(pl.col("at").is_null(), tracker="biased")["verdict"].to_list()
    yield answer(Area.zero_mean, "pool", "a mean of half a pixel", found, allowed=[Verdict.yes])


def _growth(growth: pl.DataFrame) -> Iterator[pl.DataFrame]:
    for tracker, verdict in _GROWTH.items():
        found = growth.filter(tracker=tracker)["verdict"].to_list()
        yield answer(Area.growth, "pool", tracker, found, allowed=[verdict])


def _shape(shapes: pl.DataFrame) -> Iterator[pl.DataFrame]:
    """Gaussian errors may be undecided in some bands of ages, but not in most."""
    gaussian = shapes.filter(tracker="white")["verdict"].to_list()
    yield answer(Area.shape, "pool", "Gaussian errors", gaussian, allowed=[Shape.gaussian, Shape.undecided])
    certain = sum(verdict == Shape.gaussian for verdict in gaussian)
    bands = len(gaussian)
    yield within(Area.shape, "pool", "bands that are Gaussian", certain, low=(bands + 1) // 2, high=bands, n=bands)
    heavy = shapes.filter(tracker="heavy")["verdict"].to_list()
    yield answer(Area.shape, "pool", "heavy tails", heavy, allowed=[Shape.heavy_tailed, Shape.contaminated])
