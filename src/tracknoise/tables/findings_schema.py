"""Columns of the tables that hold findings, the audit of the truth, and effects.

Every interval states its level, its method (`kind`), and what was resampled: `scenes`, `groups` of scenes, scenes
`within` their groups, or, if there are too few scenes, `blocks` of tracks within them. An interval from blocks holds
for these scenes only, one from scenes within their groups for these groups only. `kind` is the one that the experiment
asks for, with two exceptions. Shape, and what is fitted to growth, have `bca` instead of `student`
(`tracknoise.inference.intervals.Method`). Effects of factors always have `paired`.
"""

from enum import StrEnum

import polars as pl

from tracknoise.inference.conventions import IntervalKind
from tracknoise.inference.units import Resampled
from tracknoise.tables.enumerations import Behaviour, EffectIntervalKind, Lookup, Shape, Trust, TruthCause
from tracknoise.tables.schema import (
    ASPECT,
    CAUSES,
    CONDITION,
    FITTED_MEASURE,
    FITTED_TO,
    ORIGIN,
    POOLED,
    POPULATION,
    PRODUCT,
    SEQUENCE,
    SURROUNDING,
    TRIMMING,
    TRUTH_QUANTITY,
    VERDICT,
    VIEW,
    WEIGHTING,
    Schema,
)

RESAMPLED = pl.Enum(Resampled)
INTERVAL_KIND = pl.Enum(IntervalKind)
EFFECT_INTERVAL_KIND = pl.Enum(EffectIntervalKind)
BEHAVIOUR = pl.Enum(Behaviour)
SHAPE = pl.Enum(Shape)
LOOKUP = pl.Enum(Lookup)
CAUSE = pl.Enum(CAUSES)

_ESTIMATED: Schema = {
    "low": pl.Float64,
    "high": pl.Float64,
    "kind": INTERVAL_KIND,
    "level": pl.Float64,
    "resampled": RESAMPLED,
    "n_units": pl.Int32,
    "n_scenes": pl.Int32,
}
_ESTIMATE: Schema = {"value": pl.Float64, **_ESTIMATED}

INTERVALS: Schema = {
    **POOLED,
    "aspect": ASPECT,
    "at_least": pl.UInt32,
    "population": POPULATION,
    "trimming": TRIMMING,
    "weighting": WEIGHTING,
    "statistic": pl.String,
    "axis": pl.String,
    "at": pl.Int64,
    "coordinate": pl.String,
    "unit": pl.String,
    **_ESTIMATE,
    **dict.fromkeys(("spread", "next_low", "next_high", "coverage"), pl.Float64),
}
"""One row per number that has an interval: every point of every curve, and every scalar of every condition.

The aspect `all` has the errors of every track in image axes. `change` has their changes from frame to frame; the axis
of `autocorrelation` is `lag`. The other aspects, and `at_least`, are as in `ASPECTS`. Outlier ratios and lifetimes have
no population, trimming, weighting or coordinate. The axis of `survival` is `lifetime`. Bounds are null if nothing can
be resampled. Scales have a row with weighting `geometric`: absolute errors, second moments, and the robust `core`,
which has no other.

spread is the standard deviation between scenes of each scene's own value: of its logarithm for scales and lifetimes, of
its logit for shares, otherwise in the unit of the row. It includes the error within each scene. next_low and next_high
bound the own value of the next scene, with the probability of the level. coverage is null where the method was tested;
elsewhere it is the share of intervals that contain the true value in simulated data with the spread, the number and the
weights of these scenes.
"""

INCIDENCE: Schema = {
    **POOLED,
    "cause": CAUSE,
    "lifetime": pl.Int64,
    "incidence": pl.Float64,
    **_ESTIMATED,
}
"""Share of all tracks that have ended by a cause up to and including a lifetime: one row per cause and lifetime.

At every lifetime, the incidences of all causes and the survival of `LIFETIMES` add up to 1. Bounds are null where the
incidence is 0 or 1, or nothing can be resampled.
"""

TWO_TRUTHS: Schema = {
    **POOLED,
    "quantity": TRUTH_QUANTITY,
    "trimming": TRIMMING,
    "age": pl.UInt32,
    "statistic": pl.String,
    "coordinate": pl.String,
    "n": pl.Int64,
    **_ESTIMATE,
}
"""How far the true positions by two truths are apart, by age, and the errors of trackers by each of them.

The statistics are `mean` (px; u, v) and `second`, the second moment about zero (px^2; u, v, uv). All quantities have
the same observations: those visible by the first truth whose true position the second knows too. The disagreement is
zero at age 0. Its second moment is the sum of the second moments of the errors of both truths if these are independent.
The table has no rows unless the experiment has a second truth.
"""

POSE_DISAGREEMENT: Schema = {
    "dataset": pl.String,
    **VIEW,
    "lag": pl.UInt32,
    "quantity": pl.String,
    "unit": pl.String,
    "n": pl.Int64,
    **_ESTIMATE,
}
"""Root mean square difference per axis between the relative poses of two truths, by lag in frames.

The quantity is `rotation` (degrees) or `translation` (metres), n the number of pairs of frames. The table has no rows
unless the experiment has a second truth.
"""

TRIANGULATED_NOISE: Schema = {
    **POOLED,
    "measure": FITTED_MEASURE,
    "trimming": TRIMMING,
    "length_low": pl.Int64,
    "length_high": pl.Int64,
    "coordinate": pl.String,
    "n": pl.Int64,
    "sigma_px": pl.Float64,
    **_ESTIMATED,
}
"""Noise of tracks whose true positions are triangulated: standard deviation of one coordinate of a position, px.

The measure `triangulated` is from errors about the fitted points, with 2 N - 3 degrees of freedom for a track of N
observations. `epipolar` is from distances to the epipolar line of the first observation, which tracks of two
observations have as well; its coordinate is `both`. length_low and length_high bound the number of observations of the
tracks; both are null for all lengths together, and length_high for the longest class. n counts observations. White
noise in every position is measured without bias. Errors along the epipolar line are not seen. The table has no rows for
other kinds of truth.
"""

WINDOW_SIGMAS: Schema = {
    **POOLED,
    "trimming": TRIMMING,
    "window": pl.UInt32,
    "quantity": pl.String,
    "n": pl.Int64,
    **_ESTIMATE,
}
"""The noise to give to an estimator, by length of its windows: see `tracknoise.estimators.window_noise`.

Sigmas, residual_core and z_root_mean_square are in px, all others have no unit. n counts windows.
"""

ADVICE: Schema = {
    **POOLED,
    **dict.fromkeys(("estimator", "landmark", "purpose", "kernel"), pl.String),
    "window": pl.UInt32,
    "quantity": pl.String,
    "value": pl.Float64,
    "low": pl.Float64,
    "high": pl.Float64,
    "why": pl.String,
    "level": pl.Float64,
    "n_scenes": pl.Int32,
}
"""What to set in the estimator of the experiment: see `tracknoise.estimators.advice`.

estimator is its name in docs/estimators/exports.md, kernel its robust loss, null if it has none. sigma, state_sigma (of
features in its state, which observation_gate then belongs to) and innovations are in px, knee is in sigmas, gates
are factors on chi-square quantiles at .95. gated_nees is the NEES of the newest pose with sigma and the gate of tracks,
where it was tried. why says why windows are simulated; it is null where they are not. level is
that of the interval; it is null without one. n_scenes is how many scenes the model was fitted to.
"""

NOISE_LOOKUP: Schema = {
    "dataset": pl.String,
    "product": PRODUCT,
    "lookup": LOOKUP,
    "against": LOOKUP,
    "n": pl.Int64,
    "gain_nats": pl.Float64,
    **_ESTIMATED,
    "established": pl.Boolean,
    **{f"factor{table}{bound}": pl.Float64 for table in ("", "_against") for bound in ("", "_low", "_high")},
    "why": pl.String,
}
"""How much better a table of covariances predicts scenes that were left out (`tracknoise.estimators.lookup_table`).

product is `error`, the error about the first position, or `change`, what it changes from one observation to the next.
Both are second moments about zero, without the outliers that `NOISE_OUTLIERS` counts. gain_nats is the gain of the
table `lookup` over the table `against`, nat per error, with low and high as its bounds. established states whether the
gain is above 0 at the level of the row; it is null without an interval, and why says what is missing. factor is by how
much the second moment of a scene typically differs from the table `lookup`, as a ratio, factor_against from the other
one. n counts errors.
"""

DEPTH_INTERVALS: Schema = {
    **POOLED,
    "trimming": TRIMMING,
    "window": pl.UInt32,
    "covariance": pl.String,
    "quantity": pl.String,
    "sigma_px": pl.Float64,
    "n": pl.Int64,
    **_ESTIMATE,
}
"""What estimators would claim of the depths of points of other scenes: see `tracknoise.estimators.depth_intervals`.

covariance says which noise is assumed, and sigma_px how large it is if it is one number. n counts windows. No quantity
has a unit.
"""

POINT_TRACKING_METRICS: Schema = {
    **POOLED,
    "raster": pl.String,
    "metric": pl.String,
    **_ESTIMATE,
}
"""Metrics of TAP-Vid and expected feature age: means over sequences, as benchmarks report them.

The table has rows only where the experiment asks for these metrics.
"""

SEED_SPREAD: Schema = {
    **POOLED,
    **{
        name: INTERVALS[name]
        for name in ("population", "trimming", "weighting", "statistic", "axis", "at", "coordinate", "unit")
    },
    "mean": pl.Float64,
    "standard_deviation": pl.Float64,
    "n_seeds": pl.Int32,
    "widens_interval": pl.Boolean,
}
"""How much a number differs between random seeds of the trackers, in its own unit.

The table has rows if an experiment has several seeds. widens_interval states whether the standard deviation was added
to the interval of the number in `INTERVALS`. Intervals that resample scenes include this chance already.
"""

ZERO_MEAN: Schema = {
    **POOLED,
    "trimming": TRIMMING,
    "axis": pl.String,
    "at": pl.Int64,
    "n": pl.Int64,
    "n_scenes": pl.Int32,
    **dict.fromkeys(("mean_u_px", "mean_u_low_px", "mean_u_high_px"), pl.Float64),
    **dict.fromkeys(("mean_v_px", "mean_v_low_px", "mean_v_high_px"), pl.Float64),
    **dict.fromkeys(("effect_px", "effect_low_px", "effect_high_px", "share_of_second"), pl.Float64),
    **dict.fromkeys(("hotelling_p", "hotelling_p_adjusted"), pl.Float64),
    **dict.fromkeys(("sign_flip_p", "sign_flip_p_adjusted", "sign_flip_p_family", "iid_p"), pl.Float64),
    "verdict": VERDICT,
    "why": pl.String,
    "level": pl.Float64,
}
"""Is the mean error zero: one row per age (or frame), and one for all together where `at` is null.

effect_px is the length of the mean, share_of_second its square over the trace of the second moment about zero. Bounds
are for one age alone, u and v together: effect_low_px is above 0 exactly where sign_flip_p is at most 1 - level. They
and level are null where there is no test, and in the row of all ages. Adjusted p-values are over the ages of a
condition: Hotelling's by Holm, that of the sign flips by the largest statistic of each flip. sign_flip_p_family is over
all ages of all conditions of the dataset, and the verdict is about it. iid_p is the p-value of a test that assumes
independent features. The verdict `yes` means that the mean differs from zero, `undecided` that it may or may not.
"""

GAUSSIANITY: Schema = {
    **POOLED,
    "trimming": TRIMMING,
    "age_low": pl.Int64,
    "age_high": pl.Int64,
    "n": pl.Int64,
    "n_sampled": pl.Int64,
    "n_scenes": pl.Int32,
    **dict.fromkeys(("skewness", "kurtosis", "kurtosis_low", "kurtosis_high", "tail_99", "tail_999"), pl.Float64),
    **dict.fromkeys(("gain_student_nats", "gain_student_low", "gain_student_high"), pl.Float64),
    **dict.fromkeys(("gain_mixture_nats", "gain_mixture_low", "gain_mixture_high"), pl.Float64),
    **dict.fromkeys(("student_nu", "student_scale_px", "mixture_share", "mixture_ratio"), pl.Float64),
    **dict.fromkeys(
        ("skewness_within", "kurtosis_within", "kurtosis_within_low", "kurtosis_within_high", "tail_99_within"),
        pl.Float64,
    ),
    **dict.fromkeys(("gain_student_within_nats", "gain_student_within_low", "gain_student_within_high"), pl.Float64),
    **dict.fromkeys(("gain_mixture_within_nats", "gain_mixture_within_low", "gain_mixture_within_high"), pl.Float64),
    **dict.fromkeys(("gain_scales_nats", "gain_scales_low", "gain_scales_high"), pl.Float64),
    **dict.fromkeys(("student_nu_within", "mixture_share_within", "mixture_ratio_within"), pl.Float64),
    "kind": INTERVAL_KIND,
    "level": pl.Float64,
    "resampled": RESAMPLED,
    "verdict": SHAPE,
    "why": pl.String,
}
"""Are errors Gaussian: one row per band of ages (or of distances from the key frame) of a condition.

skewness and kurtosis are Mardia's b1 and b2 (0 and 8 for a Gaussian in two dimensions). tail_99 is P(d2 > 9.21) / 0.01,
tail_999 P(d2 > 13.82) / 0.001. Gains are held-out log-likelihood per observation over a Gaussian, nats. All are of
errors in units of the mean and covariance of their age. student_scale_px is the scale of one coordinate at a typical
age; mixture_share is the share of the wider component, mixture_ratio how many times larger its covariance is.

Columns with `_within` are of errors in units of the mean and covariance of their own scene, and the verdict is about
these. gain_scales is what the different scales of scenes add: Student's gain less that within scenes.
"""

RADII: Schema = {
    **POOLED,
    "trimming": TRIMMING,
    "age_low": pl.Int64,
    "age_high": pl.Int64,
    **dict.fromkeys(("probability", "expected", "observed"), pl.Float64),
}
"""Radial QQ plot: quantiles of the Mahalanobis distance, observed and of a Gaussian of the same covariance."""

_GROWTH = (
    *("white_px", "walk_px_per_sqrt_frame", "drift_px_per_frame"),
    *("saturating_white_px", "saturating_px", "saturating_frames"),
    *("white_px_geometric", "walk_px_per_sqrt_frame_geometric", "drift_px_per_frame_geometric"),
    *("autocorrelation", "autocorrelation_2", "autocorrelation_3", "autocorrelation_4", "autocorrelation_5"),
    "growth_ratio",
)

TIME_STRUCTURE: Schema = {
    **POOLED,
    "trimming": TRIMMING,
    "coordinate": pl.String,
    "n_ages": pl.Int32,
    "n_scenes": pl.Int32,
    **{f"{name}{bound}": pl.Float64 for name in _GROWTH for bound in ("", "_low", "_high")},
    "kind": INTERVAL_KIND,
    "autocorrelation_kind": INTERVAL_KIND,
    "level": pl.Float64,
    "resampled": RESAMPLED,
    "coverage": pl.Float64,
    "growth_from": pl.Int64,
    "growth_to": pl.Int64,
    "grows": VERDICT,
    "verdict": BEHAVIOUR,
    "why": pl.String,
}
"""How errors grow with age: the second moment about zero fitted as white^2 + walk^2 k + drift^2 k^2.

white_px, walk_px_per_sqrt_frame and drift_px_per_frame are of all errors together, so that every feature counts alike.
Those with `_geometric` are geometric means over scenes: the sizes in a scene of typical scale. saturating_white_px,
saturating_px and saturating_frames are white, size and tau of white^2 + size^2 (1 - exp(-k / tau)), and null where the
polynomial agrees with the data. autocorrelation is that of the changes at one step of the tracker, about zero;
autocorrelation_2 to autocorrelation_5 are those at 2 to 5 steps. coordinate is u or v. white_px is the root of the
constant term: sqrt(2) times the noise of a single position, if the first position is as noisy as the others.

growth_ratio is the RMS at age growth_to over that at growth_from, of the tracks that live to age 10 where these are
known, with scenes counted alike. coverage is the share of intervals of geometric means that contain the true value
where single errors have a heavy tail, and null elsewhere. `grows` says whether growth_ratio is above 1 + margin, and
`verdict` how errors grow: by the established part that grows, white if there is none and errors do not grow.
"""

DEPENDENCE: Schema = {
    "dataset": pl.String,
    "factor": pl.String,
    **CONDITION,
    **dict.fromkeys(("statistic", "axis", "unit", "level_a", "level_b", "larger", "better", "coordinate"), pl.String),
    "at": pl.Int64,
    **dict.fromkeys(("effect", "low", "high", "most"), pl.Float64),
    "kind": EFFECT_INTERVAL_KIND,
    "level": pl.Float64,
    "resampled": RESAMPLED,
    **dict.fromkeys(("margin", "p_yes", "q_yes", "p_no", "q_no"), pl.Float64),
    **dict.fromkeys(("n_levels", "n_pairs", "n_scenes", "n_places"), pl.Int32),
    "at_low": pl.Int64,
    "at_high": pl.Int64,
    "horizon": pl.Float64,
    "more_scenes": pl.Int32,
    "verdict": VERDICT,
    "why": pl.String,
}
"""Does a factor change a statistic: one row per factor, condition that was held, and statistic.

Levels are compared in pairs, within each scene. The row reports the pair level_a and level_b, and the size of its
difference:

- unit `ratio`: effect is the larger level over the smaller one, as geometric mean over scenes, ages (or frames) and
  both coordinates. low and high are bounds of the same ratio, and below 1 if the order may be the other way round. high
  and most are null for a ratio of outlier ratios of which one rests on fewer than five outliers per scene.
- unit `px` (mean errors): effect is the size of the difference at one age and coordinate.

coordinate and at are null unless a single age decides. most bounds the difference of any two levels at any age. margin
is in the unit of the effect. larger is the level with the larger value, better that with smaller errors, fewer
outliers or longer lifetimes; null for mean errors. n_pairs counts the pairs that were compared. n_scenes is the fewest
scenes that two levels share, n_places the number of ages that were compared, from at_low to at_high. Lifetimes are
restricted means to the common horizon (frames that the tracker saw). more_scenes is how many more scenes would settle
an `undecided` with a probability of 80 %, where that is known.

p_yes is the p-value of the hypothesis that no difference exceeds the margin, p_no of the hypothesis that some
difference is at least the margin. q_yes and q_no are adjusted p-values: q_yes by Hochberg in a family (core and second
moment; lifetime and outlier ratio; the others) of one cell, such as one tracker at one speed, and both by Benjamini and
Hochberg over the rows of a factor about the same statistic.
"""

RIGID_SHARE: Schema = {
    **POOLED,
    "fitted_to": FITTED_TO,
    "age": pl.Int64,
    "coordinate": pl.String,
    "n": pl.Int64,
    "second_px2": pl.Float64,
    "left_px2": pl.Float64,
    "share": pl.Float64,
    **_ESTIMATED,
}
"""Share of the second moment of the errors that one small pose error per frame explains, by age.

The pose errors are fitted to other tracks: to the other half of the tracks of the same tracker (`own`), or of all other
trackers (`others`), where n counts only errors for which these know it. second_px2 is the second moment about zero of n
errors, left_px2 what a correction of the poses leaves of it. share does not contain the noise of the fit, which
left_px2 does. coordinate is u, v or both.
"""

POSE_SHARE: Schema = {
    **POOLED,
    "fitted_to": FITTED_TO,
    "n": pl.Int64,
    "share": pl.Float64,
    **_ESTIMATED,
}
"""The same share of both coordinates and of all steps up to the reference age together, without outliers: (pose.share).

n counts errors, outliers too. low and high hold whatever the share is of errors for which nothing is predicted.
"""

POSE_LAW: Schema = {
    "dataset": pl.String,
    **VIEW,
    "motion": pl.String,
    "law": pl.String,
    "unit": pl.String,
    "n": pl.Int64,
    **_ESTIMATE,
}
"""Growth law of the errors of the stated poses, fitted to `POSE_GROWTH`: one row per motion and part of the law.

motion is `rotation` or `translation`. The part `white` is the standard deviation of one coordinate of a single pose,
`random walk` that of its change from one frame to the next. Both are what the tracks see as a motion of the camera,
whatever its cause.
"""

TRACKER_DIFFERENCES: Schema = {
    **POOLED,
    "other": pl.String,
    "statistic": pl.String,
    "age": pl.Int64,
    "coordinate": pl.String,
    "unit": pl.String,
    "n": pl.Int64,
    **_ESTIMATE,
    "established": pl.Boolean,
}
"""Differences of the errors of two trackers at the same corners and in the same frames: `tracker` minus `other`.

statistic is `mean` (px) or `central`, the covariance of the differences (px^2): u and v are variances. An error of the
truth cancels in the difference. established states whether a mean differs from 0 at the level of the row, with
Bonferroni's correction for all ages and both coordinates of the two trackers; it is null for covariances.
"""

RANKS: Schema = {
    "dataset": pl.String,
    **{name: kind for name, kind in CONDITION.items() if name != "tracker"},
    "statistic": pl.String,
    "axis": pl.String,
    "tracker": pl.String,
    "best": pl.Int32,
    "worst": pl.Int32,
    "n_trackers": pl.Int32,
    "n_scenes": pl.Int32,
    "level": pl.Float64,
    "why": pl.String,
}
"""Ranks of trackers at the lowest speed, one row per statistic and tracker, where three or more are compared.

A tracker is between the ranks best and worst of n_trackers, by (ranks). n_scenes is the smallest number of scenes that
it shares with another tracker. level is that of the comparisons. why names the trackers about which references of the
two kinds disagree, if any.
"""

SURROUNDING_ERRORS: Schema = {
    **POOLED,
    "surrounding": SURROUNDING,
    "class": pl.String,
    "class_low": pl.Float64,
    "class_high": pl.Float64,
    "axis": pl.String,
    "at": pl.Int64,
    "coordinate": pl.String,
    "statistic": pl.String,
    "unit": pl.String,
    "n": pl.Int64,
    **_ESTIMATE,
}
"""Untrimmed errors by what surrounds a feature: one row per property, class, age, coordinate and statistic.

The properties are those of `tracknoise.tables.enumerations.Surrounding`. class_low and class_high bound a class of
depths (m), of signed distances to a depth edge (px), or of angles of incidence (degrees). The classes of `side` are
`near`, `far` and `none`: within 7.5 px of an edge, or not. Those of `occlusion` are `never`, `later` and `now`, and
include features that are occluded; all others are of visible features. The coordinate is u, v, or along the motion of
the true position.

mean, second and share are the mean error, the second moment, and the share of the features that are of the class.
share_of_mean and share_of_second are its shares of the sum of all errors and of their squares. mean_without is the mean
error of all other features. second_removed is the share of the second moment that excluding the class removes, and
second_removed_by_others the share that excluding all other classes removes.
"""

IMAGE_CELLS: Schema = {
    **POOLED,
    "axis": pl.String,
    "at": pl.Int64,
    "row": pl.Int32,
    "column": pl.Int32,
    "n": pl.Int64,
    **{f"mean_{axis}_{value}": pl.Float64 for axis in "uv" for value in ("px", "low", "high")},
    "spread_px": pl.Float64,
    "differs": pl.Boolean,
    **{name: dtype for name, dtype in _ESTIMATED.items() if name not in ("low", "high")},
}
"""Mean of visible, untrimmed errors in each cell of the image, 20 columns x 14 rows, counted from the top left.

spread_px is the standard deviation of one coordinate, as root mean square of both. The bounds in u and v hold together
with the probability of the level. differs says whether they exclude a mean of zero; it is null without bounds.
"""

RATIO_VALUES: Schema = {
    **POOLED,
    "quantity": pl.String,
    "trimming": TRIMMING,
    "axis": pl.String,
    "at": pl.Int64,
    "n": pl.Int64,
    **_ESTIMATE,
}
"""Ratios of sums over features, by age: the quantities of `tracknoise.tables.quantities.RATIOS`, features pooled."""

OWN_COVARIANCES: Schema = {
    **POOLED,
    "covariance": pl.String,
    "trimming": TRIMMING,
    "quantity": pl.String,
    "axis": pl.String,
    "at": pl.Int64,
    "n": pl.Int64,
    "value": pl.Float64,
    "verdict": VERDICT,
    **_ESTIMATED,
}
"""Whether covariances that a tracker predicts are right: see `tracknoise.analysis.covariance_verdicts`.

covariance is the name in the columns ``quality_<name>_uu`` of the observations. axis and at are null for all ages
together. n counts errors. The verdict says of `nees` whether the covariances are right in size, of `shape` whether in
shape, of `ranking` whether they tell which errors are large, and of `gain` whether they are better than one sigma.
"""

SPEED_ERRORS: Schema = {
    **POOLED,
    "axis": pl.String,
    "at": pl.Int64,
    "class_low": pl.Float64,
    "class_high": pl.Float64,
    "coordinate": pl.String,
    "n": pl.Int64,
    "mean_px": pl.Float64,
    **_ESTIMATED,
}
"""Mean of visible, untrimmed errors along and across the image motion, by its speed: class_low to class_high px/frame.

The motion is that of the true position since the previous frame that the tracker saw.
"""

FINDINGS: Schema = {
    "rank": pl.Int32,
    **dict.fromkeys(("topic", "text", "figure", "table"), pl.String),
    "value": pl.Float64,
    "low": pl.Float64,
    "high": pl.Float64,
    "unit": pl.String,
    "rows": pl.List(pl.String),
    **dict.fromkeys(("brief", "opening", "closing"), pl.String),
    "parts": pl.List(pl.Struct({"tracker": pl.String, "text": pl.String, "rows": pl.List(pl.String)})),
}
"""Findings as sentences, the most important first.

text is all of a finding: its opening, its parts and its closing. A part is about one tracker, or about none. rows are
the ids of the rows of results whose numbers the text, or a part of it, has; the first is that of value, low and high.
brief is the finding in one sentence; empty where it has none. `figure` is the anchor of the section that shows it.
"""


class AuditVerdict(StrEnum):
    """What an audit says about a parameter of the truth.

    fault: the truth is wrong in it. explained: it looked wrong, but not established once the named faults are
    corrected. like_bias: what it explains cannot be distinguished from a bias of the trackers. disagreement: trackers
    contradict each other. small: another value fits better, but explains next to nothing. none: no fault.
    undetermined: its interval is too wide for an answer, or what it explains is not established. not_tried: it is right
    by construction.
    """

    fault = "fault"
    explained = "explained"
    like_bias = "like_bias"
    disagreement = "disagreement"
    small = "small"
    none = "none"
    undetermined = "undetermined"
    not_tried = "not_tried"


MEASURED, EVERYTHING = "measured", "all"
"""Corrections in `AUDIT_CURVES` besides the names of parameters: none, and all of them."""

TRUST: Schema = {
    "dataset": pl.String,
    "cause": pl.Enum(TruthCause),
    "tracker": pl.String,
    "verdict": pl.Enum(Trust),
    "share": pl.Float64,
    "low": pl.Float64,
    "high": pl.Float64,
    "age": pl.Int64,
    "error_px": pl.Float64,
    "bound_px": pl.Float64,
    "text": pl.String,
    "step": pl.String,
}
"""The verdict on the truth, and how much of the errors it can explain.

The first row has the verdict, its sentence, and the step that would help most. The others have shares of the squared
errors up to the reference age: of each tracker by all causes together (`every`), and by single causes. Faults that are
established have no tracker: they are fitted to all together. high is the upper bound. error_px is the core of both
coordinates of the tracker at `age`, or its RMS where there was no audit, and bound_px how much of it the truth can
explain at most.
"""

CAMERAS: Schema = {
    **SEQUENCE,
    "frame": pl.UInt32,
    "time_s": pl.Float64,
    "model": pl.String,
    "width": pl.Int32,
    "height": pl.Int32,
    **dict.fromkeys(("fx_px", "fy_px", "cx_px", "cy_px"), pl.Float64),
    "distortion": pl.List(pl.Float64),
    "readout_s": pl.Float64,
    "shutter_axis": pl.UInt8,
}
"""One row per frame: its time and its camera, a model of `tracknoise.geometry.cameras`.

time_s is null where times are unknown. What describes the lens is null for other models, and the two columns of the
shutter where all rows of an image are exposed together.
"""

PATH: Schema = {
    **SEQUENCE,
    "time_s": pl.Float64,
    **dict.fromkeys(("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"), pl.Float64),
}
"""World from camera at the times of a recording at which the run has no frame, see `POSES`."""

AUDIT_SAMPLES: Schema = {
    **ORIGIN,
    "block": pl.UInt8,
    "track": pl.UInt32,
    "birth_frame": pl.UInt32,
    "frame": pl.UInt32,
    "age": pl.UInt32,
    **dict.fromkeys(("u_birth_px", "v_birth_px", "depth_m"), pl.Float64),
    **dict.fromkeys(("u_px", "v_px", "u_true_px", "v_true_px"), pl.Float64),
}
"""A few visible observations of each tracker at the lowest speed, at most two per track, with what the truth states.

birth is the frame in which the feature got its true position: the first of its track, or the key frame of a scan.
u_birth and depth are its position and its depth there, age the number of frames between the two.
"""

DEPTH_REPEATS: Schema = {**SEQUENCE, "depth_m": pl.Float64, "relative_sd": pl.Float64}
"""Standard deviation of single depths, relative to them, at a few depths: `tracknoise.truth_faults.depth_repeats`.

It has no rows where depth is not that of a map, or too few points are in two maps.
"""

AUDIT: Schema = {
    "dataset": pl.String,
    "rank": pl.Int32,
    **dict.fromkeys(("family", "parameter", "component", "unit"), pl.String),
    **dict.fromkeys(("stated", "value", "low", "high", "in_frames", "level"), pl.Float64),
    "resampled": RESAMPLED,
    "n_units": pl.Int32,
    "n_scenes": pl.Int32,
    "n": pl.Int64,
    **dict.fromkeys(("p", "gain", "gain_low", "gain_high"), pl.Float64),
    **dict.fromkeys(("second_moment_share", "condition", "correlation"), pl.Float64),
    "correlated_with": pl.String,
    "visible_above": pl.Float64,
    "verdict": pl.Enum(AuditVerdict),
    "text": pl.String,
}
"""One row per number of every fit: its corrected value beside the stated one, and what the correction explains.

`family` is one of `tracknoise.truth_faults.fault_parameters.Family`. Rows of the family `alone` have the verdict on the
parameter, its sentence, and `visible_above`: 90 % of the errors of this size would have been named; null where none
would. What was not tried has no numbers. rank numbers the named faults from 1. p is adjusted for all parameters by
Holm's method in the families `alone` and `beside_bias`. gain is the share of the second moment in scaled units,
outliers cut, that the correction removes from held-out units; in the family `beside_bias` beyond what biases of the
trackers remove. second_moment_share is the share of the second moment in px^2 that it removes, outliers left out.
condition is the condition number of the fit. correlation is the largest one of the number in this fit, and
`correlated_with` the other number. in_frames is the value of times in frame intervals, as they are fitted. `moved`
in the family `at_most` is (truth.moved), null where that has no bound.

A run that could not be audited has one row, with the reason in its text.
"""

AUDIT_CURVES: Schema = {
    "dataset": pl.String,
    "tracker": pl.String,
    "correction": pl.String,
    "age": pl.UInt32,
    "n": pl.Int64,
    **dict.fromkeys(("mean_u_px", "mean_v_px"), pl.Float64),
    **dict.fromkeys(("second_uu", "second_vv"), pl.Float64),
    **dict.fromkeys(("core_u_px", "core_v_px", "near_px"), pl.Float64),
}
"""Errors of the audited observations by age: as `measured`, with each named fault corrected, and with `all` of them.

A fault is corrected together with those that were named before it.

A correction is applied to units that took no part in its fit. Outliers are left out of all columns, the same ones for
every correction: errors that are longer, after all corrections, than five times the median length of their tracker
and age. core is 1.4826 times the median absolute error. near_px is the RMS length of those up to three robust scales,
which shares that are explained are of.
"""


class Size(StrEnum):
    """Sizes of an effect."""

    low = "low"
    usual = "usual"
    bad = "bad"


class EffectStatistic(StrEnum):
    """What effects are measured by. Errors are visible ones of one age, of tracks that trimming kept."""

    mean_u = "mean_u"
    mean_v = "mean_v"
    second_moment = "second_moment"
    core = "core"
    lifetime = "lifetime"
    outlier_ratio = "outlier_ratio"


EFFECT_UNITS = {
    EffectStatistic.mean_u: "px",
    EffectStatistic.mean_v: "px",
    EffectStatistic.second_moment: "px^2",
    EffectStatistic.core: "px",
    EffectStatistic.lifetime: "frames",
    EffectStatistic.outlier_ratio: "1",
}
"""Unit of each statistic."""

CLEAN = "none"
"""Name of the effect of sequences without any."""

SIZE = pl.Enum(Size)
EFFECT_STATISTIC = pl.Enum(EffectStatistic)

EFFECT_VALUES: Schema = {
    "scene": pl.String,
    "effect": pl.String,
    "size": SIZE,
    "tracker": pl.String,
    "age": pl.UInt32,
    "statistic": EFFECT_STATISTIC,
    "value": pl.Float64,
}
"""One row per scene, effect, size, tracker and statistic.

The effect `CLEAN` has the same values at each size. Lifetime and outlier ratio do not depend on the age. The second
moment is about zero, the sum of u and v; the core is the geometric mean of u and v; the lifetime is the median, null
where more than half of the tracks outlive the sequence.
"""

EFFECT_CHANGES: Schema = {
    "effect": pl.String,
    "kind": pl.String,
    "size": SIZE,
    "shown": pl.String,
    "tracker": pl.String,
    "age": pl.UInt32,
    "statistic": EFFECT_STATISTIC,
    "unit": pl.String,
    **dict.fromkeys(("clean", "changed", "change", "change_low", "change_high"), pl.Float64),
    "n_scenes": pl.Int32,
}
"""One row per effect, size, tracker, age and statistic: means over scenes, and of the change within scenes.

clean and changed are means over the n_scenes scenes that have both. The interval is Student's, of the differences
within scenes; it is null with one scene.
"""
