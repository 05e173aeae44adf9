"""Trackers of one's own among those of known systems."""

import json

import pytest
from tests.lean import without_audit, without_depths, without_figure_files, without_geometry

from tracknoise.experiments.entrants import entrants, step_costs
from tracknoise.experiments.load import load_experiment
from tracknoise.experiments.plan import plan
from tracknoise.report.results_file import Results, Round, TrackerResult, read_results, results_json
from tracknoise.trackers.tracker_registry import load_preset, preset_names

EXPERIMENT = """
name = "mine"
speeds = [2, 1]
[dataset]
reader = "simulated"
options = { motions = ["forward"], worlds = 1, frames = 4, width = 160, height = 120, supersampling = 1 }
[[trackers]]
kind = "lucas-kanade"
name = "my-tracker"
options = { min_features = 20, max_features = 30 }
[[trackers]]
kind = "oracle"
"""


@pytest.fixture
def experiment(tmp_path):
    (tmp_path / "x.toml").write_text(EXPERIMENT)
    return tmp_path / "x.toml"


@pytest.fixture
def quick():
    """Runs of which a test looks at the report alone, whether it is there."""
    with without_audit(), without_depths(), without_figure_files(), without_geometry():
        yield


def of_one_camera():
    return {name for name in preset_names() if load_preset(name).tracker != "second-view"}


def test_the_own_trackers_come_first_and_every_preset_takes_part_once(experiment):
    names = entrants(load_experiment(experiment))
    assert names[:2] == ["my-tracker", "oracle"]
    assert of_one_camera() | {"lucas-kanade", "correspondence", "dense-flow", "patch"} <= set(names)
    assert len(names) == len(set(names))


def test_the_built_in_tournament_has_every_preset():
    assert of_one_camera() < set(entrants(load_experiment("tournament")))


@pytest.mark.usefixtures("quick")
def test_a_tournament_is_measured_at_full_rate_and_resumes(tracknoise, experiment):
    run = experiment.parent / "run"
    named = "my-tracker,oracle,openvins"
    command = ["tournament", str(experiment), "--out", str(run), "--trackers", named, "-w", "1"]
    code, out, _ = tracknoise(*command)
    assert code == 0
    assert f"report: {run / 'report' / 'index.html'}" in out
    settings = load_experiment(run / "experiment.toml")
    assert settings.speeds == [1]
    costs = json.loads((run / "statistics" / "costs.json").read_text())
    assert list(costs) == ["my-tracker", "openvins"]  # the oracle knows the truth
    assert all(cost > 0 for cost in costs.values())
    code, _, err = tracknoise(*command)
    assert code == 0
    assert "resuming: 1 of 1 sequence already measured" in err


def test_costs_are_of_a_sequence_that_was_measured(experiment):
    experiment.write_text(experiment.read_text().replace("worlds = 1", "worlds = 2"))
    loaded = load_experiment(experiment, trackers=["my-tracker"])
    first, second = (task.key for task in plan(loaded))
    assert step_costs(loaded, [second])["my-tracker"] > 0
    assert step_costs(loaded, []) == {}
    assert first != second


def test_a_tracker_that_is_not_known_is_named_in_one_line(tracknoise, experiment):
    code, out, err = tracknoise("tournament", str(experiment), "--trackers", "nobody", "--quiet")
    assert (code, out) == (1, "")
    assert err.count("\n") == 1
    assert "nobody" in err


def test_a_step_of_a_tracker_with_more_to_do_costs_more(experiment):
    text = experiment.read_text().replace('kind = "oracle"', 'kind = "correspondence"')
    experiment.write_text(text.replace("width = 160, height = 120", "width = 480, height = 360"))
    loaded = load_experiment(experiment)
    costs = step_costs(loaded, [task.key for task in plan(loaded)])
    assert costs["correspondence"] > 2 * costs["my-tracker"]


@pytest.mark.usefixtures("quick")
def test_trackers_join_the_rounds_of_a_file_of_results(tracknoise, experiment, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    both, to = ["--trackers", "my-tracker,oracle"], ["--to", "all.json", "-w", "1"]
    code, _, err = tracknoise("tournament", str(experiment), "--out", "run", *both, *to)
    assert code == 0, err
    (tmp_path / "added.toml").write_text(EXPERIMENT.replace("my-tracker", "added").replace("frames = 4", "frames = 9"))
    code, out, err = tracknoise("tournament", "--add", "added.toml", *to)
    assert code == 0, err
    assert "mine: truth " in out
    found = json.loads((tmp_path / "all.json").read_text())["rounds"]["mine"]
    assert list(found["trackers"]) == ["my-tracker", "oracle", "added"]
    assert {sequence["frames"] for sequence in found["sequences"].values()} == {"4"}  # those of the round
    assert "replaces" not in err
    alone = EXPERIMENT.removesuffix('[[trackers]]\nkind = "oracle"\n')
    (tmp_path / "added.toml").write_text(alone.replace("my-tracker", "oracle"))
    code, _, err = tracknoise("tournament", "--add", "added.toml", *to, "--out", "again")
    assert code == 0, err
    assert "round mine: oracle replaces the results of a tracker of this name with other options" in err
    changed = (tmp_path / "all.json").read_text().replace('"numpy": "', '"numpy": "0.')
    (tmp_path / "all.json").write_text(changed)
    code, _, err = tracknoise("tournament", "--add", "added.toml", *to, "--out", "again")
    assert code == 1
    assert "round mine: version of numpy: found " in err
    assert (tmp_path / "all.json").read_text() == changed


def test_rounds_without_their_data_are_left_out(tracknoise, experiment, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = results_json(Results({"far": Round("", "kitti", {}, {}, {}, 0.1, "trusted", "")}))
    (tmp_path / "all.json").write_text(text)
    code, _, err = tracknoise("tournament", "--add", str(experiment), "--to", "all.json", "--data", str(tmp_path))
    assert code == 2
    assert "round far is left out: its data are kitti, expected in the folder of --data" in err


def test_adding_needs_a_file_of_results(tracknoise, experiment):
    code, _, err = tracknoise("tournament", "--add", str(experiment))
    assert code == 1
    assert "--add: found no --to, expected the file of results that trackers are added to" in err


def test_trackers_of_one_camera_join_no_round_of_the_other(tracknoise, experiment, tmp_path):
    second = TrackerResult("second-view", {}, None, None, None, "", {})
    pairs = Round("", "", {}, {}, {}, 0.1, "trusted", "", {"openvins-stereo": second})
    to = tmp_path / "all.json"
    to.write_text(results_json(Results({"pairs": pairs})))
    code, _, err = tracknoise("tournament", "--add", str(experiment), "--to", str(to))
    assert code == 0, err
    assert "round pairs is of errors in the other camera" in err
    assert list(read_results(to).rounds["pairs"].trackers) == ["openvins-stereo"]
