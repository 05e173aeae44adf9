"""Calibrations and tables of noise as sentences and tables, and the reliability plot."""

import math
from typing import Any

from benchmarks.noise.calibration import Calibration
from benchmarks.noise.noise_table import NoiseRow, NoiseTable, SecondMoment
from tracknoise.analysis.covariance_verdicts import are_right
from tracknoise.estimators.model import Bias, BiasKind, Interval, Purpose
from tracknoise.report.cells import Cells
from tracknoise.report.noise_cells import interval_cells
from tracknoise.tables.enumerations import Product, Trust, Verdict
from tracknoise.text import counted, significant
from tracknoise.topics.lookup_topic import lookup_sentences
from tracknoise.words import DASH, number, percent, ratio, thousandths


def calibration_sentences(found: Calibration) -> list[str]:
    """What the comparison says, the answer first."""
    return [
        _verdict(found.nees),
        f"Compared with {counted(found.n, 'error')} of {counted(found.n_scenes, 'scene')}.",
        *_trained(found),
        *_outliers(found),
        *_impossible(found),
    ]


def _verdict(nees: Interval) -> str:
    size = number(nees.value**0.5)
    if nees.low is None or nees.high is None:
        return f"Errors are {size} times as large as predicted. There are too few scenes for an interval."
    bounds = f"{number(nees.low**0.5)} to {number(nees.high**0.5)}"
    right = are_right(nees.low, nees.high)
    if right is Verdict.yes:
        return f"The size of the errors agrees with the covariance: {size} times as large as predicted ({bounds})."
    if right is Verdict.no:
        is_what = "small" if nees.low > 1.0 else "large"
        return f"The covariance is too {is_what}: errors are {size} times as large as predicted ({bounds})."
    return f"Errors are {size} times as large as predicted ({bounds}): whether the covariance is right is undecided."


def _trained(found: Calibration) -> list[str]:
    if not found.n_trained:
        return []
    return [f"The model was fitted to {found.n_trained} of these scenes. This is no test on new scenes."]


def _outliers(found: Calibration) -> list[str]:
    if not found.outlier_share:
        return []
    return [f"{significant(100 * found.outlier_share, 2)} % of the errors are outliers of the model, and do not count."]


def _impossible(found: Calibration) -> list[str]:
    if not found.n_impossible:
        return []
    more, do = counted(found.n_impossible, "more error"), "it does" if found.n_impossible == 1 else "they do"
    return [f"For {more}, what is predicted is not positive definite; {do} not count."]


def calibration_cells(found: Calibration) -> Cells:
    """Coverage, NEES and likelihood with their intervals, and the value of a right covariance."""
    rows = [
        [f"coverage at {100 * level:g} %", *interval_cells(share), number(level)]
        for level, share in found.coverage.items()
    ]
    rows += [["NEES per degree of freedom", *interval_cells(found.nees), "1"]]
    rows += [["negative log likelihood, nat", *interval_cells(found.nll), ""]]
    rows += [["ENCE", number(found.ence), "", "", "0"]]
    return Cells("Calibration", ["quantity", "value", "low", "high", "if right"], rows, (False, *[True] * 4))


def reliability_cells(found: Calibration) -> Cells:
    """Predicted and measured standard deviations by class."""
    measured = [Interval(value=one.measured_px, low=one.low_px, high=one.high_px) for one in found.reliability]
    rows = [
        [number(one.predicted_px), *interval_cells(interval), str(one.n)]
        for one, interval in zip(found.reliability, measured, strict=True)
    ]
    headings = ["predicted, px", "measured, px", "low", "high", "errors"]
    return Cells("Standard deviations by class", headings, rows, (True,) * 5)


_ALL = "all"


def noise_table_sentences(table: NoiseTable) -> list[str]:
    """Which lookup is worth it on scenes that were left out, and how much bias is warranted."""
    truth = [] if table.truth.verdict is Trust.trusted else [table.truth.sentence]
    gains = [text for product in (Product.error, Product.change) for text in lookup_sentences(table.gains, product)]
    warranted = sum(_is_warranted(row.bias) for row in table.rows)
    bias = f"A correction of the mean error is warranted in {warranted} of {counted(len(table.rows), 'row')}."
    return [*truth, *(gains or [_no_gain(table)]), bias]


def _no_gain(table: NoiseTable) -> str:
    """Why no gain is known."""
    reasons = table.gains["why"].drop_nulls().unique(maintain_order=True).to_list()
    if not reasons:
        return "The run varies neither tracker, speed nor motion."
    return f"It is unknown whether the noise depends on tracker, speed or motion: {reasons[0]}."


def noise_table_cells(table: NoiseTable) -> Cells:
    """One row per tracker, speed and motion: sigmas, root second moments, and the bias."""
    age = _common_age(table)
    headings = ["tracker", "speed", "motion", "scenes", "innovations", "newest pose", "change u", "change v"]
    headings += [f"error u, age {age}", f"error v, age {age}"] if age else []
    rows = [_row(row, age) for row in table.rows]
    caption = (
        f"Noise in px. Sigma that makes innovations and the newest pose right, windows of {table.window} frames; root "
        "second moments about zero of changes between observations and of errors about the first position"
    )
    numeric = [False, True, False, *[True] * (len(headings) - 3), True, False]
    return Cells(caption, [*headings, "outliers", "bias"], rows, numeric)


def gain_cells(table: NoiseTable) -> Cells:
    """What each lookup gains on scenes that were left out."""
    headings = ["second moment of", "looked up by", "over", "gain, nat", "low", "high", "gain", "factor", "before"]
    rows = [_gain(row) for row in table.gains.to_dicts()]
    return Cells(
        "Gain on scenes that were left out, per error, and by which factor the second moment of a scene differs",
        [*headings, "scenes", "why"],
        rows,
        [False] * 3 + [True] * 3 + [False] + [True] * 3 + [False],
    )


def _common_age(table: NoiseTable) -> int | None:
    """The oldest age at which all rows have errors."""
    ages = [{one.age for one in row.errors if one.age is not None} for row in table.rows]
    return max(set.intersection(*ages), default=None) if ages else None


def _row(row: NoiseRow, age: int | None) -> list[str]:
    sigmas = [row.sigma.get(purpose) for purpose in (Purpose.INNOVATIONS, Purpose.NEWEST_POSE)]
    error = next((one for one in row.errors if one.age == age), None)
    return [
        row.tracker,
        str(row.speed),
        row.motion or _ALL,
        str(len(row.scenes)),
        *(DASH if one is None else number(one.value) for one in sigmas),
        *_roots(row.changes),
        *(_roots(error) if age else ()),
        percent(row.outlier_share),
        _table_bias(row.bias),
    ]


def _roots(one: SecondMoment | None) -> list[str]:
    return [DASH, DASH] if one is None else [number(math.sqrt(one.uu)), number(math.sqrt(one.vv))]


def _is_warranted(bias: Bias) -> bool:
    return bias.kind in (BiasKind.BY_AGE, BiasKind.ALONG_MOTION)


def _table_bias(bias: Bias) -> str:
    """The correction, or that none is warranted."""
    if bias.kind is BiasKind.ALONG_MOTION:
        return f"{number(bias.per_motion)} per px of motion"
    if bias.kind is BiasKind.BY_AGE:
        longest = max(bias.mean_px, key=lambda mean: math.hypot(*mean))
        return f"by age, up to {number(math.hypot(*longest))} px"
    return "none"


def _gain(row: dict[str, Any]) -> list[str]:
    what = [row["product"], row["lookup"], row["against"]]
    nats = [thousandths(row[name]) for name in ("gain_nats", "low", "high")]
    factors = [DASH if row[name] is None else ratio(row[name]) for name in ("factor", "factor_against")]
    verdict = {True: "established", False: "not established", None: "unknown"}[row["established"]]
    return [*what, *nats, verdict, *factors, str(row["n_scenes"]), row["why"] or ""]
