"""Columns of the tables that hold findings and effects, and of those that the audit of the truth reads.

Every interval states its level, its method (`kind`), and what was resampled: `scenes`, `groups` of scenes, scenes
`within` their groups, or, if there are too few scenes, `blocks` of tracks within them. An interval from blocks holds
for these scenes only, one from scenes within their groups for these groups only. `kind` is the one that the experiment
asks for, with two exceptions. Shape, and what is fitted to growth, have `bca` instead of `student`
(`tracknoise.inference.intervals.Method`). Effects of factors always have `paired`.
"""

from collections.abc import Mapping

import polars as pl

from tracknoise.inference.conventions import IntervalKind
from tracknoise.inference.units import Resampled
from tracknoise.tables.enumerations import Aspect, Behaviour, EffectIntervalKind, Lookup, Population, Shape, Weighting
from tracknoise.tables.run_table import (
    COUNTED,
    ESTIMATED,
    OF_CONDITION,
    Columns,
    Constants,
    Rows,
    RunTable,
    Value,
    same,
)
from tracknoise.tables.schema import (
    AMONG,
    ASPECT,
    AXIS,
    BY_CAUSE,
    CAUSES,
    CONDITION,
    FLOOR_SOURCE,
    ORIGIN,
    POOLED,
    POPULATION,
    SEQUENCE,
    TRIMMING,
    VERDICT,
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

INTERVAL_COLUMNS: Schema = {
    "low": pl.Float64,
    "high": pl.Float64,
    "kind": INTERVAL_KIND,
    "level": pl.Float64,
    "resampled": RESAMPLED,
    "n_units": pl.Int32,
    "n_scenes": pl.Int32,
}
ESTIMATE_COLUMNS: Schema = {"value": pl.Float64, **INTERVAL_COLUMNS}

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

CHANGE_LAGS = (1, 2, 3, 4, 5)
OF_LEVELS = same("level_a", "level_b")


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
    return Rows("errors", {**OF_CONDITION, **keys}, values)


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
    return Rows("truth floor", keys, values)


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
    without_truth=True,
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
    return Rows("errors", keys, values)


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
        for lag in CHANGE_LAGS
        for coordinate in "uv"
    ]
    return Rows("errors", {**OF_CONDITION, "trimming": "trimming", "at": "age"}, [*ages, *lags])


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
    title="frame-to-frame changes of errors",
)
"""Changes of visible errors from frame to frame: at lag 0, their mean and covariance (px^2) by the age at their end.

Lags of 1 and more, in frames that the tracker saw, have the autocorrelation of changes over all ages.
"""


def _tracks() -> Rows:
    """Lifetimes: survival, and numbers of tracks, by lifetime."""
    labels: Constants = {"axis": "lifetime", "aspect": Aspect.all}
    values = [
        Value("survival", "survival", labels, carried={"n": "at_risk", "n_scenes": "n_scenes"}),
        Value("survival_until_failure", "survival_until_failure", labels),
        Value("tracks_ended", "n_ended", labels),
        Value("tracks_censored", "n_censored", labels),
        *(Value("tracks_ended_by_cause", f"n_{cause}", {**labels, "part": cause}) for cause in CAUSES),
        Value("followed_to", "followed_to", labels),
    ]
    keys = {**OF_CONDITION, "at": "lifetime"}
    return Rows("tracks", keys, values)


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
    title="lifetimes and survival",
    without_truth=True,
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
    return Rows("outliers", OF_CONDITION, values)


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
    title="outlier ratios",
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
    title="tracks dropped by trimming",
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

COUNTS = RunTable(
    "counts", {**POOLED, "kind": pl.String, "name": pl.String, "n": pl.Int64}, title="truth statuses and track ends"
)
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
    title="key numbers of every condition",
)
"""One row per condition: lifetimes (frames its tracker saw), outlier ratio, and errors at one age or frame.

rms is the square root of Phi or Sigma. Ages and frames are those of the nominal sequence, and n is the number of
features there. If the axis is the frame, nu and eta are mu and kappa. nu, eta and rms are of all features pooled; core
and beyond are those of `CORES`. floor is the root of the truth floor, and floor_mean the standard deviation of what the
errors of the truth add to the mean: see `FLOOR`. Restricted means are of min(lifetime, restricted_to). The horizon
restricted_to is the same in all rows of a data set and speed.
"""


def _largest_differences() -> Rows:
    carried = OF_LEVELS | same("unit", "verdict", "why")
    counts = ("n_levels", "n_pairs", "n_shared")
    values = [
        Value("largest_difference", "effect", carried=carried),
        *(Value("largest_difference_part", name, {"part": name}) for name in ("difference", "common", "margin")),
        Value("largest_difference_part", "share_of_absolute", {"part": "share_of_absolute"}),
        *(Value("effect_count", name, {"part": name}) for name in counts),
    ]
    keys = {**OF_CONDITION, **same("factor", "axis", "coordinate", "at"), "of": "statistic"}
    return Rows("largest differences", keys, values)


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
    title="effects of factors by the paper's yardstick",
)
"""Effect of a factor on a statistic: the two levels that differ most, at which age or frame, and by how much.

The column of the factor itself is null. The other columns of the condition state the levels that were held fixed. `at`
is an age, or a number of frames since the key frame.
"""


def _intervals() -> Rows:
    """Numbers of errors, of tracks and of outliers, with their intervals."""

    def of(quantity: str, axis: str | None, statistic: str, topic: str | None = None) -> Value:
        rows = {"statistic": statistic, "axis": axis}
        return Value(quantity, "value", {"axis": axis}, rows, _OF_INTERVALS, topic)

    roles = [*_ROLES.items(), ("core", {"age": "core", "frame": "core"})]
    values = [of(quantity, axis, statistic) for quantity, names in roles for axis, statistic in names.items()]
    values += [of("autocorrelation", "lag", "autocorrelation")]
    values += [of(name, None, name, "tracks") for name in _LIFETIMES]
    values += [of(name, "lifetime", name, "tracks") for name in _SURVIVAL]
    values += [of("outlier_ratio", None, "outlier_ratio", "outliers")]
    keys = {**OF_CONDITION, **_POINT, "coordinate": "coordinate"}
    return Rows("errors", keys, values)


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
        **ESTIMATE_COLUMNS,
        **dict.fromkeys(("spread", "next_low", "next_high", "coverage"), pl.Float64),
    },
    _intervals(),
    verdicts=pl.col("at").is_null(),
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

STATISTICS_TABLES = (CURVES, CORES, FLOOR, LIFETIMES, OUTLIERS, TRIMS, ERRORS, COUNTS, SUMMARY, EFFECTS)
"""Tables of a run that are computed from those of its sequences. A finished run has them all."""
