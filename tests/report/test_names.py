from tracknoise.report.names import by_statement, together


def test_names_are_put_together_by_what_is_said_of_them() -> None:
    told = [("a", "dark"), ("b", "torn"), ("c", "dark")]
    assert by_statement(told) == {"dark": ["a", "c"], "torn": ["b"]}


def test_of_many_names_the_first_stand_for_all() -> None:
    assert together(["a"]) == "a"
    assert together([*"abcd"]) == "a, b, c and d"
    assert together([*"abcdef"]) == "a, b, c and 3 others"
