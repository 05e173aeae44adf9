"""Fixtures that the paper's experiments share with the tests of the report."""

from tests.report.conftest import run
from tests.report.runs import make_run

__all__ = ["make_run", "run"]
