"""How the tables of a run are rows of the table of results, and the ids of these rows.

Tables are what is stored and read. Results are derived from them (`run_results`), and nothing is turned back.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import polars as pl

from tracknoise.tables import findings_schema, schema
from tracknoise.tables.enumerations import Aspect, Population, Weighting
from tracknoise.tables.quantities import QUANTITIES, RATIOS, Topic
from tracknoise.tables.results import beside_untrusted_truth, finished, ids
from tracknoise.tables.schema import CAUSES, CONDITION
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import TruthVerdict

Columns: TypeAlias = Mapping[str, str]
"""Columns of a table by columns of `RESULTS`."""
Constants: TypeAlias = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Value:
    """A column of numbers of a table.

    Attributes
    ----------
    quantity
        Of the numbers.
    column
        Of the table.
    labels
        What the identity of the row has besides the keys of the table, or in place of one that the table has not.
    rows
        Values of columns of the table in the rows that have it; by default all rows have it.
    carried
        More columns of the row, and of the table.
    topic
        Of the row; None where it is that of the table.
    always
        Whether there is a row where the number is missing too.
    """

    quantity: str
    column: str
    labels: Constants = field(default_factory=dict)
    rows: Constants = field(default_factory=dict)
    carried: Columns = field(default_factory=dict)
    topic: Topic | None = None
    always: bool = False


@dataclass(frozen=True, slots=True)
class Rows:
    """A table as rows of results.

    Attributes
    ----------
    topic
        Of its rows.
    keys
        Columns of the identity, and of the table.
    values
        Its numbers. The first of those with the same `rows` is there in every row; others may be missing.
    packed
        A column of the identity, and columns of the table that it holds as text, joined by a colon.
    """

    topic: Topic
    keys: Columns
    values: Sequence[Value]
    packed: Mapping[str, Sequence[str]] = field(default_factory=dict)

    @property
    def topics(self) -> frozenset[Topic]:
        """Topics of its rows."""
        return frozenset(value.topic or self.topic for value in self.values)


_SEPARATOR = ": "
_ROW = "row of the table"


def results_of(tables: Mapping[str, pl.DataFrame]) -> pl.DataFrame:
    """The table of results that holds the numbers of tables.

    Parameters
    ----------
    tables
        By the names in `RESULT_ROWS`; others are left out.

    Returns
    -------
    polars.DataFrame
        Schema `RESULTS`.
    """
    made: list[pl.DataFrame] = []
    for topics in _TOGETHER:
        mine = (name for name, rows in RESULT_ROWS.items() if name in tables and rows.topics & topics)
        made.append(finished(part for name in mine for _, part in _parts_of(RESULT_ROWS[name], tables[name])))
    return pl.concat(made)


def run_results(run: RunFolder) -> pl.DataFrame:
    """The table of results of a run: every number of it (schema `RESULTS`).

    Raises
    ------
    StoreError, SchemaError
        If the run is not finished, or a file is missing or damaged.
    """
    results = results_of({name: run.statistics(name) for name in RESULT_ROWS})
    return results if TruthVerdict.of_run(run).is_usable else beside_untrusted_truth(results)


def with_ids(name: str, table: pl.DataFrame) -> pl.DataFrame:
    """A table of `RESULT_ROWS` with the column `ids`: by column of numbers, the id of the row of results; or null."""
    rows = RESULT_ROWS[name]
    found = {value.column: pl.Series(value.column, [None] * table.height, dtype=pl.String) for value in rows.values}
    for value, part in _parts_of(rows, table):
        found[value.column] = found[value.column].scatter(part[_ROW], ids(part))
    return table.with_columns(ids=pl.struct(*found.values()))


def _parts_of(rows: Rows, table: pl.DataFrame) -> Iterator[tuple[Value, pl.DataFrame]]:
    """Rows of results of a table: a part for each of its values that has any, with the numbers of its rows."""
    for column, names in rows.packed.items():
        texts = [pl.col(name).cast(pl.String).fill_null("") for name in names]
        table = table.with_columns(pl.concat_str(texts, separator=_SEPARATOR).alias(f"packed {column}"))
    keys = {**rows.keys, **{column: f"packed {column}" for column in rows.packed}}
    if table.is_empty():
        return
    kinds, table = table.schema, table.with_row_index(_ROW)
    groups: dict[tuple[tuple[str, Any], ...], pl.DataFrame] = {}
    for value in rows.values:
        is_first = (group := tuple(value.rows.items())) not in groups
        if is_first:
            groups[group] = table.filter(*(pl.col(name).eq_missing(pl.lit(wanted)) for name, wanted in group))
        own = groups[group]
        if not (is_first or value.always) and own[value.column].null_count():
            own = own.filter(pl.col(value.column).is_not_null())
        if own.is_empty():
            continue
        unit = QUANTITIES[value.quantity].unit
        constants = {"topic": value.topic or rows.topic, "quantity": value.quantity, "unit": unit, **value.labels}
        named = {name: column for name, column in keys.items() if name not in value.labels}
        taken = {**named, "value": value.column, **value.carried}
        yield (
            value,
            own.select(
                _ROW,
                *(pl.lit(constant).alias(name) for name, constant in constants.items() if name not in taken),
                *(_encoded(column, kinds.get(column)).alias(target) for target, column in taken.items()),
            ),
        )


def _encoded(column: str, kind: pl.DataType | None) -> pl.Expr:
    """A column as results have it: what is true or false becomes `yes` or `no`; a verdict may have no number."""
    if kind is None:
        return pl.lit(None)
    if kind == pl.Boolean and column != "cut":
        return pl.when(pl.col(column)).then(pl.lit("yes")).when(~pl.col(column)).then(pl.lit("no"))
    return pl.col(column)


def _same(*names: str) -> dict[str, str]:
    return {name: name for name in names}


def _bounds_of(stem: str, unit: str = "") -> dict[str, str]:
    return {"low": f"{stem}_low{unit}", "high": f"{stem}_high{unit}", "level": "level"}


_CONDITION = _same("dataset", *CONDITION)
_ESTIMATED = _same("low", "high", "level", "resampled", "n_units", "n_scenes") | {"interval": "kind"}
_WITH_N = _ESTIMATED | {"n": "n"}
_OF_INTERVALS = _ESTIMATED | _same("unit", "spread", "next_low", "next_high", "coverage")
_COUNTED = _same("n", "n_scenes")
_ROLES: Mapping[str, Mapping[str, str]] = {
    "mean_error": {"age": "nu", "frame": "mu"},
    "mean_absolute_error": {"age": "eta", "frame": "kappa"},
    "second_moment": {"age": "Phi", "frame": "Sigma"},
    "central_moment": {"age": "central", "frame": "central"},
}
"""Statistics of errors, and their names in curves by age and by frame."""
_POINT = _same("aspect", "at_least", "population", "trimming", "weighting", "at")
_LIFETIMES = (
    *("mean_lifetime", "median_lifetime", "lower_quartile_lifetime", "upper_quartile_lifetime"),
    *("restricted_mean_lifetime", "median_until_failure", "restricted_mean_until_failure"),
)
_SURVIVAL = ("survival", "survival_until_failure")
_LAGS = (1, *(int(name[-1]) for name in findings_schema.TIME_STRUCTURE if name[:-1] == "autocorrelation_"))


def _curves(keys: Columns, labels: Constants) -> Rows:
    """Curves of errors: columns u, v and uv."""
    values = [
        Value(
            quantity,
            coordinate,
            {**labels, "axis": axis, "coordinate": coordinate},
            {"statistic": statistic, "axis": axis},
            {**_COUNTED, "unit": "unit", "cut": "cut"},
        )
        for quantity, names in _ROLES.items()
        for axis, statistic in names.items()
        for coordinate in ("u", "v", "uv")
    ]
    return Rows(Topic.errors, {**_CONDITION, **keys}, values)


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
        Value(quantity, column, {**of_age, "coordinate": coordinate}, {"lag": 0}, _COUNTED)
        for column, (quantity, coordinate) in moments.items()
    ]
    of_lag = {"aspect": Aspect.change, "population": Population.visible, "axis": "lag"}
    lags = [
        Value(
            "autocorrelation",
            f"autocorrelation_{coordinate}",
            {**of_lag, "at": lag, "coordinate": coordinate},
            {"lag": lag},
            _COUNTED,
        )
        for lag in _LAGS
        for coordinate in "uv"
    ]
    return Rows(Topic.errors, {**_CONDITION, "trimming": "trimming", "at": "age"}, [*ages, *lags])


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
    keys = {**_CONDITION, **_same("population", "trimming", "at")}
    return Rows(Topic.errors, keys, values)


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
    keys = {**_CONDITION, "at": "lifetime"}
    return Rows(Topic.tracks, keys, values)


def _outliers() -> Rows:
    names = ("mean", "median", "lower_quartile", "upper_quartile", "lower_whisker", "upper_whisker")
    values = [
        Value("frames", "n_frames", carried={"n_scenes": "n_scenes"}),
        Value("features_offered", "offered"),
        Value("features_rejected", "outliers"),
        Value("outlier_ratio", "pooled_ratio", {"aspect": Aspect.all}),
        *(Value("outlier_ratio_of_frames", name, {"part": name}) for name in names),
    ]
    return Rows(Topic.outliers, _CONDITION, values)


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
    keys = {**_CONDITION, **_POINT, "coordinate": "coordinate"}
    return Rows(Topic.errors, keys, values)


def _floor() -> Rows:
    values = [
        Value("truth_floor", f"floor_{2 * name if len(name) == 1 else name}", {"coordinate": name}, carried=_COUNTED)
        for name in ("u", "uv", "v")
    ]
    values += [Value("truth_floor_of_mean", f"mean_{name}_px", {"coordinate": name}) for name in "uv"]
    keys = {**_CONDITION, "part": "source", **_same("axis", "at")}
    return Rows(Topic.truth_floor, keys, values)


def _bias() -> Rows:
    tests = [
        name for name in findings_schema.ZERO_MEAN if name == "iid_p" or name.startswith(("hotelling", "sign_flip"))
    ]
    of_mean = {name: _bounds_of(f"mean_{name}", "_px") for name in "uv"}
    values = [
        Value("bias", "effect_px", carried={**_COUNTED, **_same("verdict", "why"), **_bounds_of("effect", "_px")}),
        *(
            Value("bias_component", f"mean_{name}_px", {"coordinate": name}, carried=_COUNTED | of_mean[name])
            for name in "uv"
        ),
        Value("bias_share", "share_of_second"),
        *(Value("p_value", name, {"part": name}) for name in tests),
    ]
    keys = {**_CONDITION, **_same("trimming", "axis", "at")}
    return Rows(Topic.bias, keys, values)


def _shape() -> Rows:
    made = _same("level", "resampled") | {"interval": "kind"}
    values = [Value("shape", "shape", carried=_same("n", "n_scenes", "verdict", "why") | made)]
    for part, suffix in (("pooled", ""), ("within scenes", "_within")):
        bounds = _bounds_of(f"kurtosis{suffix}") | made
        values += [
            Value("skewness", f"skewness{suffix}", {"part": part}),
            Value("kurtosis", f"kurtosis{suffix}", {"part": part}, carried=bounds),
            Value("tail_ratio", f"tail_99{suffix}", {"part": part, "against": "99 %"}),
        ]
        for density in ("student", "mixture"):
            stem = f"gain_{density}{suffix}"
            bounds = _bounds_of(stem) | made
            values.append(Value("gain", f"{stem}_nats", {"part": part, "against": density}, carried=bounds))
        values += [
            Value("student_nu", f"student_nu{suffix}", {"part": part}),
            Value("mixture_share", f"mixture_share{suffix}", {"part": part}),
            Value("mixture_ratio", f"mixture_ratio{suffix}", {"part": part}),
        ]
    scales = _bounds_of("gain_scales") | made
    values += [
        Value("tail_ratio", "tail_999", {"part": "pooled", "against": "99.9 %"}),
        Value("gain", "gain_scales_nats", {"part": "scales of scenes", "against": "student"}, carried=scales),
        Value("student_scale", "student_scale_px", {"part": "pooled"}),
        Value("errors_sampled", "n_sampled"),
    ]
    keys = {**_CONDITION, "trimming": "trimming", "at_low": "age_low", "at_high": "age_high"}
    return Rows(Topic.shape, keys, values)


def _radii() -> Rows:
    values = [Value("radius", name, {"part": name}) for name in ("expected", "observed")]
    keys = {**_CONDITION, "trimming": "trimming", "at_low": "age_low", "at_high": "age_high", "part_low": "probability"}
    return Rows(Topic.radii, keys, values)


def _growth() -> Rows:
    made = _same("level", "resampled") | {"interval": "kind"}
    values = [Value("growth", "growth", carried={"n": "n_ages", **_same("n_scenes", "verdict", "why"), **made})]
    ends = {"low": "growth_ratio_low", "high": "growth_ratio_high", "at_low": "growth_from", "at_high": "growth_to"}
    of_ratio = {**ends, "verdict": "grows", **_same("level", "resampled", "coverage")}
    values.append(Value("growth_ratio", "growth_ratio", carried=of_ratio, always=True))

    def bounded(quantity: str, column: str, labels: Constants, *, kind: str = "kind") -> Value:
        bounds = _bounds_of(column) | _same("resampled") | {"interval": kind}
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
    keys = {**_CONDITION, **_same("trimming", "coordinate")}
    return Rows(Topic.growth, keys, values)


_LEVELS = _same("level_a", "level_b")


def _factors() -> Rows:
    """Effects of factors."""
    carried = _LEVELS | _same(
        *("unit", "low", "high", "level", "resampled", "n_scenes", "verdict", "why", "larger", "better")
    )
    counts = ("n_levels", "n_pairs", "n_places", "at_low", "at_high", "more_scenes")
    values = [
        Value("effect", "effect", carried=carried | {"interval": "kind"}),
        Value("effect_bound", "most", carried=_same("unit")),
        Value("effect_margin", "margin", carried=_same("unit")),
        *(Value("effect_p", f"p_{part}", {"part": part}) for part in ("yes", "no")),
        *(Value("effect_q", f"q_{part}", {"part": part}) for part in ("yes", "no")),
        *(Value("effect_count", name, {"part": name}) for name in counts),
        Value("effect_horizon", "horizon"),
    ]
    keys = {**_CONDITION, **_same("factor", "axis", "coordinate", "at"), "of": "statistic"}
    return Rows(Topic.factors, keys, values)


def _largest_differences() -> Rows:
    carried = _LEVELS | _same("unit", "verdict", "why")
    counts = ("n_levels", "n_pairs", "n_shared")
    values = [
        Value("largest_difference", "effect", carried=carried),
        *(Value("largest_difference_part", name, {"part": name}) for name in ("difference", "common", "margin")),
        Value("largest_difference_part", "share_of_absolute", {"part": "share_of_absolute"}),
        *(Value("effect_count", name, {"part": name}) for name in counts),
    ]
    keys = {**_CONDITION, **_same("factor", "axis", "coordinate", "at"), "of": "statistic"}
    return Rows(Topic.largest_differences, keys, values)


def _by_quantity(names: Mapping[str, tuple[str, Constants]], carried: Columns, **labels: str | None) -> list[Value]:
    """Values of a table with the columns quantity and value: quantities of results and their labels, by `names`."""
    return [
        Value(quantity, "value", {**labels, **own}, {"quantity": name}, carried)
        for name, (quantity, own) in names.items()
    ]


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
    values = _by_quantity(names, _WITH_N, axis="window", coordinate=None, part=None)
    keys = {**_CONDITION, "trimming": "trimming", "at": "window"}
    return Rows(Topic.windows, keys, values)


def _lookup() -> Rows:
    gain = _ESTIMATED | {"n": "n", "verdict": "established", "why": "why"}
    values = [
        Value("noise_gain", "gain_nats", carried=gain),
        *(
            Value("noise_spread", f"factor{table}", {"at_low": place}, carried=_bounds_of(f"factor{table}"))
            for place, table in enumerate(("", "_against"))
        ),
    ]
    keys = {"dataset": "dataset", "of": "product", "part": "lookup", "against": "against"}
    return Rows(Topic.lookup, keys, values)


def _depths() -> Rows:
    names: dict[str, tuple[str, Constants]] = {
        **{f"coverage_{level}": ("depth_coverage", {"of": f"{level} %"}) for level in (50, 90, 95, 99)},
        "overconfidence": ("depth_overconfidence", {}),
        "error_ratio": ("depth_error_ratio", {}),
        "depth_error": ("depth_error", {}),
    }
    values = _by_quantity(names, _WITH_N, axis="window", of=None)
    keys = {**_CONDITION, "trimming": "trimming", "at": "window", "part": "covariance", "part_low": "sigma_px"}
    return Rows(Topic.depths, keys, values)


def _own_covariances() -> Rows:
    names: dict[str, tuple[str, Constants]] = {
        **{f"coverage_{level}": ("covariance_coverage", {"of": f"{level} %"}) for level in (50, 90, 95, 99)},
        "nees": ("covariance_nees", {}),
        "shape": ("covariance_shape", {"of": "worst"}),
        **{
            f"shape_{frame}_{name}": ("covariance_shape", {"of": f"{frame}, {name}"})
            for frame in schema.COVARIANCE_FRAMES
            for name in ("along", "turned")
        },
        "elongation": ("covariance_elongation", {}),
        "fourth": ("covariance_fourth_moment", {}),
        "ranking": ("covariance_ranking", {}),
        "gain": ("covariance_gain", {}),
        "impossible": ("impossible_covariances", {}),
    }
    values = _by_quantity(names, _WITH_N | _same("verdict"), of=None)
    keys = {**_CONDITION, **_same("trimming", "axis", "at"), "part": "covariance"}
    return Rows(Topic.own_covariances, keys, values)


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
    values = _by_quantity(names, _same("low", "high", "level", "n_scenes", "why"), axis="window", against=None)
    packed = {"part": ("estimator", "landmark", "purpose", "kernel")}
    keys = {**_CONDITION, "at": "window"}
    return Rows(Topic.advice, keys, values, packed=packed)


def _second_truth() -> Rows:
    values = [
        Value(f"truth_difference_{statistic}", "value", {}, {"statistic": statistic}, _WITH_N)
        for statistic in ("mean", "second")
    ]
    keys = {**_CONDITION, **_same("trimming", "coordinate"), "part": "quantity", "at": "age"}
    return Rows(Topic.second_truth, keys, values)


def _one(topic: Topic, quantity: str, value: str, keys: Columns, carried: Columns) -> Rows:
    """A table with one number in each row."""
    return Rows(topic, keys, [Value(quantity, value, carried=carried)])


_VIEW = _same(*schema.VIEW)
_CLASS = {"part_low": "class_low", "part_high": "class_high"}


def _shared_motion() -> Rows:
    values = [
        Value("shared_motion", "share", carried=_WITH_N),
        Value("shared_motion_moment", "second_px2", {"against": "measured"}),
        Value("shared_motion_moment", "left_px2", {"against": "left"}),
    ]
    keys = {**_CONDITION, "part": "fitted_to", "at": "age", "coordinate": "coordinate"}
    return Rows(Topic.shared_motion, keys, values)


def _image() -> Rows:
    made = _same("level", "resampled", "n_units", "n_scenes") | {"interval": "kind"}
    values = [
        Value("image_spread", "spread_px", carried=made | {"n": "n", "verdict": "differs"}),
        *(
            Value("image_mean", f"mean_{name}_px", {"coordinate": name}, carried=made | _bounds_of(f"mean_{name}"))
            for name in "uv"
        ),
    ]
    keys = {**_CONDITION, **_same("axis", "at")}
    return Rows(Topic.image, keys, values, packed={"part": ("row", "column")})


def _seeds() -> Rows:
    values = [
        Value("seed_spread", "standard_deviation", carried=_same("unit") | {"verdict": "widens_interval"}),
        Value("seed_mean", "mean", carried=_same("unit")),
        Value("seeds", "n_seeds"),
    ]
    keys = {**_CONDITION, **_same("population", "trimming", "weighting", "axis", "at", "coordinate"), "of": "statistic"}
    return Rows(Topic.seeds, keys, values)


_OF_SURROUNDINGS = {**_CONDITION, **_CLASS, **_same("axis", "at", "coordinate"), "of": "statistic"}
RESULT_ROWS: Mapping[str, Rows] = {
    "curves": _curves(
        _same("population", "trimming", "weighting", "at"),
        {"aspect": Aspect.all},
    ),
    "cores": _cores(),
    "floor": _floor(),
    "lifetimes": _tracks(),
    "outliers": _outliers(),
    "effects": _largest_differences(),
    "aspect_curves": _curves(_same(*_POINT), {}),
    "changes": _changes(),
    "intervals": _intervals(),
    "seed_spread": _seeds(),
    "triangulated_noise": _one(
        Topic.fitted_noise,
        "fitted_noise",
        "sigma_px",
        {
            **_CONDITION,
            **_same("trimming", "coordinate"),
            "part": "measure",
            "at_low": "length_low",
            "at_high": "length_high",
        },
        _WITH_N,
    ),
    "window_sigmas": _windows(),
    "advice": _advice(),
    "noise_lookup": _lookup(),
    "depth_intervals": _depths(),
    "own_covariances": _own_covariances(),
    "point_tracking_metrics": _one(
        Topic.point_tracking,
        "point_tracking",
        "value",
        {**_CONDITION, "part": "raster", "of": "metric"},
        _ESTIMATED,
    ),
    "two_truths": _second_truth(),
    "pose_disagreement": _one(
        Topic.pose_disagreement,
        "pose_disagreement",
        "value",
        {"dataset": "dataset", **_VIEW, "at": "lag", "of": "quantity"},
        _WITH_N | {"unit": "unit"},
    ),
    "incidence": _one(
        Topic.causes,
        "incidence",
        "incidence",
        {**_CONDITION, "part": "cause", "at": "lifetime"},
        _ESTIMATED,
    ),
    "zero_mean": _bias(),
    "gaussianity": _shape(),
    "radii": _radii(),
    "time_structure": _growth(),
    "dependence": _factors(),
    "ranks": Rows(
        Topic.ranks,
        {**_CONDITION, "axis": "axis", "of": "statistic"},
        [
            *(
                Value("rank", name, {"part": name}, carried=_same("n_scenes", "level", "why"))
                for name in ("best", "worst")
            ),
            Value("rank_count", "n_trackers"),
        ],
    ),
    "surrounding_errors": Rows(
        Topic.surroundings,
        _OF_SURROUNDINGS,
        [Value("surrounding", "value", carried=_WITH_N | {"unit": "unit"})],
        packed={"part": ("surrounding", "class")},
    ),
    "image_cells": _image(),
    "speed_errors": _one(
        Topic.image_speeds,
        "image_speed_mean",
        "mean_px",
        {**_CONDITION, **_CLASS, **_same("axis", "at", "coordinate")},
        _WITH_N,
    ),
    "ratios": Rows(
        Topic.ratios,
        {**_CONDITION, **_same("trimming", "axis", "at")},
        [Value(name, "value", {}, {"quantity": name}, _WITH_N) for name in RATIOS],
    ),
    "rigid_share": _shared_motion(),
    "pose_share": _one(
        Topic.pose_share,
        "pose_share",
        "share",
        {**_CONDITION, "part": "fitted_to"},
        _WITH_N,
    ),
    "pose_law": _one(
        Topic.pose_errors,
        "pose_error",
        "value",
        {"dataset": "dataset", **_VIEW, "part": "motion", "of": "law"},
        _WITH_N | {"unit": "unit"},
    ),
    "tracker_differences": _one(
        Topic.tracker_differences,
        "tracker_difference",
        "value",
        {**_CONDITION, "against": "other", "of": "statistic", "at": "age", "coordinate": "coordinate"},
        _WITH_N | {"unit": "unit", "verdict": "established"},
    ),
}
"""Rows of each table of a run that has any, by its name."""
_SHARED = frozenset[Topic]().union(*(chosen.topics for chosen in RESULT_ROWS.values() if len(chosen.topics) > 1))
_TOGETHER: tuple[frozenset[Topic], ...] = (_SHARED, frozenset(Topic) - _SHARED)
"""Topics whose tables have rows in common, and all others: the rows of these are made at once."""
