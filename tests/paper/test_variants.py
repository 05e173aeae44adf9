"""Which of the paper's experiments the data allow, and the variants of their trackers."""

from pathlib import Path

import pytest

from tracknoise.exceptions import DataError
from tracknoise.experiments.load import load_experiment
from tracknoise.experiments.plan import make_trackers, plan
from tracknoise.experiments.run_statistics import first_lighting
from tracknoise.paper.variants import Candidate, Limits, candidates, load_candidate, variants

LINEAR = Candidate("gazebo-linear", None, True, "")


def test_without_data_only_the_simulations_can_be_repeated() -> None:
    assert [(item.preset, item.possible) for item in candidates([])] == [
        ("dtu", False), ("kitti", False), ("gazebo-linear", True), ("gazebo-arvr", True),
    ]  # fmt: skip


def test_data_that_are_not_there_are_said_in_one_line(tmp_path: Path) -> None:
    dtu, kitti, *_ = candidates([tmp_path])
    for item in (dtu, kitti):
        assert not item.possible
        assert item.found.startswith(f"No data: {tmp_path}: ")
        assert "\n" not in item.found


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="nowhere: no such directory"):
        candidates([tmp_path, tmp_path / "nowhere"])


def test_data_are_found_in_a_folder_within(sample, tmp_path: Path) -> None:
    (tmp_path / "some").mkdir()
    (tmp_path / "drives").symlink_to(sample("kitti"))
    kitti = candidates([tmp_path / "some", tmp_path])[1]
    assert kitti.possible
    assert kitti.root in (tmp_path, tmp_path / "drives")
    assert kitti.found == f"1 scene in {kitti.root}."
    assert load_candidate(kitti, Limits(frames=5)).dataset.max_frames == 5


def test_limits_are_those_of_the_experiment() -> None:
    dataset = load_candidate(LINEAR, Limits(scenes=2, frames=7)).dataset
    assert (dataset.max_scenes, dataset.max_frames) == (2, 7)


def test_models_in_a_folder_within_go_to_simulated_worlds(tmp_path: Path) -> None:
    (tmp_path / "gazebo" / "oak").mkdir(parents=True)
    *_, without = candidates([tmp_path])
    assert (without.root, without.found) == (None, "Simulated; no data are needed.")
    (tmp_path / "gazebo" / "oak" / "model.config").touch()
    _, kitti, linear, _ = candidates([tmp_path])
    assert linear.found == f"Simulated, of the Gazebo models in {tmp_path / 'gazebo'}."
    dataset = load_candidate(linear, Limits()).dataset
    assert (dataset.root, dataset.options["models"]) == (None, str(tmp_path / "gazebo"))
    assert not kitti.possible


def test_variants_try_every_way_to_reject_outliers_on_one_scene_seen_plainly() -> None:
    experiment = load_experiment("gazebo-linear")
    varied = variants(experiment)
    assert [choice.label for choice in varied.trackers] == [
        "lucas-kanade, hypothesis",
        "lucas-kanade, refined",
        "correspondence, first, hypothesis",
        "correspondence, first, refined",
        "correspondence, previous, hypothesis",
        "correspondence, previous, refined",
    ]
    rejections = [tracker.rejection for tracker in make_trackers(varied).values()]
    assert [str(rejection.consensus) for rejection in rejections] == ["hypothesis", "refined"] * 3
    assert [str(rejection.reference) for rejection in rejections[2:]] == ["first", "first", "previous", "previous"]
    (task,) = plan(varied)
    assert (task.sequence.scene, task.sequence.rotation, str(task.sequence.direction)) == ("linear-00", 0, "forward")
    assert task.speeds == (1,)
    assert varied.name == "gazebo-linear-differences"
    assert varied.paper is None
    assert experiment.paper == "gazebo-linear"


def test_one_variant_is_the_experiments_own_tracker() -> None:
    experiment = load_experiment("gazebo-arvr")
    own, tried = make_trackers(experiment), make_trackers(variants(experiment))
    assert tried["correspondence, first, hypothesis"] == own["correspondence"]
    assert tried["lucas-kanade, hypothesis"] == own["lucas-kanade"]


@pytest.mark.parametrize(
    ("lightings", "named", "expected"),
    [
        ({"LR0", "BF0", "diffuse"}, None, "diffuse"),
        ({"east", "default"}, None, "default"),
        ({"west", "east"}, None, "east"),
        ({"LR10", "LR9"}, None, "LR9"),
        ({"LR0", "diffuse"}, ["LR0", "diffuse"], "LR0"),
        ({"diffuse"}, ["LR0", "diffuse"], "diffuse"),
    ],
)
def test_the_first_lighting(lightings: set[str], named: list[str] | None, expected: str) -> None:
    experiment = load_experiment("demo")
    chosen = experiment.model_copy(update={"dataset": experiment.dataset.model_copy(update={"lightings": named})})
    assert first_lighting(lightings, chosen) == expected
