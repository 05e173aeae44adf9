"""A run with a noise model, fitted once for all processes that run the tests."""

import shutil
from pathlib import Path

import pytest
from tests.estimators.conftest import planted_run

from tracknoise.tables.store import RunFolder

__all__ = ["fitted_run", "planted_run"]


@pytest.fixture(scope="session")
def fitted_run(planted_run: Path, tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """A run with its model: a copy for every process."""
    return RunFolder(shutil.copytree(planted_run, tmp_path_factory.mktemp("fitted") / "run"))
