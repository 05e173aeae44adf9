"""Positions of the LEDs of the stage."""

import numpy as np
from numpy.typing import NDArray

_ROWS = (3, 4, 5, 4, 3)
_PITCH_M = 0.25
_HEIGHT_M = 0.9


def led_positions() -> NDArray[np.float64]:
    """Nineteen LEDs in a level hexagon: rows of 3, 4, 5, 4 and 3, 0.25 m between neighbours, 0.9 m above the table.

    Returns
    -------
    (19, 3) float64
        Metres: x from left to right and y from front to back as the cameras see it, z up; the origin is the middle of
        the table. Rows are ordered from the back to the front, and the LEDs in a row from left to right.
    """
    places = [
        (_PITCH_M * (column - (count - 1) / 2), _PITCH_M * np.sqrt(0.75) * (len(_ROWS) // 2 - row), _HEIGHT_M)
        for row, count in enumerate(_ROWS)
        for column in range(count)
    ]
    return np.array(places)
