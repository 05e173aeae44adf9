"""The pages that join the runs of a replication."""

import csv
import re
import shutil
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest

from tracknoise.exceptions import StoreError
from tracknoise.paper.claim_verdicts import cells, claims
from tracknoise.paper.replication import Replicated, write_replication
from tracknoise.report.page import write_report
from tracknoise.tables.enumerations import Reading
from tracknoise.tables.store import RunFolder

OTHERS = {Reading.none: {"trimming": "untrimmed"}, Reading.followed: {"trim_among": "followed"}}


class Links(HTMLParser):
    """What a page links to, and the anchors that it has."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.anchors: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        named = dict(attributes)
        if tag == "a" and named.get("href"):
            self.targets.append(str(named["href"]))
        if named.get("id"):
            self.anchors.add(str(named["id"]))


@pytest.fixture(scope="module")
def written(make_run: Callable[..., RunFolder], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of one experiment with a report, variants of its trackers, and one that has no data."""
    folder = tmp_path_factory.mktemp("replication")
    small = {
        "told": True,
        "paper": "kitti",
        "scenes": ("one",),
        "trackers": ("lucas-kanade",),
        "speeds": (1,),
        "n_frames": 14,
    }
    run = RunFolder(shutil.copytree(make_run(**small).path, folder / "kitti"))
    write_report(run, figure_formats=())
    others = {reading: make_run(**small, **OTHERS[reading]) for reading in OTHERS}
    replicated = [
        Replicated("dtu", "No <data>: nothing there."),
        Replicated("kitti", "1 scene in /data.", run, run, others),
        Replicated("gazebo-linear", "Simulated.", make_run(**small)),
    ]
    assert write_replication(folder, replicated) == folder / "index.html"
    return folder


@pytest.mark.parametrize("page", ["index.html", "differences.html"])
def test_pages_stand_alone(written: Path, page: str) -> None:
    text = (written / page).read_text(encoding="utf-8")
    assert not re.search(r"<(script|link|img|iframe)\b", text)
    assert "default-src 'none'" in text


def test_every_link_leads_somewhere(written: Path) -> None:
    links = Links(written / "index.html")
    assert "kitti/report/index.html#factor-effects" in links.targets
    for target in set(links.targets) - {"https://arxiv.org/abs/2303.14315"}:
        place, _, anchor = target.partition("#")
        page = written / (place or "index.html")
        if "/kitti/" in f"/{target}" or not place.endswith("report/index.html"):
            assert page.is_file(), target
            assert not anchor or anchor in Links(page).anchors, target


def test_every_figure_family_of_a_report_is_linked(written: Path) -> None:
    page = "kitti/report/index.html#"
    linked = {t.removeprefix(page) for t in Links(written / "index.html").targets if t.startswith(page)}
    text = (written / "kitti" / "report" / "index.html").read_text(encoding="utf-8")
    sections = re.split(r'<(?:section|details class="entry") id="', text)[1:]
    drawn = [section.partition('"')[0] for section in sections if '<figure id="figure-' in section]
    assert len(drawn) > 4
    assert linked - {"factor-effects"} == set(drawn)


def test_figures_under_every_reading_stand_side_by_side(written: Path) -> None:
    text = (written / "figures.html").read_text(encoding="utf-8")
    shown = re.findall(r'<img src="([^"]+)"', text)
    assert all((written / file).is_file() for file in shown)
    kitti = [file for file in shown if file.startswith("figures/0/")]
    names = {file.rpartition("-")[0] for file in kitti}
    assert {f"{name}-{reading}.svg" for name in names for reading in Reading} == set(kitti)
    assert "figures/0/error-by-age" in names
    assert not any(name.endswith("trimmed") for name in names)
    one, other = (written / f"figures/0/error-by-age-{reading}.svg" for reading in (Reading.none, Reading.all))
    assert one.read_bytes() != other.read_bytes()
    assert "No curve: too few features" in text  # of the experiment that was run under one reading only


def test_every_claim_is_judged_under_every_reading(written: Path) -> None:
    with (written / "claims.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(Reading) * len([*claims(), *cells()])
    judged = {row["experiment"] for row in rows if row["reason"] != "the experiment was not repeated"}
    assert judged == {"kitti", "gazebo-linear"}
    text = (written / "index.html").read_text(encoding="utf-8")
    assert all(claim.text in text for claim in (*claims(), *cells()) if claim.experiment in judged)


def test_what_could_not_be_repeated_says_why(written: Path) -> None:
    text = (written / "index.html").read_text(encoding="utf-8")
    assert "<strong>Not repeated.</strong> No &lt;data&gt;: nothing there." in text
    assert "tables have 20 cells" in text


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path, run: RunFolder) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(StoreError, match="cannot be written"):
        write_replication(tmp_path / "file", [Replicated("kitti", "found", run)])
