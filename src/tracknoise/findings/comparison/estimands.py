"""The statistics by which two runs are compared: what is estimated, in which unit, and which way is better.

All of them are differences within scenes, averaged over scenes of equal weight. Scales, shares of events, lifetimes and
counts are compared as ratios: geometric means over scenes.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class Unit(StrEnum):
    """Unit of an effect: a ratio, px, or a difference of shares."""

    ratio = "ratio"
    px = "px"
    share = "share"


@dataclass(frozen=True, slots=True)
class Estimand:
    """One statistic.

    Attributes
    ----------
    title
        For readers.
    meaning
        What is estimated.
    unit
        Unit of the effect.
    larger_is_better
        Whether a larger value is better.
    """

    title: str
    meaning: str
    unit: Unit = Unit.ratio
    larger_is_better: bool = False


_MEAN = "geometric mean over scenes, ages (or frames) and both coordinates"
_TAP = "as TAP-Vid defines it for images of 256 x 256 pixels, mean over scenes"

ESTIMANDS: Mapping[str, Estimand] = {
    "core": Estimand("core of the errors", f"Robust standard deviation of the errors of a scene: {_MEAN}."),
    "second_moment": Estimand("second moment", f"Second moment of all errors about zero, untrimmed: {_MEAN}."),
    "bias": Estimand(
        "bias",
        "Size of the mean error in u or v, mean over scenes, at the age (or frame) that changed most clearly.",
        Unit.px,
    ),
    "tails": Estimand(
        "tails",
        "Share of the errors of a scene that are larger than three cores of their age, all ages together: geometric "
        "mean over scenes and both coordinates.",
    ),
    "growth": Estimand(
        "growth",
        "Factor by which the second moment grows from the youngest to the oldest age, by a straight line through "
        "logarithms: geometric mean over scenes and both coordinates.",
    ),
    "outlier_ratio": Estimand(
        "outlier ratio", "Features rejected as outliers, divided by features offered: geometric mean over scenes."
    ),
    "lifetime": Estimand(
        "lifetime",
        "Restricted mean lifetime to a horizon that all scenes reach in both runs: geometric mean over scenes.",
        larger_is_better=True,
    ),
    "feature_count": Estimand(
        "feature count", "Mean number of features per frame: geometric mean over scenes.", larger_is_better=True
    ),
    "consistent_sigma": Estimand(
        "sigma to set",
        "Consistent sigma, the one to set in an estimator, of the longest windows up to 15 observations that enough "
        "scenes of both runs have: geometric mean over scenes.",
    ),
    "residual_sigma": Estimand(
        "residual sigma",
        "Residual core of windows of observations, what residuals look like: geometric mean over scenes and lengths of "
        "windows.",
    ),
    "overconfidence": Estimand(
        "overconfidence",
        "Consistent sigma of windows, divided by their residual core: geometric mean over scenes and lengths.",
    ),
    "tap_delta_avg": Estimand("position accuracy (TAP)", f"Delta average, {_TAP}.", Unit.share, larger_is_better=True),
    "tap_average_jaccard": Estimand(
        "average Jaccard (TAP)", f"Average Jaccard, {_TAP}.", Unit.share, larger_is_better=True
    ),
    "tap_occlusion_accuracy": Estimand(
        "occlusion accuracy (TAP)", f"Occlusion accuracy, {_TAP}.", Unit.share, larger_is_better=True
    ),
    "expected_feature_age": Estimand(
        "expected feature age",
        "Share of its visible time for which a point is tracked, in images of 256 x 256 pixels, mean over scenes.",
        Unit.share,
        larger_is_better=True,
    ),
}
"""By name, in the order in which they are reported."""
OF_ERRORS = ("core", "second_moment", "bias", "tails", "growth")
"""Statistics of errors. Without meaning where true positions are fitted to the tracks."""


class OfStatistic:
    """Anything about one of the `ESTIMANDS`.

    Attributes
    ----------
    statistic
        Its name.
    """

    __slots__ = ()
    statistic: str

    @property
    def estimand(self) -> Estimand:
        """What is estimated."""
        return ESTIMANDS[self.statistic]
