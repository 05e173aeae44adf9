"""The calibration of predicted covariances, as sentences and tables."""

from tracknoise.findings.wording import number
from tracknoise.noise_models.calibration import Calibration
from tracknoise.noise_models.model import Interval
from tracknoise.printable import counted, significant
from tracknoise.report.cells import Cells
from tracknoise.report.noise_model_cells import interval_cells

_ALIKE = 1.1
"""Errors that are certainly not this many times as large, or as small, as predicted agree with a covariance."""


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
    if nees.low > 1.0:
        return f"The covariance is too small: errors are {size} times as large as predicted ({bounds})."
    if nees.high < 1.0:
        return f"The covariance is too large: errors are {size} times as large as predicted ({bounds})."
    if nees.low**0.5 > 1.0 / _ALIKE and nees.high**0.5 < _ALIKE:
        return f"The size of the errors agrees with the covariance: {size} times as large as predicted ({bounds})."
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
