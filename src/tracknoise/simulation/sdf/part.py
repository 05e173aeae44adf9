"""Triangles that wear one thing."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
"""Pattern of a number that is not negative, such as a channel of a colour."""
_LUMA = np.array([0.299, 0.587, 0.114])  # of red, green and blue, as in the grey images of colour files


@dataclass(frozen=True, slots=True)
class Look:
    """What a surface wears.

    Parameters
    ----------
    texture
        Image file; None for an even colour.
    reflectance
        Of the even colour, 0 to 1.
    """

    texture: Path | None = None
    reflectance: float = 0.7


PLAIN = Look()
"""Of what has neither colour nor texture: light grey."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Triangles that wear one thing.

    Parameters
    ----------
    corners
        (t, 3, 3) float64, metres.
    corner_uv
        (t, 3, 2) float64, repeats of the texture, row 0 first; None where there are no texture coordinates.
    look
        What they wear; None if nothing was said.
    """

    corners: NDArray[np.float64]
    corner_uv: NDArray[np.float64] | None
    look: Look | None = None


def even(red: float, green: float, blue: float) -> Look:
    """Look of an even colour, whose channels go from 0 to 1."""
    return Look(reflectance=float(np.clip(_LUMA @ (red, green, blue), 0.0, 1.0)))
