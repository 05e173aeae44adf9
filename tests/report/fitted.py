"""A run with a noise model, fitted once for all processes that run the tests."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.estimators.conftest import planted_run

from tracknoise.estimators.run_models import fitted_models
from tracknoise.estimators.training import RunTruth
from tracknoise.tables.store import RunFolder

__all__ = ["fitted_run", "planted_run"]


@pytest.fixture(scope="session")
def fitted_run(
    made_once: Callable[[str, Callable[[Path], object]], Path],
    planted_run: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> RunFolder:
    """A run with its model: a copy for every process."""

    def fit(path: Path) -> None:
        shutil.copytree(planted_run, path)
        run = RunFolder(path)
        run.write_statistics({}, documents=fitted_models(run, ["oracle"], 1, RunTruth.of(run)).documents)

    original = made_once("fitted-run", fit)
    return RunFolder(shutil.copytree(original, tmp_path_factory.mktemp("fitted") / "run"))
