"""What the truth explains of errors, by age: poses, corrections, two truths, and differences between trackers.

- Differences between two trackers at the same corners, by age: their mean and their spread.
- How much of the second moment small errors of the stated poses explain, by age.
- Two truths of the same images: how far they disagree, beside the errors of trackers by each of them.
- Errors by age as measured, and after the corrections that the audit of the truth proposes.
"""

from collections.abc import Mapping, Sequence

import altair as alt
import polars as pl

from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Figure, Sections
from tracknoise.report.figures.messages import values
from tracknoise.report.figures.panels import Panel, arranged, layered, panels, side_by_side
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.tables.enumerations import FittedTo, TruthQuantity
from tracknoise.tables.truth_audit import EVERYTHING, MEASURED
from tracknoise.topics import bands
from tracknoise.topics.bands import describe_intervals
from tracknoise.words import DASH, SPACE, number, percent, pixels, px

_TRACKER_DIFFERENCE_NAME, _TRACKER_DIFFERENCE_TITLE = (
    "between-trackers",
    "Differences between trackers at the same corners",
)
_ROWS = {"mean": "mean difference (px)", "central": "standard deviation (px)"}
"""Statistics in the rows of the figure, and what their axes say."""
_MOST_PAIRS = 7


def tracker_difference_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: every two trackers at the lowest speed."""
    table = data.nominal(data["tracker_differences"]).filter(pl.col("n") >= data.min_features)
    pair = pl.format("{} " + DASH + " {}", "tracker", "other")
    table = table.with_columns(pl.col("value", "low", "high").pipe(_root), pair=pair)
    pairs = table["pair"].unique(maintain_order=True).to_list()[:_MOST_PAIRS]
    shown = table.filter(pl.col("pair").is_in(pairs))
    points = side_by_side(shown, "value", ["pair", "statistic"])
    if points.is_empty():
        why = f"No two trackers followed the same {data.min_features} corners to any age."
        return [Absence(_TRACKER_DIFFERENCE_NAME, _TRACKER_DIFFERENCE_TITLE, why)]
    colours = dict(zip(pairs, style.colours(pairs), strict=True))
    rows = [
        panel
        for statistic, heading in _ROWS.items()
        for panel in panels(points.filter(statistic=statistic), "pair", colours, heading, titled=statistic == "mean")
    ]
    spec = arranged(rows, columns=2, independent=["fill"])
    return [
        Figure(
            _TRACKER_DIFFERENCE_NAME,
            _TRACKER_DIFFERENCE_TITLE,
            _shows(data, points),
            _look_for_tracker_difference(points),
            spec,
            _tracker_difference_message(shown),
        )
    ]


def _tracker_difference_message(table: pl.DataFrame) -> str:
    """The mean difference of the first pair that differs at the last age up to the reference age.

    It is established with an interval that allows for all ages and both coordinates.
    """
    means = table.filter(pl.col("age") <= REFERENCE_AGE, statistic="mean")
    last = means.filter(pl.col("age") == pl.col("age").max().over("pair"))
    for row in last.filter("established").to_dicts():
        return f"{row['pair']}: mean difference in {row['coordinate']} of {px(row['value'])}"
    return ""


def _root(value: pl.Expr) -> pl.Expr:
    """Standard deviations in place of variances."""
    return pl.when(pl.col("statistic") == "central").then(value.clip(lower_bound=0.0).sqrt()).otherwise(value)


def _shows(data: ReportData, points: pl.DataFrame) -> str:
    return (
        f"Difference of the positions of two trackers at speed {data.slowest}{data.where}, where both began a track at "
        "the same corner of the same frame, by age. Top: mean of the first minus the second. Bottom: standard "
        f"deviation. {bands.describe_intervals(points, of='the curves')}"
    )


def _look_for_tracker_difference(points: pl.DataFrame) -> str:
    sentences = " ".join(
        _tracker_difference_numbers(pair, part) for (pair,), part in points.group_by("pair", maintain_order=True)
    )
    return (
        f"{sentences} An error of poses, depth, calibration or clock is in neither. A mean that differs from zero is "
        "therefore a bias of one of the two trackers. What both have in common is not in the difference."
    )


def _tracker_difference_numbers(pair: object, points: pl.DataFrame) -> str:
    """Mean and standard deviation at the last age up to the reference age."""
    young = points.filter(pl.col("at") <= REFERENCE_AGE)
    at = young["at"].max() if young.height else points["at"].min()
    mean, spread = (points.filter(statistic=name, at=at).row(0, named=True) for name in _ROWS)
    return (
        f"For {pair} at age {number(at)}, the mean is {px(mean['u'])} in u and {px(mean['v'])} in v. "  # type: ignore[arg-type]
        f"The standard deviation is {px(spread['u'])} in u and {px(spread['v'])} in v."
    )


_POSE_ERROR_NAME, _POSE_ERROR_TITLE = "pose-errors", "Share of the second moment that pose errors explain"
_SOURCES: Mapping[str, str] = {FittedTo.own: "fitted to this tracker", FittedTo.others: "fitted to other trackers"}
"""What the axes say, by what pose errors were fitted to."""


def pose_error_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: all trackers at the lowest speed."""
    table = data.nominal(data["rigid_share"]).filter(pl.col("n") >= data.min_features)
    points = side_by_side(table, "share", ["tracker", "fitted_to"])
    if points.is_empty():
        why = f"No age has {data.min_features} features with a known depth and a visible true position."
        return [Absence(_POSE_ERROR_NAME, _POSE_ERROR_TITLE, why)]
    rows = [
        panel
        for place, (source, heading) in enumerate(_SOURCES.items())
        if not (source_points := points.filter(fitted_to=source)).is_empty()
        for panel in panels(source_points, "tracker", data.colour, heading, titled=place == 0)
    ]
    shows = (
        f"Share of the second moment about zero at speed {data.slowest}{data.where} that one small error of each "
        "stated pose explains, by age. The pose errors are fitted to tracks other than those whose errors they "
        "predict: to the other half of the tracks of the same tracker (top), and to all other trackers that saw "
        f"images (bottom). {bands.describe_intervals(points, of='the shares')}"
        f"{' Each block has the tracks of successive frames.' if 'blocks' in points['resampled'] else ''}"
    )
    spec = arranged(rows, columns=2, independent=["fill"])
    return [
        Figure(
            _POSE_ERROR_NAME,
            _POSE_ERROR_TITLE,
            shows,
            _look_for_pose_errors(data, table),
            spec,
            _pose_error_message(data, table),
        )
    ]


def _pose_error_message(data: ReportData, table: pl.DataFrame) -> str:
    """Share that pose errors explain, at the last age up to the reference age, where its interval is above zero."""
    young = table.filter(pl.col("age") <= REFERENCE_AGE, coordinate="both", fitted_to=FittedTo.own)
    last = young.filter(pl.col("age") == pl.col("age").max().over("tracker"))
    shares = dict(last.filter(pl.col("low") > 0).select("tracker", "share").iter_rows())
    texts = {name: percent(shares[name]) for name in data.trackers if name in shares}
    return values(texts, "Share that pose errors explain")


def _look_for_pose_errors(data: ReportData, table: pl.DataFrame) -> str:
    numbers = [_pose_error_numbers(table.filter(tracker=tracker), tracker) for tracker in data.trackers]
    sentences = [sentence for sentence in numbers if sentence]
    alone = "" if "others" in table["fitted_to"] else " With one tracker only, such a motion may be its own."
    return (
        f"{' '.join(sentences)} A share near 0 means that features do not move together. A share near 1 means that the "
        "error is a motion of the camera which the stated poses do not have. If other trackers predict it too, the "
        f"truth is probably at fault: its poses, its clock, its calibration, or a rolling shutter.{alone}"
    )


def _pose_error_numbers(table: pl.DataFrame, tracker: str) -> str:
    """Shares of both coordinates at the last age up to the reference age."""
    rows = table.filter(pl.col("age") <= REFERENCE_AGE, coordinate="both").sort("age")
    if rows.is_empty():
        return ""
    age = rows["age"].max()
    shares = {row["fitted_to"]: percent(row["share"]) for row in rows.filter(age=age).to_dicts()}
    sentence = f"For {tracker}, pose errors explain {shares.get('own', 'an unknown share')} at age {number(age)}."  # type: ignore[arg-type]
    return (
        sentence if "others" not in shares else f"{sentence} Those fitted to other trackers explain {shares['others']}."
    )


_TWO_TRUTH_NAMES = {
    TruthQuantity.disagreement.value: "disagreement of the truths",
    TruthQuantity.first.value: "error by the first truth",
    TruthQuantity.second.value: "error by the second truth",
}
_COLOURS = dict(zip(_TWO_TRUTH_NAMES.values(), style.colours([*_TWO_TRUTH_NAMES]), strict=True))
_LAG = alt.X("at:Q", title="frames between the two poses", axis=alt.Axis(tickMinStep=1))
_POSES = {"rotation": "rotation per axis (degrees)", "translation": "translation per axis (metres)"}


def two_truth_figures(data: ReportData) -> Sequence[Figure]:
    """One figure per tracker at the lowest speed, and one of the poses. None without a second truth."""
    table = data.nominal(data["two_truths"]).filter(trimming=data.trimming, statistic="second")
    present = [tracker for tracker in data.trackers if tracker in table["tracker"]]
    figures = [_two_truths_of_tracker(data, tracker, table.filter(tracker=tracker)) for tracker in present]
    poses = data.reference(data["pose_disagreement"])
    return figures if poses.is_empty() else [*figures, _of_poses(data, poses)]


def _two_truths_of_tracker(data: ReportData, tracker: str, table: pl.DataFrame) -> Figure:
    points = _points(
        table.filter(pl.col("coordinate").is_in(["u", "v"])).with_columns(
            pl.col("value", "low", "high").sqrt(),
            series=pl.col("quantity").cast(pl.String).replace_strict(_TWO_TRUTH_NAMES),
            at=pl.col("age"),
        ),
        least=data.min_features,
    )
    ages = marks.along(points["at"], title="age (frames)", from_zero=True)
    panels = [_two_truth_panel(points.filter(coordinate=axis), f"RMS in {axis} (px)", ages) for axis in "uv"]
    return Figure(
        id=f"two-truths-{data.slug(tracker)}",
        title=f"{tracker}, by two truths",
        shows=f"RMS by age at speed {data.slowest}{data.where}, of observations that both "
        "truths know. The disagreement is the distance between the true positions by the two truths. It does not "
        f"depend on the errors of the tracker. {describe_intervals(points, of='the curves', n_scenes='n_scenes')}",
        look_for=_two_truth_sentence(tracker, points),
        spec=arranged(panels, columns=2, independent=["fill"]),
        message=_two_truth_message(tracker, points.filter(coordinate="u")),
    )


def _two_truth_message(tracker: str, points: pl.DataFrame) -> str:
    """The disagreement in u at the largest age beside the error."""
    value = dict(points.filter(at=points["at"].max()).select("series", "value").iter_rows())
    pair = [value.get(_TWO_TRUTH_NAMES[name]) for name in (TruthQuantity.disagreement, TruthQuantity.first)]
    if None in pair:
        return ""
    return f"The truths differ by {pixels(pair[0])} px in u; the error of {tracker} is {pixels(pair[1])} px"


def _of_poses(data: ReportData, table: pl.DataFrame) -> Figure:
    named = table.with_columns(
        series=pl.lit(_TWO_TRUTH_NAMES[TruthQuantity.disagreement]), at=pl.col("lag"), coordinate=pl.col("quantity")
    )
    points = _points(named, least=1)
    panels = [_two_truth_panel(points.filter(coordinate=name), title, _LAG) for name, title in _POSES.items()]
    first = points.filter(pl.col("at") == points["at"].min())
    value = dict(first.select("coordinate", "value").rows())
    return Figure(
        id="two-truths-poses",
        title="Disagreement of the poses",
        shows="Root mean square difference per axis between the relative poses of the two truths, by the number of "
        f"frames between the two poses{data.where}. {describe_intervals(points, of='the curves', n_scenes='n_scenes')}",
        look_for=f"Over {first['at'].item(0)} frame the relative poses differ by {number(value['rotation'])} degrees "
        f"and {number(1e3 * value['translation'])} mm per axis. Errors that are independent from frame to frame give "
        "a level curve. A random walk grows with the square root of the number of frames.",
        spec=arranged(panels, columns=2, independent=["fill"]),
        message=f"Relative poses of the truths differ by {number(value['rotation'])}{SPACE}° and "
        f"{number(1e3 * value['translation'])}{SPACE}mm per axis",
    )


def _points(table: pl.DataFrame, *, least: int) -> pl.DataFrame:
    """Columns that panels and descriptions need, where there are enough observations."""
    rows = table.filter(pl.col("n") >= least, pl.col("value").is_not_null())
    return rows.sort("coordinate", "series", "at")


def _two_truth_panel(points: pl.DataFrame, title: str, x: alt.X) -> Panel:
    table = points.rename({"low": "value_low", "high": "value_high"})
    y = alt.Y("value:Q", title=title, scale=alt.Scale(domain=marks.holding(table["value"], table["value_high"])))
    hue, opacity = marks.colour("series", _COLOURS, "truth"), marks.opacity("series")
    tips = [
        alt.Tooltip("series:N", title="of"),
        alt.Tooltip("at:Q", title="frames"),
        alt.Tooltip("value:Q", format=".3g"),
        alt.Tooltip("n:Q"),
    ]
    line = alt.Chart(marks.rows(table.select("series", "at", "value", "n"))).mark_line(clip=True)
    line = line.encode(x=x, y=y, tooltip=tips, color=hue, opacity=opacity)
    band = marks.band(table, "series", _COLOURS, "value", x, y)
    chart = layered(*band, line).properties(width=385, height=240)
    return Panel(chart, (marks.shown("series", _COLOURS),), layer=len(band))


def _two_truth_sentence(tracker: str, points: pl.DataFrame) -> str:
    """At the largest age: the disagreement in u beside the error."""
    horizontal = points.filter(coordinate="u")
    last = horizontal.filter(at=horizontal["at"].max())
    value = dict(last.select("series", "value").rows())
    disagreement, error = (
        pixels(value[_TWO_TRUTH_NAMES[name]]) for name in (TruthQuantity.disagreement, TruthQuantity.first)
    )
    return (
        f"At age {last['at'].item(0)} the two truths differ by {disagreement} px in u, where the error of {tracker} by "
        f"the first truth is {error} px. Errors of a tracker that are smaller than the disagreement cannot be measured "
        "with these truths. The disagreement contains only errors that the two truths do not share."
    )


_AUDIT_CURVE_NAMES = {MEASURED: "as measured", EVERYTHING: "all corrections"}
_VALUES = {
    "mean_u_px": "mean error in u (px)",
    "mean_v_px": "mean error in v (px)",
    "core_u_px": "core in u (px)",
    "core_v_px": "core in v (px)",
}
_SIZE = {"width": 395, "height": 165}


def audit_curve_figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure per tracker that took part in the audit, where it found a fault."""
    curves = data.audit.audit_curves
    if not set(curves["correction"].unique()) - {MEASURED}:
        why = "The audit found no fault of the truth that could be corrected." if curves.height else _not_audited(data)
        return [Absence("audit", "Errors before and after corrections", why)]
    present = [tracker for tracker in data.trackers if tracker in curves["tracker"]]
    return [_audit_curves_of_tracker(data, tracker, curves.filter(tracker=tracker)) for tracker in present]


def _not_audited(data: ReportData) -> str:
    texts = data.audit.audit["text"].to_list()
    return texts[0] if texts else "The truth of this run was not audited."


def _audit_curves_of_tracker(data: ReportData, tracker: str, curves: pl.DataFrame) -> Figure:
    names = {
        name: _AUDIT_CURVE_NAMES.get(name, f"+ {name.replace('_', ' ')}")
        for name in curves["correction"].unique(maintain_order=True)
    }
    named = curves.with_columns(series=pl.col("correction").replace_strict(names), at=pl.col("age").cast(pl.Int64))
    colours = dict(zip(names.values(), style.colours([*names.values()]), strict=True))
    panels = [_audit_curve_panel(named, value, title, colours) for value, title in _VALUES.items()]
    return Figure(
        id=f"audit-{data.slug(tracker)}",
        title=f"{tracker}, before and after corrections of the truth",
        shows="Mean error and core by age of the observations that the audit used. Each correction is shown together "
        "with those above it in the legend.",
        look_for=_audit_curve_sentence(named),
        spec=arranged(panels, columns=2, independent=["fill"]),
        message=_audit_curve_message(tracker, named),
    )


def _audit_curve_message(tracker: str, curves: pl.DataFrame) -> str:
    """How the corrections change the core of the tracker in u at the largest age."""
    last = curves.filter(at=curves["at"].max())
    before, after = (last.filter(correction=name)["core_u_px"].item() for name in (MEASURED, EVERYTHING))
    if before is None or after is None or pixels(before) == pixels(after):
        return ""
    return f"Corrections change the core of {tracker} in u from {pixels(before)} to {pixels(after)} px"


def _audit_curve_panel(curves: pl.DataFrame, value: str, title: str, colours: dict[str, str]) -> Panel:
    rows = curves.drop_nulls(value)
    x = marks.along(rows["at"], title="age (frames)", from_zero=True)
    y = alt.Y(f"{value}:Q", title=title, scale=alt.Scale(domain=marks.holding(rows[value], rows[value]), nice=False))
    tips = [alt.Tooltip("series:N", title="errors"), alt.Tooltip("at:Q"), alt.Tooltip(f"{value}:Q", format=".3g")]
    hue, opacity = marks.colour("series", colours, "errors"), marks.opacity("series")
    line = alt.Chart(marks.rows(rows.select("series", "at", value))).mark_line(clip=True)
    drawn = line.encode(x=x, y=y, color=hue, opacity=opacity, tooltip=tips)
    return Panel(layered(drawn).properties(**_SIZE), (marks.shown("series", colours),), layer=0)


def _audit_curve_sentence(curves: pl.DataFrame) -> str:
    """Mean errors at the largest age, before and after."""
    last = curves.filter(at=curves["at"].max())
    before, after = (last.filter(correction=name).row(0, named=True) for name in (MEASURED, EVERYTHING))
    changes = (f"{pixels(before[name])} to {pixels(after[name])} px" for name in ("mean_u_px", "mean_v_px"))
    return f"At age {last['at'][0]} the corrections change the mean error from {' in u, and from '.join(changes)} in v."


FIGURES: Sections = {
    "truth-audit": (audit_curve_figures, two_truth_figures),
    "pose-errors": (pose_error_figures,),
    "between-trackers": (tracker_difference_figures,),
}
"""What this module draws, by the section of the report."""
