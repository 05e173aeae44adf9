"""Enumerations of names that tables hold."""

from enum import StrEnum


class Aspect(StrEnum):
    """Which errors, and in which axes, a row is about.

    all: errors of all tracks in image axes. change: their changes from one frame of the tracker to the next. gradient
    and motion: errors along and across the dominant image gradient where the feature was first seen, or the motion of
    its true position. long_lived: errors in image axes of tracks that were seen at some age or later.
    """

    all = "all"
    change = "change"
    gradient = "gradient"
    long_lived = "long_lived"
    motion = "motion"
