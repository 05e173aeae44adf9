"""The report in a browser: it fits the window, loads nothing, and its controls and links work."""

import base64
import json
import re
from collections.abc import Callable
from importlib import resources
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.browser.chromium import Page
from tests.report.runs import filmed as filmed_copy

from tracknoise.estimators.exports import estimator
from tracknoise.estimators.run_models import run_models
from tracknoise.report.glossary import TERMS
from tracknoise.report.page import write_report
from tracknoise.report.report_data import ReportData
from tracknoise.tables.enumerations import Trust
from tracknoise.tables.store import RunFolder
from tracknoise.words import px

Open = Callable[..., Page]
ODD = "<script>window.harmed = 1</script>\"'`\N{GRINNING FACE}&${x}"
LONG = "n" * 300
DRAWN = "[...document.querySelectorAll('[data-explorer]')].every(one => one.dataset.shown && one.querySelector('svg'))"
EVERY = "openFigures().every(one => one.dataset.drawn === 'yes')"
FIRST = ".first .question, .first .picture"
BOTTOMS = f"Math.max(...[...document.querySelectorAll('{FIRST}')].map(one => one.getBoundingClientRect().bottom))"
TOO_WIDE = """[...document.querySelectorAll('table, figure, .chart, .scroll, pre, .card, dl')]
  .filter(one => one.scrollWidth > one.clientWidth + 1 || one.getBoundingClientRect().right > innerWidth + 1)
  .map(one => one.textContent.slice(0, 60))"""


@pytest.fixture(scope="module")
def filmed(run: RunFolder, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of the run with the images of its first frames."""
    return write_report(filmed_copy(run, tmp_path_factory.mktemp("filmed") / "run"))


@pytest.fixture(scope="module")
def odd_report(make_run: Callable[..., RunFolder]) -> Path:
    """Names of trackers and scenes that are markup, or very long."""
    run = make_run(
        told=True, scenes=(ODD, LONG), trackers=(ODD, LONG, "c"), speeds=(1,), n_frames=12, born=20, min_features=10
    )
    return write_report(run, figure_formats=())


def shown(page: Page) -> str:
    """The figure of the explorer as it is drawn, without the numbers of clips, which differ every time."""
    page.wait(DRAWN)
    return re.sub(r"clip\d+", "", page.evaluate("document.querySelector('[data-explorer]').innerHTML"))


def choose(page: Page, name: str, value: str) -> None:
    """Choose in a control, as a reader does, and wait until all figures follow."""
    control = f"document.querySelector('#controls [name={name}]')"
    page.evaluate(
        f"{control}.value = {json.dumps(value)}; {control}.dispatchEvent(new Event('change', {{bubbles: true}}))"
    )
    one = "JSON.parse(one.dataset.shown)"
    page.wait(
        "[...document.querySelectorAll('[data-explorer]')]"
        f".every(one => one.dataset.shown && {one}[{json.dumps(name)}] === {json.dumps(value)})"
    )


@pytest.mark.parametrize("name", ["report", "odd_report"])
def test_nothing_is_loaded_fails_or_is_wider_than_the_window(
    name: str, open_page: Open, request: pytest.FixtureRequest
) -> None:
    path = request.getfixturevalue(name)
    page = open_page(path)
    page.wait(EVERY)
    page.wait(DRAWN)
    assert page.errors == []
    assert [address for address in page.requests if not address.startswith("data:")] == [f"file://{path}"]
    assert page.evaluate("window.harmed === undefined")
    page.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")
    page.evaluate("Promise.all([...document.querySelectorAll('[data-figure]')].map(draw))")
    page.wait("[...document.querySelectorAll('[data-figure]')].every(one => one.dataset.drawn === 'yes')")
    assert page.errors == []
    assert page.evaluate("document.documentElement.scrollWidth") == 1280
    assert page.evaluate(TOO_WIDE) == []


def test_the_answer_fits_the_first_screen(report: Path, open_page: Open) -> None:
    page = open_page(report, width=1366)
    assert page.evaluate("[...document.querySelectorAll('.first h2')].map(one => one.textContent.trim())")[:2] == [
        "What to set",
        "Which is better",
    ]
    assert page.evaluate(BOTTOMS) <= 768
    verdict = page.evaluate("document.querySelector('.first .chip').textContent").strip()
    assert verdict.removeprefix("truth: ") in {*Trust}


def test_the_answer_fits_where_most_true_positions_are_unknown(
    make_run: Callable[..., RunFolder], open_page: Open
) -> None:
    run = make_run(told=True, scenes=("a", "b", "c"), trackers=("one", "two"), speeds=(1,), depthless=("b", "c"))
    page = open_page(write_report(run, figure_formats=()), width=1366)
    assert "lack true positions" in page.evaluate("document.querySelector('.first').textContent")
    assert page.evaluate(BOTTOMS) <= 768


def test_the_picture_and_its_estimator_are_chosen_on_the_first_screen(
    fitted_run: RunFolder, fitted_report: Path, open_page: Open
) -> None:
    page = open_page(fitted_report, width=1366)
    cells = "[...document.querySelector('[data-set]').cells].map(one => one.textContent.trim())"
    heading = "document.querySelector('#answer [data-heading]').textContent"
    page.wait("document.querySelector('[data-copy]').title !== ''")
    of_filter, title = page.evaluate(cells), page.evaluate(heading)
    model = run_models(fitted_run).models["oracle"]
    pick(page, "estimator", "sliding_window")
    page.wait("document.querySelector('#export [name=estimator]').value === 'sliding_window'")
    for window in ("20", "5"):
        pick(page, "window", window)
        sigma = px(estimator("sliding_window").advise(model, window=int(window)).sigma.value)
        page.wait(f"{cells}[1].startsWith({json.dumps(sigma)})")
        assert sigma in page.evaluate(heading)
        assert page.evaluate("document.querySelector('[data-copy]').textContent") == "Copy command"
        dots = page.evaluate(
            "[...document.querySelectorAll('.plotted .dots')].filter(one => one.getAttribute('display') !== 'none')"
            ".map(one => one.dataset.window)"
        )
        assert dots == ([window] if int(window) <= model.training.ages[1] + 1 else [])
    pick(page, "estimator", "filter")
    page.wait(f"JSON.stringify({cells}) === JSON.stringify({json.dumps(of_filter)})")
    assert page.evaluate(heading) == title
    assert page.errors == []


def pick(page: Page, name: str, value: str) -> None:
    """Choose what the first screen is about."""
    choice = f"document.querySelector('#choose [name={name}]')"
    page.evaluate(f"{choice}.value = '{value}'; {choice}.dispatchEvent(new Event('change', {{bubbles: true}}))")


def test_words_of_the_first_screen_show_their_definitions(fitted_report: Path, open_page: Open) -> None:
    page = open_page(fitted_report, width=390)
    page.evaluate("document.querySelector('#choose [name=features]').parentElement.hidden = false")
    page.evaluate("document.dispatchEvent(new Event('rewritten'))")
    words = page.evaluate("[...document.querySelectorAll('#answer .term')].map(one => one.textContent.toLowerCase())")
    assert {"track gate", "errors in common"} <= set(words)
    assert len(set(words)) == len(words)
    page.command("Emulation.setFocusEmulationEnabled", enabled=True)
    page.evaluate("document.querySelector('#answer .term').focus()")
    shown = page.evaluate("getComputedStyle(document.querySelector('#answer .term'), '::after').content")
    assert json.loads(shown) == TERMS[next(name for name in TERMS if name.lower() == words[0])]
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_links_of_the_first_screen_lead_into_the_page(report: Path, open_page: Open) -> None:
    page = open_page(report)
    targets = page.evaluate("[...document.querySelectorAll('a[href^=\"#\"]')].map(one => one.getAttribute('href'))")
    assert len(set(targets)) > 8
    assert page.evaluate(f"{json.dumps(targets)}.filter(one => !document.getElementById(one.slice(1)))") == []


def test_links_land_where_they_point_while_figures_are_drawn(report: Path, open_page: Open) -> None:
    page = open_page(report, width=1366)
    opened, folded = (
        page.evaluate(f"[...document.querySelectorAll('{kind}')].map(one => one.id)")
        for kind in ("section.open", ".entry")
    )
    for target in [*opened[1::2], folded[0], folded[-1]]:
        again = f"{report.as_uri()}?{target}#{target}"
        page.goto(again)
        page.wait(f"document.body.dataset.arrived === {json.dumps(target)}")
        page.wait(EVERY)
        top, left = page.evaluate(
            f"[document.getElementById({json.dumps(target)}).getBoundingClientRect().top, "
            "document.documentElement.scrollHeight - scrollY - innerHeight]"
        )
        assert abs(top) < 40 or left < 2, target


def test_points_are_reached_by_the_keyboard(report: Path, open_page: Open) -> None:
    page = open_page(report)
    page.wait(DRAWN)
    page.evaluate("document.querySelector('[data-explorer]').focus()")
    for key in ("ArrowRight", "ArrowRight", "ArrowRight"):
        page.key(key)
    told = page.evaluate("document.getElementById('point').textContent")
    assert re.match(r"lucas-kanade, pooled, u, age 2: ", told)
    page.key("Enter")
    page.wait("!!document.getElementById('looks').dataset.shown")
    assert json.loads(page.evaluate("document.getElementById('looks').dataset.shown"))["tracker"] == "lucas-kanade"


def test_a_figure_is_one_thing_to_a_screen_reader(report: Path, open_page: Open) -> None:
    page = open_page(report)
    page.wait(EVERY)
    page.command("Accessibility.enable")
    nodes = [node for node in page.command("Accessibility.getFullAXTree")["nodes"] if not node["ignored"]]
    assert len(nodes) < 2500
    assert not [node for node in nodes if node["role"]["value"].startswith("graphics-")]


def test_the_search_leaves_what_holds_its_words(report: Path, open_page: Open) -> None:
    page = open_page(report)
    listed = "[...document.querySelectorAll('.entry')].filter(one => !one.hidden).map(one => one.id)"
    every = page.evaluate(listed)
    page.evaluate("document.querySelector('[name=words]').value = 'camera path'")
    page.evaluate("document.querySelector('[name=words]').dispatchEvent(new Event('input', {bubbles: true}))")
    assert "trajectory" in page.evaluate(listed)
    assert len(page.evaluate(listed)) < len(every)


def test_on_a_phone_nothing_is_cut(report: Path, open_page: Open) -> None:
    page = open_page(report, width=390, height=844)
    page.wait(EVERY)
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    assert not page.evaluate("document.querySelector('nav details').open")


def test_text_is_large_enough_to_read(report: Path, open_page: Open) -> None:
    page = open_page(report, width=1366)
    page.wait(EVERY)
    small = page.evaluate(
        """[...document.querySelectorAll('main *')].filter((one) => one.childElementCount === 0
          && one.textContent.trim() && one.offsetParent !== null
          && parseFloat(getComputedStyle(one).fontSize) < 12).map((one) => one.textContent.slice(0, 40))"""
    )
    assert small == []


def test_the_page_prints_on_a_few_sheets(report: Path, open_page: Open) -> None:
    page = open_page(report, width=1366)
    page.wait(EVERY)
    printed = base64.b64decode(page.command("Page.printToPDF")["data"])
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 6


def test_frames_are_shown_one_by_one(filmed: Path, open_page: Open) -> None:
    page = open_page(filmed)
    page.evaluate("document.getElementById('film').scrollIntoView({behavior: 'instant'})")
    canvas = "document.querySelector('#film canvas').dataset.shown"
    page.wait(f"({canvas} ?? '').startsWith('lucas-kanade')")
    page.evaluate(
        "(() => { const form = document.querySelector('#film form'); form.frame.value = 3; "
        "form.dispatchEvent(new Event('input')); })()"
    )
    page.wait(f"{canvas} === 'lucas-kanade 3'")
    assert " tracks." in page.evaluate("document.querySelector('#film output').textContent")
    assert page.errors == []


@pytest.mark.parametrize(
    ("name", "value", "kept"),
    [("tracker", "lucas-kanade", ()), ("speed", "2", ()), ("trimming", "untrimmed", ("survival",))],
)
def test_a_choice_changes_every_statistic(
    name: str, value: str, kept: tuple[str, ...], report: Path, open_page: Open
) -> None:
    page = open_page(report)
    statistics = page.evaluate("options('statistic').map(([one]) => one)")
    assert statistics == ["mean", "absolute", "second", "core", "survival"]
    first = page.evaluate("start()")[name]
    for statistic in statistics:
        choose(page, name, first)
        choose(page, "statistic", statistic)
        before = shown(page)
        choose(page, name, value)
        assert (before == shown(page)) == (statistic in kept)
    assert page.errors == []


def test_scenes_are_added_as_lines(report: Path, open_page: Open) -> None:
    page = open_page(report)
    before = shown(page)
    choose(page, "scene", "all")
    assert len(shown(page)) > len(before)


def test_the_address_holds_the_choice(report: Path, open_page: Open) -> None:
    page = open_page(report)
    shown(page)
    choose(page, "speed", "2")
    address = page.evaluate("location.hash")
    expected = shown(page)
    again = open_page(f"{report}?other{address}")
    again.wait(DRAWN)
    assert again.evaluate("document.querySelector('#controls [name=speed]').value") == "2"
    assert shown(again) == expected


def test_an_address_that_names_nothing_is_ignored(report: Path, open_page: Open) -> None:
    page = open_page(f"{report}#explorer?tracker=none-such&speed=99&other=1")
    shown(page)
    assert page.evaluate("document.querySelector('#controls [name=tracker]').value") == "all"
    assert page.errors == []


def test_the_keyboard_moves_the_controls(report: Path, open_page: Open) -> None:
    page = open_page(report)
    before = shown(page)
    page.evaluate("document.querySelector('#controls [name=tracker]').focus()")
    page.key("ArrowUp")
    page.wait("document.querySelector('#controls [name=tracker]').value !== 'all'")
    page.wait("JSON.parse(document.querySelector('[data-explorer]').dataset.shown).tracker !== 'all'")
    assert shown(page) != before


def test_curves_are_those_of_the_tables(run: RunFolder, report: Path, open_page: Open) -> None:
    page = open_page(report)
    choose(page, "statistic", "second")
    rows = page.evaluate("shownView.spec.usermeta.rows.filter(row => row.series === 'correspondence')")
    data = ReportData.of(run)
    points = data.nominal(data.points).filter(
        role="second", tracker="correspondence", trimming=data.trimming, population=data.population
    )
    expected = pl.concat([points["u"], points["v"]]).sort().to_list()
    assert sorted(row["value"] for row in rows) == pytest.approx(expected, rel=1e-3)


def test_the_data_of_a_figure_can_be_saved(report: Path, open_page: Open) -> None:
    page = open_page(report)
    page.evaluate("window.saved = []; save = (name, text) => window.saved.push([name, text])")
    page.click("[data-download]")
    page.wait(DRAWN)
    page.click("[data-save=csv]")
    page.wait("window.saved.length === 2")
    (figure, text), (name, values) = page.evaluate("window.saved")
    assert figure.endswith(".csv")
    assert text.count("\n") > 5
    assert name == "mean.csv"
    assert values.startswith("series,scene,axis,at,value,low,high,n\n")


def test_a_link_unfolds_what_it_leads_to(report: Path, open_page: Open) -> None:
    page = open_page(report)
    page.evaluate("document.querySelector('#measured details').id = 'folded'; location.hash = '#folded'")
    page.wait("document.getElementById('folded').open && document.getElementById('measured').open")


def test_dark_and_print(report: Path, open_page: Open) -> None:
    page = open_page(report, dark=True)
    background = "getComputedStyle(document.body).backgroundColor"
    assert page.evaluate(background) == "rgb(20, 25, 31)"
    page.size(1280, 768)
    assert page.evaluate(background) == "rgb(255, 255, 255)"
    page.command("Emulation.setEmulatedMedia", media="print")
    assert page.evaluate("getComputedStyle(document.querySelector('nav')).display") == "none"


def pooled_tracks(run: RunFolder, tracker: str, at: int) -> pl.DataFrame:
    """Observations of a tracker at an age, the largest error first, with the scene and the track."""
    seen = pl.concat(run.sequence_tables("observations")).filter(tracker=tracker, speed=1, age=at, truth="valid")
    size = (pl.col("du_px") ** 2 + pl.col("dv_px") ** 2).sqrt()
    return seen.with_columns(size=size).sort("size", descending=True)


def test_a_click_on_a_point_opens_the_tracks_behind_it(run: RunFolder, report: Path, open_page: Open) -> None:
    page = open_page(report)
    page.wait(DRAWN)
    choose(page, "statistic", "second")
    page.evaluate(
        """(() => {
          const marks = [...document.querySelectorAll('[data-explorer] .mark-symbol path')];
          const wanted = (item) => item.datum.at === 5 && item.datum.series === 'lucas-kanade';
          marks.find((mark) => wanted(mark.__data__)).id = 'point';
        })()"""
    )
    page.click("#point")
    page.wait("document.getElementById('looks').dataset.shown")
    shown_now = json.loads(page.evaluate("document.getElementById('looks').dataset.shown"))
    assert shown_now == {"tracker": "lucas-kanade", "scene": "all", "at": 5}
    tracks = page.evaluate("[...document.querySelectorAll('.track')].map(one => ({...one.dataset}))")
    assert [one["kind"] for one in tracks] == [*["worst"] * 8, *["median"] * 8, *["best"] * 8]
    expected = pooled_tracks(run, "lucas-kanade", 5).select("scene", pl.col("track").cast(pl.String)).rows()
    assert [(one["scene"], one["track"]) for one in tracks[:8]] == expected[:8]
    assert [(one["scene"], one["track"]) for one in tracks[16:]] == expected[::-1][:8]
    assert page.errors == []


def pictured(run: RunFolder, tracker: str) -> pl.DataFrame:
    """Tracks of a tracker that have pictures, each once: scene, track, lifetime and max_error_px."""
    patches = pl.concat(run.sequence_tables("patches")).filter(tracker=tracker, speed=1)
    keys = ["dataset", "scene", "track"]
    shown_ones = patches.explode("track").select(keys).unique()
    tracks = pl.concat(run.sequence_tables("tracks")).filter(tracker=tracker, speed=1)
    return tracks.join(shown_ones.with_columns(pl.col("track").cast(tracks["track"].dtype)), on=keys)


def told_apart(run: RunFolder, tracks: pl.DataFrame) -> int:
    """The lifetime of three tracks or more at which the bars of the two trackers differ the most."""
    ended = pl.concat(run.sequence_tables("tracks")).filter(speed=1)
    counts = ended.group_by("lifetime").agg(
        apart=((pl.col("tracker") == "lucas-kanade").sum() * 2.0 - pl.len()).abs(),
    )
    several = tracks.group_by("lifetime").len().filter(pl.col("len") > 2)
    return int(counts.join(several, on="lifetime").sort("apart", "lifetime")["lifetime"][-1])


STILL = """(async () => {
  for (let same = 0, before = -1; same < 20; before = scrollY) {
    await new Promise((done) => setTimeout(done, 25));
    same = scrollY === before ? same + 1 : 0;
  }
})()"""


def click_bar(page: Page, figure: str, condition: str) -> None:
    """Click the top of the bar of a histogram whose row meets a condition, when the page no longer scrolls."""
    page.evaluate(STILL)
    page.evaluate(
        f"""(async () => {{
          delete document.getElementById('looks').dataset.shown;
          const place = document.querySelector('[data-figure={figure}]');
          place.scrollIntoView({{block: 'center', behavior: 'instant'}});
          const all = [...place.querySelectorAll('.mark-line path')];
          const line = all.find((one) => one.__data__.mark.items.some((item) => ({condition})(item.datum)));
          const bar = line.__data__.mark.items.find((item) => ({condition})(item.datum));
          const at = new DOMPoint(bar.x + 1, bar.y).matrixTransform(line.getScreenCTM());
          window.target = [at.x, at.y];
        }})()"""
    )
    x, y = page.evaluate("window.target")
    for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
        page.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
    page.wait("!!document.getElementById('looks').dataset.shown")


def cards(page: Page) -> list[tuple[str, str, str]]:
    """Scene, track and kind of every track that is shown."""
    shown_ones = page.evaluate("[...document.querySelectorAll('.track')].map(one => ({...one.dataset}))")
    return [(one["scene"], one["track"], one["kind"]) for one in shown_ones]


def test_a_click_on_a_bar_opens_its_tracks(run: RunFolder, report: Path, open_page: Open) -> None:
    """A bar of lifetimes opens all of its tracks, a bar of errors the worst first."""
    page = open_page(report)
    page.wait(EVERY)
    page.evaluate("document.getElementById('trimming').open = true")
    page.evaluate("draw(document.querySelector('[data-figure=trimming]'))")
    bar_of_lifetimes(page, run)
    bar_of_errors(page, run)


def bar_of_lifetimes(page: Page, run: RunFolder) -> None:
    tracks = pictured(run, "lucas-kanade")
    lifetime = told_apart(run, tracks)
    click_bar(page, "lifetimes", f"(row) => row.lifetime === {lifetime} && row.tracker === 'lucas-kanade' && row.n > 0")
    wanted = tracks.filter(lifetime=lifetime).select("scene", pl.col("track").cast(pl.String)).rows()
    found = cards(page)
    assert len(found) == min(24, len(wanted)) > 2
    assert {(scene, track) for scene, track, _ in found} <= set(wanted)
    assert [kind for *_, kind in found] == sorted((kind for *_, kind in found), key=["worst", "median", "best"].index)
    assert page.errors == []


def bar_of_errors(page: Page, run: RunFolder) -> None:
    tracks = pictured(run, "lucas-kanade").drop_nulls("max_error_px")
    middle = tracks["max_error_px"].sort()[tracks.height // 2]
    click_bar(
        page,
        "trimming",
        f"(row) => row.tracker === 'lucas-kanade' && row.speed == 1 && row.of <= {middle} && {middle} < row.to",
    )
    bar = json.loads(page.evaluate("document.getElementById('looks').dataset.shown"))
    assert bar["tracker"] == "lucas-kanade"
    inside = tracks.filter(pl.col("max_error_px").is_between(bar["of"], bar["to"], closed="left"))
    wanted = inside.sort("max_error_px", descending=True).select("scene", pl.col("track").cast(pl.String)).rows()
    found = cards(page)
    assert [one[:2] for one in found if one[2] == "worst"] == wanted[: min(8, -(-len(wanted) // 3))]
    assert len(found) == min(24, len(wanted)) > 0


def test_a_click_on_the_curve_of_a_scene_opens_its_tracks(report: Path, open_page: Open) -> None:
    page = open_page(report)
    page.wait(EVERY)
    choose(page, "statistic", "second")
    choose(page, "scene", "forward")
    choose(page, "tracker", "lucas-kanade")
    shown(page)
    page.evaluate(
        """(() => {
          const place = document.querySelector('[data-explorer]');
          place.scrollIntoView({block: 'center', behavior: 'instant'});
          const all = [...place.querySelectorAll('.mark-line path')];
          const line = all.find((one) => one.__data__.mark.items[0].datum.scene === 'forward');
          const at = line.__data__.mark.items.find((item) => item.datum.at === 5);
          const point = new DOMPoint(at.x, at.y).matrixTransform(line.getScreenCTM());
          window.target = [point.x, point.y];
        })()"""
    )
    x, y = page.evaluate("window.target")
    for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
        page.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
    page.wait("!!document.getElementById('looks').dataset.shown")
    shown_now = json.loads(page.evaluate("document.getElementById('looks').dataset.shown"))
    assert shown_now == {"tracker": "lucas-kanade", "scene": "forward", "at": 5}
    assert {scene for scene, *_ in cards(page)} == {"forward"}


def test_tracks_of_one_scene_are_chosen_without_a_mouse(run: RunFolder, report: Path, open_page: Open) -> None:
    page = open_page(report)
    page.wait(DRAWN)
    choice = "document.querySelector('#look [name={}]').value = '{}'; "
    chosen = "".join(choice.format(*pair) for pair in (("tracker", "correspondence"), ("scene", "forward"), ("at", 1)))
    page.evaluate(f"{chosen} document.getElementById('look').dispatchEvent(new Event('change'))")
    tracks = page.evaluate("[...document.querySelectorAll('.track')].map(one => ({...one.dataset}))")
    expected = pooled_tracks(run, "correspondence", 1).filter(scene="forward")["track"].cast(pl.String).to_list()
    assert [one["track"] for one in tracks[:8]] == expected[:8]
    assert {one["scene"] for one in tracks} == {"forward"}


def test_the_marks_of_a_patch_are_where_the_tables_say(run: RunFolder, report: Path, open_page: Open) -> None:
    page = open_page(report)
    page.wait(DRAWN)
    page.evaluate("look('lucas-kanade', 'forward', 5)")
    worst = pooled_tracks(run, "lucas-kanade", 5).filter(scene="forward").row(0, named=True)
    circle = page.evaluate(
        "(({cx, cy}) => [cx, cy].map(one => one.baseVal.value))(document.querySelector('.track circle'))"
    )
    assert page.evaluate("tile") == 124
    u, v = (worst[name] - round(worst[name]) for name in ("u_px", "v_px"))
    assert circle == pytest.approx([124 + 62 + 4 * (u - worst["du_px"]), 62 + 4 * (v - worst["dv_px"])], abs=0.1)


MARKS_OF_ERRORS = """
((errors) => {
  const group = looked.groups.find((one) => one.tracker === 'lucas-kanade' && one.scene === 'forward' && one.at === 5);
  const [kept, some] = [group.tracks, group.tracks[0]];
  group.tracks = errors.map((error) => ({ ...some, error, within: [0.25, -0.25] }));
  look('lucas-kanade', 'forward', 5);
  group.tracks = kept;
  const points = (path) => path.getAttribute('d').match(/[-0-9.]+,[-0-9.]+/g).map((one) => one.split(',').map(Number));
  return [...document.querySelectorAll('.track')].map((one) => {
    const [circle, arrow] = [one.querySelector('circle'), one.querySelector('path.beyond')];
    return {
      circle: circle && [circle.cx.baseVal.value, circle.cy.baseVal.value],
      arrow: arrow && points(arrow),
      clipped: getComputedStyle((circle || arrow).ownerSVGElement).overflow,
      patch: (({ x, width }) => [x.baseVal.value, width.baseVal.value])((circle || arrow).ownerSVGElement),
    };
  });
})(%s)
"""
"""Marks of true places for made-up errors of a track that was observed (0.25, -0.25) px from its nearest pixel."""


def test_a_true_place_outside_the_patch_has_an_arrow_that_points_to_it(report: Path, open_page: Open) -> None:
    page = open_page(report)
    page.wait(DRAWN)
    observed = np.array([124 + 62 + 1, 62 - 1])
    inside = [[3.0, 4.0], [-15.2, 0.0], [15.6, 0.0], [0.0, -15.6], [0.0, 15.0]]
    outside = [[15.8, 0.0], [-17.1, 2.8], [0.0, 16.0], [0.0, -15.8], [40.0, 40.0], [-60.0, 30.0], [5.0, -900.0]]
    marks = page.evaluate(MARKS_OF_ERRORS % json.dumps([*inside, *outside]))
    assert {(one["clipped"], *one["patch"]) for one in marks} == {("hidden", 124, 124)}
    for error, mark in zip(inside, marks, strict=False):
        assert mark["arrow"] is None
        assert mark["circle"] == pytest.approx((observed - 4 * np.array(error)).tolist(), abs=1e-3)
    for error, mark in zip(outside, marks[len(inside) :], strict=True):
        assert mark["circle"] is None
        tail, tip = np.array(mark["arrow"][:2])
        towards = -np.array(error) / np.hypot(*error)
        np.testing.assert_allclose((tip - tail) / np.hypot(*(tip - tail)), towards, atol=1e-6)
        np.testing.assert_allclose((tip - observed) / np.hypot(*(tip - observed)), towards, atol=1e-6)
        assert min(abs(tip[0] - 124), abs(248 - tip[0]), abs(tip[1]), abs(124 - tip[1])) == pytest.approx(3)
        assert all(124 <= x <= 248 and 0 <= y <= 124 for x, y in mark["arrow"])


def test_a_run_without_patches_says_so(odd_report: Path, open_page: Open) -> None:
    page = open_page(odd_report)
    page.wait(DRAWN)
    assert "This run keeps no patches of tracks." in page.evaluate("document.getElementById('explorer').textContent")


@pytest.mark.parametrize("dark", [False, True])
def test_nothing_serious_is_found_by_axe(report: Path, open_page: Open, dark: bool) -> None:
    page = open_page(report, width=1366, dark=dark)
    page.wait(EVERY)
    page.wait(DRAWN)
    page.evaluate(f"{(resources.files('axe_core_python') / 'axe.min.js').read_text(encoding='utf-8')}; true")
    found = page.evaluate(
        "axe.run().then((one) => one.violations.map((rule) => [rule.impact, rule.id, rule.nodes[0].html]))"
    )
    assert [one for one in found if one[0] in ("serious", "critical")] == []


BEYOND_KEYS = """[...document.querySelectorAll('body *')]
  .filter(one => ['auto', 'scroll'].includes(getComputedStyle(one).overflowX) && one.scrollWidth > one.clientWidth + 1)
  .filter(one => one.tabIndex < 0 && !one.querySelector('a[href], button, input, select, [tabindex="0"]'))
  .map(one => one.className + ': ' + one.textContent.slice(0, 60))"""


def test_what_scrolls_on_a_phone_can_be_scrolled_by_keys(open_page: Open, report: Path):
    page = open_page(report, width=390, height=844)
    page.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")
    assert page.evaluate("[...document.querySelectorAll('.scroll')].some(one => one.scrollWidth > one.clientWidth)")
    assert page.evaluate(BEYOND_KEYS) == []
