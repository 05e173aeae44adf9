"""What departs from the paper, and what that changes in runs whose tables are known."""

import re
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

from tracknoise.paper.departures import START, Departure, Part, departures, markdown, texts
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.lifetimes import mean_lifetime
from tracknoise.tables.store import RunFolder
from tracknoise.words import number, pixels

PAGE = Path(__file__).resolve().parents[2] / "docs" / "paper.md"


@pytest.fixture(scope="module")
def part(make_run: Callable[..., RunFolder]) -> Part:
    data = ReportData.of(make_run(hidden=0.2))
    return Part("made up", data, data)


@pytest.fixture(scope="module")
def found(part: Part) -> dict[str, Departure]:
    return {item.id: item for item in departures([part])}


def test_the_documentation_is_made_from_the_texts() -> None:
    found = PAGE.read_text(encoding="utf-8").partition(START)[2]
    assert found == markdown(), "python -m tracknoise.paper.departures docs/paper.md"
    assert re.findall(r"^\*\*(.*?)\.\*\*", found, flags=re.MULTILINE) == [item["title"] for item in texts().values()]


def test_links_of_the_documentation_lead_to_headings_of_its_pages() -> None:
    for item in texts().values():
        name, _, anchor = item.get("see", "statistics.md").partition("#")
        headings = re.findall(r"^#+ (.*)$", (PAGE.parent / name).read_text(encoding="utf-8"), flags=re.MULTILINE)
        assert not anchor or anchor in {heading.lower().replace(" ", "-") for heading in headings}


def test_every_departure_says_what_differs(found: dict[str, Departure]) -> None:
    assert list(found) == list(texts())
    assert all(item.title and text.endswith(".") for item in found.values() for text in item.paragraphs)


@pytest.mark.parametrize("name", ["occlusion", "trimming", "weighting", "covariance", "lifetimes", "rejection"])
def test_tables_have_a_row_for_each_experiment_and_tracker(found: dict[str, Departure], name: str) -> None:
    cells = found[name].measured
    assert cells is not None
    assert [row[:2] for row in cells.rows] == [["made up", "lucas-kanade"], ["made up", "correspondence"]]
    assert all(len(row) == len(cells.headings) == len(cells.numeric) for row in cells.rows)
    assert not cells.groups or sum(span for _, span in cells.groups) == len(cells.headings)
    assert name in ("trimming", "lifetimes") or {"trimmed", "untrimmed"} == {
        title.rpartition(", ")[2] for title, _ in cells.groups if title
    }


def test_what_the_tables_do_not_tell_has_no_numbers(found: dict[str, Departure]) -> None:
    assert found["simulation"].measured is None
    (first,) = departures([])[:1]
    assert first.measured is not None
    assert first.measured.rows == []


def test_the_covariance_differs_from_the_second_moment_by_the_squared_bias(part: Part) -> None:
    (row, _) = {item.id: item for item in departures([part])}["covariance"].measured.rows  # type: ignore[union-attr]
    curves = part.data.nominal(part.data["curves"]).filter(
        tracker="lucas-kanade", population="visible", trimming="trimmed", weighting="features", cut=False
    )
    known = curves.filter(pl.col("at") > 0).sort("at")
    bias, central = (known.filter(statistic=name)["u"].to_numpy() for name in ("nu", "central"))
    n = known.filter(statistic="nu")["n"].to_numpy()
    assert row[2] == f"{max(bias**2 - central / n):.4f} px²"  # the drift is along u; n - 1 of n in the covariance


def test_trimming_and_hidden_features_make_a_difference_here(found: dict[str, Departure]) -> None:
    for name in ("trimming", "occlusion"):
        cells = found[name].measured
        assert cells is not None
        assert all(not text.startswith("0 ") for row in cells.rows for text in row[2:])


@pytest.mark.parametrize("trimming", ["trimmed", "untrimmed"])
def test_hidden_features_are_compared_with_and_without_trimming(
    part: Part, found: dict[str, Departure], trimming: str
) -> None:
    curves = part.data.nominal(part.data["curves"]).filter(
        pl.col("at") > 0, tracker="lucas-kanade", weighting="features", cut=False, statistic="eta", trimming=trimming
    )
    both = curves.filter(population="visible").join(curves.filter(population="projected"), on="at")
    cells = found["occlusion"].measured
    assert cells is not None
    place = 2 * [title for title, _ in cells.groups].index(f"mean absolute error, {trimming}")
    differences = {axis: (both[axis] - both[f"{axis}_right"]).abs().max() for axis in "uv"}
    assert cells.rows[0][place] in {f"{number(difference)} px" for difference in differences.values()}


def test_lifetimes_are_those_of_the_statistics(part: Part, found: dict[str, Departure]) -> None:
    table = mean_lifetime(part.data.nominal(part.data["lifetimes"])).filter(tracker="lucas-kanade")
    cells = found["lifetimes"].measured
    assert cells is not None
    means = [number(table[name][0]) for name in ("mean_lifetime", "restricted_mean_lifetime")]
    assert cells.rows[0][2:4] == means


def test_without_variants_there_is_no_table_of_them(part: Part) -> None:
    alone = {item.id: item for item in departures([Part("alone", part.data)])}
    assert alone["rejection"].measured is None


def test_ways_to_reject_outliers_are_compared_at_the_last_age_that_all_have(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(loss=0.35, trackers=("lasting", "fleeting"), hidden=0.0))
    points = data.nominal(data.points).filter(role="second", trimming="trimmed", population=data.population)
    last = points.group_by("tracker").agg(pl.col("since").max())["since"].sort()
    assert 0 < last[0] < min(10, last[1]), "their own last ages differ"
    (cells,) = [item.measured for item in departures([Part("made up", data, data)]) if item.id == "rejection"]
    assert cells is not None
    assert [row[4] for row in cells.rows] == [f"at\N{NO-BREAK SPACE}age\N{NO-BREAK SPACE}{last[0]}"] * 2
    for row, tracker in zip(cells.rows, ("lasting", "fleeting"), strict=True):
        (point,) = points.filter(tracker=tracker, since=last[0]).to_dicts()
        assert list(row[5:7]) == [pixels(point["u"]), pixels(point["v"])]


def test_one_scene_has_no_weight_to_be_compared(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(scenes=("only",), born=40))
    found = {item.id: item.measured for item in departures([Part("alone", data)])}
    assert found["weighting"] is not None
    assert all(list(row[2:]) == ["–", "one scene"] * 6 for row in found["weighting"].rows)
    assert found["trimming"] is not None
    assert "one scene" not in {text for row in found["trimming"].rows for text in row}


def test_curves_that_cannot_be_compared_are_dashes(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(min_features=10**6))
    cells = departures([Part("cut", data)])[0].measured
    assert cells is not None
    assert set(cells.rows[0][2:]) == {"–"}
