"""The topic focal length: whether another focal length would fit the image motion better."""

import numpy as np

from tracknoise.inspection.check_report import Item, Severity, Values
from tracknoise.inspection.evidence import Evidence, residual_px, thinned
from tracknoise.inspection.hypotheses import Hypothesis
from tracknoise.inspection.jackknife import jackknife
from tracknoise.inspection.optics import focal_px

_LOG_FACTORS = np.linspace(-0.3, 0.3, 61)
_LEAST_MOTION_PX, _FEWEST_PAIRS = 1.5, 10
_FLOOR_PX = 0.05
_MOST_GAIN, _LEAST_RELATIVE, _SURE_SD, _MOST_SD = 0.9, 0.02, 3.0, 0.05
_UNKNOWN = "The focal length cannot be determined from this recording."


def focal_length(evidence: Evidence) -> Item:
    """The focal length that fits best, where depths and motion determine it."""
    pairs = thinned([pair for pair in evidence.pairs if pair.motion_px >= _LEAST_MOTION_PX])
    if not evidence.has_depth or len(pairs) < _FEWEST_PAIRS:
        return Item("focal length", Severity.unknown, _UNKNOWN)
    zoomed = [Hypothesis("focal", "another focal length", zoom=float(np.exp(factor))) for factor in _LOG_FACTORS]
    residuals = np.array([[residual_px(evidence, pair, one) for one in zoomed] for pair in pairs])
    logs = np.log(np.clip(residuals, _FLOOR_PX, None))
    best, sd = jackknife(logs, lambda rows: float(_LOG_FACTORS[np.argmin(rows.mean(axis=0))]))
    means = logs.mean(axis=0)
    return _item(focal_px(evidence.camera), best, sd, gain=float(np.exp(means.min() - means[len(means) // 2])))


def _item(given_px: float, best: float, sd: float, *, gain: float) -> Item:
    fitted_px = given_px * float(np.exp(best))
    values: Values = {"given_px": given_px, "fitted_px": fitted_px, "fitted_sd_px": fitted_px * sd, "gain": gain}
    if sd > _MOST_SD:
        return Item("focal length", Severity.unknown, _UNKNOWN, values)
    if abs(best) > max(_LEAST_RELATIVE, _SURE_SD * sd) and gain < _MOST_GAIN:
        text = (
            f"A focal length of {fitted_px:.0f} +- {max(fitted_px * sd, 1.0):.0f} px fits the image motion better than "
            f"the given {given_px:.0f} px. Residuals fall to {gain:.0%}."
        )
        return Item("focal length", Severity.caveat, text, values)
    text = f"The focal length of {given_px:.4g} px agrees with the image motion."
    return Item("focal length", Severity.ok, text, values)
