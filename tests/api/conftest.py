"""One small finished run for all tests of the API, and the same sequences measured in memory."""

import shutil
from pathlib import Path

import pytest
from tests.lean import with_models

import tracknoise as tn
from tracknoise.experiments.execute import execute
from tracknoise.experiments.settings import parse_experiment
from tracknoise.tables.store import RunFolder

OPTIONS = {"motions": ["forward", "sideways"], "frames": 8, "width": 200, "height": 150, "supersampling": 1}
EXPERIMENT = f"""
name = "demo"
speeds = [1, 2]
[dataset]
reader = "simulated"
options = {{ {", ".join(f"{name} = {value}" for name, value in OPTIONS.items())} }}
[[trackers]]
kind = "lucas-kanade"
[statistics]
min_features = 20
"""
WITHOUT_OBSERVATIONS = """
name = "bare"
keep = "statistics"
[dataset]
reader = "simulated"
options = { motions = ["forward"], frames = 4, width = 64, height = 48, supersampling = 1 }
[[trackers]]
kind = "oracle"
options = { n_features = 20, margin_px = 2 }
"""


class Silent:
    """Listens to a run and says nothing."""

    def planned(self, keys, done): ...

    def frame(self, key, done, total, first): ...

    def measured(self, key, entry): ...

    def failed(self, keys, cause): ...

    def remark(self, text): ...


@pytest.fixture(scope="session")
def place(made_once, tmp_path_factory) -> Path:
    """A folder with ``runs/demo``, measured once: a copy for every process."""
    original = made_once("api-demo", lambda path: _execute(EXPERIMENT, path / "runs" / "demo"))
    return Path(shutil.copytree(original, tmp_path_factory.mktemp("place") / "copy"))


@pytest.fixture(scope="session")
def run(place) -> tn.Run:
    return tn.open_run(place / "runs" / "demo")


@pytest.fixture(scope="session")
def bare_run(tmp_path_factory) -> tn.Run:
    """One that keeps statistics alone."""
    return _execute(WITHOUT_OBSERVATIONS, tmp_path_factory.mktemp("bare") / "run")


@pytest.fixture(scope="session")
def measurements() -> list[tn.Measurement]:
    """What the run measured, measured again."""
    return [tn.measure(one, tn.LucasKanade(), speeds=[1, 2]) for one in tn.open_sequences("simulated", **OPTIONS)]


@pytest.fixture(scope="session")
def analysis(measurements) -> tn.Run:
    with with_models():
        return tn.analyse(measurements, min_features=20)


def _execute(text: str, folder: Path) -> tn.Run:
    with with_models():
        outcome = execute(parse_experiment(text, place="test"), RunFolder(folder), listener=Silent())
    assert not outcome.failures
    return tn.open_run(folder)
