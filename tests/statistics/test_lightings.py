import pytest

from tracknoise.statistics.definitions import lightings_in_order, natural_key


@pytest.mark.parametrize(
    ("lightings", "named", "expected"),
    [
        ({"LR10", "LR9", "diffuse", "BF0"}, None, ["diffuse", "BF0", "LR9", "LR10"]),
        ({"west", "default", "east"}, None, ["default", "east", "west"]),
        ({"LR0", "LR1", "diffuse"}, ["LR1", "gone", "LR1", "diffuse"], ["LR1", "diffuse", "LR0"]),
        ({"LR2", "LR10"}, [], ["LR2", "LR10"]),
        ([], None, []),
    ],
)
def test_named_ones_come_first_or_else_plain_ones_and_then_the_others_by_name(lightings, named, expected) -> None:
    assert lightings_in_order(lightings, named) == expected


def test_digits_in_names_count_as_numbers() -> None:
    assert sorted(["LR10", "LR9", "BF0", "default"], key=natural_key) == ["BF0", "LR9", "LR10", "default"]
