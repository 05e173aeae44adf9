"""The sentence about depth edges: what it states, and when nothing is stated."""

import polars as pl
import pytest

from tracknoise.analysis.places_found import SURROUNDING_ERRORS
from tracknoise.statistics.yardstick import ReferenceCondition
from tracknoise.tables.findings_schema import SUMMARY
from tracknoise.tables.schema import empty
from tracknoise.topics.edge_topic import depth_edges
from tracknoise.topics.headline import ReportedConditions

LABELS = {
    "dataset": "d", "lighting": "l", "rotation": 0, "direction": "forward", "camera": "", "tracker": "lk", "speed": 1,
    "surrounding": "side", "axis": "age", "kind": "student", "level": 0.95, "resampled": "scenes",
}  # fmt: skip
N = {"far": 100, "near": 100, "none": 800}
SCOPE = ReportedConditions(ReferenceCondition("l"), ("lk", "sift"))


def rows(side: str, at: int = 20, coordinate: str = "u", **values: tuple[float, float | None, float | None]):
    for statistic, (value, low, high) in values.items():
        unit = "px" if statistic.startswith("mean") else "share"
        given = {"value": value, "low": low, "high": high, "statistic": statistic, "unit": unit}
        yield {**LABELS, **given, "class": side, "at": at, "coordinate": coordinate, "n": N[side]}


def read(*parts) -> str | None:
    made = pl.DataFrame([row for part in parts for row in part], schema=dict(SURROUNDING_ERRORS), orient="row")
    found = depth_edges({"surrounding_errors": made, "summary": empty(SUMMARY)}, SCOPE)
    return None if found is None else found.text.replace("\N{NO-BREAK SPACE}", " ")


FAR = {"mean": (-3.0, -4.0, -2.0), "share": (0.1, 0.08, 0.12), "mean_without": (0.1, 0.0, 0.2)}
NEAR = {"mean": (1.0, 0.5, 1.5)}
NONE = {"mean": (-0.1, -0.2, 0.0), "second_removed_by_others": (0.7, 0.6, 0.8)}


def test_means_of_both_sides_are_stated_and_whether_most_of_the_mean_is_on_one() -> None:
    text = read(rows("far", share_of_mean=(1.1, 0.8, 1.4), **FAR), rows("near", **NEAR), rows("none", **NONE))
    assert text == (
        "Depth edges at speed 1, in untrimmed errors of visible features. At age 20, the mean error of lk in u "
        "differs beside depth edges. On the far side it is −3.000 px (−4.000 to −2.000). On the near side it is "
        "1.000 px (0.500 to 1.500). Elsewhere it is −0.100 px (−0.200 to 0). Most of the drift comes from features on "
        "the far side of depth edges. These are 10.0 % of the features, and have 110.0 % of the mean error. The mean "
        "of all features is −0.280 px, and without the far side 0.100 px. Without features beside depth edges, the "
        "second moment falls by 70.0 % (60.0 % to 80.0 %). A "
        "feature beside a depth edge has two surfaces in its window."
    )


def test_most_is_said_only_where_the_interval_says_so() -> None:
    text = read(rows("far", share_of_mean=(1.1, 0.4, 1.8), **FAR), rows("none", **NONE))
    assert text is not None
    assert "Most of the drift" not in text
    assert "On the near side" not in text


@pytest.mark.parametrize(
    "far",
    [(-3.0, -7.0, 1.0), (-0.3, -0.4, -0.15), (-3.0, None, None), (0.1, 0.02, 0.2)],
    ids=["zero", "elsewhere", "no interval", "both"],
)
def test_nothing_is_said_where_a_side_does_not_differ_from_zero_and_from_the_others(far) -> None:
    elsewhere = {"mean": (-0.1, -0.2, 0.1)}
    assert read(rows("far", **{**FAR, "mean": far}), rows("none", **elsewhere)) is None
    assert read() is None


def test_the_oldest_age_with_intervals_and_the_coordinate_of_the_largest_mean_are_taken() -> None:
    older = rows("far", at=30, mean=(-9.0, None, None))
    along = (
        rows("far", coordinate="along", mean=(4.0, 3.0, 5.0)),
        rows("none", coordinate="along", mean=(0.5, 0.4, 0.6)),
    )
    text = read(older, rows("far", **FAR), rows("none", **NONE), *along)
    assert text is not None
    assert "At age 20, the mean error of lk along the motion differs beside depth edges." in text
    assert "On the far side it is 4.000 px" in text
