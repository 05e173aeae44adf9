"""The pages that join the runs of a replication."""

import re
import shutil
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest

from tracknoise.exceptions import StoreError
from tracknoise.report.page import write_report
from tracknoise.report.replication import Replicated, write_replication
from tracknoise.tables.store import RunFolder


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
    small = {"paper": "kitti", "scenes": ("one",), "trackers": ("lucas-kanade",), "speeds": (1,)}
    run = RunFolder(shutil.copytree(make_run(**small).path, folder / "kitti"))
    write_report(run, figure_formats=())
    replicated = [
        Replicated("dtu", "No <data>: nothing there."),
        Replicated("kitti", "1 scene in /data.", run, run),
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
    drawn = [section.partition('"')[0] for section in text.split('<section id="')[1:] if "<figure" in section]
    assert len(drawn) > 4
    assert linked - {"factor-effects"} == set(drawn)


def test_what_could_not_be_repeated_says_why(written: Path) -> None:
    text = (written / "index.html").read_text(encoding="utf-8")
    assert "<strong>Not repeated.</strong> No &lt;data&gt;: nothing there." in text
    assert "tables have 20 cells" in text


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path, run: RunFolder) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(StoreError, match="cannot be written"):
        write_replication(tmp_path / "file", [Replicated("kitti", "found", run)])
