"""Noise models as sentences and tables."""

import math

from tracknoise.findings.wording import number
from tracknoise.noise_models.model import BiasKind, Interval, Landmark, Purpose
from tracknoise.noise_models.noise_model import NoiseModel
from tracknoise.printable import counted, significant
from tracknoise.report.cells import Cells

_COMPONENTS = {
    "first": ("first position (A)", "px"),
    "white": ("each frame (W)", "px"),
    "walk": ("walk (Q)", "px per sqrt(frame)"),
    "drift": ("drift (D)", "px per frame"),
}
_LANDMARKS = {
    Landmark.FREE: "point solved for",
    Landmark.EXACT: "first observation exact",
    Landmark.STATE: "first direction a state",
}
_PURPOSES = {
    Purpose.INNOVATIONS: "innovations",
    Purpose.ALL_POSES: "all poses",
    Purpose.NEWEST_POSE: "newest pose",
    Purpose.DEPTH: "depth",
}


def model_sentences(model: NoiseModel) -> list[str]:
    """What a model says, the answer first."""
    training = model.training
    return [
        f"Noise of {training.tracker} at speed {training.speed:g}.",
        *_advice(model),
        _tails(model),
        f"{_percent(model.outlier_share)} of the observations are outliers, with errors beyond about "
        f"{number(model.outliers_beyond_px)} px; the numbers do not describe them.",
        _bias(model),
        *_conditions(model),
        *_common(model),
        *_floor(model),
        f"Fitted to {counted(len(training.scenes), 'scene')}, {counted(training.n_tracks, 'track')}, "
        f"ages {training.ages[0]} to {training.ages[1]} frames.",
        *model.camera.notes,
    ]


def component_cells(model: NoiseModel) -> Cells:
    """The components, with the reason where one was dropped."""
    rows = []
    for name, (title, unit) in _COMPONENTS.items():
        part = getattr(model, name)
        rows.append([title, *interval_cells(part.sigma), unit, part.why_dropped or ""])
    return Cells("Components", ["component", "sigma", "low", "high", "unit", "dropped because"], rows, _NUMERIC)


_NUMERIC = (False, True, True, True, False, False)


def equivalent_cells(model: NoiseModel, window: int) -> Cells:
    """Standard deviations for windows of nearly this length, named by what they make right."""
    lengths = sorted({one.window for one in model.equivalents}, key=lambda length: (abs(length - window), length))
    some = [one for one in model.equivalents if lengths and one.window == lengths[0]]
    rows = [
        [
            _LANDMARKS[one.landmark],
            _PURPOSES[one.purpose],
            *interval_cells(one.sigma),
            number(one.gate_95),
            number(one.gate_99),
        ]
        for one in some
    ]
    headings = ["landmark", "makes right", "sigma, px", "low", "high", "gate .95", "gate .99"]
    caption = f"One sigma for all observations, windows of {lengths[0] if lengths else window} frames"
    return Cells(caption, headings, rows, (False, False, True, True, True, True, True))


def _advice(model: NoiseModel) -> list[str]:
    """What to set, and what residuals will look like."""
    known = [one for one in model.equivalents if one.landmark is Landmark.FREE and one.window == 10]
    by_purpose = {one.purpose: one.sigma for one in known}
    if not {Purpose.NEWEST_POSE, Purpose.INNOVATIONS} <= by_purpose.keys():
        return []
    newest, residuals = by_purpose[Purpose.NEWEST_POSE], by_purpose[Purpose.INNOVATIONS]
    text = f"For windows of 10 frames, {_range(newest)} px makes the covariance of the newest pose right."
    if residuals.value == 0.0:
        return [text]
    more = f"Residuals look like {number(residuals.value)} px."
    factor = newest.value / residuals.value
    warning = f"Tuned to them, the newest pose is {number(factor)} times less certain than claimed."
    return [text, more, warning] if factor >= 1.05 else [text, more]


def _range(interval: Interval) -> str:
    if interval.low is None or interval.high is None:
        return number(interval.value)
    return f"{number(interval.value)} ({number(interval.low)} to {number(interval.high)})"


def _tails(model: NoiseModel) -> str:
    if math.isinf(model.tails.nu):
        return "Tails are no heavier than those of a Gaussian."
    knee = model.loss().knee
    return (
        f"Tails are those of Student's t with {number(model.tails.nu)} degrees of freedom; the loss of Cauchy with its "
        f"knee at {number(knee)} sigma fits them."
    )


def _bias(model: NoiseModel) -> str:
    verdict = {
        BiasKind.NONE: "The mean error is not part of the model",
        BiasKind.REFUSED: "No correction of the mean error is warranted",
    }
    return f"{verdict.get(model.bias.kind, 'The mean error should be corrected')}: {model.bias.why}."


def _conditions(model: NoiseModel) -> list[str]:
    return [
        f"White noise and walk depend on {one.of}: their variances change by a factor of "
        f"{number(math.exp(max(one.log_factor) - min(one.log_factor)))}. On scenes that were left out this gains "
        f"{number(one.gain.value)} nat per change{' beyond the first factor' if place else ''}."
        for place, one in enumerate(model.conditions)
    ]


def _common(model: NoiseModel) -> list[str]:
    """How much of the noise does not average out over the features of a frame."""
    share = model.common_share
    if share is None:
        return []
    bounds = "" if share.low is None or share.high is None else f" ({_percent(share.low)} to {_percent(share.high)})"
    text = f"All features of a frame have {_percent(share.value)} of the variance in common{bounds}."
    if not share.low:
        return [text]
    return [text, f"More than {1.0 / share.value:.0f} features in a frame therefore improve a pose little."]


def _floor(model: NoiseModel) -> list[str]:
    if not model.truth_floor_px:
        return []
    return [f"Errors of the truth are part of these numbers: {number(model.truth_floor_px)} px root mean square."]


def interval_cells(interval: Interval) -> list[str]:
    """A value and its bounds, each in a cell of its own; empty where there is none."""
    return [number(value) if value is not None else "" for value in (interval.value, interval.low, interval.high)]


def _percent(share: float) -> str:
    return f"{significant(100.0 * share, 2)} %"
