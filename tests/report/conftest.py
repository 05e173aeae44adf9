"""Run folders of made-up measurements, and the module that makes them."""

from collections.abc import Callable
from types import ModuleType

import pytest
from tests.estimators.conftest import planted_run
from tests.report import synthetic as module
from tests.report.fitted import fitted_run
from tests.report.runs import make_run

from tracknoise.tables.store import RunFolder

__all__ = ["fitted_run", "make_run", "planted_run"]


@pytest.fixture(scope="session")
def synthetic() -> ModuleType:
    """Worlds to make runs of."""
    return module


@pytest.fixture(scope="session")
def run(make_run: Callable[..., RunFolder]) -> RunFolder:
    """Two scenes, two trackers, two speeds."""
    return make_run()
