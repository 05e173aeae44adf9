"""What a number of a run is: its unit and what it estimates.

A quantity is declared once. Its name is the value of the column `quantity` of the table of results.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class ComparedBy(StrEnum):
    """How a quantity of two conditions is compared."""

    difference = "difference"
    ratio = "ratio"
    none = "none"


class Better(StrEnum):
    """Which value of a quantity is the better one."""

    smaller = "smaller"
    larger = "larger"
    neither = "neither"


@dataclass(frozen=True, slots=True)
class Quantity:
    """What a number is.

    Attributes
    ----------
    unit
        Of the value and its bounds; 1 for ratios and counts. Where it is None, the row states it.
    estimand
        What it estimates: of which tracks, weighted how. The row states population, trimming and weighting.
    title
        Of its figure.
    better
        Which value is better, for a quantity that has a figure.
    compared
        How conditions are compared, for a quantity of `RATIOS`.
    sentence
        Its finding about ``{tracker}``, with its ``{value}``, for a quantity of `RATIOS`.
    """

    unit: str | None
    estimand: str
    title: str = ""
    better: Better = Better.neither
    compared: ComparedBy = ComparedBy.none
    sentence: str = ""


QUANTITIES: Mapping[str, Quantity] = {
    # errors, by age (frame) and coordinate
    "mean_error": Quantity("px", "Mean error of the tracks that are followed at this age (frame)."),
    "mean_absolute_error": Quantity("px", "Mean absolute error of one coordinate."),
    "second_moment": Quantity("px^2", "Second moment of the error about zero; its root is the RMS."),
    "central_moment": Quantity("px^2", "Covariance of the errors about their mean."),
    "core": Quantity("px", "Sigma of the Gaussian with the same median absolute error: geometric mean over scenes."),
    "share_beyond_three_cores": Quantity(
        "share", "Share of the errors beyond three cores of their scene; .0027 for a Gaussian."
    ),
    "autocorrelation": Quantity(
        "1", "Correlation of the changes of the error at a lag, in frames that the tracker saw."
    ),
    # ratios of sums over features, by age: see tracknoise.statistics.ratios
    "gross_error_share": Quantity(
        "share",
        "Share of the visible features whose error is longer than 3 px.",
        "Errors longer than 3 px",
        Better.smaller,
        ComparedBy.difference,
        sentence="{value} of the features of {tracker} are farther than 3 px from their true position.",
    ),
    # tracks
    "mean_lifetime": Quantity(
        "frames", "Mean number of consecutive frames, of tracks that ended and that were cut alike."
    ),
    "median_lifetime": Quantity("frames", "Kaplan-Meier median lifetime, tracks pooled over scenes."),
    "lower_quartile_lifetime": Quantity("frames", "Kaplan-Meier lower quartile of lifetimes."),
    "upper_quartile_lifetime": Quantity("frames", "Kaplan-Meier upper quartile of lifetimes."),
    "restricted_mean_lifetime": Quantity("frames", "Mean of min(lifetime, horizon), from the Kaplan-Meier curve."),
    "median_until_failure": Quantity("frames", "Median lifetime where only lost tracks and outliers count as ended."),
    "restricted_mean_until_failure": Quantity(
        "frames", "Restricted mean where only lost tracks and outliers count as ended."
    ),
    "survival": Quantity("share", "Kaplan-Meier share of tracks that live longer than this."),
    "survival_until_failure": Quantity("share", "The same where only lost tracks and outliers count as ended."),
    "tracks_ended": Quantity("1", "Number of tracks that ended with this lifetime."),
    "tracks_censored": Quantity("1", "Number of tracks that the end of their sequence cut at this lifetime."),
    "tracks_ended_by_cause": Quantity("1", "Number of tracks that ended with this lifetime, by cause."),
    "followed_to": Quantity("frames", "Largest lifetime up to which every scene of the condition was followed."),
    # outliers
    "outlier_ratio": Quantity("share", "Outliers over features carried into a frame, all frames pooled."),
    "outlier_ratio_of_frames": Quantity("share", "Distribution of the outlier ratio over frames."),
    "frames": Quantity("1", "Number of frames with carried features."),
    "features_offered": Quantity("1", "Number of features carried into frames."),
    "features_rejected": Quantity("1", "Number of features rejected as outliers."),
    # truth floor
    "truth_floor": Quantity(
        "px^2", "Second moment of the errors of the true positions, as far as their accuracy is known."
    ),
    "truth_floor_of_mean": Quantity("px", "Standard deviation of what errors of the truth add to the mean error."),
    # factors
    "effect_count": Quantity("1", "Numbers of levels, pairs, ages and scenes behind an effect."),
    "largest_difference": Quantity(None, "Largest difference between levels' pooled curves, the paper's measure."),
    "largest_difference_part": Quantity(None, "What the largest difference is made from."),
}
"""Quantities of `tracknoise.tables.findings_schema`, and ratios. All others are declared beside their tables."""
RATIOS: tuple[str, ...] = tuple(name for name, quantity in QUANTITIES.items() if quantity.sentence)
"""Quantities that are ratios of two sums over features (`tracknoise.statistics.ratios`).

Their intervals, sentences, figures and comparisons are made from what is declared here.
"""
