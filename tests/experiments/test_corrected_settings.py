"""A run that failed because of a wrong setting does not block the corrected one."""

import shutil

import pytest
from tests.experiments.test_execute import Silent
from tests.lean import measured_only, of_reader

from tracknoise.exceptions import StoreError
from tracknoise.experiments.execute import execute
from tracknoise.experiments.settings import parse_experiment
from tracknoise.tables.store import RunFolder


@pytest.fixture(scope="module")
def recording(made_once):
    """A recording in the layout of reader folder."""

    def write(folder):
        from tracknoise.cli.app import main

        size = [*of_reader("width=160", "height=120", "supersampling=1")]
        with pytest.raises(SystemExit):
            main(["simulate", "--out", str(folder / "walk"), "--motion", "arvr", "--frames", "4", *size, "--quiet"])

    return made_once("corrected-settings", write)


def experiment(root, *, speeds=(1,)):
    return parse_experiment(
        f'name = "walk"\nspeeds = {list(speeds)}\n[dataset]\nreader = "folder"\nroot = "{root}"\n'
        '[[trackers]]\nkind = "lucas-kanade"\n[statistics]\nmin_features = 5\n',
        place="walk.toml",
    )


def damaged(recording, folder):
    """A copy whose first image is not an image."""
    shutil.copytree(recording, folder)
    next(iter(sorted((folder / "walk" / "images").iterdir()))).write_text("no image")
    return folder


@pytest.mark.usefixtures("lean")
def test_a_wrong_setting_can_be_corrected(recording, tmp_path):
    run = RunFolder(tmp_path / "run")
    bad = damaged(recording, tmp_path / "bad")
    assert execute(experiment(bad, speeds=(1, 2)), run, listener=Silent()).measured == []
    assert execute(experiment(recording), run, listener=Silent()).measured == ["walk@default"]
    assert "speeds = [1]" in run.experiment_toml()


@pytest.fixture(scope="module")
def finished(recording, made_once):
    """A run of the recording, which no test changes."""

    def write(folder):
        with measured_only():
            execute(experiment(recording), RunFolder(folder), listener=Silent())

    return RunFolder(made_once("corrected-settings-run", write))


@pytest.mark.usefixtures("lean")
def test_a_wrong_folder_of_data_can_be_corrected_and_nothing_of_the_failed_run_is_left(recording, finished, tmp_path):
    run = RunFolder(tmp_path / "run")
    first = execute(experiment(damaged(recording, tmp_path / "bad")), run, listener=Silent())
    assert (first.measured, len(first.failures)) == ([], 1)
    second = execute(experiment(recording), run, listener=Silent())
    assert (second.measured, second.failures) == (["walk@default"], {})
    assert files(run) == files(finished)


def files(run):
    return sorted(path.relative_to(run.path) for path in run.path.rglob("*"))


def test_a_run_that_has_measured_something_is_not_replaced(recording, finished, tmp_path):
    run = RunFolder(shutil.copytree(finished.path, tmp_path / "run"))
    with pytest.raises(StoreError, match="speeds"):
        execute(experiment(recording, speeds=(1, 2)), run, listener=Silent())
