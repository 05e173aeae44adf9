import pytest

from tracknoise.tables.identity import identifiers
from tracknoise.topics.sentences import by_statement, together


def test_names_are_put_together_by_what_is_said_of_them() -> None:
    told = [("a", "dark"), ("b", "torn"), ("c", "dark")]
    assert by_statement(told) == {"dark": ["a", "c"], "torn": ["b"]}


def test_of_many_names_the_first_stand_for_all() -> None:
    assert together(["a"]) == "a"
    assert together([*"abcd"]) == "a, b, c and d"
    assert together([*"abcdef"]) == "a, b, c and 3 others"


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["LK", "ORB"], ["lk", "orb"]),
        (["a b", "a_b", "LK"], ["a-b-1", "a-b-2", "lk"]),
        (["a b", "a.b", "a b 2"], ["a-b-1", "a-b-3", "a-b-2"]),
        (["a b 1", "a b", "a.b", "a-b"], ["a-b-1", "a-b-2", "a-b-3", "a-b-4"]),
        (["\u8ddf", "\u8e2a", "tracker"], ["tracker-1", "tracker-2", "tracker-3"]),
        (["by lighting", "By-Lighting"], ["by-lighting-1", "by-lighting-2"]),
        (["by lighting"], ["by-lighting-1"]),
    ],
)
def test_identifiers_are_unique(names: list[str], expected: list[str]) -> None:
    assert list(map(identifiers(names, taken=["by-lighting"]).get, names)) == expected


def test_long_names_have_short_identifiers() -> None:
    names = ["x" * 5000 + end for end in "abc"]
    found = identifiers(names)
    assert len(set(found.values())) == 3
    assert max(map(len, found.values())) < 100
