"""Kinds of intervals, the usual kind, and the usual level."""

from enum import StrEnum


class IntervalKind(StrEnum):
    """Method of intervals.

    student: jackknife with Student's distribution. percentile, bca: bootstrap.
    """

    student = "student"
    percentile = "percentile"
    bca = "bca"


LEVEL = 0.95
"""Share of intervals that hold the true value."""
KIND_OF_INTERVAL = IntervalKind.student
"""How intervals are made."""
