"""How much of each LED's image the images of other lightings contain.

Light adds up: an image in the light of several lamps is the sum of the images in the light of each.
"""

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import read_text
from tracknoise.foreign.parsing import damage_reported

LED_COUNT = 19
SIGMA_M = 0.20
"""Standard deviation of the Gaussian by which LEDs share in directional light, metres."""
BACK_TO_FRONT, LEFT_TO_RIGHT = 8, 10
"""Counts of directional lightings."""
WEIGHT_STEPS = 1 << 14
"""Weights are multiples of 1 / 16384: then float32 holds every sum of weighted grey levels exactly."""

LIGHTINGS = (
    "diffuse",
    *(f"BF{step}" for step in range(BACK_TO_FRONT)),
    *(f"LR{step}" for step in range(LEFT_TO_RIGHT)),
)
"""Names of the lightings, in the order of `weights`."""

_WIDEST_M = 10.0


def weights(leds_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """The share of each LED in each lighting.

    In diffuse light all have the same. Directional light comes from a place in the plane of x and y that moves in equal
    steps through the middle of the LEDs, from the one at the very back to the one in front, or from left to right; the
    shares fall with the distance d from there as exp(-d^2 / (2 sigma^2)).

    Parameters
    ----------
    leds_m
        (19, 3) float64, metres: x from left to right and y from front to back as the key frame sees it, z up.

    Returns
    -------
    (19 lightings, 19 LEDs) float64
        Not negative; the sum of each row is 1, so that all lightings are about as bright. Multiples of
        1 / `WEIGHT_STEPS`, for which a share is changed by less than one step.
    """
    (left, front), (right, back) = leds_m[:, :2].min(axis=0), leds_m[:, :2].max(axis=0)
    centre_x, centre_y = (left + right) / 2.0, (front + back) / 2.0
    places = [(centre_x, y) for y in np.linspace(back, front, BACK_TO_FRONT)]
    places += [(x, centre_y) for x in np.linspace(left, right, LEFT_TO_RIGHT)]
    d2 = ((np.array(places)[:, None] - leds_m[:, :2]) ** 2).sum(axis=2)
    d2 -= d2.min(axis=1, keepdims=True)  # a factor common to all, which keeps far LEDs from vanishing altogether
    gaussian = np.exp(-d2 / (2.0 * SIGMA_M**2))
    return _in_steps(np.concatenate([np.ones((1, len(leds_m))), gaussian]))


def read_leds(path: Path) -> NDArray[np.float64]:
    """Read the positions of the LEDs from a CSV file: one row per LED of x, y, z in metres, with a header or without.

    Returns
    -------
    (19, 3) float64

    Raises
    ------
    DataError
        If the file is missing, or has not 19 rows of three finite numbers, or they cannot be metres.
    """
    expected = f"{LED_COUNT} rows of x,y,z in metres"
    lines = read_text(path, expected).splitlines()
    with damage_reported(path, "unreadable file", expected):
        rows = [(number, row) for number, row in enumerate(csv.reader(lines), start=1) if any(map(str.strip, row))]
    if rows and not any(map(_is_number, rows[0][1])):
        rows = rows[1:]
    leds = np.array([_position(f"{path}:{number}", row) for number, row in rows]).reshape(-1, 3)
    if len(leds) != LED_COUNT:
        raise DataError(path, f"{len(leds)} LEDs", expected)
    extent = float(np.ptp(leds, axis=0).max())
    if not 0.0 < extent <= _WIDEST_M:
        raise DataError(path, f"LEDs {extent:g} apart", f"{expected}, up to {_WIDEST_M:g} m apart")
    return leds


def _position(place: str, row: list[str]) -> list[float]:
    if len(row) != 3 or not all(map(_is_number, row)):
        raise DataError(place, ",".join(row), "x,y,z in metres")
    return [float(field) for field in row]


def _is_number(field: str) -> bool:
    try:
        return bool(np.isfinite(float(field)))
    except ValueError:
        return False


def _in_steps(shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows of shares as multiples of 1 / `WEIGHT_STEPS` whose sum is 1: the largest remainders are rounded up."""
    exact = shares / shares.sum(axis=1, keepdims=True) * WEIGHT_STEPS
    steps = np.floor(exact)
    order = np.argsort(steps - exact, axis=1, kind="stable")
    missing = WEIGHT_STEPS - steps.sum(axis=1, keepdims=True)
    np.put_along_axis(
        steps, order, np.take_along_axis(steps, order, axis=1) + (np.arange(steps.shape[1]) < missing), axis=1
    )
    rounded: NDArray[np.float64] = steps / WEIGHT_STEPS
    return rounded
