"""How much of the second moment small errors of the stated poses explain, by age."""

from collections.abc import Mapping, Sequence

import polars as pl

from tracknoise.findings.wording import number, percent
from tracknoise.report import bands
from tracknoise.report.figures.age_panels import panels, side_by_side
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.figures.layout import arranged
from tracknoise.report.figures.message import values
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.tables.enumerations import FittedTo

_NAME, _TITLE = "pose-errors", "Share of the second moment that pose errors explain"
_SOURCES: Mapping[str, str] = {FittedTo.own: "fitted to this tracker", FittedTo.others: "fitted to other trackers"}
"""What the axes say, by what pose errors were fitted to."""


def figures(data: ReportData) -> Sequence[Figure | Absence]:
    """One figure: all trackers at the lowest speed."""
    table = data.nominal(data.rigid_share).filter(pl.col("n") >= data.min_features)
    points = side_by_side(table, "share", ["tracker", "fitted_to"])
    if points.is_empty():
        why = f"No age has {data.min_features} features with a known depth and a visible true position."
        return [Absence(_NAME, _TITLE, why)]
    rows = [
        panel
        for place, (source, heading) in enumerate(_SOURCES.items())
        if not (of := points.filter(fitted_to=source)).is_empty()
        for panel in panels(of, "tracker", data.colour, heading, titled=place == 0)
    ]
    shows = (
        f"Share of the second moment about zero at speed {data.slowest}{data.where} that one small error of each "
        "stated pose explains, by age. The pose errors are fitted to tracks other than those whose errors they "
        "predict: to the other half of the tracks of the same tracker (top), and to all other trackers that saw "
        f"images (bottom). {bands.describe_intervals(points, of='the shares')}"
        f"{' Each block has the tracks of successive frames.' if 'blocks' in points['resampled'] else ''}"
    )
    spec = arranged(rows, columns=2, independent=["fill"])
    return [Figure(_NAME, _TITLE, shows, _look_for(data, table), spec, _message(data, table))]


def _message(data: ReportData, table: pl.DataFrame) -> str:
    """Share that pose errors explain, at the last age up to the reference age, where its interval is above zero."""
    young = table.filter(pl.col("age") <= REFERENCE_AGE, coordinate="both", fitted_to=FittedTo.own)
    last = young.filter(pl.col("age") == pl.col("age").max().over("tracker"))
    shares = dict(last.filter(pl.col("low") > 0).select("tracker", "share").iter_rows())
    found = {name: percent(shares[name]) for name in data.trackers if name in shares}
    return values(found, "Share that pose errors explain")


def _look_for(data: ReportData, table: pl.DataFrame) -> str:
    numbers = [_numbers(table.filter(tracker=tracker), tracker) for tracker in data.trackers]
    sentences = [sentence for sentence in numbers if sentence]
    alone = "" if "others" in table["fitted_to"] else " With one tracker only, such a motion may be its own."
    return (
        f"{' '.join(sentences)} A share near 0 means that features do not move together. A share near 1 means that the "
        "error is a motion of the camera which the stated poses do not have. If other trackers predict it too, the "
        f"truth is probably at fault: its poses, its clock, its calibration, or a rolling shutter.{alone}"
    )


def _numbers(table: pl.DataFrame, tracker: str) -> str:
    """Shares of both coordinates at the last age up to the reference age."""
    rows = table.filter(pl.col("age") <= REFERENCE_AGE, coordinate="both").sort("age")
    if rows.is_empty():
        return ""
    age = rows["age"].max()
    shares = {row["fitted_to"]: percent(row["share"]) for row in rows.filter(age=age).to_dicts()}
    own = f"For {tracker}, pose errors explain {shares.get('own', 'an unknown share')} at age {number(age)}."  # type: ignore[arg-type]
    return own if "others" not in shares else f"{own} Those fitted to other trackers explain {shares['others']}."
