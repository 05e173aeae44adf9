from itertools import pairwise

from tracknoise.report.style import PALETTE, colours, ramp, shades


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


def test_a_ramp_leads_from_one_end_to_the_other() -> None:
    assert ramp(("#000000", "#ffffff"), 3) == ["#000000", "#808080", "#ffffff"]
    assert ramp(("#123456", "#ffffff"), 1) == ["#123456"]
