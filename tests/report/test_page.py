import dataclasses
import html
import json
import re
import shutil
import subprocess
import tomllib
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import cv2
import polars as pl
import pytest
from tests.report.runs import filmed

from tracknoise.exceptions import StoreError, UnknownNameError
from tracknoise.report import measured
from tracknoise.report import page as page_module
from tracknoise.report.figures.families import FAMILIES
from tracknoise.report.filmed_scene import filmed_scene
from tracknoise.report.measured import truth_was_read
from tracknoise.report.page import write_report
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import TruthVerdict
from tracknoise.topics.sentences import sentences_of

MAGIC = {".png": b"\x89PNG\r\n", ".svg": b"<svg"}


class Page(HTMLParser):
    """Every element of a page with its attributes, and the text of its scripts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self._in_script = False
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attributes)))
        self._in_script = tag == "script"

    def handle_endtag(self, tag: str) -> None:
        self._in_script = False

    def handle_data(self, data: str) -> None:
        if self._in_script:
            self.scripts.append(data)

    def named(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.elements if name == tag]


@pytest.fixture(scope="module")
def report(whole_report: Path) -> Path:
    return whole_report / "report" / "index.html"


@pytest.fixture
def one_family(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages have one family of figures, and are written in a moment."""
    monkeypatch.setattr(page_module, "FAMILIES", [family for family in FAMILIES if family.id == "feature-counts"])


@pytest.fixture(scope="module")
def page(report: Path) -> Page:
    return Page(report.read_text(encoding="utf-8"))


def test_nothing_is_loaded_from_anywhere(page: Page) -> None:
    loading = [
        attributes[name]
        for tag, attributes in page.elements
        for name in ("src", "srcset", "data", "poster", "action", "background", "xlink:href")
        if name in attributes and tag != "a"
    ]
    assert loading == []
    assert not page.named("link")
    assert not page.named("iframe")
    (policy,) = [meta["content"] for meta in page.named("meta") if meta.get("http-equiv") == "Content-Security-Policy"]
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy


def test_styles_load_nothing(report: Path) -> None:
    (style,) = re.findall(r"<style>(.*?)</style>", report.read_text(), flags=re.DOTALL)
    assert "url(" not in style
    assert "@import" not in style


def test_links_lead_to_files_that_are_there_or_to_the_paper(page: Page, report: Path) -> None:
    for link in page.named("a"):
        target = link["href"]
        if target.startswith("#"):
            assert any(attributes.get("id") == target[1:] for _, attributes in page.elements)
        elif target != "https://arxiv.org/abs/2303.14315":
            assert (report.parent / target).is_file()


def test_every_figure_can_be_written_in_every_format(page: Page, report: Path) -> None:
    names = [attributes["data-figure"] for _, attributes in page.elements if "data-figure" in attributes]
    assert len(names) >= 9
    written = {path.name for path in (report.parent / "figures").iterdir()}
    assert written == {f"{name}{kind}" for name in names for kind in MAGIC}
    for path in (report.parent / "figures").iterdir():
        assert path.read_bytes().startswith(MAGIC[path.suffix])


def test_few_figures_are_open_and_the_others_are_folded(report: Path) -> None:
    text = report.read_text(encoding="utf-8")
    opened, folded = text.split('<section id="everything">')
    assert 5 <= opened.count("<figure") <= 12
    assert opened.count('<section id="') <= 8
    assert folded.count("<figure") > 9
    assert folded.split("<details")[0].count("<figure") == 0


def test_room_is_kept_for_figures_that_are_not_drawn_yet(page: Page) -> None:
    kept = [attributes["style"] for _, attributes in page.elements if "data-figure" in attributes]
    assert all(int(re.fullmatch(r"min-height: (\d+)px", style)[1]) > 100 for style in kept)


@pytest.mark.usefixtures("one_family")
def test_the_picture_to_share_says_what_to_set(fitted_run: RunFolder) -> None:
    index = write_report(fitted_run)
    image = cv2.imread(str(index.parent / "share.png"))
    assert image.shape == (630, 1200, 3)
    text = index.read_text(encoding="utf-8")
    (title,) = re.findall(r"<h2 data-heading>(Your innovations [^<]*)</h2>", text)
    settings = json.loads((index.parent / "summary.json").read_text(encoding="utf-8"))["settings"]
    assert any(one["sigma"]["text"] in title for one in settings)


def test_the_libraries_stand_in_the_page_once_and_specifications_are_json(page: Page) -> None:
    kinds = [attributes.get("type") for attributes in page.named("script")]
    assert kinds.count(None) == 2
    names = [attributes.get("id") or "" for attributes in page.named("script")]
    for text, kind, name in zip(page.scripts, kinds, names, strict=True):
        if kind == "application/json":
            known = {"explored": "choices", "looked": "groups", "filmed": "frames", "glossary": "core"}
            assert known.get(name, "concat") in json.loads(text)


def test_figures_are_described_for_those_who_do_not_see_them(page: Page) -> None:
    charts = [attributes for _, attributes in page.elements if "data-figure" in attributes]
    assert all(chart["role"] == "img" and chart["aria-label"] for chart in charts)
    assert all(image["alt"] for image in page.named("img"))


def test_what_the_reader_is_told_first(report: Path) -> None:
    text = html.unescape(report.read_text(encoding="utf-8"))
    for words in ("observed minus true position", "population", "Summary", "arXiv 2303.14315"):
        assert words in text
    assert "poses were projected to the nearest rotation, by up to 0.002" in text


def test_the_same_run_gives_the_same_bytes(whole_report: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With figures of some families: `tests/contract/test_figures.py` compares what each of them draws."""
    some = ("error-by-tracker", "lifetimes", "feature-counts", "example-frames")
    monkeypatch.setattr(page_module, "FAMILIES", [family for family in FAMILIES if family.id in some])
    runs = [RunFolder(tmp_path / place / whole_report.name) for place in ("one", "other")]
    for run in runs:
        shutil.copytree(whole_report, run.path, ignore=shutil.ignore_patterns("report"))
        write_report(run, figure_formats=("svg", "png"))

    def written(folder: Path) -> dict[Path, bytes]:
        return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    first, second = (written(run.path / "report") for run in runs)
    assert sum(path.suffix == ".svg" for path in first) > 3
    assert first == second


@pytest.mark.usefixtures("one_family")
def test_a_new_report_replaces_the_old_one_whole(own_run: RunFolder) -> None:
    run = own_run
    write_report(run, figure_formats=("png",))
    (run.path / "report" / "figures" / "stale.svg").write_text("of an earlier run")
    index = write_report(run, figure_formats=("svg",))
    assert {path.suffix for path in (index.parent / "figures").iterdir()} == {".svg"}
    assert not (index.parent / "figures" / "stale.svg").exists()
    assert [path.name for path in run.path.iterdir() if path.name.startswith(".")] == []


@pytest.mark.usefixtures("one_family")
def test_what_a_killed_process_left_of_a_report_is_removed(own_run: RunFolder) -> None:
    run = own_run
    process = subprocess.Popen(["true"])
    process.wait()
    leftover = run.path / f".report.{process.pid}.0123456789abcdef.tracknoise-unfinished"
    (leftover / "figures").mkdir(parents=True)
    write_report(run, figure_formats=())
    assert [path.name for path in run.path.iterdir() if path.name.startswith(".")] == []


def test_names_that_look_like_markup_are_only_names(make_run: Callable[..., RunFolder]) -> None:
    name = "</script><script>alert(1)</script><b>&"
    run = make_run(told=True, trackers=(name,), scenes=("<i>",), speeds=(1,), n_frames=6, born=6, min_features=5)
    text = write_report(run, figure_formats=()).read_text(encoding="utf-8")
    assert "<script>alert(1)" not in text
    assert "&lt;script&gt;alert(1)" in text


@pytest.mark.usefixtures("one_family")
def test_failures_are_told(own_run: RunFolder) -> None:
    run = own_run
    manifest = run.manifest()
    manifest.failures["gone@default"] = "gone/depth.png: truncated, expected a PNG"
    run.write_manifest(manifest)
    text = write_report(run, figure_formats=()).read_text(encoding="utf-8")
    assert "Could not be measured" in text
    assert "gone/depth.png: truncated, expected a PNG" in text


@pytest.mark.usefixtures("one_family")
def test_what_the_numbers_rest_on_is_told_before_the_first_table(make_run: Callable[..., RunFolder]) -> None:
    small = {"scenes": ("read",), "trackers": ("one",), "speeds": (1,), "n_frames": 6, "born": 4}
    run = make_run(**small, dataset="tum", truth="birth", depth=False)
    page = html.unescape(write_report(run, figure_formats=()).read_text(encoding="utf-8"))
    first = page.split("<table")[0]
    assert "Errors of the truth can explain up to" in first
    assert '<a href="#truth">' in first
    assert f"<p>Next: {sentences_of(TruthVerdict.of_run(run).step)[0]}</p>" in first
    assert "100.0\N{NO-BREAK SPACE}% of observations lack true positions" in first
    assert "<strong>The whole run</strong>: the true position of 100.0" in page.split('<section id="truth"')[1]


@pytest.mark.parametrize(("dataset", "truth"), [("simulated", "raycast"), ("simulated", "birth"), ("tum", "raycast")])
def test_simulated_truth_is_not_called_read(own_run: RunFolder, dataset: str, truth: str) -> None:
    manifest = own_run.manifest()
    ((key, entry),) = manifest.sequences.items()
    sequence = dataclasses.replace(entry.sequence, dataset=dataset)
    manifest.sequences[key] = dataclasses.replace(entry, sequence=sequence, truth=truth)
    own_run.write_manifest(manifest)
    assert not truth_was_read(ReportData.of(own_run))


def test_the_summary_says_which_lifetime_is_which(report: Path) -> None:
    text = report.read_text(encoding="utf-8")
    summary = text.split('<details class="entry" id="summary">')[1].split("</table>")[0]
    assert "mean</th>" in summary
    assert "KM median</th>" in summary


def test_an_unknown_format_is_refused(run: RunFolder) -> None:
    with pytest.raises(UnknownNameError, match="unknown figure format 'gif'"):
        write_report(run, figure_formats=("gif",))


@pytest.mark.usefixtures("one_family")
def test_a_missing_table_is_named_and_leaves_the_old_report(own_run: RunFolder) -> None:
    run = own_run
    index = write_report(run, figure_formats=())
    before = index.read_bytes()
    (run.path / "statistics" / "curves.parquet").unlink()
    with pytest.raises(StoreError, match=r"curves\.parquet: missing"):
        write_report(run, figure_formats=())
    assert index.read_bytes() == before


def test_a_report_that_cannot_be_written_is_one_line(own_run: RunFolder) -> None:
    (own_run.path / "report").write_text("a file where a folder should be")
    with pytest.raises(StoreError, match="cannot be written"):
        write_report(own_run, figure_formats=())


def test_a_film_without_images_is_left_out(own_run: RunFolder) -> None:
    copy = filmed(own_run, own_run.path.with_name("filmed"), n_frames=0)
    assert filmed_scene(ReportData.of(copy)) is None


def test_the_page_does_not_name_the_folders_of_the_machine(own_run: RunFolder) -> None:
    settings = tomllib.loads((own_run.path / "experiment.toml").read_text())
    secret = "/home/somebody/recordings/one"
    settings["dataset"]["root"] = secret
    manifest = own_run.manifest()
    ((key, entry),) = manifest.sequences.items()
    manifest.sequences[key] = replace(entry, notes=(f"{secret}/rgb.txt: 3 images are not there.",))
    data = replace(ReportData.of(own_run), manifest=manifest, settings=settings)
    assert dict(measured.settings(data).rows)["dataset.root"] == ".../one"
    assert [note for _, note in measured.notes(data)] == [".../one/rgb.txt: 3 images are not there."]


@pytest.mark.usefixtures("one_family")
@pytest.mark.parametrize("verdict", ["trusted", "not trusted"])
def test_a_truth_that_is_not_trusted_comes_first_and_nothing_is_to_be_set(
    fitted_run: RunFolder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, verdict: str
) -> None:
    shutil.copytree(fitted_run.path, tmp_path / "run")
    run = RunFolder(tmp_path / "run")
    data = ReportData.of(run)
    row = {"cause": "every", "verdict": verdict, "text": "A sentence.", "step": "Another one."}
    found = data.with_tables(trust=pl.DataFrame([row], schema=data["trust"].schema))
    monkeypatch.setattr(ReportData, "of", classmethod(lambda cls, run: found))
    first = write_report(run).read_text(encoding="utf-8").split("</header>")[0]
    is_first = first.index('id="ask-trust"') < first.index('id="ask-set"')
    assert is_first == (verdict == "not trusted")
    assert ("What to set" in first, "data-copy" in first) == (not is_first, not is_first)
    assert ("Upper bounds of sigma" in first, "Sigma is at most" in first) == (is_first, is_first)
