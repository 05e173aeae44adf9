"""The tables that figures and sentences are drawn from, each as a view of the table of results.

A `View` says which rows of `RESULTS` hold the numbers of a table, and what its columns are called there. It works in
both directions: `results_of` makes the rows from the tables of an analysis, and `view` makes a table from the rows.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import polars as pl

from tracknoise.tables import findings_schema, schema
from tracknoise.tables.enumerations import Aspect, Population, Weighting
from tracknoise.tables.findings_schema import INTERVALS
from tracknoise.tables.quantities import QUANTITIES, RATIOS, Topic
from tracknoise.tables.results import RESULTS, Caveat, finished
from tracknoise.tables.schema import CAUSES, CONDITION, Schema

Columns: TypeAlias = Mapping[str, str]
"""Columns of a view by columns of `RESULTS`."""
Constants: TypeAlias = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Value:
    """A column of numbers of a view.

    Attributes
    ----------
    quantity
        Of the numbers.
    column
        Of the view.
    labels
        What the identity of the row has besides the keys of the view, or in place of one that the table has not.
    rows
        Values of columns of the view in the rows that have it; by default all rows have it.
    carried
        More columns of the row, and of the view.
    topic
        Of the row; None where it is that of the view.
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
class View:
    """A table as rows of results.

    Attributes
    ----------
    topic
        Of its rows.
    columns
        Columns of the table.
    keys
        Columns of the identity, and of the table.
    values
        Its numbers. The first of those with the same `rows` is there in every row; others may be missing.
    sort
        Columns of the table by which it is sorted; by none if its rows have an order of their own.
    only
        Which rows of the topic belong to the view, for topics with several views.
    packed
        A column of the identity, and columns of the table that it holds as text, joined by a colon.
    """

    topic: Topic
    columns: Schema
    keys: Columns
    values: Sequence[Value]
    sort: Sequence[str]
    only: pl.Expr | None = None
    packed: Mapping[str, Sequence[str]] = field(default_factory=dict)

    @property
    def topics(self) -> frozenset[Topic]:
        """Topics of its rows."""
        return frozenset(value.topic or self.topic for value in self.values)


_SEPARATOR = ": "
_NONE = pl.DataFrame(schema=RESULTS)
_STORED = {"cut": "caveats"}
"""Columns of results that `finished` takes, by those that it makes of them."""


def results_of(tables: Mapping[str, pl.DataFrame]) -> pl.DataFrame:
    """The table of results that holds the numbers of all tables that are views.

    Parameters
    ----------
    tables
        By the names in `VIEWS`; others are left out.

    Returns
    -------
    polars.DataFrame
        Schema `RESULTS`.
    """
    made: list[pl.DataFrame] = []
    for topics in _TOGETHER:
        mine = (name for name, chosen in VIEWS.items() if name in tables and chosen.topics & topics)
        made.append(finished(part for name in mine for part in _rows_of(VIEWS[name], tables[name])))
    return pl.concat(made)


def view(results: pl.DataFrame, name: str, *, ids: bool = False) -> pl.DataFrame:
    """A table from the rows of results.

    `results`: schema `RESULTS`. `ids`: whether to add a column `ids`: a structure that has the id of the row of results
    of each column of numbers.
    """
    chosen = VIEWS[name]
    mine = results.filter(pl.col("topic").is_in(chosen.topics))
    if chosen.only is not None:
        mine = mine.filter(chosen.only)
    if mine.is_empty():
        return schema.empty(chosen.columns).with_columns([_ids_of(chosen, [])] if ids else [])
    groups: dict[tuple[tuple[str, Any], ...], list[Value]] = {}
    for value in chosen.values:
        groups.setdefault(tuple(value.rows.items()), []).append(value)
    rows = {name: part for (name,), part in mine.partition_by("quantity", as_dict=True).items()}
    parts = [_group_of(chosen, rows, values, ids=ids) for values in groups.values()]
    table = pl.concat([part for part in parts if part.height] or parts[:1])
    return table.sort(*chosen.sort, maintain_order=True) if chosen.sort else table


class Identified(Mapping[str, pl.DataFrame]):
    """Tables of which those that are views have the column `ids` of `view`; each is made when it is asked for.

    Parameters
    ----------
    results
        Schema `RESULTS`.
    tables
        That the results were made of, and others.
    """

    def __init__(self, results: pl.DataFrame, tables: Mapping[str, pl.DataFrame]) -> None:
        self._results, self._tables = results, tables
        self._made: dict[str, pl.DataFrame] = {}

    def __getitem__(self, name: str) -> pl.DataFrame:
        if name not in VIEWS:
            return self._tables[name]
        if name not in self._made:
            self._made[name] = view(self._results, name, ids=True)
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._tables)

    def __len__(self) -> int:
        return len(self._tables)


def _rows_of(chosen: View, table: pl.DataFrame) -> list[pl.DataFrame]:
    """Rows of results of one table: a part for each of its values that has any."""
    for column, names in chosen.packed.items():
        texts = [pl.col(name).cast(pl.String).fill_null("") for name in names]
        table = table.with_columns(pl.concat_str(texts, separator=_SEPARATOR).alias(f"packed {column}"))
    keys = {**chosen.keys, **{column: f"packed {column}" for column in chosen.packed}}
    if table.is_empty():
        return []
    parts, kinds = [], table.schema
    groups: dict[tuple[tuple[str, Any], ...], pl.DataFrame] = {}
    for value in chosen.values:
        is_first = (group := tuple(value.rows.items())) not in groups
        if is_first:
            groups[group] = table.filter(*(pl.col(name).eq_missing(pl.lit(wanted)) for name, wanted in group))
        rows = groups[group]
        if not (is_first or value.always) and rows[value.column].null_count():
            rows = rows.filter(pl.col(value.column).is_not_null())
        if rows.is_empty():
            continue
        unit = QUANTITIES[value.quantity].unit
        constants = {"topic": value.topic or chosen.topic, "quantity": value.quantity, "unit": unit, **value.labels}
        own = {name: column for name, column in keys.items() if name not in value.labels}
        taken = {**own, "value": value.column, **value.carried}
        parts.append(
            rows.select(
                *(pl.lit(constant).alias(name) for name, constant in constants.items() if name not in taken),
                *(_encoded(column, kinds.get(column)).alias(target) for target, column in taken.items()),
            )
        )
    return parts


def _encoded(column: str, kind: pl.DataType | None) -> pl.Expr:
    """A column as it is stored: what is true or false becomes `yes` or `no`; a verdict may have no number."""
    if kind is None:
        return pl.lit(None)
    if kind == pl.Boolean and column != "cut":
        return pl.when(pl.col(column)).then(pl.lit("yes")).when(~pl.col(column)).then(pl.lit("no"))
    return pl.col(column)


def _group_of(chosen: View, rows: Mapping[str, pl.DataFrame], values: Sequence[Value], *, ids: bool) -> pl.DataFrame:
    """Rows of a view that have the same values of its `rows`, from those of its topics, by quantity."""
    keys = [name for name in (*chosen.keys, *chosen.packed) if name not in values[0].labels]
    on = [f"key {key}" for key in keys]
    table: pl.DataFrame | None = None
    for value in values:
        own = rows.get(value.quantity, _NONE)
        wanted = [pl.col(name).eq_missing(pl.lit(label, dtype=RESULTS[name])) for name, label in value.labels.items()]
        if len(chosen.topics) > 1:
            wanted.append(pl.col("topic") == (value.topic or chosen.topic))
        own = own.filter(*wanted) if wanted else own
        taken = {value.column: "value", **{column: _STORED.get(name, name) for name, column in value.carried.items()}}
        taken |= {f"id {value.column}": "id"} if ids else {}
        part = pl.DataFrame([own[key].alias(f"key {key}") for key in keys])
        new = [
            own[name].alias(column) for column, name in taken.items() if table is None or column not in table.columns
        ]
        if table is None:
            table = part.hstack(new)
        elif part.equals(table[on]):
            table = table.hstack(new)
        else:
            table = table.join(part.hstack(new), on=on, how="left", nulls_equal=True, maintain_order="left")
    assert table is not None
    constants = {name: pl.lit(constant) for name, constant in values[0].rows.items()}
    named = {column: pl.col(f"key {key}") for key, column in chosen.keys.items() if key in keys}
    for key, names in chosen.packed.items():
        texts = pl.col(f"key {key}").cast(pl.String).str.splitn(_SEPARATOR, len(names))
        for place, name in enumerate(names):
            text = texts.struct.field(f"field_{place}")
            named[name] = pl.when(text != "").then(text)
    found = {**named, **constants}
    return table.select_seq(
        *(
            (found[name] if name in found else _decoded(name, kind) if name in table.columns else pl.lit(None))
            .cast(kind)
            .alias(name)
            for name, kind in chosen.columns.items()
        ),
        *([_ids_of(chosen, table.columns)] if ids else []),
    )


def _ids_of(chosen: View, columns: Sequence[str]) -> pl.Expr:
    """Ids of the rows of results of all columns of numbers of a view; null for those that these rows do not have."""
    names = dict.fromkeys(value.column for value in chosen.values)
    known = {name: pl.col(f"id {name}") if f"id {name}" in columns else pl.lit(None, dtype=pl.String) for name in names}
    return pl.struct(*(expression.alias(name) for name, expression in known.items())).alias("ids")


def _decoded(column: str, kind: pl.DataType | type[pl.DataType]) -> pl.Expr:
    """A stored column as it is in a view: the other way round than `_encoded`."""
    if column in _STORED:
        return pl.col(column).list.contains(str(Caveat.few_features))
    if kind == pl.Boolean:
        return pl.col(column).cast(pl.String).replace_strict({"yes": True, "no": False}, return_dtype=pl.Boolean)
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
_SORTED = [
    *("dataset", *CONDITION, "aspect", "at_least", "population", "trimming", "weighting", "statistic", "axis", "at"),
    "coordinate",
]


def _curves(keys: Columns, columns: Schema, only: pl.Expr, labels: Constants) -> View:
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
    sort = [name for name in columns if name not in ("n", "n_scenes", "unit", "u", "v", "uv", "cut")]
    return View(Topic.errors, columns, {**_CONDITION, **keys}, values, sort, pl.col("n").is_not_null() & only)


def _changes() -> View:
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
    keys, sort = {**_CONDITION, "trimming": "trimming", "at": "age"}, [*_CONDITION, "trimming", "lag", "age"]
    return View(Topic.errors, schema.CHANGES, keys, [*ages, *lags], sort, pl.col("n").is_not_null())


def _cores() -> View:
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
    only = pl.col("n").is_not_null() | (pl.col("quantity") == "share_beyond_three_cores")
    sort = [name for name in schema.CORES if name in (*_CONDITION, "population", "trimming", "axis", "at")]
    return View(Topic.errors, schema.CORES, keys, values, sort, only)


def _tracks() -> View:
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
    only = (pl.col("quantity") != "survival") | pl.col("n").is_not_null()
    return View(Topic.tracks, schema.LIFETIMES, keys, values, [*_CONDITION, "lifetime"], only)


def _outliers() -> View:
    names = ("mean", "median", "lower_quartile", "upper_quartile", "lower_whisker", "upper_whisker")
    values = [
        Value("frames", "n_frames", carried={"n_scenes": "n_scenes"}),
        Value("features_offered", "offered"),
        Value("features_rejected", "outliers"),
        Value("outlier_ratio", "pooled_ratio", {"aspect": Aspect.all}),
        *(Value("outlier_ratio_of_frames", name, {"part": name}) for name in names),
    ]
    return View(Topic.outliers, schema.OUTLIERS, _CONDITION, values, list(_CONDITION))


def _intervals() -> View:
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
    return View(Topic.errors, INTERVALS, keys, values, _SORTED, pl.col("n_units").is_not_null())


def _floor() -> View:
    values = [
        Value("truth_floor", f"floor_{2 * name if len(name) == 1 else name}", {"coordinate": name}, carried=_COUNTED)
        for name in ("u", "uv", "v")
    ]
    values += [Value("truth_floor_of_mean", f"mean_{name}_px", {"coordinate": name}) for name in "uv"]
    keys = {**_CONDITION, "part": "source", **_same("axis", "at")}
    return View(Topic.truth_floor, schema.FLOOR, keys, values, [*_CONDITION, "source", "axis", "at"])


def _bias() -> View:
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
    return View(Topic.bias, findings_schema.ZERO_MEAN, keys, values, [*_CONDITION, "trimming", "axis", "at"])


def _shape() -> View:
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
    sort = [*_CONDITION, "trimming", "age_low", "age_high"]
    return View(Topic.shape, findings_schema.GAUSSIANITY, keys, values, sort)


def _radii() -> View:
    values = [Value("radius", name, {"part": name}) for name in ("expected", "observed")]
    keys = {**_CONDITION, "trimming": "trimming", "at_low": "age_low", "at_high": "age_high", "part_low": "probability"}
    sort = [*_CONDITION, "trimming", "age_low", "age_high", "probability"]
    return View(Topic.radii, findings_schema.RADII, keys, values, sort)


def _growth() -> View:
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
    return View(Topic.growth, findings_schema.TIME_STRUCTURE, keys, values, [*_CONDITION, "trimming", "coordinate"])


_LEVELS = _same("level_a", "level_b")


def _factors() -> View:
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
    return View(Topic.factors, findings_schema.DEPENDENCE, keys, values, [])


def _largest_differences() -> View:
    carried = _LEVELS | _same("unit", "verdict", "why")
    counts = ("n_levels", "n_pairs", "n_shared")
    values = [
        Value("largest_difference", "effect", carried=carried),
        *(Value("largest_difference_part", name, {"part": name}) for name in ("difference", "common", "margin")),
        Value("largest_difference_part", "share_of_absolute", {"part": "share_of_absolute"}),
        *(Value("effect_count", name, {"part": name}) for name in counts),
    ]
    keys = {**_CONDITION, **_same("factor", "axis", "coordinate", "at"), "of": "statistic"}
    return View(Topic.largest_differences, schema.EFFECTS, keys, values, [])


def _by_quantity(names: Mapping[str, tuple[str, Constants]], carried: Columns, **labels: str | None) -> list[Value]:
    """Values of a table with the columns quantity and value: quantities of results and their labels, by `names`."""
    return [
        Value(quantity, "value", {**labels, **own}, {"quantity": name}, carried)
        for name, (quantity, own) in names.items()
    ]


def _windows() -> View:
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
    sort = [*_CONDITION, "trimming", "window", "quantity"]
    return View(Topic.windows, findings_schema.WINDOW_SIGMAS, keys, values, sort)


def _lookup() -> View:
    gain = _ESTIMATED | {"n": "n", "verdict": "established", "why": "why"}
    values = [
        Value("noise_gain", "gain_nats", carried=gain),
        *(
            Value("noise_spread", f"factor{table}", {"at_low": place}, carried=_bounds_of(f"factor{table}"))
            for place, table in enumerate(("", "_against"))
        ),
    ]
    keys = {"dataset": "dataset", "of": "product", "part": "lookup", "against": "against"}
    return View(Topic.lookup, findings_schema.NOISE_LOOKUP, keys, values, [])


def _depths() -> View:
    names: dict[str, tuple[str, Constants]] = {
        **{f"coverage_{level}": ("depth_coverage", {"of": f"{level} %"}) for level in (50, 90, 95, 99)},
        "overconfidence": ("depth_overconfidence", {}),
        "error_ratio": ("depth_error_ratio", {}),
        "depth_error": ("depth_error", {}),
    }
    values = _by_quantity(names, _WITH_N, axis="window", of=None)
    keys = {**_CONDITION, "trimming": "trimming", "at": "window", "part": "covariance", "part_low": "sigma_px"}
    sort = [*_CONDITION, "trimming", "window", "covariance", "quantity"]
    return View(Topic.depths, findings_schema.DEPTH_INTERVALS, keys, values, sort)


def _own_covariances() -> View:
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
    sort = [*_CONDITION, "covariance", "trimming", "quantity", "axis", "at"]
    return View(Topic.own_covariances, findings_schema.OWN_COVARIANCES, keys, values, sort)


def _advice() -> View:
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
    sort = [*_CONDITION, "estimator", "window", "quantity"]
    keys = {**_CONDITION, "at": "window"}
    return View(Topic.advice, findings_schema.ADVICE, keys, values, sort, packed=packed)


def _second_truth() -> View:
    values = [
        Value(f"truth_difference_{statistic}", "value", {}, {"statistic": statistic}, _WITH_N)
        for statistic in ("mean", "second")
    ]
    keys = {**_CONDITION, **_same("trimming", "coordinate"), "part": "quantity", "at": "age"}
    sort = [*_CONDITION, "quantity", "trimming", "age", "statistic", "coordinate"]
    return View(Topic.second_truth, findings_schema.TWO_TRUTHS, keys, values, sort)


def _one(
    topic: Topic, columns: Schema, quantity: str, value: str, keys: Columns, carried: Columns, sort: Sequence[str]
) -> View:
    """A table with one number in each row."""
    return View(topic, columns, keys, [Value(quantity, value, carried=carried)], sort)


_VIEW = _same(*schema.VIEW)
_CLASS = {"part_low": "class_low", "part_high": "class_high"}


def _shared_motion() -> View:
    values = [
        Value("shared_motion", "share", carried=_WITH_N),
        Value("shared_motion_moment", "second_px2", {"against": "measured"}),
        Value("shared_motion_moment", "left_px2", {"against": "left"}),
    ]
    keys = {**_CONDITION, "part": "fitted_to", "at": "age", "coordinate": "coordinate"}
    sort = [*_CONDITION, "fitted_to", "age", "coordinate"]
    return View(Topic.shared_motion, findings_schema.RIGID_SHARE, keys, values, sort)


def _image() -> View:
    made = _same("level", "resampled", "n_units", "n_scenes") | {"interval": "kind"}
    values = [
        Value("image_spread", "spread_px", carried=made | {"n": "n", "verdict": "differs"}),
        *(
            Value("image_mean", f"mean_{name}_px", {"coordinate": name}, carried=made | _bounds_of(f"mean_{name}"))
            for name in "uv"
        ),
    ]
    keys = {**_CONDITION, **_same("axis", "at")}
    sort = [*_CONDITION, "axis", "at", "row", "column"]
    return View(Topic.image, findings_schema.IMAGE_CELLS, keys, values, sort, packed={"part": ("row", "column")})


def _seeds() -> View:
    values = [
        Value("seed_spread", "standard_deviation", carried=_same("unit") | {"verdict": "widens_interval"}),
        Value("seed_mean", "mean", carried=_same("unit")),
        Value("seeds", "n_seeds"),
    ]
    keys = {**_CONDITION, **_same("population", "trimming", "weighting", "axis", "at", "coordinate"), "of": "statistic"}
    sort = [name for name in findings_schema.SEED_SPREAD if name in keys.values()]
    return View(Topic.seeds, findings_schema.SEED_SPREAD, keys, values, sort)


_OF_SURROUNDINGS = {**_CONDITION, **_CLASS, **_same("axis", "at", "coordinate"), "of": "statistic"}
VIEWS: Mapping[str, View] = {
    "curves": _curves(
        _same("population", "trimming", "weighting", "at"),
        schema.CURVES,
        pl.col("aspect") == Aspect.all,
        {"aspect": Aspect.all},
    ),
    "cores": _cores(),
    "floor": _floor(),
    "lifetimes": _tracks(),
    "outliers": _outliers(),
    "effects": _largest_differences(),
    "aspect_curves": _curves(
        _same(*_POINT), schema.ASPECT_CURVES, ~pl.col("aspect").is_in([Aspect.all, Aspect.change]), {}
    ),
    "changes": _changes(),
    "intervals": _intervals(),
    "seed_spread": _seeds(),
    "triangulated_noise": _one(
        Topic.fitted_noise,
        findings_schema.TRIANGULATED_NOISE,
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
        [*_CONDITION, "measure", "trimming", "length_low", "coordinate"],
    ),
    "window_sigmas": _windows(),
    "advice": _advice(),
    "noise_lookup": _lookup(),
    "depth_intervals": _depths(),
    "own_covariances": _own_covariances(),
    "point_tracking_metrics": _one(
        Topic.point_tracking,
        findings_schema.POINT_TRACKING_METRICS,
        "point_tracking",
        "value",
        {**_CONDITION, "part": "raster", "of": "metric"},
        _ESTIMATED,
        [*_CONDITION, "raster", "metric"],
    ),
    "two_truths": _second_truth(),
    "pose_disagreement": _one(
        Topic.pose_disagreement,
        findings_schema.POSE_DISAGREEMENT,
        "pose_disagreement",
        "value",
        {"dataset": "dataset", **_VIEW, "at": "lag", "of": "quantity"},
        _WITH_N | {"unit": "unit"},
        ["dataset", *_VIEW, "lag", "quantity"],
    ),
    "incidence": _one(
        Topic.causes,
        findings_schema.INCIDENCE,
        "incidence",
        "incidence",
        {**_CONDITION, "part": "cause", "at": "lifetime"},
        _ESTIMATED,
        [*_CONDITION, "cause", "lifetime"],
    ),
    "zero_mean": _bias(),
    "gaussianity": _shape(),
    "radii": _radii(),
    "time_structure": _growth(),
    "dependence": _factors(),
    "ranks": View(
        Topic.ranks,
        findings_schema.RANKS,
        {**_CONDITION, "axis": "axis", "of": "statistic"},
        [
            *(
                Value("rank", name, {"part": name}, carried=_same("n_scenes", "level", "why"))
                for name in ("best", "worst")
            ),
            Value("rank_count", "n_trackers"),
        ],
        [],
    ),
    "surrounding_errors": View(
        Topic.surroundings,
        findings_schema.SURROUNDING_ERRORS,
        _OF_SURROUNDINGS,
        [Value("surrounding", "value", carried=_WITH_N | {"unit": "unit"})],
        [],
        packed={"part": ("surrounding", "class")},
    ),
    "image_cells": _image(),
    "speed_errors": _one(
        Topic.image_speeds,
        findings_schema.SPEED_ERRORS,
        "image_speed_mean",
        "mean_px",
        {**_CONDITION, **_CLASS, **_same("axis", "at", "coordinate")},
        _WITH_N,
        [*_CONDITION, "axis", "at", "class_low", "class_high", "coordinate"],
    ),
    "ratios": View(
        Topic.ratios,
        findings_schema.RATIO_VALUES,
        {**_CONDITION, **_same("trimming", "axis", "at")},
        [Value(name, "value", {}, {"quantity": name}, _WITH_N) for name in RATIOS],
        [*_CONDITION, "quantity", "trimming", "axis", "at"],
    ),
    "rigid_share": _shared_motion(),
    "pose_share": _one(
        Topic.pose_share,
        findings_schema.POSE_SHARE,
        "pose_share",
        "share",
        {**_CONDITION, "part": "fitted_to"},
        _WITH_N,
        [*_CONDITION, "fitted_to"],
    ),
    "pose_law": _one(
        Topic.pose_errors,
        findings_schema.POSE_LAW,
        "pose_error",
        "value",
        {"dataset": "dataset", **_VIEW, "part": "motion", "of": "law"},
        _WITH_N | {"unit": "unit"},
        [],
    ),
    "tracker_differences": _one(
        Topic.tracker_differences,
        findings_schema.TRACKER_DIFFERENCES,
        "tracker_difference",
        "value",
        {**_CONDITION, "against": "other", "of": "statistic", "at": "age", "coordinate": "coordinate"},
        _WITH_N | {"unit": "unit", "verdict": "established"},
        [*_CONDITION, "other", "statistic", "age", "coordinate"],
    ),
}
"""Every view by its name."""
_SHARED = frozenset[Topic]().union(*(chosen.topics for chosen in VIEWS.values() if len(chosen.topics) > 1))
_TOGETHER: tuple[frozenset[Topic], ...] = (_SHARED, frozenset(Topic) - _SHARED)
"""Topics whose views have rows in common, and all others: the rows of these are made at once."""
