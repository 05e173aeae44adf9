"""What every family of figures keeps to, whatever the run: valid, drawable, explained in words, and repeatable."""

import json
import re
from collections.abc import Callable
from functools import partial
from hashlib import sha256

import altair as alt
import jsonschema
import pytest
import vl_convert as vlc
from tests.report.synthetic import DEGENERATE

from tracknoise.report.figure_files import render, specification
from tracknoise.report.figures.families import FAMILIES, Family
from tracknoise.report.figures.figure import Absence, Figure
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder

WORLDS: dict[str, dict[str, object]] = {"an ordinary run": {}, **DEGENERATE}
READ_IMAGES_OR_POSES = ("example-frames", "trajectory")
ERRORS = ("error-by-tracker", "error-by-speed", "error-by-place", "along-and-across", "gaussianity", "time-structure")
AFFECTED = {
    "an ordinary run": ("error-by-speed", "lifetimes", "outlier-ratio"),
    "a perfect tracker": (*ERRORS, "changes", "lifetimes", "trimming", "survivorship-bias", "truth-audit"),
    "one tracker finds nothing": (*ERRORS, "lifetimes", "outlier-ratio", "feature-counts", "between-trackers"),
    "a light stage": (
        *READ_IMAGES_OR_POSES, "lifetimes", "outlier-ratio", "feature-counts", "changes", "survivorship-bias",
        "error-by-tracker", "error-by-lighting",
    ),
    "nothing trimmed": ("error-by-tracker", "trimming", "survivorship-bias", "gaussianity", "time-structure"),
    "all that is projected": ("error-by-tracker", "occlusion", "survivorship-bias", *READ_IMAGES_OR_POSES),
    "everything censored": ("trimming", "lifetimes", "feature-counts", "outlier-ratio", "survivorship-bias"),
    "no image": READ_IMAGES_OR_POSES,
    "statistics alone are kept": (*READ_IMAGES_OR_POSES, "feature-counts"),
    "two lightings": ("example-frames", "error-by-lighting"),
    "turned, and played backward": (
        *READ_IMAGES_OR_POSES, "feature-counts", "occlusion",
        "error-by-tracker", "error-by-rotation", "error-by-direction",
    ),
    "many conditions": (*READ_IMAGES_OR_POSES, "lifetimes", "outlier-ratio", "error-by-tracker", "error-by-lighting"),
}  # fmt: skip
"""The families that look at what is odd about a world; all of them where a world is not listed.

The other families see in these worlds what they see in "one of everything" or, with several trackers and scenes, in
"odd names", both of which all families draw.
"""
COMPARED: dict[str, dict[str, object]] = {
    "error-by-speed": {},
    "error-by-lighting": {"lightings": ("a", "b")},
    "error-by-rotation": {"views": ((0, "forward"), (90, "forward"), (0, "backward"))},
    "error-by-direction": {"views": ((0, "forward"), (90, "forward"), (0, "backward"))},
    "between-trackers": {"trackers": ("one", "other")},
}
"""What a family that compares conditions needs more of than two speeds."""


@pytest.fixture(scope="module", params=WORLDS, ids=str)
def made(request: pytest.FixtureRequest, make_run: Callable[..., RunFolder]) -> list[Figure | Absence]:
    """What the families that are affected make of a world."""
    data = ReportData.of(make_run(**WORLDS[request.param]))
    chosen = AFFECTED.get(request.param, [family.id for family in FAMILIES])
    return [item for family in FAMILIES if family.id in chosen for item in family.figures(data)]


@pytest.fixture(scope="module")
def drawn() -> set[str]:
    """Digests of specifications that were drawn: many worlds differ in what most figures do not show."""
    return set()


def test_the_families_that_are_chosen_exist() -> None:
    """A renamed family or world must not silently be drawn no more."""
    chosen = {name for names in (*AFFECTED.values(), COMPARED) for name in names}
    assert chosen <= {family.id for family in FAMILIES}
    assert AFFECTED.keys() <= WORLDS.keys()


def test_figures_draw_without_a_warning(
    made: list[Figure | Absence], drawn: set[str], capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As files of a report are drawn, and hence without zoom. What equals another to the letter is drawn once."""
    monkeypatch.setattr(vlc, "vegalite_to_svg", partial(vlc.vegalite_to_svg, show_warnings=True))
    for figure in (specification(item) for item in made if isinstance(item, Figure)):
        digest = sha256(json.dumps(figure).encode()).hexdigest()
        if digest not in drawn:
            svg = render(figure, ("svg",))["svg"].decode()
            drawn.add(digest)
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
def small(make_run: Callable[..., RunFolder]) -> Callable[[str], list[ReportData]]:
    """Gives the smallest run of which a family makes a figure, read twice."""
    one = {"scenes": ("only",), "trackers": ("one",), "speeds": (1, 2), "n_frames": 7, "born": 10, "min_features": 5}
    plain = make_run(**one)
    read_twice = [ReportData.of(plain), ReportData.of(plain)]

    def read(family: str) -> list[ReportData]:
        if not COMPARED.get(family):
            return read_twice
        run = make_run(**{**one, **COMPARED[family]})
        return [ReportData.of(run), ReportData.of(run)]

    return read


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.id)
def test_figures_are_valid_and_repeatable(
    family: Family, small: Callable[[str], list[ReportData]], capfd: pytest.CaptureFixture[str]
) -> None:
    made, again = ([item for item in family.figures(data) if isinstance(item, Figure)] for data in small(family.id))
    assert made
    alt.ConcatChart.validate(specification(made[0]))  # raises where Vega-Lite's schema is not kept
    assert "<path" in vlc.vegalite_to_svg(specification(made[0]), show_warnings=True)  # with zoom, as pages draw it
    assert "WARN" not in capfd.readouterr().err
    assert made == again


def test_an_invalid_specification_would_be_noticed(small: Callable[[str], list[ReportData]]) -> None:
    figure = next(item for item in FAMILIES[1].figures(small("")[0]) if isinstance(item, Figure))
    spec = specification(figure)
    spec["concat"][0]["layer"][0]["mark"]["type"] = "blob"
    with pytest.raises(jsonschema.ValidationError):
        alt.ConcatChart.validate(spec)
