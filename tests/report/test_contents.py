"""The table of contents beside a report says what is in it."""

import json
import re
from pathlib import Path

import pytest

import tracknoise
from tracknoise.exceptions import StoreError
from tracknoise.report.contents import CONTENTS, FORMAT, Section, contents_json, layout, read_contents
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.topics.answer_summary import SUMMARY

FIGURE, ABSENCE = Figure("one", "One", "It shows.", "Look.", {}), Absence("two", "Two", "Nothing was found.")


@pytest.fixture(scope="module")
def report(whole_report: Path) -> Path:
    return whole_report / "report"


def test_sections_figures_tables_and_absences_are_listed() -> None:
    sections = [
        Section("family", "Family", (FIGURE, ABSENCE)),
        Section("summary", "Summary", (), [("counts", "counts", ("csv", "tex"))]),
    ]
    document = json.loads(contents_json("mine", sections, ("svg", "png")))
    assert document.pop("sections") == [
        {
            "id": "family",
            "title": "Family",
            "figures": [{"id": "one", "title": "One", "files": ["figures/one.svg", "figures/one.png"]}],
            "tables": [],
            "absences": [{"id": "two", "title": "Two", "why": "Nothing was found."}],
        },
        {
            "id": "summary",
            "title": "Summary",
            "figures": [],
            "tables": [{"id": "counts", "title": "counts", "files": ["tables/counts.csv", "tables/counts.tex"]}],
            "absences": [],
        },
    ]
    assert document == {
        "format": FORMAT,
        "title": "mine \N{EN DASH} tracknoise report",
        "experiment": "mine",
        "tracknoise": tracknoise.__version__,
        "page": "index.html",
    }


@pytest.mark.parametrize(("compared", "title"), [(True, "Which is better"), (False, "How accurate it is")])
def test_a_single_tracker_is_not_asked_whether_it_is_better(compared: bool, title: str) -> None:
    curve = Figure("error-by-age-lucas-kanade", "Error by age", "It shows.", "Look.", {})
    (opened,) = layout([Section("error-by-tracker", "By tracker", [curve])], compared=compared).open
    assert (opened.title, opened.items) == (title, [curve])


def test_it_lists_the_sections_of_the_page_in_order(report: Path) -> None:
    page = (report / "index.html").read_text(encoding="utf-8")
    contents = read_contents(report)
    assert contents is not None
    placed = re.findall(r'<(?:section|details class="entry") id="([^"]+)"', page)
    assert [section["id"] for section in contents["sections"]] == [one for one in placed if one != "everything"]
    assert f"<title>{contents['title']}</title>" in page
    for section in contents["sections"]:
        inside = re.split(r'<section id=|<details class="entry" id=', page.split(f'id="{section["id"]}"', 1)[1])[0]
        assert [figure["id"] for figure in section["figures"]] == re.findall(r'<figure id="figure-([^"]+)"', inside)


def test_it_lists_every_file_of_the_report(report: Path) -> None:
    contents = read_contents(report)
    assert contents is not None
    listed = [
        file
        for section in contents["sections"]
        for item in (*section["figures"], *section["tables"])
        for file in item["files"]
    ]
    written = {str(path.relative_to(report)) for path in report.rglob("*") if path.is_file()}
    assert {*listed, "index.html", CONTENTS, SUMMARY} == written
    assert len(listed) == len(written) - 3


def test_a_report_of_an_earlier_version_has_no_contents(tmp_path: Path) -> None:
    assert read_contents(tmp_path) is None


@pytest.mark.parametrize(("text", "message"), [("{", "damaged"), ('{"format": 99}', "found format 99, expected 1")])
def test_contents_that_cannot_be_used_are_one_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / CONTENTS).write_text(text)
    with pytest.raises(StoreError, match=message) as caught:
        read_contents(tmp_path)
    assert "\n" not in str(caught.value)
