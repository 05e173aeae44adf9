"""What every family of figures keeps to, whatever the run: valid, drawable, explained in words, and repeatable."""

import importlib.util
import re
import sys
from pathlib import Path
from typing import Any

import altair as alt
import jsonschema
import pytest
import vl_convert as vlc

from tracknoise.report.export import specification
from tracknoise.report.figures.families import FAMILIES, Family
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData


def _synthetic() -> Any:
    path = Path(__file__).parents[1] / "report" / "synthetic.py"
    spec = importlib.util.spec_from_file_location("tracknoise_synthetic", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


synthetic = _synthetic()
WORLDS: dict[str, dict[str, object]] = {"an ordinary run": {}, **synthetic.DEGENERATE}


@pytest.fixture(scope="module", params=WORLDS, ids=str)
def data(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> ReportData:
    world = synthetic.World(**{**synthetic.SMALL, **WORLDS[request.param]})
    return ReportData.of(synthetic.write_run(tmp_path_factory.mktemp("run"), world))


@pytest.fixture(scope="module")
def made(data: ReportData) -> list[Figure | Absence]:
    """What all families make."""
    return [item for family in FAMILIES for item in family.figures(data)]


def test_figures_draw_without_a_warning(made: list[Figure | Absence], capfd: pytest.CaptureFixture[str]) -> None:
    for figure in made:
        if isinstance(figure, Figure):
            svg = vlc.vegalite_to_svg(specification(figure), show_warnings=True)
            assert "<path" in svg
            assert "NaN" not in re.sub(r"base64,[^\"]*", "", svg)
    assert "WARN" not in capfd.readouterr().err


def test_every_figure_says_what_it_shows_and_what_to_look_for(made: list[Figure | Absence]) -> None:
    for item in made:
        for text in [item.why] if isinstance(item, Absence) else [item.shows, item.look_for]:
            assert text.endswith(".")
            assert text[0].isupper()
            assert not re.search(r"\b(nan|None|inf|null)\b|\.\.|  | ;|: \.|\(\)", text), text


def test_names_are_file_names_and_differ(made: list[Figure | Absence]) -> None:
    names = [item.id for item in made]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"[a-z0-9-]+", name) for name in names)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Any:
    views = ((0, "forward"), (90, "forward"), (0, "backward"))
    one = {"scenes": ("only",), "trackers": ("one",), "speeds": (1, 2), "n_frames": 7, "born": 10, "min_features": 5}
    world = synthetic.World(**one, lightings=("a", "b"), views=views)
    return synthetic.write_run(tmp_path_factory.mktemp("run"), world)


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.id)
def test_figures_are_valid_and_repeatable(family: Family, small: Any) -> None:
    made = [item for item in family.figures(ReportData.of(small)) if isinstance(item, Figure)]
    assert made
    alt.ConcatChart.from_dict(specification(made[0]))  # raises where Vega-Lite's schema is not kept
    assert made == [item for item in family.figures(ReportData.of(small)) if isinstance(item, Figure)]


def test_an_invalid_specification_would_be_noticed(small: Any) -> None:
    figure = next(item for item in FAMILIES[1].figures(ReportData.of(small)) if isinstance(item, Figure))
    spec = specification(figure)
    spec["concat"][0]["layer"][0]["mark"]["type"] = "blob"
    with pytest.raises(jsonschema.ValidationError):
        alt.ConcatChart.from_dict(spec)
