"""Fixtures that the contracts share with the tests of the report."""

from tests.report.runs import make_run

__all__ = ["make_run"]
