from collections.abc import Mapping

import polars as pl
import pytest

from tracknoise.exceptions import SchemaError
from tracknoise.tables import schema
from tracknoise.tables.findings_schema import SUMMARY
from tracknoise.tables.schema import TrackEnd, TruthStatus, check, empty

SCHEMAS = {name: value for name, value in vars(schema).items() if name.isupper() and isinstance(value, Mapping)}
PAIR = {"name": pl.String, "n": pl.Int64}


def test_empty_tables_meet_their_schemas() -> None:
    assert len(SCHEMAS) > 40
    for name, columns in SCHEMAS.items():
        table = empty(columns)
        assert table.height == 0
        assert check(table, columns, name) is table


def test_enumerations_list_the_names_in_the_order_of_their_numbers() -> None:
    assert schema.TRUTH.categories.to_list() == [TruthStatus(value).name for value in range(7)]
    assert schema.END.categories.to_list() == [TrackEnd(value).name for value in range(5)]


def test_the_known_truth_statuses_are_those_with_a_true_position() -> None:
    assert [status.name for status in TruthStatus] == [
        "valid",
        "no_depth",
        "edge",
        "occluded",
        "out_of_image",
        "behind_camera",
        "no_pose",
    ]


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (pl.DataFrame({"name": ["a"]}), "pairs: column 1 is nothing, expected n: Int64"),
        (pl.DataFrame({"name": ["a"], "n": [1.0]}), "pairs: column 1 is n: Float64, expected n: Int64"),
        (pl.DataFrame({"n": [1], "name": ["a"]}), "pairs: column 0 is n: Int64, expected name: String"),
        (pl.DataFrame({"name": ["a"], "n": [1], "more": [2]}), "pairs: unexpected column 'more'"),
    ],
)
def test_check_names_the_first_column_that_differs(table: pl.DataFrame, message: str) -> None:
    with pytest.raises(SchemaError) as error:
        check(table, PAIR, "pairs")
    assert str(error.value) == message


def observed(*more: tuple[str, type[pl.DataType]]) -> pl.DataFrame:
    return pl.DataFrame(schema={**schema.OBSERVATIONS, **dict(more)})


AFTER = len(schema.OBSERVATIONS)
"""Number of the first column after those that all observations have."""
COVARIANCE = [(name, pl.Float64) for name in ("cov_true_uu", "cov_true_uv", "cov_true_vv")]


@pytest.mark.parametrize(
    "more",
    [
        [("quality_sure", pl.Float32)],
        [("quality_a", pl.Float32), ("quality_b2", pl.Float32)],
        COVARIANCE,
        [*COVARIANCE, ("quality_sure", pl.Float32)],
    ],
)
def test_observations_may_have_quality_and_true_covariances_at_their_end(more) -> None:
    table = observed(*more)
    assert check(table, schema.OBSERVATIONS, "observations") is table
    assert list(schema.OBSERVATIONS) == table.columns[: len(schema.OBSERVATIONS)]


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ([("quality_sure", pl.Float64)], f"column {AFTER} is quality_sure: Float64, expected quality_sure: Float32"),
        (
            [("quality_b", pl.Float32), ("quality_a", pl.Float32)],
            f"column {AFTER} is quality_b: Float32, expected quality_a: Float32",
        ),
        ([("quality_Sure", pl.Float32)], "unexpected column 'quality_Sure'"),
        ([("sure", pl.Float32)], "unexpected column 'sure'"),
        (COVARIANCE[:2], f"column {AFTER + 2} is nothing, expected cov_true_vv: Float64"),
        (
            [("quality_a", pl.Float32), *COVARIANCE],
            f"column {AFTER} is quality_a: Float32, expected cov_true_uu: Float64",
        ),
    ],
)
def test_other_columns_of_observations_are_refused(more, message) -> None:
    with pytest.raises(SchemaError) as error:
        check(observed(*more), schema.OBSERVATIONS, "observations")
    assert str(error.value) == f"observations: {message}"


def test_quality_is_allowed_in_observations_only() -> None:
    with pytest.raises(SchemaError, match="unexpected column 'quality_sure'"):
        check(empty(schema.TRACKS).with_columns(quality_sure=pl.lit(1.0, pl.Float32)), schema.TRACKS, "tracks")


def test_moments_hold_every_joint_central_sum_of_orders_two_to_four() -> None:
    expected = {"m_" + "u" * (total - q) + "v" * q for total in (2, 3, 4) for q in range(total + 1)}
    assert expected <= set(schema.MOMENTS)
    assert len(expected) == 12


def test_summary_has_the_same_values_trimmed_and_untrimmed() -> None:
    names = [name.removeprefix("trimmed_") for name in SUMMARY if name.startswith("trimmed_")]
    scales = [f"{name}_{axis}_px" for name in ("nu", "eta", "rms", "core") for axis in "uv"]
    assert names == ["n", *scales, "beyond_u", "beyond_v"]
    assert [f"untrimmed_{name}" for name in names] == [name for name in SUMMARY if name.startswith("untrimmed_")]


def test_lists_of_an_enumeration_with_more_values_are_read() -> None:
    before, now = pl.List(pl.Enum(["a"])), pl.List(pl.Enum(["a", "b"]))
    old = pl.DataFrame({"caveats": [["a"], []]}, schema={"caveats": before})
    assert schema.of_this_version(old, {"caveats": now}).schema["caveats"] == now


def test_an_enumeration_that_was_extended_since_a_table_was_written_is_read() -> None:
    now, before, unknown = pl.Enum(["a", "b", "c"]), pl.Enum(["b", "a"]), pl.Enum(["b", "z"])
    expected = {"name": now, "n": pl.Int64}
    old = pl.DataFrame({"name": ["b", None], "n": [1, 2]}, schema={"name": before, "n": pl.Int64})
    read = schema.of_this_version(old, expected)
    assert check(read, expected, "old").rows() == old.rows()
    assert schema.of_this_version(old.cast({"name": unknown}), expected).schema["name"] == unknown
    assert schema.of_this_version(read, {"name": before, "n": pl.Int64}).schema == read.schema


def test_last_columns_that_earlier_versions_did_not_write_are_null() -> None:
    now = {"core_u_px": pl.Float64, "near_px": pl.Float64}
    read = schema.of_this_version(pl.DataFrame({"core_u_px": [0.5]}), now)
    assert check(read, now, "old").rows() == [(0.5, None)]
    with pytest.raises(SchemaError, match="expected other"):
        check(schema.of_this_version(read, {**now, "other": pl.Float64}), {**now, "other": pl.Float64}, "old")


def test_names_that_were_strings_are_read() -> None:
    old = pl.DataFrame({"name": ["lk", None]})
    assert (
        check(schema.of_this_version(old, {"name": pl.Categorical()}), {"name": pl.Categorical()}, "old").rows()
        == old.rows()
    )
