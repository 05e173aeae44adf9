"""The catalogue of quantities: every number that a run can have, with its unit and what it estimates.

A quantity is declared here once. Its name is the value of the column `quantity` of the table of results.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class ResultTopic(StrEnum):
    """What a result is about."""

    errors = "errors"
    tracks = "tracks"
    outliers = "outliers"
    causes = "causes"
    truth_floor = "truth floor"
    bias = "bias"
    shape = "shape"
    radii = "radii"
    growth = "growth"
    factors = "factors"
    ranks = "ranks"
    largest_differences = "largest differences"
    windows = "windows"
    advice = "advice"
    lookup = "lookup"
    depths = "depths"
    own_covariances = "own covariances"
    point_tracking = "point tracking"
    fitted_noise = "fitted noise"
    second_truth = "second truth"
    pose_disagreement = "pose disagreement"
    shared_motion = "shared motion"
    pose_share = "pose share"
    pose_errors = "pose errors"
    tracker_differences = "tracker differences"
    surroundings = "surroundings"
    image = "image"
    ratios = "ratios"
    image_speeds = "image speeds"
    seeds = "seeds"


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
    compared
        How conditions are compared.
    better
        Which value is better.
    title
        Of its figure and its comparison, for a quantity of `RATIOS`.
    sentence
        Its finding about ``{tracker}``, with its ``{value}``, for a quantity of `RATIOS`.
    """

    unit: str | None
    estimand: str
    compared: ComparedBy = ComparedBy.none
    better: Better = Better.neither
    title: str = ""
    sentence: str = ""


_RATIO, _DIFFERENCE = ComparedBy.ratio, ComparedBy.difference
_SMALLER, _LARGER = Better.smaller, Better.larger

QUANTITIES: Mapping[str, Quantity] = {
    # errors, by age (frame) and coordinate
    "mean_error": Quantity(
        "px", "Mean error of the tracks that are followed at this age (frame).", _DIFFERENCE, _SMALLER
    ),
    "mean_absolute_error": Quantity("px", "Mean absolute error of one coordinate.", _RATIO, _SMALLER),
    "second_moment": Quantity("px^2", "Second moment of the error about zero; its root is the RMS.", _RATIO, _SMALLER),
    "central_moment": Quantity("px^2", "Covariance of the errors about their mean.", _RATIO, _SMALLER),
    "core": Quantity(
        "px", "Sigma of the Gaussian with the same median absolute error: geometric mean over scenes.", _RATIO, _SMALLER
    ),
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
        _DIFFERENCE,
        _SMALLER,
        title="Errors longer than 3 px",
        sentence="{value} of the features of {tracker} are farther than 3 px from their true position.",
    ),
    # tracks
    "mean_lifetime": Quantity(
        "frames", "Mean number of consecutive frames, of tracks that ended and that were cut alike.", _RATIO, _LARGER
    ),
    "median_lifetime": Quantity("frames", "Kaplan-Meier median lifetime, tracks pooled over scenes.", _RATIO, _LARGER),
    "lower_quartile_lifetime": Quantity("frames", "Kaplan-Meier lower quartile of lifetimes.", _RATIO, _LARGER),
    "upper_quartile_lifetime": Quantity("frames", "Kaplan-Meier upper quartile of lifetimes.", _RATIO, _LARGER),
    "restricted_mean_lifetime": Quantity(
        "frames", "Mean of min(lifetime, horizon), from the Kaplan-Meier curve.", _RATIO, _LARGER
    ),
    "median_until_failure": Quantity(
        "frames", "Median lifetime where only lost tracks and outliers count as ended.", _RATIO, _LARGER
    ),
    "restricted_mean_until_failure": Quantity(
        "frames", "Restricted mean where only lost tracks and outliers count as ended.", _RATIO, _LARGER
    ),
    "survival": Quantity("share", "Kaplan-Meier share of tracks that live longer than this.", _DIFFERENCE, _LARGER),
    "survival_until_failure": Quantity(
        "share", "The same where only lost tracks and outliers count as ended.", _DIFFERENCE, _LARGER
    ),
    "tracks_ended": Quantity("1", "Number of tracks that ended with this lifetime."),
    "tracks_censored": Quantity("1", "Number of tracks that the end of their sequence cut at this lifetime."),
    "tracks_ended_by_cause": Quantity("1", "Number of tracks that ended with this lifetime, by cause."),
    "followed_to": Quantity("frames", "Largest lifetime up to which every scene of the condition was followed."),
    "incidence": Quantity(
        "share", "Share of all tracks that a cause has ended up to this lifetime.", _DIFFERENCE, _SMALLER
    ),
    # outliers
    "outlier_ratio": Quantity(
        "share", "Outliers over features carried into a frame, all frames pooled.", _RATIO, _SMALLER
    ),
    "outlier_ratio_of_frames": Quantity("share", "Distribution of the outlier ratio over frames."),
    "frames": Quantity("1", "Number of frames with carried features."),
    "features_offered": Quantity("1", "Number of features carried into frames."),
    "features_rejected": Quantity("1", "Number of features rejected as outliers."),
    # truth floor
    "truth_floor": Quantity(
        "px^2", "Second moment of the errors of the true positions, as far as their accuracy is known."
    ),
    "truth_floor_of_mean": Quantity("px", "Standard deviation of what errors of the truth add to the mean error."),
    # tests of zero mean
    "bias": Quantity(
        "px",
        "Length of the mean error, scenes weighted equally; the verdict says whether it is not zero.",
        _DIFFERENCE,
        _SMALLER,
    ),
    "bias_component": Quantity("px", "Mean error in u or v, scenes weighted equally.", _DIFFERENCE, _SMALLER),
    "bias_share": Quantity(
        "share", "Square of the mean over the second moment, u and v together.", _DIFFERENCE, _SMALLER
    ),
    "p_value": Quantity("1", "Chance of such a mean error, or a larger one, if the true mean is zero."),
    # shape
    "shape": Quantity("1", "Verdict on the distribution of the errors, each scene standardised."),
    "skewness": Quantity("1", "Mardia's b1, 0 for a Gaussian."),
    "kurtosis": Quantity("1", "Mardia's b2, 8 for a Gaussian in two dimensions."),
    "tail_ratio": Quantity("1", "Share of errors beyond an ellipse, over that of a Gaussian."),
    "gain": Quantity("nat", "Held-out log-likelihood per error over a Gaussian."),
    "student_nu": Quantity("1", "Degrees of freedom of the fitted Student's t."),
    "student_scale": Quantity("px", "Scale of one coordinate of the fitted Student's t."),
    "mixture_share": Quantity("share", "Share of the wider component of the fitted mixture."),
    "mixture_ratio": Quantity("1", "Covariance of the wider component over that of the narrower one."),
    "errors_sampled": Quantity("1", "Number of errors that densities were fitted to."),
    "radius": Quantity(
        "1", "Quantile of the Mahalanobis distance: of a Gaussian (expected) and of the errors (observed)."
    ),
    # growth
    "growth": Quantity("1", "Verdict on how the second moment grows with age: by its established parts."),
    "growth_ratio": Quantity(
        "1",
        "RMS at age 10 over that at the first age, of the tracks that live to age 10; scenes count alike.",
        _RATIO,
        _SMALLER,
    ),
    "white": Quantity("px", "Part of the error that is the same at every age.", _RATIO, _SMALLER),
    "random_walk": Quantity("px per sqrt(frame)", "Part whose variance grows linearly with age.", _RATIO, _SMALLER),
    "drift": Quantity("px per frame", "Part that grows linearly with age.", _RATIO, _SMALLER),
    "saturating_white": Quantity("px", "Constant part of the saturating model."),
    "saturating": Quantity("px", "Size to which the saturating part grows."),
    "saturating_frames": Quantity("frames", "Time constant of the saturating part."),
    # factors
    "effect": Quantity(None, "Largest difference that a factor makes, paired within scenes: a ratio, or px for means."),
    "effect_bound": Quantity(None, "Upper bound of the difference of any two levels at any age."),
    "effect_margin": Quantity(None, "Effect above which a factor matters."),
    "effect_p": Quantity(
        "1", "p-value: yes (no difference exceeds the margin) and no (some difference is at least the margin)."
    ),
    "effect_q": Quantity(
        "1", "The same adjusted for the other questions of its family, and for the other cells of the factor."
    ),
    "effect_count": Quantity("1", "Numbers of levels, pairs, ages and scenes behind an effect."),
    "effect_horizon": Quantity("frames", "Horizon to which lifetimes are restricted."),
    "rank": Quantity("1", "Best and worst rank among trackers, by a statistic, by shown differences."),
    "rank_count": Quantity("1", "Number of trackers that were ranked."),
    "largest_difference": Quantity(None, "Largest difference between levels' pooled curves, the paper's measure."),
    "largest_difference_part": Quantity(None, "What the largest difference is made from."),
    # windows of an estimator
    "sigma_to_set": Quantity("px", "Noise to set in the estimator of the experiment.", _RATIO, _SMALLER),
    "state_sigma_to_set": Quantity("px", "The same for features in its state."),
    "features_of_sigma": Quantity("1", "Features of a frame whose errors in common the noise to set counts."),
    "nees_with_gate": Quantity("1", "NEES of the newest pose with sigma and the gate of tracks, in trials."),
    "knee_to_set": Quantity("sigmas", "Knee of its robust loss."),
    "gate_to_set": Quantity("1", "Factor on its chi-square gate at .95."),
    "sigma_of_innovations": Quantity("px", "Noise with which its innovations look right.", _RATIO, _SMALLER),
    "sigma": Quantity(
        "px",
        "Noise that makes the depths of points fitted to windows of tracks as certain as they are, for known poses.",
        _RATIO,
        _SMALLER,
    ),
    "residual_sigma": Quantity(
        "px", "RMS of the residuals of points fitted to windows, by degrees of freedom.", _RATIO, _SMALLER
    ),
    "residual_sigma_of_coordinate": Quantity("px", "The same of one coordinate.", _RATIO, _SMALLER),
    "residual_core": Quantity("px", "The same by the median over windows.", _RATIO, _SMALLER),
    "overconfidence": Quantity("1", "Noise for depths over residual sigma.", _RATIO, _SMALLER),
    "core_overconfidence": Quantity("1", "Noise for depths over residual core.", _RATIO, _SMALLER),
    "z_root_mean_square": Quantity("px", "Noise for depths with the tails.", _RATIO, _SMALLER),
    "gate_factor": Quantity("1", "Quantile of the squared residuals of a window over that of chi square."),
    "window_coverage": Quantity("share", "Share of windows whose depth is inside its interval, for residual sigma."),
    "depth_share": Quantity("share", "Share of windows that show the depth of their point."),
    "noise_gain": Quantity(
        "nat", "Gain of a table of second moments over a coarser one on scenes that were left out, per error."
    ),
    "noise_spread": Quantity("1", "Factor by which the second moment of a scene typically differs from the table."),
    "depth_coverage": Quantity(
        "share", "Share of the depths of points of other scenes inside their claimed interval.", _DIFFERENCE
    ),
    "depth_error": Quantity("share", "Error of the depth of points of other scenes, relative to the depth."),
    "depth_error_ratio": Quantity("1", "Error of the depth over the claimed one."),
    "depth_overconfidence": Quantity("1", "Factor by which claimed depths are too certain."),
    "point_tracking": Quantity(
        "share", "Metrics of TAP-Vid and expected feature age: means over sequences.", _DIFFERENCE, _LARGER
    ),
    "fitted_noise": Quantity("px", "Noise of one coordinate, corrected for the fit of the true positions."),
    # covariances that trackers predict for their own observations
    "covariance_coverage": Quantity(
        "share", "Share of the errors inside the region of a level that the tracker's own covariances claim."
    ),
    "covariance_nees": Quantity(
        "1",
        "Mean of the squared Mahalanobis distance over 2. Of all ages together, the factor by which the tracker's own "
        "covariances would have to be multiplied; the verdict says whether they are right in size.",
    ),
    "covariance_shape": Quantity(
        "1",
        "Size of errors whitened by the tracker's own covariances, along one axis over that across it, in axes of the "
        "image, of the covariances, or of the motion, and in axes turned by 45 degrees. The worst has the verdict.",
    ),
    "covariance_elongation": Quantity(
        "1", "Mean difference of the eigenvalues of the tracker's own covariances over their sum: 0 for circles."
    ),
    "covariance_fourth_moment": Quantity(
        "1", "Fourth moment of the Mahalanobis distance over that of Gaussian errors with the same second moment."
    ),
    "covariance_ranking": Quantity(
        "1",
        "Mean length of errors that the tracker's own covariances predict to be large, over that of the others. The "
        "verdict says whether they tell which errors are large.",
        _DIFFERENCE,
        _LARGER,
    ),
    "covariance_gain": Quantity(
        "nat",
        "Gain of the tracker's own covariances, times one factor, over one sigma for all, per error. Both are fitted "
        "to other scenes. The verdict says whether they describe errors better.",
        _DIFFERENCE,
        _LARGER,
    ),
    "impossible_covariances": Quantity(
        "share", "Share of the tracker's own covariances that are not positive definite.", _DIFFERENCE, _SMALLER
    ),
    # truth
    "truth_difference_mean": Quantity("px", "Mean of positions by two truths, and of errors by each."),
    "truth_difference_second": Quantity("px^2", "Second moment of the same."),
    "pose_disagreement": Quantity(None, "RMS difference per axis between the relative poses of two truths."),
    "shared_motion": Quantity("share", "Share of the second moment that one small pose error per frame explains."),
    "shared_motion_moment": Quantity("px^2", "Second moment before and after a correction of the poses."),
    "pose_share": Quantity(
        "share", "Share of the squared errors up to the reference age, without outliers, that pose errors explain."
    ),
    "pose_error": Quantity(None, "Growth law of the errors of the stated poses."),
    "tracker_difference": Quantity(None, "Difference of the errors of two trackers at the same corners."),
    # places
    "surrounding": Quantity(None, "Untrimmed errors by what surrounds a feature."),
    "image_mean": Quantity("px", "Mean error in a cell of the image."),
    "image_spread": Quantity("px", "Standard deviation of one coordinate in a cell of the image."),
    "image_speed_mean": Quantity("px", "Mean error along and across the image motion, by its speed."),
    # seeds
    "seed_spread": Quantity(None, "Standard deviation between random seeds of the tracker."),
    "seed_mean": Quantity(None, "Mean over random seeds of the tracker."),
    "seeds": Quantity("1", "Number of random seeds."),
}
"""Every quantity by its name."""
RATIOS: tuple[str, ...] = tuple(name for name, quantity in QUANTITIES.items() if quantity.sentence)
"""Quantities that are ratios of two sums over features (`tracknoise.statistics.ratios`).

Their intervals, sentences, figures and comparisons are made from what is declared here.
"""
