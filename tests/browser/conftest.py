"""A browser for the tests of pages, if this system has one, and made-up runs to show."""

from collections.abc import Callable, Iterator

import pytest
from tests.browser import chromium
from tests.estimators.conftest import planted_run
from tests.report.fitted import fitted_run
from tests.report.runs import make_run

__all__ = ["fitted_run", "make_run", "planted_run"]


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
