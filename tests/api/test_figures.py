"""Figures by name, as charts that display themselves."""

import altair as alt
import pytest

from tracknoise.exceptions import FigureError, UnknownNameError
from tracknoise.report import figure_files
from tracknoise.report.figures.families import FAMILIES
from tracknoise.report.figures.figure import Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder


@pytest.fixture(scope="module")
def drawn(run) -> dict[str, Figure]:
    """Some figures, as the report has them."""
    data = ReportData.of(RunFolder(run.path))
    some = [family for family in FAMILIES if family.id in ("lifetimes", "gaussianity")]
    return {item.id: item for family in some for item in family.figures(data) if isinstance(item, Figure)}


def test_figures_are_those_of_the_report_in_its_order(run, drawn):
    listed = run.figures()
    order = [family.id for family in FAMILIES]
    assert listed["section"].unique(maintain_order=True).to_list() == [x for x in order if x in set(listed["section"])]
    some = listed.filter(listed["figure"].is_in(list(drawn)))
    assert some["figure"].to_list() == list(drawn)
    for name in ("title", "shows", "look_for"):
        assert some[name].to_list() == [getattr(figure, name) for figure in drawn.values()]


def test_a_figure_has_either_texts_or_the_reason_why_it_is_absent(bare_run):
    listed = bare_run.figures()
    assert 0 < listed["absent"].null_count() < listed.height
    for text in ("shows", "look_for"):
        assert (listed[text].is_null() == listed["absent"].is_not_null()).all()


def test_a_chart_is_the_figure_of_the_report(run, drawn):
    for name in ("lifetimes", "gaussianity"):
        chart, expected = run.figure(name).to_dict(), figure_files.specification(drawn[name])
        assert chart["concat"] == expected["concat"]
        assert chart["datasets"] == expected["datasets"]
        assert chart["params"] == expected["params"]


def test_a_chart_displays_itself(run):
    chart = run.figure("lifetimes")
    shown = chart._repr_mimebundle_()
    assert set(shown) == {"image/svg+xml", "text/plain"}
    assert shown["image/svg+xml"].startswith("<svg")
    assert "src=" not in shown["image/svg+xml"]
    assert chart.to_dict()["description"].startswith(shown["text/plain"].removeprefix("<Chart: ").removesuffix(">"))


@pytest.mark.parametrize("renderer", ["mimetype", "html"])
def test_a_notebook_file_can_hold_what_is_displayed(run, renderer):
    """Of types of JSON, it allows those alone that end with ``+json``."""
    with alt.renderers.enable(renderer):
        shown = run.figure("lifetimes")._repr_mimebundle_()
    assert all(isinstance(one, str) and not kind.endswith(".json") for kind, one in shown.items())
    assert ("text/html" in shown) is (renderer == "html")


@pytest.mark.parametrize(("kind", "start"), [("svg", b"<svg"), ("png", b"\x89PNG"), ("html", b"<!DOCTYPE html>")])
def test_a_chart_can_be_saved(run, tmp_path, kind, start):
    run.figure("outlier-ratio").save(str(tmp_path / f"figure.{kind}"))
    assert (tmp_path / f"figure.{kind}").read_bytes().lstrip().startswith(start)


def test_a_section_stands_for_its_first_figure(run):
    first = run.figures().filter(section="error-by-tracker").row(0, named=True)
    chart = run.figure("error-by-age").to_dict(validate=False)
    assert chart["description"] == f"{first['title']}. {first['shows']}"


def test_an_unknown_figure_lists_the_known_ones(run):
    with pytest.raises(UnknownNameError, match=r"unknown figure 'error-by-frame' \(did you mean 'error-by-age'\?\)"):
        run.figure("error-by-frame")


def test_a_figure_with_nothing_to_show_says_why(run, bare_run):
    with pytest.raises(
        FigureError, match="figure 'error-by-lighting' cannot be drawn: this run has nothing to compare there"
    ):
        run.figure("error-by-lighting")
    (why,) = bare_run.figures().filter(section="error-by-tracker")["absent"].unique()
    with pytest.raises(FigureError, match="figure 'error-by-age' cannot be drawn: ") as raised:
        bare_run.figure("error-by-age")
    assert str(raised.value).endswith(why)
