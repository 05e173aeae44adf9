"""Columns of the tables that hold findings, the audit of the truth, and effects.

Every interval states its level, its method (`kind`), and what was resampled: `scenes`, `groups` of scenes, scenes
`within` their groups, or, if there are too few scenes, `blocks` of tracks within them. An interval from blocks holds
for these scenes only, one from scenes within their groups for these groups only. `kind` is the one that the experiment
asks for, with two exceptions. Shape, and what is fitted to growth, have `bca` instead of `student`
(`tracknoise.inference.intervals.Method`). Effects of factors always have `paired`.
"""

from collections.abc import Mapping
from enum import StrEnum

import polars as pl

from tracknoise.inference.conventions import IntervalKind
from tracknoise.inference.units import Resampled
from tracknoise.tables.enumerations import (
    Aspect,
    Behaviour,
    EffectIntervalKind,
    Lookup,
    Population,
    Shape,
    Trust,
    TruthCause,
    Weighting,
)
from tracknoise.tables.quantities import RATIOS, Topic
from tracknoise.tables.run_table import (
    COUNTED,
    ESTIMATED,
    ESTIMATED_OF_N,
    OF_CLASS,
    OF_CONDITION,
    OF_VIEW,
    Columns,
    Constants,
    Rows,
    RunTable,
    Value,
    bounds_of,
    by_quantity,
    one_number,
    same,
)
from tracknoise.tables.schema import (
    AMONG,
    ASPECT,
    AXIS,
    BY_CAUSE,
    CAUSES,
    CONDITION,
    COVARIANCE_FRAMES,
    FITTED_MEASURE,
    FITTED_TO,
    FLOOR_SOURCE,
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

_OF_INTERVALS = ESTIMATED | same("unit", "spread", "next_low", "next_high", "coverage")

_ROLES: Mapping[str, Mapping[str, str]] = {
    "mean_error": {"age": "nu", "frame": "mu"},
    "mean_absolute_error": {"age": "eta", "frame": "kappa"},
    "second_moment": {"age": "Phi", "frame": "Sigma"},
    "central_moment": {"age": "central", "frame": "central"},
}

_POINT = same("aspect", "at_least", "population", "trimming", "weighting", "at")

_LIFETIMES = (
    *("mean_lifetime", "median_lifetime", "lower_quartile_lifetime", "upper_quartile_lifetime"),
    *("restricted_mean_lifetime", "median_until_failure", "restricted_mean_until_failure"),
)

_SURVIVAL = ("survival", "survival_until_failure")

_LAGS = (1, 2, 3, 4, 5)
_LEVELS = same("level_a", "level_b")


def _curves(keys: Columns, labels: Constants) -> Rows:
    """Curves of errors: columns u, v and uv."""
    values = [
        Value(
            quantity,
            coordinate,
            {**labels, "axis": axis, "coordinate": coordinate},
            {"statistic": statistic, "axis": axis},
            {**COUNTED, "unit": "unit", "cut": "cut"},
        )
        for quantity, names in _ROLES.items()
        for axis, statistic in names.items()
        for coordinate in ("u", "v", "uv")
    ]
    return Rows(Topic.errors, {**OF_CONDITION, **keys}, values)


CURVES = RunTable(
    "curves",
    {
        **POOLED,
        "population": POPULATION,
        "trimming": TRIMMING,
        "weighting": WEIGHTING,
        "statistic": pl.String,
        "axis": AXIS,
        "at": pl.UInt32,
        "n": pl.Int64,
        "n_scenes": pl.Int32,
        "unit": pl.String,
        "u": pl.Float64,
        "v": pl.Float64,
        "uv": pl.Float64,
        "cut": pl.Boolean,
    },
    _curves(
        same("population", "trimming", "weighting", "at"),
        {"aspect": Aspect.all},
    ),
)
"""nu (px), eta (px), Phi (px^2) and central covariance (px^2) by age, or mu, kappa, Sigma and central by frame.

cut marks ages or frames with too few features.
"""


def _floor() -> Rows:
    values = [
        Value("truth_floor", f"floor_{2 * name if len(name) == 1 else name}", {"coordinate": name}, carried=COUNTED)
        for name in ("u", "uv", "v")
    ]
    values += [Value("truth_floor_of_mean", f"mean_{name}_px", {"coordinate": name}) for name in "uv"]
    keys = {**OF_CONDITION, "part": "source", **same("axis", "at")}
    return Rows(Topic.truth_floor, keys, values)


FLOOR = RunTable(
    "floor",
    {
        **POOLED,
        "source": FLOOR_SOURCE,
        "axis": AXIS,
        "at": pl.UInt32,
        "n": pl.Int64,
        "n_scenes": pl.Int32,
        **dict.fromkeys(("floor_uu", "floor_uv", "floor_vv", "mean_u_px", "mean_v_px"), pl.Float64),
    },
    _floor(),
)
"""Truth floor: the second moment of the errors of true positions (px^2), and the standard deviation of their mean (px).

Of the visible observations of all scenes whose truth has a known accuracy, features pooled. The source `all` is the sum
of the sources that are known: a floor is at least as large as this.
"""


def _cores() -> Rows:
    values = []
    for axis in ("age", "frame"):
        for quantity, stem in (("core", "core_{}_px"), ("share_beyond_three_cores", "beyond_{}")):
            for name in "uv":
                counted = {"n": f"n_{name}", "n_scenes": f"n_scenes_{name}", "cut": "cut"}
                carried = counted if quantity == "core" else {}
                weighting = Weighting.geometric if quantity == "core" else Weighting.features
                labels = {"aspect": Aspect.all, "weighting": weighting, "axis": axis, "coordinate": name}
                values.append(Value(quantity, stem.format(name), labels, {"axis": axis}, carried))
    keys = {**OF_CONDITION, **same("population", "trimming", "at")}
    return Rows(Topic.errors, keys, values)


CORES = RunTable(
    "cores",
    {
        **POOLED,
        "population": POPULATION,
        "trimming": TRIMMING,
        "axis": AXIS,
        "at": pl.UInt32,
        "n_u": pl.Int64,
        "n_v": pl.Int64,
        "n_scenes_u": pl.Int32,
        "n_scenes_v": pl.Int32,
        **dict.fromkeys(("core_u_px", "core_v_px", "beyond_u", "beyond_v"), pl.Float64),
        "cut": pl.Boolean,
    },
    _cores(),
)
"""Robust scale of errors by age or frame: the geometric mean over scenes of each scene's own `SCALES`.

beyond is the share of errors that are larger than three cores of their own scene, features pooled; that of a Gaussian
is 0.0027. n_u, n_scenes_u, n_v and n_scenes_v count the features and scenes that have a core in u and in v. cut is that
of `CURVES`.
"""

ASPECT_CURVES = RunTable(
    "aspect_curves",
    {"aspect": ASPECT, "at_least": pl.UInt32, **CURVES},
    _curves(same(*_POINT), {}),
)
"""Curves of each aspect of `ASPECTS`. u is along and v across the direction. `gradient` has no sign, so no mean."""


def _changes() -> Rows:
    """Changes of errors: their moments by age, and their autocorrelation by lag."""
    of_age = {"aspect": Aspect.change, "population": Population.visible, "weighting": Weighting.features, "axis": "age"}
    moments = {
        "mean_u_px": ("mean_error", "u"),
        "mean_v_px": ("mean_error", "v"),
        "covariance_uu": ("central_moment", "u"),
        "covariance_uv": ("central_moment", "uv"),
        "covariance_vv": ("central_moment", "v"),
    }
    ages = [
        Value(quantity, column, {**of_age, "coordinate": coordinate}, {"lag": 0}, COUNTED)
        for column, (quantity, coordinate) in moments.items()
    ]
    of_lag = {"aspect": Aspect.change, "population": Population.visible, "axis": "lag"}
    lags = [
        Value(
            "autocorrelation",
            f"autocorrelation_{coordinate}",
            {**of_lag, "at": lag, "coordinate": coordinate},
            {"lag": lag},
            COUNTED,
        )
        for lag in _LAGS
        for coordinate in "uv"
    ]
    return Rows(Topic.errors, {**OF_CONDITION, "trimming": "trimming", "at": "age"}, [*ages, *lags])


CHANGES = RunTable(
    "changes",
    {
        **POOLED,
        "trimming": TRIMMING,
        "lag": pl.UInt32,
        "age": pl.UInt32,
        "n": pl.Int64,
        "n_scenes": pl.Int32,
        **dict.fromkeys(("mean_u_px", "mean_v_px"), pl.Float64),
        **dict.fromkeys(("covariance_uu", "covariance_uv", "covariance_vv"), pl.Float64),
        **dict.fromkeys(("autocorrelation_u", "autocorrelation_v"), pl.Float64),
    },
    _changes(),
)
"""Changes of visible errors from frame to frame: at lag 0, their mean and covariance (px^2) by the age at their end.

Lags of 1 and more, in frames that the tracker saw, have the autocorrelation of changes over all ages.
"""


def _tracks() -> Rows:
    """Lifetimes: survival, and numbers of tracks, by lifetime."""
    at: Constants = {"axis": "lifetime", "aspect": Aspect.all}
    values = [
        Value("survival", "survival", at, carried={"n": "at_risk", "n_scenes": "n_scenes"}),
        Value("survival_until_failure", "survival_until_failure", at),
        Value("tracks_ended", "n_ended", at),
        Value("tracks_censored", "n_censored", at),
        *(Value("tracks_ended_by_cause", f"n_{cause}", {**at, "part": cause}) for cause in CAUSES),
        Value("followed_to", "followed_to", at),
    ]
    keys = {**OF_CONDITION, "at": "lifetime"}
    return Rows(Topic.tracks, keys, values)


LIFETIMES = RunTable(
    "lifetimes",
    {
        **POOLED,
        "lifetime": pl.UInt32,
        "n_ended": pl.Int64,
        "n_censored": pl.Int64,
        **BY_CAUSE,
        "at_risk": pl.Int64,
        "survival": pl.Float64,
        "survival_until_failure": pl.Float64,
        "followed_to": pl.UInt32,
        "n_scenes": pl.Int32,
    },
    _tracks(),
)
"""One row per lifetime: number of tracks that ended or were censored, and the Kaplan-Meier survival beyond it.

survival_until_failure counts only tracks that were lost or rejected as outliers as ended. followed_to is the largest
lifetime up to which every scene of the condition has follow-up, the same in each of its rows. It is null if no scene
limits it.
"""


def _outliers() -> Rows:
    names = ("mean", "median", "lower_quartile", "upper_quartile", "lower_whisker", "upper_whisker")
    values = [
        Value("frames", "n_frames", carried={"n_scenes": "n_scenes"}),
        Value("features_offered", "offered"),
        Value("features_rejected", "outliers"),
        Value("outlier_ratio", "pooled_ratio", {"aspect": Aspect.all}),
        *(Value("outlier_ratio_of_frames", name, {"part": name}) for name in names),
    ]
    return Rows(Topic.outliers, OF_CONDITION, values)


OUTLIERS = RunTable(
    "outliers",
    {
        **POOLED,
        "n_frames": pl.Int64,
        "n_scenes": pl.Int32,
        "offered": pl.Int64,
        "outliers": pl.Int64,
        **dict.fromkeys(("pooled_ratio", "mean", "median"), pl.Float64),
        **dict.fromkeys(("lower_quartile", "upper_quartile", "lower_whisker", "upper_whisker"), pl.Float64),
    },
    _outliers(),
)
"""Distribution of f1(t) / F(t-1) over frames with F(t-1) > 0; whiskers reach the last value within 1.5 IQR."""

TRIMS = RunTable(
    "trims",
    {
        **ORIGIN,
        "percentile": pl.Float64,
        "among": AMONG,
        "threshold_px": pl.Float64,
        **dict.fromkeys(("n_tracks", "n_measured", "n_anchor_only", "n_dropped", "n_followed_dropped"), pl.Int64),
        "dropped_share": pl.Float64,
    },
)
"""Trimming of each scene and condition: the threshold of the largest error, and the tracks that it dropped.

n_measured tracks have a largest error. n_anchor_only of them have only the error at their anchor, which is zero by
construction. The others were followed, and n_followed_dropped of these were dropped.
"""

ERRORS = RunTable(
    "errors",
    {
        **POOLED,
        "bin_low_px": pl.Float64,
        "bin_high_px": pl.Float64,
        "n": pl.Int64,
    },
)
"""Histogram of the largest errors of tracks, in logarithmic bins, before trimming. The first bin starts at 0."""

COUNTS = RunTable("counts", {**POOLED, "kind": pl.String, "name": pl.String, "n": pl.Int64})
"""Number of observations by truth status (kind `truth`), and of tracks by end (kind `end`)."""

SUMMARY = RunTable(
    "summary",
    {
        **POOLED,
        "n_scenes": pl.Int32,
        "n_tracks": pl.Int64,
        "mean_lifetime": pl.Float64,
        "median_lifetime": pl.UInt32,
        "restricted_to": pl.UInt32,
        "restricted_mean_lifetime": pl.Float64,
        "median_until_failure": pl.UInt32,
        "restricted_mean_until_failure": pl.Float64,
        "outlier_ratio": pl.Float64,
        "axis": AXIS,
        "at": pl.UInt32,
        **{
            f"{trimming}_{value}": pl.Int64 if value == "n" else pl.Float64
            for trimming in TRIMMING.categories
            for value in (
                "n",
                *(f"{statistic}_{axis}_px" for statistic in ("nu", "eta", "rms", "core") for axis in "uv"),
            )
        },
        **{f"{trimming}_beyond_{axis}": pl.Float64 for trimming in TRIMMING.categories for axis in "uv"},
        **dict.fromkeys(("floor_u_px", "floor_v_px", "floor_mean_u_px", "floor_mean_v_px"), pl.Float64),
    },
)
"""One row per condition: lifetimes (frames its tracker saw), outlier ratio, and errors at one age or frame.

rms is the square root of Phi or Sigma. Ages and frames are those of the nominal sequence, and n is the number of
features there. If the axis is the frame, nu and eta are mu and kappa. nu, eta and rms are of all features pooled; core
and beyond are those of `CORES`. floor is the root of the truth floor, and floor_mean the standard deviation of what the
errors of the truth add to the mean: see `FLOOR`. Restricted means are of min(lifetime, restricted_to). The horizon
restricted_to is the same in all rows of a data set and speed.
"""


def _largest_differences() -> Rows:
    carried = _LEVELS | same("unit", "verdict", "why")
    counts = ("n_levels", "n_pairs", "n_shared")
    values = [
        Value("largest_difference", "effect", carried=carried),
        *(Value("largest_difference_part", name, {"part": name}) for name in ("difference", "common", "margin")),
        Value("largest_difference_part", "share_of_absolute", {"part": "share_of_absolute"}),
        *(Value("effect_count", name, {"part": name}) for name in counts),
    ]
    keys = {**OF_CONDITION, **same("factor", "axis", "coordinate", "at"), "of": "statistic"}
    return Rows(Topic.largest_differences, keys, values)


EFFECTS = RunTable(
    "effects",
    {
        "dataset": pl.String,
        "factor": pl.String,
        **CONDITION,
        "statistic": pl.String,
        "axis": AXIS,
        "unit": pl.String,
        "coordinate": pl.String,
        "level_a": pl.String,
        "level_b": pl.String,
        "at": pl.Int64,
        **dict.fromkeys(("difference", "common", "effect", "share_of_absolute", "margin"), pl.Float64),
        "n_levels": pl.Int32,
        "n_pairs": pl.Int32,
        "n_shared": pl.Int32,
        "verdict": VERDICT,
        "why": pl.String,
    },
    _largest_differences(),
)
"""Effect of a factor on a statistic: the two levels that differ most, at which age or frame, and by how much.

The column of the factor itself is null. The other columns of the condition state the levels that were held fixed. `at`
is an age, or a number of frames since the key frame.
"""


def _intervals() -> Rows:
    """Numbers of errors, of tracks and of outliers, with their intervals."""

    def of(quantity: str, axis: str | None, statistic: str, topic: Topic | None = None) -> Value:
        rows = {"statistic": statistic, "axis": axis}
        return Value(quantity, "value", {"axis": axis}, rows, _OF_INTERVALS, topic)

    roles = [*_ROLES.items(), ("core", {"age": "core", "frame": "core"})]
    values = [of(quantity, axis, statistic) for quantity, names in roles for axis, statistic in names.items()]
    values += [of("autocorrelation", "lag", "autocorrelation")]
    values += [of(name, None, name, Topic.tracks) for name in _LIFETIMES]
    values += [of(name, "lifetime", name, Topic.tracks) for name in _SURVIVAL]
    values += [of("outlier_ratio", None, "outlier_ratio", Topic.outliers)]
    keys = {**OF_CONDITION, **_POINT, "coordinate": "coordinate"}
    return Rows(Topic.errors, keys, values)


INTERVALS = RunTable(
    "intervals",
    {
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
    },
    _intervals(),
)
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

INCIDENCE = RunTable(
    "incidence",
    {
        **POOLED,
        "cause": CAUSE,
        "lifetime": pl.Int64,
        "incidence": pl.Float64,
        **_ESTIMATED,
    },
    one_number(
        Topic.causes,
        "incidence",
        "incidence",
        {**OF_CONDITION, "part": "cause", "at": "lifetime"},
        ESTIMATED,
    ),
)
"""Share of all tracks that have ended by a cause up to and including a lifetime: one row per cause and lifetime.

At every lifetime, the incidences of all causes and the survival of `LIFETIMES` add up to 1. Bounds are null where the
incidence is 0 or 1, or nothing can be resampled.
"""


def _second_truth() -> Rows:
    values = [
        Value(f"truth_difference_{statistic}", "value", {}, {"statistic": statistic}, ESTIMATED_OF_N)
        for statistic in ("mean", "second")
    ]
    keys = {**OF_CONDITION, **same("trimming", "coordinate"), "part": "quantity", "at": "age"}
    return Rows(Topic.second_truth, keys, values)


TWO_TRUTHS = RunTable(
    "two_truths",
    {
        **POOLED,
        "quantity": TRUTH_QUANTITY,
        "trimming": TRIMMING,
        "age": pl.UInt32,
        "statistic": pl.String,
        "coordinate": pl.String,
        "n": pl.Int64,
        **_ESTIMATE,
    },
    _second_truth(),
)
"""How far the true positions by two truths are apart, by age, and the errors of trackers by each of them.

The statistics are `mean` (px; u, v) and `second`, the second moment about zero (px^2; u, v, uv). All quantities have
the same observations: those visible by the first truth whose true position the second knows too. The disagreement is
zero at age 0. Its second moment is the sum of the second moments of the errors of both truths if these are independent.
The table has no rows unless the experiment has a second truth.
"""

POSE_DISAGREEMENT = RunTable(
    "pose_disagreement",
    {
        "dataset": pl.String,
        **VIEW,
        "lag": pl.UInt32,
        "quantity": pl.String,
        "unit": pl.String,
        "n": pl.Int64,
        **_ESTIMATE,
    },
    one_number(
        Topic.pose_disagreement,
        "pose_disagreement",
        "value",
        {"dataset": "dataset", **OF_VIEW, "at": "lag", "of": "quantity"},
        ESTIMATED_OF_N | {"unit": "unit"},
    ),
)
"""Root mean square difference per axis between the relative poses of two truths, by lag in frames.

The quantity is `rotation` (degrees) or `translation` (metres), n the number of pairs of frames. The table has no rows
unless the experiment has a second truth.
"""

TRIANGULATED_NOISE = RunTable(
    "triangulated_noise",
    {
        **POOLED,
        "measure": FITTED_MEASURE,
        "trimming": TRIMMING,
        "length_low": pl.Int64,
        "length_high": pl.Int64,
        "coordinate": pl.String,
        "n": pl.Int64,
        "sigma_px": pl.Float64,
        **_ESTIMATED,
    },
    one_number(
        Topic.fitted_noise,
        "fitted_noise",
        "sigma_px",
        {
            **OF_CONDITION,
            **same("trimming", "coordinate"),
            "part": "measure",
            "at_low": "length_low",
            "at_high": "length_high",
        },
        ESTIMATED_OF_N,
    ),
)
"""Noise of tracks whose true positions are triangulated: standard deviation of one coordinate of a position, px.

The measure `triangulated` is from errors about the fitted points, with 2 N - 3 degrees of freedom for a track of N
observations. `epipolar` is from distances to the epipolar line of the first observation, which tracks of two
observations have as well; its coordinate is `both`. length_low and length_high bound the number of observations of the
tracks; both are null for all lengths together, and length_high for the longest class. n counts observations. White
noise in every position is measured without bias. Errors along the epipolar line are not seen. The table has no rows for
other kinds of truth.
"""


def _windows() -> Rows:
    names: dict[str, tuple[str, Constants]] = {
        "residual_sigma": ("residual_sigma", {}),
        "residual_sigma_u": ("residual_sigma_of_coordinate", {"coordinate": "u"}),
        "residual_sigma_v": ("residual_sigma_of_coordinate", {"coordinate": "v"}),
        "residual_core": ("residual_core", {}),
        "consistent_sigma": ("sigma", {}),
        "overconfidence": ("overconfidence", {}),
        "core_overconfidence": ("core_overconfidence", {}),
        "z_root_mean_square": ("z_root_mean_square", {}),
        **{f"gate_{level}": ("gate_factor", {"part": f"{level} %"}) for level in (95, 99)},
        **{f"coverage_{level}": ("window_coverage", {"part": f"{level} %"}) for level in (50, 90, 95, 99)},
        "depth_share": ("depth_share", {}),
    }
    values = by_quantity(names, ESTIMATED_OF_N, axis="window", coordinate=None, part=None)
    keys = {**OF_CONDITION, "trimming": "trimming", "at": "window"}
    return Rows(Topic.windows, keys, values)


WINDOW_SIGMAS = RunTable(
    "window_sigmas",
    {
        **POOLED,
        "trimming": TRIMMING,
        "window": pl.UInt32,
        "quantity": pl.String,
        "n": pl.Int64,
        **_ESTIMATE,
    },
    _windows(),
)
"""The noise to give to an estimator, by length of its windows: see `tracknoise.estimators.window_noise`.

Sigmas, residual_core and z_root_mean_square are in px, all others have no unit. n counts windows.
"""


def _advice() -> Rows:
    names: dict[str, tuple[str, Constants]] = {
        "sigma": ("sigma_to_set", {}),
        "state_sigma": ("state_sigma_to_set", {}),
        "knee": ("knee_to_set", {}),
        "track_gate": ("gate_to_set", {"against": "track"}),
        "observation_gate": ("gate_to_set", {"against": "observation"}),
        "innovations": ("sigma_of_innovations", {}),
        "gated_nees": ("nees_with_gate", {}),
    }
    values = by_quantity(names, same("low", "high", "level", "n_scenes", "why"), axis="window", against=None)
    packed = {"part": ("estimator", "landmark", "purpose", "kernel")}
    keys = {**OF_CONDITION, "at": "window"}
    return Rows(Topic.advice, keys, values, packed=packed)


ADVICE = RunTable(
    "advice",
    {
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
    },
    _advice(),
)
"""What to set in the estimator of the experiment: see `tracknoise.estimators.advice`.

estimator is its name in docs/estimators/exports.md, kernel its robust loss, null if it has none. sigma, state_sigma (of
features in its state, which observation_gate then belongs to) and innovations are in px, knee is in sigmas, gates
are factors on chi-square quantiles at .95. gated_nees is the NEES of the newest pose with sigma and the gate of tracks,
where it was tried. why says why windows are simulated; it is null where they are not. level is
that of the interval; it is null without one. n_scenes is how many scenes the model was fitted to.
"""


def _lookup() -> Rows:
    gain = ESTIMATED | {"n": "n", "verdict": "established", "why": "why"}
    values = [
        Value("noise_gain", "gain_nats", carried=gain),
        *(
            Value("noise_spread", f"factor{table}", {"at_low": place}, carried=bounds_of(f"factor{table}"))
            for place, table in enumerate(("", "_against"))
        ),
    ]
    keys = {"dataset": "dataset", "of": "product", "part": "lookup", "against": "against"}
    return Rows(Topic.lookup, keys, values)


NOISE_LOOKUP = RunTable(
    "noise_lookup",
    {
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
    },
    _lookup(),
)
"""How much better a table of covariances predicts scenes that were left out (`tracknoise.estimators.lookup_table`).

product is `error`, the error about the first position, or `change`, what it changes from one observation to the next.
Both are second moments about zero, without the outliers that `NOISE_OUTLIERS` counts. gain_nats is the gain of the
table `lookup` over the table `against`, nat per error, with low and high as its bounds. established states whether the
gain is above 0 at the level of the row; it is null without an interval, and why says what is missing. factor is by how
much the second moment of a scene typically differs from the table `lookup`, as a ratio, factor_against from the other
one. n counts errors.
"""


def _depths() -> Rows:
    names: dict[str, tuple[str, Constants]] = {
        **{f"coverage_{level}": ("depth_coverage", {"of": f"{level} %"}) for level in (50, 90, 95, 99)},
        "overconfidence": ("depth_overconfidence", {}),
        "error_ratio": ("depth_error_ratio", {}),
        "depth_error": ("depth_error", {}),
    }
    values = by_quantity(names, ESTIMATED_OF_N, axis="window", of=None)
    keys = {**OF_CONDITION, "trimming": "trimming", "at": "window", "part": "covariance", "part_low": "sigma_px"}
    return Rows(Topic.depths, keys, values)


DEPTH_INTERVALS = RunTable(
    "depth_intervals",
    {
        **POOLED,
        "trimming": TRIMMING,
        "window": pl.UInt32,
        "covariance": pl.String,
        "quantity": pl.String,
        "sigma_px": pl.Float64,
        "n": pl.Int64,
        **_ESTIMATE,
    },
    _depths(),
)
"""What estimators would claim of the depths of points of other scenes: see `tracknoise.estimators.depth_intervals`.

covariance says which noise is assumed, and sigma_px how large it is if it is one number. n counts windows. No quantity
has a unit.
"""

POINT_TRACKING_METRICS = RunTable(
    "point_tracking_metrics",
    {
        **POOLED,
        "raster": pl.String,
        "metric": pl.String,
        **_ESTIMATE,
    },
    one_number(
        Topic.point_tracking,
        "point_tracking",
        "value",
        {**OF_CONDITION, "part": "raster", "of": "metric"},
        ESTIMATED,
    ),
)
"""Metrics of TAP-Vid and expected feature age: means over sequences, as benchmarks report them.

The table has rows only where the experiment asks for these metrics.
"""


def _seeds() -> Rows:
    values = [
        Value("seed_spread", "standard_deviation", carried=same("unit") | {"verdict": "widens_interval"}),
        Value("seed_mean", "mean", carried=same("unit")),
        Value("seeds", "n_seeds"),
    ]
    keys = {
        **OF_CONDITION,
        **same("population", "trimming", "weighting", "axis", "at", "coordinate"),
        "of": "statistic",
    }
    return Rows(Topic.seeds, keys, values)


SEED_SPREAD = RunTable(
    "seed_spread",
    {
        **POOLED,
        **{
            name: INTERVALS[name]
            for name in ("population", "trimming", "weighting", "statistic", "axis", "at", "coordinate", "unit")
        },
        "mean": pl.Float64,
        "standard_deviation": pl.Float64,
        "n_seeds": pl.Int32,
        "widens_interval": pl.Boolean,
    },
    _seeds(),
)
"""How much a number differs between random seeds of the trackers, in its own unit.

The table has rows if an experiment has several seeds. widens_interval states whether the standard deviation was added
to the interval of the number in `INTERVALS`. Intervals that resample scenes include this chance already.
"""


_BIAS_TESTS = (
    *("hotelling_p", "hotelling_p_adjusted"),
    *("sign_flip_p", "sign_flip_p_adjusted", "sign_flip_p_family", "iid_p"),
)


def _bias() -> Rows:
    of_mean = {name: bounds_of(f"mean_{name}", "_px") for name in "uv"}
    values = [
        Value("bias", "effect_px", carried={**COUNTED, **same("verdict", "why"), **bounds_of("effect", "_px")}),
        *(
            Value("bias_component", f"mean_{name}_px", {"coordinate": name}, carried=COUNTED | of_mean[name])
            for name in "uv"
        ),
        Value("bias_share", "share_of_second"),
        *(Value("p_value", name, {"part": name}) for name in _BIAS_TESTS),
    ]
    keys = {**OF_CONDITION, **same("trimming", "axis", "at")}
    return Rows(Topic.bias, keys, values)


ZERO_MEAN = RunTable(
    "zero_mean",
    {
        **POOLED,
        "trimming": TRIMMING,
        "axis": pl.String,
        "at": pl.Int64,
        "n": pl.Int64,
        "n_scenes": pl.Int32,
        **dict.fromkeys(("mean_u_px", "mean_u_low_px", "mean_u_high_px"), pl.Float64),
        **dict.fromkeys(("mean_v_px", "mean_v_low_px", "mean_v_high_px"), pl.Float64),
        **dict.fromkeys(("effect_px", "effect_low_px", "effect_high_px", "share_of_second"), pl.Float64),
        **dict.fromkeys(_BIAS_TESTS, pl.Float64),
        "verdict": VERDICT,
        "why": pl.String,
        "level": pl.Float64,
    },
    _bias(),
)
"""Is the mean error zero: one row per age (or frame), and one for all together where `at` is null.

effect_px is the length of the mean, share_of_second its square over the trace of the second moment about zero. Bounds
are for one age alone, u and v together: effect_low_px is above 0 exactly where sign_flip_p is at most 1 - level. They
and level are null where there is no test, and in the row of all ages. Adjusted p-values are over the ages of a
condition: Hotelling's by Holm, that of the sign flips by the largest statistic of each flip. sign_flip_p_family is over
all ages of all conditions of the dataset, and the verdict is about it. iid_p is the p-value of a test that assumes
independent features. The verdict `yes` means that the mean differs from zero, `undecided` that it may or may not.
"""


def _shape() -> Rows:
    made = same("level", "resampled") | {"interval": "kind"}
    values = [Value("shape", "shape", carried=same("n", "n_scenes", "verdict", "why") | made)]
    for part, suffix in (("pooled", ""), ("within scenes", "_within")):
        bounds = bounds_of(f"kurtosis{suffix}") | made
        values += [
            Value("skewness", f"skewness{suffix}", {"part": part}),
            Value("kurtosis", f"kurtosis{suffix}", {"part": part}, carried=bounds),
            Value("tail_ratio", f"tail_99{suffix}", {"part": part, "against": "99 %"}),
        ]
        for density in ("student", "mixture"):
            stem = f"gain_{density}{suffix}"
            bounds = bounds_of(stem) | made
            values.append(Value("gain", f"{stem}_nats", {"part": part, "against": density}, carried=bounds))
        values += [
            Value("student_nu", f"student_nu{suffix}", {"part": part}),
            Value("mixture_share", f"mixture_share{suffix}", {"part": part}),
            Value("mixture_ratio", f"mixture_ratio{suffix}", {"part": part}),
        ]
    scales = bounds_of("gain_scales") | made
    values += [
        Value("tail_ratio", "tail_999", {"part": "pooled", "against": "99.9 %"}),
        Value("gain", "gain_scales_nats", {"part": "scales of scenes", "against": "student"}, carried=scales),
        Value("student_scale", "student_scale_px", {"part": "pooled"}),
        Value("errors_sampled", "n_sampled"),
    ]
    keys = {**OF_CONDITION, "trimming": "trimming", "at_low": "age_low", "at_high": "age_high"}
    return Rows(Topic.shape, keys, values)


GAUSSIANITY = RunTable(
    "gaussianity",
    {
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
        **dict.fromkeys(
            ("gain_student_within_nats", "gain_student_within_low", "gain_student_within_high"), pl.Float64
        ),
        **dict.fromkeys(
            ("gain_mixture_within_nats", "gain_mixture_within_low", "gain_mixture_within_high"), pl.Float64
        ),
        **dict.fromkeys(("gain_scales_nats", "gain_scales_low", "gain_scales_high"), pl.Float64),
        **dict.fromkeys(("student_nu_within", "mixture_share_within", "mixture_ratio_within"), pl.Float64),
        "kind": INTERVAL_KIND,
        "level": pl.Float64,
        "resampled": RESAMPLED,
        "verdict": SHAPE,
        "why": pl.String,
    },
    _shape(),
)
"""Are errors Gaussian: one row per band of ages (or of distances from the key frame) of a condition.

skewness and kurtosis are Mardia's b1 and b2 (0 and 8 for a Gaussian in two dimensions). tail_99 is P(d2 > 9.21) / 0.01,
tail_999 P(d2 > 13.82) / 0.001. Gains are held-out log-likelihood per observation over a Gaussian, nats. All are of
errors in units of the mean and covariance of their age. student_scale_px is the scale of one coordinate at a typical
age; mixture_share is the share of the wider component, mixture_ratio how many times larger its covariance is.

Columns with `_within` are of errors in units of the mean and covariance of their own scene, and the verdict is about
these. gain_scales is what the different scales of scenes add: Student's gain less that within scenes.
"""


def _radii() -> Rows:
    values = [Value("radius", name, {"part": name}) for name in ("expected", "observed")]
    keys = {
        **OF_CONDITION,
        "trimming": "trimming",
        "at_low": "age_low",
        "at_high": "age_high",
        "part_low": "probability",
    }
    return Rows(Topic.radii, keys, values)


RADII = RunTable(
    "radii",
    {
        **POOLED,
        "trimming": TRIMMING,
        "age_low": pl.Int64,
        "age_high": pl.Int64,
        **dict.fromkeys(("probability", "expected", "observed"), pl.Float64),
    },
    _radii(),
)
"""Radial QQ plot: quantiles of the Mahalanobis distance, observed and of a Gaussian of the same covariance."""

_GROWTH = (
    *("white_px", "walk_px_per_sqrt_frame", "drift_px_per_frame"),
    *("saturating_white_px", "saturating_px", "saturating_frames"),
    *("white_px_geometric", "walk_px_per_sqrt_frame_geometric", "drift_px_per_frame_geometric"),
    *("autocorrelation", *(f"autocorrelation_{lag}" for lag in _LAGS[1:])),
    "growth_ratio",
)


def _growth() -> Rows:
    made = same("level", "resampled") | {"interval": "kind"}
    values = [Value("growth", "growth", carried={"n": "n_ages", **same("n_scenes", "verdict", "why"), **made})]
    ends = {"low": "growth_ratio_low", "high": "growth_ratio_high", "at_low": "growth_from", "at_high": "growth_to"}
    of_ratio = {**ends, "verdict": "grows", **same("level", "resampled", "coverage")}
    values.append(Value("growth_ratio", "growth_ratio", carried=of_ratio, always=True))

    def bounded(quantity: str, column: str, labels: Constants, *, kind: str = "kind") -> Value:
        bounds = bounds_of(column) | same("resampled") | {"interval": kind}
        return Value(quantity, column, labels, carried=bounds, always=column == "autocorrelation")

    for quantity, column in (
        ("white", "white_px"),
        ("random_walk", "walk_px_per_sqrt_frame"),
        ("drift", "drift_px_per_frame"),
    ):
        values.append(bounded(quantity, column, {"weighting": Weighting.features}))
        values.append(bounded(quantity, f"{column}_geometric", {"weighting": Weighting.geometric}))
    for quantity in ("saturating_white", "saturating"):
        values.append(bounded(quantity, f"{quantity}_px", {"weighting": Weighting.features}))
    values.append(bounded("saturating_frames", "saturating_frames", {"weighting": Weighting.features}))
    for lag in _LAGS:
        column = "autocorrelation" if lag == 1 else f"autocorrelation_{lag}"
        values.append(bounded("autocorrelation", column, {"axis": "lag", "at": lag}, kind="autocorrelation_kind"))
    keys = {**OF_CONDITION, **same("trimming", "coordinate")}
    return Rows(Topic.growth, keys, values)


TIME_STRUCTURE = RunTable(
    "time_structure",
    {
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
    },
    _growth(),
)
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


def _factors() -> Rows:
    """Effects of factors."""
    carried = _LEVELS | same(
        *("unit", "low", "high", "level", "resampled", "n_scenes", "verdict", "why", "larger", "better")
    )
    counts = ("n_levels", "n_pairs", "n_places", "at_low", "at_high", "more_scenes")
    values = [
        Value("effect", "effect", carried=carried | {"interval": "kind"}),
        Value("effect_bound", "most", carried=same("unit")),
        Value("effect_margin", "margin", carried=same("unit")),
        *(Value("effect_p", f"p_{part}", {"part": part}) for part in ("yes", "no")),
        *(Value("effect_q", f"q_{part}", {"part": part}) for part in ("yes", "no")),
        *(Value("effect_count", name, {"part": name}) for name in counts),
        Value("effect_horizon", "horizon"),
    ]
    keys = {**OF_CONDITION, **same("factor", "axis", "coordinate", "at"), "of": "statistic"}
    return Rows(Topic.factors, keys, values)


DEPENDENCE = RunTable(
    "dependence",
    {
        "dataset": pl.String,
        "factor": pl.String,
        **CONDITION,
        **dict.fromkeys(
            ("statistic", "axis", "unit", "level_a", "level_b", "larger", "better", "coordinate"), pl.String
        ),
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
    },
    _factors(),
)
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


def _shared_motion() -> Rows:
    values = [
        Value("shared_motion", "share", carried=ESTIMATED_OF_N),
        Value("shared_motion_moment", "second_px2", {"against": "measured"}),
        Value("shared_motion_moment", "left_px2", {"against": "left"}),
    ]
    keys = {**OF_CONDITION, "part": "fitted_to", "at": "age", "coordinate": "coordinate"}
    return Rows(Topic.shared_motion, keys, values)


RIGID_SHARE = RunTable(
    "rigid_share",
    {
        **POOLED,
        "fitted_to": FITTED_TO,
        "age": pl.Int64,
        "coordinate": pl.String,
        "n": pl.Int64,
        "second_px2": pl.Float64,
        "left_px2": pl.Float64,
        "share": pl.Float64,
        **_ESTIMATED,
    },
    _shared_motion(),
)
"""Share of the second moment of the errors that one small pose error per frame explains, by age.

The pose errors are fitted to other tracks: to the other half of the tracks of the same tracker (`own`), or of all other
trackers (`others`), where n counts only errors for which these know it. second_px2 is the second moment about zero of n
errors, left_px2 what a correction of the poses leaves of it. share does not contain the noise of the fit, which
left_px2 does. coordinate is u, v or both.
"""

POSE_SHARE = RunTable(
    "pose_share",
    {
        **POOLED,
        "fitted_to": FITTED_TO,
        "n": pl.Int64,
        "share": pl.Float64,
        **_ESTIMATED,
    },
    one_number(
        Topic.pose_share,
        "pose_share",
        "share",
        {**OF_CONDITION, "part": "fitted_to"},
        ESTIMATED_OF_N,
    ),
)
"""The same share of both coordinates and of all steps up to the reference age together, without outliers: (pose.share).

n counts errors, outliers too. low and high hold whatever the share is of errors for which nothing is predicted.
"""

POSE_LAW = RunTable(
    "pose_law",
    {
        "dataset": pl.String,
        **VIEW,
        "motion": pl.String,
        "law": pl.String,
        "unit": pl.String,
        "n": pl.Int64,
        **_ESTIMATE,
    },
    one_number(
        Topic.pose_errors,
        "pose_error",
        "value",
        {"dataset": "dataset", **OF_VIEW, "part": "motion", "of": "law"},
        ESTIMATED_OF_N | {"unit": "unit"},
    ),
)
"""Growth law of the errors of the stated poses, fitted to `POSE_GROWTH`: one row per motion and part of the law.

motion is `rotation` or `translation`. The part `white` is the standard deviation of one coordinate of a single pose,
`random walk` that of its change from one frame to the next. Both are what the tracks see as a motion of the camera,
whatever its cause.
"""

TRACKER_DIFFERENCES = RunTable(
    "tracker_differences",
    {
        **POOLED,
        "other": pl.String,
        "statistic": pl.String,
        "age": pl.Int64,
        "coordinate": pl.String,
        "unit": pl.String,
        "n": pl.Int64,
        **_ESTIMATE,
        "established": pl.Boolean,
    },
    one_number(
        Topic.tracker_differences,
        "tracker_difference",
        "value",
        {**OF_CONDITION, "against": "other", "of": "statistic", "at": "age", "coordinate": "coordinate"},
        ESTIMATED_OF_N | {"unit": "unit", "verdict": "established"},
    ),
)
"""Differences of the errors of two trackers at the same corners and in the same frames: `tracker` minus `other`.

statistic is `mean` (px) or `central`, the covariance of the differences (px^2): u and v are variances. An error of the
truth cancels in the difference. established states whether a mean differs from 0 at the level of the row, with
Bonferroni's correction for all ages and both coordinates of the two trackers; it is null for covariances.
"""

RANKS = RunTable(
    "ranks",
    {
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
    },
    Rows(
        Topic.ranks,
        {**OF_CONDITION, "axis": "axis", "of": "statistic"},
        [
            *(
                Value("rank", name, {"part": name}, carried=same("n_scenes", "level", "why"))
                for name in ("best", "worst")
            ),
            Value("rank_count", "n_trackers"),
        ],
    ),
)
"""Ranks of trackers at the lowest speed, one row per statistic and tracker, where three or more are compared.

A tracker is between the ranks best and worst of n_trackers, by (ranks). n_scenes is the smallest number of scenes that
it shares with another tracker. level is that of the comparisons. why names the trackers about which references of the
two kinds disagree, if any.
"""

SURROUNDING_ERRORS = RunTable(
    "surrounding_errors",
    {
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
    },
    Rows(
        Topic.surroundings,
        {**OF_CONDITION, **OF_CLASS, **same("axis", "at", "coordinate"), "of": "statistic"},
        [Value("surrounding", "value", carried=ESTIMATED_OF_N | {"unit": "unit"})],
        packed={"part": ("surrounding", "class")},
    ),
)
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


def _image() -> Rows:
    made = same("level", "resampled", "n_units", "n_scenes") | {"interval": "kind"}
    values = [
        Value("image_spread", "spread_px", carried=made | {"n": "n", "verdict": "differs"}),
        *(
            Value("image_mean", f"mean_{name}_px", {"coordinate": name}, carried=made | bounds_of(f"mean_{name}"))
            for name in "uv"
        ),
    ]
    keys = {**OF_CONDITION, **same("axis", "at")}
    return Rows(Topic.image, keys, values, packed={"part": ("row", "column")})


IMAGE_CELLS = RunTable(
    "image_cells",
    {
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
    },
    _image(),
)
"""Mean of visible, untrimmed errors in each cell of the image, 20 columns x 14 rows, counted from the top left.

spread_px is the standard deviation of one coordinate, as root mean square of both. The bounds in u and v hold together
with the probability of the level. differs says whether they exclude a mean of zero; it is null without bounds.
"""

RATIO_VALUES = RunTable(
    "ratios",
    {
        **POOLED,
        "quantity": pl.String,
        "trimming": TRIMMING,
        "axis": pl.String,
        "at": pl.Int64,
        "n": pl.Int64,
        **_ESTIMATE,
    },
    Rows(
        Topic.ratios,
        {**OF_CONDITION, **same("trimming", "axis", "at")},
        [Value(name, "value", {}, {"quantity": name}, ESTIMATED_OF_N) for name in RATIOS],
    ),
)
"""Ratios of sums over features, by age: the quantities of `tracknoise.tables.quantities.RATIOS`, features pooled."""


def _own_covariances() -> Rows:
    names: dict[str, tuple[str, Constants]] = {
        **{f"coverage_{level}": ("covariance_coverage", {"of": f"{level} %"}) for level in (50, 90, 95, 99)},
        "nees": ("covariance_nees", {}),
        "shape": ("covariance_shape", {"of": "worst"}),
        **{
            f"shape_{frame}_{name}": ("covariance_shape", {"of": f"{frame}, {name}"})
            for frame in COVARIANCE_FRAMES
            for name in ("along", "turned")
        },
        "elongation": ("covariance_elongation", {}),
        "fourth": ("covariance_fourth_moment", {}),
        "ranking": ("covariance_ranking", {}),
        "gain": ("covariance_gain", {}),
        "impossible": ("impossible_covariances", {}),
    }
    values = by_quantity(names, ESTIMATED_OF_N | same("verdict"), of=None)
    keys = {**OF_CONDITION, **same("trimming", "axis", "at"), "part": "covariance"}
    return Rows(Topic.own_covariances, keys, values)


OWN_COVARIANCES = RunTable(
    "own_covariances",
    {
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
    },
    _own_covariances(),
)
"""Whether covariances that a tracker predicts are right: see `tracknoise.analysis.covariance_verdicts`.

covariance is the name in the columns ``quality_<name>_uu`` of the observations. axis and at are null for all ages
together. n counts errors. The verdict says of `nees` whether the covariances are right in size, of `shape` whether in
shape, of `ranking` whether they tell which errors are large, and of `gain` whether they are better than one sigma.
"""

SPEED_ERRORS = RunTable(
    "speed_errors",
    {
        **POOLED,
        "axis": pl.String,
        "at": pl.Int64,
        "class_low": pl.Float64,
        "class_high": pl.Float64,
        "coordinate": pl.String,
        "n": pl.Int64,
        "mean_px": pl.Float64,
        **_ESTIMATED,
    },
    one_number(
        Topic.image_speeds,
        "image_speed_mean",
        "mean_px",
        {**OF_CONDITION, **OF_CLASS, **same("axis", "at", "coordinate")},
        ESTIMATED_OF_N,
    ),
)
"""Mean of visible, untrimmed errors along and across the image motion, by its speed: class_low to class_high px/frame.

The motion is that of the true position since the previous frame that the tracker saw.
"""

FINDINGS = RunTable(
    "findings",
    {
        "rank": pl.Int32,
        **dict.fromkeys(("topic", "text", "figure", "table"), pl.String),
        "value": pl.Float64,
        "low": pl.Float64,
        "high": pl.Float64,
        "unit": pl.String,
        "rows": pl.List(pl.String),
        **dict.fromkeys(("brief", "opening", "closing"), pl.String),
        "parts": pl.List(pl.Struct({"tracker": pl.String, "text": pl.String, "rows": pl.List(pl.String)})),
    },
)
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

TRUST = RunTable(
    "trust",
    {
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
    },
)
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

AUDIT = RunTable(
    "audit",
    {
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
    },
)
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

AUDIT_CURVES = RunTable(
    "audit_curves",
    {
        "dataset": pl.String,
        "tracker": pl.String,
        "correction": pl.String,
        "age": pl.UInt32,
        "n": pl.Int64,
        **dict.fromkeys(("mean_u_px", "mean_v_px"), pl.Float64),
        **dict.fromkeys(("second_uu", "second_vv"), pl.Float64),
        **dict.fromkeys(("core_u_px", "core_v_px", "near_px"), pl.Float64),
    },
)
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

STATISTICS_TABLES = (CURVES, CORES, FLOOR, LIFETIMES, OUTLIERS, TRIMS, ERRORS, COUNTS, SUMMARY, EFFECTS)
"""Tables of a run that are computed from those of its sequences. A finished run has them all."""
FINDINGS_TABLES = (
    ASPECT_CURVES,
    CHANGES,
    INTERVALS,
    SEED_SPREAD,
    TRIANGULATED_NOISE,
    WINDOW_SIGMAS,
    ADVICE,
    NOISE_LOOKUP,
    DEPTH_INTERVALS,
    POINT_TRACKING_METRICS,
    TWO_TRUTHS,
    POSE_DISAGREEMENT,
    INCIDENCE,
    ZERO_MEAN,
    GAUSSIANITY,
    RADII,
    TIME_STRUCTURE,
    DEPENDENCE,
    RANKS,
    SURROUNDING_ERRORS,
    IMAGE_CELLS,
    SPEED_ERRORS,
    RATIO_VALUES,
    OWN_COVARIANCES,
    RIGID_SHARE,
    POSE_SHARE,
    POSE_LAW,
    TRACKER_DIFFERENCES,
    FINDINGS,
    AUDIT,
    AUDIT_CURVES,
    TRUST,
)
"""Tables of a run that are computed from the others. They are empty if they were not computed."""
RUN_TABLES = {table.name: table for table in (*STATISTICS_TABLES, *FINDINGS_TABLES)}
"""Tables of the whole run by their names: a file each."""


def by_table(tables: Mapping[str, pl.DataFrame]) -> dict[RunTable, pl.DataFrame]:
    """Tables of a run by what they are, not by name."""
    return {RUN_TABLES[name]: table for name, table in tables.items()}
