"""Values of one statistic in two runs, paired by scene: arrays only."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.findings.factors.differences import Differences, differences


@dataclass(frozen=True, slots=True)
class PairedValues:
    """What changed in every scene from the first run to the second.

    Points are places (ages, frames or lengths of windows) times coordinates, the coordinate running fastest.

    Attributes
    ----------
    change : (scenes, points) float64
        Second run minus first run: of logarithms for ratios, otherwise in the unit. NaN where a scene lacks one.
    both : (scenes,) bool
        Which scenes were measured in both runs, whether or not they have a value.
    unlike : (points,) bool
        Where a scene has a value of 0 in one of the runs only, so that there is no ratio.
    places : (places,) int64
        Empty for a statistic that is a single number.
    n_coordinates
        2 if u and v have points of their own, else 1.
    total : (scenes, points) float64 or None
        Sum of both runs, for mean errors.
    horizon
        Common horizon of lifetimes, frames.
    scarce
        Whether the first run, and whether the second, has so few events that its value is too large.
    scale_px
        For mean errors: the error that a margin is a share of; None where it is unknown.
    """

    change: NDArray[np.float64]
    both: NDArray[np.bool_]
    unlike: NDArray[np.bool_]
    places: NDArray[np.int64]
    n_coordinates: int = 1
    total: NDArray[np.float64] | None = None
    horizon: float | None = None
    scarce: tuple[bool, bool] = (False, False)
    scale_px: float | None = None

    def place(self, point: int) -> int | None:
        """Age, frame or window of a point; None for a single number."""
        return int(self.places[point // self.n_coordinates]) if len(self.places) else None

    def coordinate(self, point: int) -> str | None:
        """Coordinate of a point; None where both have one value."""
        return "uv"[point % 2] if self.n_coordinates > 1 else None


NO_PLACES = np.zeros(0, dtype=np.int64)


def of_differences(found: Differences) -> PairedValues:
    """What `Differences` of two levels, the second run before the first, hold of a single number."""
    horizon = None if np.isnan(found.horizon[0]) else float(found.horizon[0])
    second, first = found.scarce[0].tolist()
    return PairedValues(
        found.values[:, 0], found.both[:, 0], found.unlike[0], NO_PLACES, horizon=horizon, scarce=(first, second)
    )


def paired(
    levels: tuple[NDArray[np.float64], NDArray[np.float64]],
    measured: NDArray[np.bool_],
    places: NDArray[np.int64] = NO_PLACES,
    *,
    n_coordinates: int = 1,
    logarithms: bool = True,
) -> PairedValues:
    """Changes of values that every run has on its own.

    Parameters
    ----------
    levels : two (scenes, points) float64
        First and second run: values of a scene, or their logarithms: -inf where a value is 0, NaN where there is none.
    measured : (scenes, 2) bool
        Which scenes were measured in each of both runs.
    places, n_coordinates
        As in `PairedValues`.
    logarithms
        Whether these are logarithms.
    """
    first, second = levels
    found = differences(np.stack([second, first], axis=1), measured, logarithms=logarithms)
    return PairedValues(found.values[:, 0], found.both[:, 0], found.unlike[0], places, n_coordinates)
