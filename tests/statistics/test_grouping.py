from collections.abc import Iterator

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.statistics import grouping
from tracknoise.statistics.grouping import (
    group_rows,
    group_runs,
    in_chunks,
    number_combinations,
    number_names,
    reduce_each,
)

NUMBERS = {"n": pl.Int64}


def test_groups_are_sorted_and_every_row_knows_its_own() -> None:
    table = pl.DataFrame({"name": ["b", "a", "b", "a", "c"], "k": [1, 2, 1, 1, 0]})
    groups = group_rows(table, ["name", "k"])
    assert groups.keys.rows() == [("a", 1), ("a", 2), ("b", 1), ("c", 0)]
    assert groups.index.tolist() == [2, 1, 2, 0, 3]
    assert groups.count == 4


def test_columns_that_do_not_vary_change_no_group() -> None:
    table = pl.DataFrame({"all": ["x"] * 4, "k": [3, 7, 3, 0]})
    assert group_rows(table, ["all", "k"]).index.tolist() == group_rows(table, ["k"]).index.tolist() == [1, 2, 1, 0]
    assert group_rows(table, ["all", "k"]).keys.rows() == [("x", 0), ("x", 3), ("x", 7)]
    assert group_rows(table, ["all"]).keys.rows() == [("x",)]


def test_names_are_numbered_in_their_order_whether_or_not_equal_ones_are_adjacent() -> None:
    names, index = number_names(pl.Series(["b", "b", "a", "b", "c"]))
    assert names == ["a", "b", "c"]
    assert index.tolist() == [1, 1, 0, 1, 2]
    nothing, none = number_names(pl.Series([], dtype=pl.String))
    assert (nothing, none.shape, none.dtype) == ([], (0,), np.intp)


def test_enumerations_sort_by_definition_and_not_by_name() -> None:
    kind = pl.Enum(["z", "a"])
    groups = group_rows(pl.DataFrame({"e": ["a", "z", "a"]}, schema={"e": kind}), ["e"])
    assert groups.keys["e"].to_list() == ["z", "a"]
    assert groups.index.tolist() == [1, 0, 1]


def test_no_rows_make_no_groups() -> None:
    groups = group_rows(pl.DataFrame(schema={"name": pl.String}), ["name"])
    assert groups.count == 0
    assert groups.index.shape == (0,)


def test_several_tables_share_their_groups_whether_or_not_equal_rows_are_adjacent() -> None:
    first = pl.DataFrame({"name": ["b", "b", None, "a", "b"], "k": [1, 1, 1, 1, 2]})
    second = pl.DataFrame({"name": ["c", "b"], "k": [0, 1]})
    one, two = group_runs([first, second], ["name", "k"])
    assert one.keys.rows() == two.keys.rows() == [(None, 1), ("a", 1), ("b", 1), ("b", 2), ("c", 0)]
    assert one.keys[one.index].equals(first)
    assert two.keys[two.index].equals(second)


def test_runs_of_no_rows_make_no_groups() -> None:
    nothing = pl.DataFrame(schema={"name": pl.String})
    assert [groups.index.shape for groups in group_runs([nothing, nothing], ["name"])] == [(0,), (0,)]


@pytest.mark.parametrize("largest", [0, 2**20])
def test_combinations_are_numbered_in_order_with_a_lookup_table_or_without(monkeypatch, largest: int) -> None:
    monkeypatch.setattr(grouping, "_LARGEST_LOOKUP", largest)
    keys = (np.array([2, 0, 2, 2, 0]), np.array([False, True, True, False, True]))
    (first, second), index = number_combinations(keys)
    assert list(zip(first.tolist(), second.tolist(), strict=True)) == [(0, 1), (2, 0), (2, 1)]
    assert index.tolist() == [1, 0, 2, 1, 0]
    none, index = number_combinations([np.empty(0, dtype=np.intp)])
    assert (none[0].shape, index.shape) == ((0,), (0,))


def test_a_large_table_gives_each_row_the_group_with_its_key() -> None:
    rng = np.random.default_rng(0)
    table = pl.DataFrame({"a": rng.integers(0, 5, 20_000), "b": rng.integers(0, 7, 20_000)})
    groups = group_rows(table, ["a", "b"])
    assert groups.keys[groups.index].equals(table)


def test_tables_are_read_one_at_a_time() -> None:
    alive: list[int] = []

    def read() -> Iterator[pl.DataFrame]:
        for number in range(3):
            alive.append(number)
            yield pl.DataFrame({"n": [number, number]})

    def total(table: pl.DataFrame) -> pl.DataFrame:
        if table.height:
            assert table["n"][0] == alive[-1]
        return table.select(pl.col("n").sum()) if table.height else table

    assert reduce_each(read(), NUMBERS, "numbers", total)["n"].to_list() == [0, 2, 4]


def test_each_table_is_checked() -> None:
    good, bad = pl.DataFrame({"n": [1]}), pl.DataFrame({"m": [1]})
    with pytest.raises(SchemaError, match="numbers: column 0 is m: Int64, expected n: Int64"):
        reduce_each([good, bad], NUMBERS, "numbers", lambda table: table)


def test_small_tables_are_stacked_and_a_large_one_is_not_cut() -> None:
    tables = (pl.DataFrame({"n": range(height)}, schema=NUMBERS) for height in (1, 1, 5, 0, 2))
    assert [chunk.height for chunk in in_chunks(tables, NUMBERS, "numbers", rows=2)] == [2, 5, 2]


def test_of_no_tables_there_are_no_chunks_and_of_one_it_is_the_only() -> None:
    assert list(in_chunks([], NUMBERS, "numbers")) == []
    table = pl.DataFrame({"n": range(9)}, schema=NUMBERS)
    assert [chunk.equals(table) for chunk in in_chunks(table, NUMBERS, "numbers", rows=2)] == [True]


def test_no_more_tables_are_held_than_make_a_chunk() -> None:
    asked = []

    def read() -> Iterator[pl.DataFrame]:
        for place in range(6):
            asked.append(place)
            yield pl.DataFrame({"n": [place]}, schema=NUMBERS)

    chunks = in_chunks(read(), NUMBERS, "numbers", rows=2)
    next(chunks)
    assert asked == [0, 1]
    next(chunks)
    assert asked == [0, 1, 2, 3]


def test_a_chunk_of_another_schema_is_refused() -> None:
    with pytest.raises(SchemaError, match="numbers"):
        list(in_chunks([pl.DataFrame({"m": [1]})], NUMBERS, "numbers"))
