"""Run folders with links below them: nothing is written, removed or read where they lead."""

import os
import shutil

import pytest
from tests.writers.program import small_experiment

from tracknoise.atomic import UNFINISHED
from tracknoise.cli.app import main
from tracknoise.tables.store import RunFolder

LEFT = f".a.parquet.1.0{UNFINISHED}"
"""A file that a killed process left."""


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """The folder of a small experiment and its run."""
    folder = tmp_path_factory.mktemp("measured")
    (folder / "x.toml").write_text(small_experiment('kind = "lucas-kanade"'))
    with pytest.raises(SystemExit, match="0"):
        main(["run", str(folder / "x.toml"), "--out", str(folder / "run"), "-w", "1", "--no-report", "--quiet"])
    return folder


@pytest.fixture
def resumed(measured, tracknoise):
    """Run the experiment into a folder."""

    def go(run, *options):
        return tracknoise(
            "run", str(measured / "x.toml"), "--out", str(run), "-w", "1", "--no-report", "--quiet", *options
        )

    return go


@pytest.fixture
def elsewhere(tmp_path):
    """A file and a folder that are none of the run's business; called, they must be as they were."""
    (tmp_path / "elsewhere").mkdir()
    files = {"file": "dear diary", LEFT: "the same", "folder/kept": "too"}
    for name, text in files.items():
        (tmp_path / "elsewhere" / name).parent.mkdir(exist_ok=True)
        (tmp_path / "elsewhere" / name).write_text(text)

    def require_untouched() -> None:
        there = (path for path in (tmp_path / "elsewhere").rglob("*") if path.is_file())
        assert {str(path.relative_to(tmp_path / "elsewhere")): path.read_text() for path in there} == files

    return require_untouched


LINKS = [
    (".lock", "elsewhere/file"),
    (".lock", "elsewhere/new"),
    ("statistics", "elsewhere"),
    ("inputs", "elsewhere"),
    ("snapshots", "elsewhere"),
    ("report", "elsewhere"),
    ("parts/a", "elsewhere/folder"),
    ("manifest.json", "elsewhere/file"),
    ("moments/a.parquet", "elsewhere/file"),
]


@pytest.mark.parametrize("fresh", [False, True])
@pytest.mark.parametrize(("name", "leads"), LINKS)
def test_a_run_is_not_resumed_or_replaced_through_links(measured, resumed, elsewhere, tmp_path, name, leads, fresh):
    run, link = shutil.copytree(measured / "run", tmp_path / "run"), tmp_path / "run" / name
    shutil.rmtree(link) if link.is_dir() else link.unlink(missing_ok=True)
    link.parent.mkdir(exist_ok=True)
    link.symlink_to(tmp_path / leads)
    options = ["--fresh"] if fresh else []
    code, out, err = resumed(run, *options)
    assert (code, out, err.count("\n")) == (1, "", 1), err
    assert f"{link}: a link to {tmp_path / leads}, expected no links in this folder; remove it" in err
    elsewhere()


@pytest.mark.parametrize(("name", "leads"), LINKS[2:])
@pytest.mark.parametrize("command", [("report",), ("report", "--text"), ("check",)], ids=" ".join)
def test_a_run_is_not_read_or_written_through_links(whole, tracknoise, elsewhere, tmp_path, name, leads, command):
    run, link = shutil.copytree(whole, tmp_path / "run"), tmp_path / "run" / name
    shutil.rmtree(link) if link.is_dir() else link.unlink(missing_ok=True)
    link.parent.mkdir(exist_ok=True)
    link.symlink_to(tmp_path / leads)
    code, out, err = tracknoise(*command, str(run))
    assert (code, out, err.count("\n")) == (1, "", 1), err
    assert f"{link}: a link to " in err
    elsewhere()


def test_a_lock_that_is_another_file_too_is_refused(measured, resumed, elsewhere, tmp_path):
    run = shutil.copytree(measured / "run", tmp_path / "run")
    os.link(tmp_path / "elsewhere" / "file", run / ".lock")
    code, _, err = resumed(run)
    assert (code, err.count("\n")) == (1, 1)
    assert f"{run / '.lock'}: a file with other names, expected the lock of a run; remove it" in err
    elsewhere()


def test_a_new_run_does_not_follow_a_link_of_its_lock(resumed, elsewhere, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / ".lock").symlink_to(tmp_path / "elsewhere" / "file")
    code, _, err = resumed(tmp_path / "run")
    assert (code, err.count("\n")) == (1, 1)
    assert ".lock: a link to " in err
    elsewhere()


def test_a_link_to_the_run_folder_is_followed(measured, resumed, tmp_path):
    shutil.copytree(measured / "run", tmp_path / "run")
    (tmp_path / "link").symlink_to(tmp_path / "run")
    code, _, err = resumed(tmp_path / "link")
    assert (code, err) == (0, "")
    assert RunFolder(tmp_path / "run").manifest() == RunFolder(measured / "run").manifest()
