"""A run with planted white noise, measured once."""

from collections.abc import Callable
from pathlib import Path

import pytest
from tests.lean import with_models, without_findings

from tracknoise.cli.app import main
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.run_models import run_models
from tracknoise.experiments.execute import execute
from tracknoise.experiments.load import load_experiment
from tracknoise.tables.store import RunFolder

TEXT = """
name = "{name}"
speeds = {speeds}
[dataset]
reader = "simulated"
[dataset.options]
motions = ["sideways", "forward"]
worlds = 4
frames = 14
width = 160
height = 120
supersampling = 1
[[trackers]]
kind = "oracle"
options = {{ n_features = 120, margin_px = 2, covariance_px2 = [[0.09, 0.0], [0.0, 0.04]], {option} }}
[statistics]
min_features = 2
"""


class Silent:
    """Listens to a run."""

    def planned(self, keys, done): ...

    def frame(self, key, done, total, first): ...

    def measured(self, key, entry): ...

    def failed(self, keys, cause):
        raise AssertionError(cause)

    def remark(self, text): ...


def _measure(path: Path, **settings: object) -> None:
    path.mkdir(parents=True)
    (path / "x.toml").write_text(TEXT.format(**settings))
    execute(load_experiment(path / "x.toml"), RunFolder(path / "run"), listener=Silent())


@pytest.fixture(scope="session")
def planted_run(made_once: Callable[[str, Callable[[Path], object]], Path]) -> Path:
    """Folder of a run of 8 scenes whose oracle has a standard deviation of 0.3 px in u and 0.2 px in v."""

    def measure(path: Path) -> None:
        with with_models():
            _measure(path, name="planted", speeds=[1, 2], option="loss_rate = 0.05")

    return made_once("planted-noise", measure) / "run"


@pytest.fixture(scope="session")
def planted_model(planted_run: Path) -> NoiseModel:
    """The model of its tracker at speed 1, which the run has; `tests/report/test_run_models.py` fits it again."""
    return run_models(RunFolder(planted_run)).models["oracle"]


@pytest.fixture(scope="session")
def fast_model(made_once: Callable[[str, Callable[[Path], object]], Path], planted_run: Path) -> NoiseModel:
    """As `planted_model`, at speed 2."""

    def fit(path: Path) -> None:
        path.write_text(NoiseModel.fit(planted_run, tracker="oracle", speed=2).text)

    return NoiseModel.read(made_once("fast-model.noise.json", fit))


@pytest.fixture(scope="session")
def common_run(made_once: Callable[[str, Callable[[Path], object]], Path]) -> Path:
    """Folder of such a run in which all features of a frame also have an error of 0.2 px in common."""

    def measure(path: Path) -> None:
        with without_findings():
            _measure(path, name="common", speeds=[1], option="common_px = 0.2")

    return made_once("common-noise", measure) / "run"


@pytest.fixture
def tracknoise(capsys):
    def go(*arguments):
        with pytest.raises(SystemExit) as exit_:
            main(list(map(str, arguments)))
        captured = capsys.readouterr()
        return exit_.value.code, captured.out, captured.err

    return go
