"""``tracknoise replicate``, as a user types it, on experiments cut down to be quick."""

import re

import pytest
from tests.lean import without_audit, without_depths, without_figure_files, without_geometry

from tracknoise.experiments.load import load_experiment
from tracknoise.experiments.settings import ViewSettings
from tracknoise.paper import variants


@pytest.fixture
def small(monkeypatch):
    """Presets with one tracker, one speed and small images, no audit and no files of figures, which take seconds."""

    def load(name, **options):
        experiment = load_experiment(name, **options)
        size = {"width": 160, "height": 120, "supersampling": 1}
        dataset = experiment.dataset.model_copy(update={"options": {**experiment.dataset.options, **size}})
        return experiment.model_copy(
            update={"dataset": dataset, "speeds": [1], "trackers": experiment.trackers[:1], "views": [ViewSettings()]}
        )

    monkeypatch.setattr(variants, "load_experiment", load)
    with without_audit(), without_depths(), without_geometry(), without_figure_files():
        yield


ONCE = ("--scenes", "1", "--frames", "2", "-w", "1")


def test_one_experiment_that_fails_does_not_stop_the_others_and_nothing_is_measured_again(
    tracknoise, small, tmp_path, monkeypatch
):
    out = tmp_path / "out"
    (out / "gazebo-linear").mkdir(parents=True)
    (out / "gazebo-linear" / "holiday.jpg").write_bytes(b"")
    code, printed, err = tracknoise("replicate", "--out", str(out), *ONCE)
    assert code == 2
    assert "dtu: No data folder was given (--data)." in err
    assert f"gazebo-linear: {out / 'gazebo-linear'}: contains files that are not a run" in err
    assert f"replication: {(out / 'index.html').resolve()}" in printed
    runs = {path.parent.name for path in out.glob("*/manifest.json")}
    assert runs == {"gazebo-linear-differences", "gazebo-arvr", "gazebo-arvr-differences"}
    assert (out / "gazebo-arvr" / "report" / "index.html").is_file()
    assert (out / "differences.html").is_file()
    assert {path.parent.name for path in out.glob("readings/*/manifest.json")} == {
        "gazebo-arvr-none",
        "gazebo-arvr-followed",
    }
    assert "Gazebo AR/VR: verdicts with untrimmed errors (none)" in printed
    assert "Gazebo Linear: verdicts" not in printed
    claim = "The mean error of lucas-kanade drifts with age."
    (line,) = [line for line in printed.splitlines() if line.startswith(claim)]
    assert len(re.findall(r"agrees|opposite sign|disagrees|cannot be judged", line)) == 3
    assert err.count("measured arvr-00") == 2
    monkeypatch.setattr(variants, "SIMULATED", ("gazebo-arvr",))
    code, _, err = tracknoise("replicate", "--out", str(out), *ONCE)
    assert code == 0
    assert err.count("resuming: 1 of 1 sequence already measured") == 2
    assert "measured arvr-00" not in err


def test_a_folder_of_data_that_is_not_there_is_an_error(tracknoise, tmp_path):
    out = tmp_path / "out"
    code, printed, err = tracknoise("replicate", "--data", str(tmp_path / "wrong"), "--out", str(out))
    assert (code, printed) == (1, "")
    assert err == f"tracknoise: error: {tmp_path / 'wrong'}: no such directory, expected a data set's folder\n"
    assert not out.exists()


def test_where_nothing_can_be_measured_that_is_an_error(tracknoise, tmp_path, monkeypatch):
    monkeypatch.setattr(variants, "SIMULATED", ("nothing-like-it",))
    code, printed, err = tracknoise("replicate", "--out", str(tmp_path / "out"), "--quiet")
    assert code == 1
    assert printed == ""
    assert err.count("unknown experiment file or preset 'nothing-like-it'") == 2
    assert err.endswith("tracknoise: error: none of the paper's experiments could be measured\n")
