"""What lies beside the images, and that it is looked at once however many sequences depend on it."""

from pathlib import Path

import pytest

from tracknoise.experiments.running.inputs import with_inputs
from tracknoise.experiments.running.plan import plan
from tracknoise.experiments.settings import Experiment, parse_experiment

TEXT = """
name = "x"
[dataset]
reader = "simulated"
options = { motions = ["sideways", "arvr"], world = "objects", models = "MODELS" }
[[trackers]]
kind = "imported"
options = { path = "TRACKS/{scene}.csv" }
"""


@pytest.fixture
def experiment(tmp_path) -> Experiment:
    models, tracks = tmp_path / "models", tmp_path / "tracks"
    for folder in (models / "box", tracks):
        folder.mkdir(parents=True)
    (models / "box" / "model.config").write_text("<model/>")
    (models / "box" / "model.sdf").write_text("<sdf/>")
    for scene in ("sideways-00", "arvr-00"):
        (tracks / f"{scene}.csv").write_text(scene)
    return parse_experiment(TEXT.replace("MODELS", str(models)).replace("TRACKS", str(tracks)), place="x.toml")


def digests(experiment: Experiment) -> dict[str, str]:
    return {task.sequence.scene: task.inputs for task in with_inputs(plan(experiment))}


def test_a_file_counts_for_the_sequences_that_depend_on_it(experiment, tmp_path):
    before = digests(experiment)
    (tmp_path / "tracks" / "arvr-00.csv").write_text("other")
    after = digests(experiment)
    assert after["sideways-00"] == before["sideways-00"]
    assert after["arvr-00"] != before["arvr-00"]


@pytest.mark.parametrize("change", ["size", "name"])
def test_of_a_folder_names_and_sizes_count(experiment, tmp_path, change):
    before, model = digests(experiment), tmp_path / "models" / "box" / "model.sdf"
    model.write_text("<sdf></sdf>") if change == "size" else model.rename(model.with_name("other.sdf"))
    after = digests(experiment)
    assert not set(after.values()) & set(before.values())


def test_a_folder_is_walked_once(experiment, monkeypatch):
    walked, walk = [], Path.rglob

    def spy(self, pattern):
        walked.append(self.name)
        return walk(self, pattern)

    tasks = plan(experiment)
    monkeypatch.setattr(Path, "rglob", spy)
    assert len(with_inputs(tasks)) == 2
    assert walked == ["models"]
