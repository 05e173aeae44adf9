import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import by_condition, scenes_by_dataset
from tracknoise.tables.schema import ORIGIN, empty

COUNTED = {**ORIGIN, "n": pl.Int64}


def counted(scene: str, *, n: int, tracker: str = "a", dataset: str = "one") -> pl.DataFrame:
    view = {"lighting": "default", "rotation": 0, "direction": "forward", "camera": "", "speed": 1}
    row = {"dataset": dataset, "scene": scene, "tracker": tracker, "n": n, **view}
    return pl.DataFrame([row], schema=dict(COUNTED))


@pytest.fixture(scope="module")
def tables() -> list[pl.DataFrame]:
    both = [pl.concat([counted(scene, n=n), counted(scene, n=-n, tracker="b")]) for scene, n in (("x", 2), ("w", 1))]
    return [*both, counted("y", n=3, dataset="another")]


def test_rows_of_a_condition_keep_their_order_and_all_columns(tables) -> None:
    apart = by_condition(iter(tables), COUNTED, "counted")
    assert [key[POOLED.index("tracker")] for key in apart] == ["a", "a", "b"]
    another, a, b = apart.values()
    assert another.equals(tables[2])
    assert a.equals(pl.concat(tables).filter(dataset="one", tracker="a"))
    assert b["n"].to_list() == [-2, -1]


def test_it_matters_neither_how_rows_are_spread_over_tables_nor_whether_they_are_apart_already(tables) -> None:
    once = by_condition(pl.concat(tables), COUNTED, "counted")
    for spread in (tables, once):
        again = by_condition(spread, COUNTED, "counted")
        assert list(again) == list(once)
        assert all(again[key].equals(once[key]) for key in once)


def test_tables_are_reduced_before_they_are_held(tables) -> None:
    apart = by_condition(tables, COUNTED, "counted", lambda table: table.filter(pl.col("n") > 1).drop("scene"))
    assert [table["n"].to_list() for table in apart.values()] == [[3], [2]]
    assert all(table.columns == [name for name in COUNTED if name != "scene"] for table in apart.values())


def test_no_rows_are_of_no_condition_and_wrong_tables_are_refused(tables) -> None:
    assert by_condition(empty(COUNTED), COUNTED, "counted") == {}
    assert by_condition((), COUNTED, "counted") == {}
    wrong = tables[0].drop("n")
    for given in (wrong, [wrong], {("one",): wrong}):
        with pytest.raises(SchemaError, match="counted: column 8"):
            by_condition(given, COUNTED, "counted")


def test_scenes_are_those_that_have_a_row(tables) -> None:
    apart = by_condition(tables, COUNTED, "counted")
    assert scenes_by_dataset(apart.items()) == {"one": {"w", "x"}, "another": {"y"}}
    large = ((key, table.filter(pl.col("n").abs() == 2)) for key, table in apart.items())
    assert scenes_by_dataset(large) == {"one": {"x"}}
