from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tracknoise.report.style import MOST_SHADES, ORDINAL, PALETTE, colours, levels, shades

_DEFICIENCIES = {
    "none": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
}
"""Linear RGB as it is seen, after Machado, Oliveira and Fernandes (2009), severity 1."""
_LMS = [[0.4122, 0.5363, 0.0514], [0.2119, 0.6807, 0.1074], [0.0883, 0.2817, 0.6300]]
_OKLAB = [[0.2105, 0.7936, -0.0041], [1.9780, -2.4286, 0.4506], [0.0259, 0.7828, -0.8087]]


def _brightness(colour: str) -> int:
    return sum(int(colour[i : i + 2], 16) for i in (1, 3, 5))


def test_each_name_has_its_own_colour_until_the_palette_is_used_up() -> None:
    names = [str(i) for i in range(len(PALETTE) + 1)]
    assert len(set(colours(names[:-1]))) == len(PALETTE)
    assert colours(names)[-1] == PALETTE[0]


def test_shades_run_from_dark_to_light() -> None:
    for colour in PALETTE[:-1]:
        assert all(_brightness(a) < _brightness(b) for a, b in pairwise(shades(colour, 9)))


def test_a_single_shade_is_the_colour() -> None:
    assert shades("#0072B2", 1) == ["#0072B2"]


def _seen(colour: str, deficiency: str) -> NDArray[np.float64]:
    """A colour in a space in which distances are those that people see (OKLab)."""
    coded = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.array(_DEFICIENCIES[deficiency]) @ linear, 0, 1)
    return np.array(_OKLAB) @ np.cbrt(np.array(_LMS) @ seen)


def _closest(chosen: list[str], deficiency: str) -> float:
    seen = np.array([_seen(colour, deficiency) for colour in chosen])
    distances = np.linalg.norm(seen[:, None] - seen[None], axis=2)
    return float(distances[~np.eye(len(chosen), dtype=bool)].min())


def test_nine_levels_are_distinct_for_any_colour_vision_and_nine_shades_are_not() -> None:
    nine = levels("#0072B2", 9)
    assert _closest(nine, "none") > 0.15
    assert min(_closest(nine, name) for name in _DEFICIENCIES) > 0.09
    assert _closest(shades("#0072B2", 9), "none") < 0.1


def test_few_levels_are_shades_and_many_have_colours_of_their_own() -> None:
    assert levels("#0072B2", MOST_SHADES) == shades("#0072B2", MOST_SHADES)
    assert levels("#0072B2", 9) == list(ORDINAL)
    for n in range(MOST_SHADES + 1, 30):
        assert len(set(levels("#0072B2", n))) == n
        assert [levels("#0072B2", n)[end] for end in (0, -1)] == [ORDINAL[0], ORDINAL[-1]]
    assert levels("#0072B2", 0) == []
