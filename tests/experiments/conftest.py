"""Small scenes on disk that are measured in a moment, and what a run of them left."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.lean import measured_only, with_findings, without_findings

from tracknoise.experiments.execute import execute
from tracknoise.experiments.load import load_experiment
from tracknoise.experiments.settings import Experiment
from tracknoise.tables.store import RunFolder


def pytest_assertrepr_compare(op: str, left: object, right: object) -> list[str] | None:
    """Contents of files that differ are named, not printed."""
    if op != "==" or not (_are_contents(left) and _are_contents(right)):
        return None
    names = sorted(name for name in {*left, *right} if left.get(name) != right.get(name))
    return ["the same files", *(str(name) for name in names), f"are {len(names)} that differ or are missing"]


def _are_contents(value: object) -> bool:
    return isinstance(value, dict) and all(isinstance(content, bytes) for content in value.values())


TEXT = """
name = "x"
[dataset]
reader = "sevenscenes"
root = "data"
[truth]
poses = "stated"
[[trackers]]
kind = "oracle"
options = { n_features = 20, margin_px = 2 }
[statistics]
min_features = 2
"""
"""To refine poses takes a third of what it takes to measure a scene: `tests/experiments/test_kills.py` and the runs of
`tests/cli` do it."""


class Told:
    """Listens to a run and keeps what it was told."""

    def __init__(self):
        self.keys, self.failures, self.remarks, self.done = [], {}, [], 0

    def planned(self, keys, done):
        self.done = done

    def frame(self, key, done, total, first): ...

    def measured(self, key, entry):
        self.keys.append(key)

    def failed(self, keys, cause):
        self.failures |= dict.fromkeys(keys, cause)

    def remark(self, text):
        self.remarks.append(text)


@pytest.fixture
def told() -> Callable[[], Told]:
    return Told


@pytest.fixture(scope="module", autouse=True)
def unfound() -> Iterator[None]:
    """Runs have the statistics of their scenes, and findings only where a test wants them (`found`)."""
    with without_findings():
        yield


@pytest.fixture
def found() -> Iterator[None]:
    """Findings are made as in a program, of a `finished` run too."""
    with with_findings():
        yield


@pytest.fixture
def lean() -> Iterator[None]:
    """Runs are measured, and nothing is computed of them. Not for tests of a `finished` run, which has statistics."""
    with measured_only():
        yield


@pytest.fixture
def experiment_file(tmp_path) -> Callable[..., Path]:
    """Writes so many scenes in 7-Scenes' layout, ``seq-01`` and so on, and an experiment on them."""
    return lambda *arguments: write_experiment(tmp_path, *arguments)


@pytest.fixture
def shared_file(made_once) -> Callable[..., Path]:
    """As `experiment_file`, but written once for all tests, none of which may change the scenes."""

    def written(count: int, n_frames: int = 4) -> Path:
        folder = made_once(f"scenes-{count}-{n_frames}", lambda path: write_experiment(path, count, n_frames))
        return folder / "x.toml"

    return written


@pytest.fixture
def finished(request, made_once, shared_file, tmp_path) -> Callable[..., tuple[Experiment, RunFolder]]:
    """Gives an experiment on so many scenes, and a finished run of it for the test to change, measured only once."""

    def copy(
        count: int, n_frames: int = 4, *, keep: str = "observations", most: int | None = None
    ) -> tuple[Experiment, RunFolder]:
        experiment = load_experiment(shared_file(count, n_frames)).model_copy(update={"keep": keep}).with_scenes(most)
        found = "-found" if "found" in request.fixturenames else ""
        name = f"run-{count}-{n_frames}-{keep}-{most}{found}"
        original = made_once(name, lambda path: execute(experiment, RunFolder(path), listener=Told()))
        return experiment, RunFolder(shutil.copytree(original, tmp_path / name / "run"))

    return copy


@pytest.fixture
def scenes(experiment_file) -> Callable[..., Experiment]:
    """Writes so many scenes and gives the experiment on them."""
    return lambda *arguments: load_experiment(experiment_file(*arguments))


def write_experiment(folder: Path, count: int, n_frames: int = 4) -> Path:
    for number in range(1, count + 1):
        write_scene(folder / "data" / f"seq-{number:02d}", n_frames, number)
    path = folder / "x.toml"
    path.write_text(TEXT)
    return path


def write_scene(folder: Path, n_frames: int, seed: int) -> None:
    """A textured wall at 0.585 m, seen by a camera that moves right by 2 px a frame."""
    folder.mkdir(parents=True)
    wall = np.random.default_rng(seed).integers(0, 256, (48, 64 + 2 * n_frames), dtype=np.uint8)
    for index in range(n_frames):
        pose = np.eye(4)
        pose[0, 3] = index * 2e-3
        name = f"frame-{index:06d}"
        cv2.imwrite(str(folder / f"{name}.color.png"), wall[:, 2 * index : 2 * index + 64])
        cv2.imwrite(str(folder / f"{name}.depth.png"), np.full((48, 64), 585, np.uint16))
        np.savetxt(folder / f"{name}.pose.txt", pose)
    np.savetxt(folder / "camera-intrinsics.txt", [[585, 0, 31.5], [0, 585, 23.5], [0, 0, 1]])


@pytest.fixture
def files() -> Callable[[RunFolder], dict[str, bytes]]:
    """Gives the contents of all files of a run that must not depend on how it was done."""

    def contents(run: RunFolder) -> dict[str, bytes]:
        names = ("*/*.parquet", "*/*.png", "experiment.toml", "failures.jsonl")
        paths = sorted(path for name in names for path in run.path.glob(name))
        return {str(path.relative_to(run.path)): path.read_bytes() for path in paths}

    return contents
