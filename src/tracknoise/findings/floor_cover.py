"""Whether an error may come from the truth alone: an error beside its truth floor.

A mean error is covered if it lies within two standard deviations of what the errors of the truth add to the mean. The
growth of a second moment is covered if it is at most twice the growth of the floor: the errors of the poses of a few
stretches scatter about their expected size, and that size is itself known roughly only.
"""

from dataclasses import dataclass
from math import sqrt

SIGMAS = 2.0
_VARIANCES = 2.0


@dataclass(frozen=True, slots=True)
class FloorCover:
    """An error and what the truth can cause.

    Attributes
    ----------
    error_px
        Size of the error, px.
    limit_px
        Largest size that errors of the truth can explain, px.
    """

    error_px: float
    limit_px: float

    @property
    def is_covered(self) -> bool:
        """Whether the error of the truth alone can explain the error."""
        return self.error_px <= self.limit_px


def cover_of_mean(mean_px: float | None, floor_mean_px: float | None) -> FloorCover | None:
    """A mean error beside its floor; None where either is unknown, or the truth is exact.

    Parameters
    ----------
    mean_px
        Mean error of a coordinate, px.
    floor_mean_px
        Standard deviation of what the errors of the truth add to it, px.
    """
    if mean_px is None or not floor_mean_px:
        return None
    return FloorCover(abs(mean_px), SIGMAS * floor_mean_px)


def cover_of_second(second: float | None, floor: float | None) -> FloorCover | None:
    """A second moment, or its growth, beside that of the floor; None where either is unknown, or the truth is exact.

    Parameters
    ----------
    second
        Second moment of a coordinate, or its growth between two ages, px^2.
    floor
        The same of the truth floor, px^2.
    """
    if second is None or floor is None or floor <= 0.0:
        return None
    return FloorCover(sqrt(max(second, 0.0)), sqrt(_VARIANCES * floor))


def covered_by_floor(*found: FloorCover | None) -> bool:
    """Whether there is an error at all, and errors of the truth alone can explain each."""
    known = [one for one in found if one is not None]
    return bool(known) and len(known) == len(found) and all(one.is_covered for one in known)
