import pytest

from tracknoise.statistics.definitions import NAMES
from tracknoise.topics.bands import AGE, FRAME


@pytest.mark.parametrize(
    ("axis", "since", "written"),
    [
        (AGE, 10, "at age 10"),
        (FRAME, 10, "10 frames after the key frame"),
        (FRAME, 1, "1 frame after the key frame"),
        (FRAME, -8, "8 frames before the key frame"),
    ],
)
def test_places_are_told_from_where_errors_are_zero(axis, since, written) -> None:
    assert axis.place(since) == written
    assert axis.opening_place(since) == f"At {written.removeprefix('at ')}"


@pytest.mark.parametrize("axis", [AGE, FRAME], ids=lambda axis: axis.name)
def test_every_statistic_of_the_tables_has_a_role(axis) -> None:
    assert set(axis.roles) == set(NAMES[axis.name].values())
