"""A browser for the tests of pages, if this system has one, and made-up runs to show."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from tests.browser import chromium
from tests.estimators.conftest import planted_run
from tests.report.fitted import fitted_run
from tests.report.runs import make_run

from tracknoise.report.page import write_report
from tracknoise.tables.store import RunFolder

__all__ = ["fitted_run", "make_run", "planted_run"]


@pytest.fixture(scope="session")
def run(make_run: Callable[..., RunFolder], made_once: Callable[..., Path]) -> RunFolder:
    """A run with a report whose figures have no files. Not to be changed."""
    made_up = make_run(told=True, scenes=("fixating", "forward"), n_frames=20, born=20, min_features=20, patches=True)

    def write(folder: Path) -> None:
        shutil.copytree(made_up.path, folder / "run")
        write_report(RunFolder(folder / "run"))

    return RunFolder(made_once("shown-report", write) / "run")


@pytest.fixture(scope="session")
def report(run: RunFolder) -> Path:
    """Its page."""
    return run.path / "report" / "index.html"


@pytest.fixture(scope="session")
def fitted_report(fitted_run: RunFolder) -> Path:
    """The page of a run with a noise model, without files of figures."""
    return write_report(fitted_run)


@pytest.fixture(scope="session")
def pipe(tmp_path_factory: pytest.TempPathFactory) -> Iterator[object]:
    """A browser; tests are skipped where none is installed."""
    if chromium.installed() is None:
        pytest.skip(f"no browser is installed (one of {', '.join(chromium.NAMES)})")
    with chromium.browser(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.fixture
def open_page(pipe: object) -> Iterator[Callable[..., chromium.Page]]:
    """Opens a file in a tab of its own, which is closed after the test."""
    with chromium.tab(pipe) as page:

        def opened(path: object, *, width: int = 1280, height: int = 768, dark: bool = False) -> chromium.Page:
            page.size(width, height, dark=dark)
            page.goto(f"file://{path}")
            return page

        yield opened
