"""Run folders of made-up measurements, and the module that makes them."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest
from altair.utils.schemapi import debug_mode
from tests.estimators.conftest import planted_run
from tests.report import synthetic as module
from tests.report.fitted import fitted_run
from tests.report.runs import make_run

from tracknoise.report.figure_files import FORMATS
from tracknoise.report.page import write_report
from tracknoise.tables.store import RunFolder

__all__ = ["fitted_run", "make_run", "planted_run"]


@pytest.fixture(scope="module", autouse=True)
def unchecked_parts() -> Iterator[None]:
    """Figures are made as in a program: Altair checks none of their parts. `tests/contract` checks them whole."""
    with debug_mode(False):
        yield


@pytest.fixture(scope="session")
def synthetic() -> ModuleType:
    """Worlds to make runs of."""
    return module


@pytest.fixture(scope="session")
def run(make_run: Callable[..., RunFolder]) -> RunFolder:
    """Two scenes, two trackers, two speeds, and sentences."""
    return make_run(told=True)


@pytest.fixture(scope="session")
def whole_report(make_run: Callable[..., RunFolder], made_once: Callable[..., Path]) -> Path:
    """The folder of a run with its report, whose figures are written in all formats. Not to be changed."""
    run = make_run(told=True, scenes=("forward",), trackers=("lucas-kanade",), speeds=(1,), n_frames=10, born=40)

    def write(folder: Path) -> None:
        shutil.copytree(run.path, folder)
        write_report(RunFolder(folder), figure_formats=FORMATS)

    return made_once("whole-report", write)


@pytest.fixture
def own_run(make_run: Callable[..., RunFolder], tmp_path: Path) -> RunFolder:
    """A small run that a test may change."""
    run = make_run(scenes=("one",), trackers=("one",), speeds=(1,), n_frames=6, born=4)
    return RunFolder(shutil.copytree(run.path, tmp_path / "run"))
