"""A run with a noise model, fitted once for all processes that run the tests."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from tests.noise_models.conftest import planted_run

from tracknoise.report.noise_fits import noise_fits
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder

__all__ = ["fitted_run", "planted_run"]


@pytest.fixture(scope="session")
def fitted_run(
    made_once: Callable[[str, Callable[[Path], object]], Path],
    planted_run: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> RunFolder:
    """A run whose report was written before, as far as its models are concerned: a copy for every process."""

    def fit(path: Path) -> None:
        shutil.copytree(planted_run, path)
        noise_fits(ReportData.of(RunFolder(path)))

    original = made_once("fitted-run", fit)
    return RunFolder(shutil.copytree(original, tmp_path_factory.mktemp("fitted") / "run"))
