"""The self-test passes for a correct program, and fails for each fault that is put in."""

import numpy as np
import polars as pl
import pytest
from benchmarks.selfcheck import exact_worlds, scene_pools
from benchmarks.selfcheck import self_test as selfcheck
from benchmarks.selfcheck.comparison import CHECKS, SUSPECTS, Area, answer, exact, within
from benchmarks.selfcheck.self_test import LEAST_SCENES, judge, self_test
from tests.lean import without_audit, without_depths, without_geometry

from tracknoise.exceptions import StoreError
from tracknoise.statistics import trimming

SEED = 5
EXACT = [
    Area.geometry,
    Area.visibility,
    Area.errors,
    Area.trimming,
    Area.curves,
    Area.changes,
    Area.lifetimes,
    Area.rates,
]


@pytest.fixture(scope="module")
def clean(tmp_path_factory) -> pl.DataFrame:
    """All checks of a self-test: the exact part by two processes, and pools with one tracker for each kind of error."""
    folder = tmp_path_factory.mktemp("selfcheck")
    exact_part = self_test(folder / "exact", scenes=1, seed=SEED, workers=2)
    chosen = {name: errors for name, errors in scene_pools.ERRORS.items() if name[-1] not in "123"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scene_pools, "ERRORS", chosen)
        patch.setattr(scene_pools, "N_FRAMES", 17)
        patch.setattr(scene_pools, "N_TURNED", 1)
        patch.setattr(selfcheck, "_PARTS", {name: selfcheck._PARTS[name] for name in ("pool", "factors")})
        with without_audit(), without_depths(), without_geometry():  # no check is about them
            return pl.concat([exact_part, self_test(folder / "pools", scenes=LEAST_SCENES, seed=SEED)])


@pytest.fixture(scope="module")
def reversed_trimming(tmp_path_factory) -> pl.DataFrame:
    """The exact part in this process, of one scene, while trimming keeps what it should remove."""
    right = trimming._thresholds
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(exact_worlds, "_SCENES", exact_worlds._SCENES[:1])
        patch.setattr(trimming, "_thresholds", lambda *args: -right(*args))
        return self_test(tmp_path_factory.mktemp("reversed"), scenes=1, seed=SEED)


def test_a_correct_program_passes(clean):
    assert clean.filter(pl.col("n_wrong") > 0).rows() == []
    result = judge(clean)
    assert result.passes
    assert (result.areas, result.suspect, result.n_wrong) == ((), None, 0)
    assert result.n_values == clean["n"].sum() > 300_000


def test_every_area_is_tested_and_has_a_suspect(clean):
    assert clean["area"].unique().sort().to_list() == list(Area) == list(SUSPECTS)
    assert clean.filter(area=Area.geometry)["world"].unique().sort().to_list() == ["files", "ray cast", "scan"]


def test_scripts_have_what_makes_faults_visible(clean):
    """Statuses, ends, populations and trimmings that only some scripts might have."""
    statuses = clean.filter(quantity="truth")["expected"]
    assert set(clean["area"]) >= set(EXACT)
    assert statuses.len() > 10
    assert clean.filter(pl.col("quantity").str.contains("Sigma|mu|kappa"))["n"].sum() > 1000


def test_reversed_trimming_is_noticed(reversed_trimming):
    assert not judge(reversed_trimming).passes
    wrong = reversed_trimming.filter(pl.col("n_wrong") > 0)
    assert {*wrong["area"]} == {Area.trimming, Area.curves}


def test_results_do_not_depend_on_the_number_of_workers(clean, reversed_trimming):
    """The observations of the first scene are the same in this process and in those of two workers."""
    assert reversed_trimming["area"].unique().sort().to_list() == EXACT
    for area in (Area.geometry, Area.visibility, Area.errors):
        one, two = (checks.filter(area=area, world="files") for checks in (reversed_trimming, clean))
        assert one.equals(two.head(one.height))
        assert two.height == 2 * one.height > 0


def test_an_error_in_the_package_is_a_fault_and_a_full_disk_is_not(tmp_path, monkeypatch):
    def broken(*_: object) -> pl.DataFrame:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setitem(selfcheck._PARTS, "exact", broken)
    result = self_test(tmp_path, scenes=12)
    assert result.select("quantity", "measured").rows() == [("measurement", "ZeroDivisionError: division by zero")]
    with pytest.raises(ZeroDivisionError):
        self_test(tmp_path, scenes=12, debug=True)

    def full(*_: object) -> pl.DataFrame:
        raise StoreError("no space left")

    monkeypatch.setitem(selfcheck._PARTS, "exact", full)
    with pytest.raises(StoreError, match="no space left"):
        self_test(tmp_path, scenes=12)


EXPECTED = pl.DataFrame({"key": [1, 2, 3], "value": [1.0, None, 2.0], "name": ["a", "b", "c"]})


def compared(measured: pl.DataFrame) -> list[tuple[str, int, int]]:
    checks = exact(Area.curves, "world", EXPECTED, measured, values=["value", "name"])
    assert checks.schema == pl.Schema(CHECKS)
    return checks.select("quantity", "n", "n_wrong").rows()


def test_equal_tables_agree_up_to_rounding_and_order():
    close = EXPECTED.reverse().with_columns(pl.col("value") * (1 + 1e-8), other=pl.lit(0))
    assert compared(close) == [("value", 3, 0), ("name", 3, 0)]


@pytest.mark.parametrize(
    ("value", "wrong"),
    [([1.0, None, 2.1], 1), ([1.0, 0.0, 2.0], 1), ([None, None, np.nan], 2), ([1.0, None, np.inf], 1)],
)
def test_other_values_are_wrong(value, wrong):
    assert compared(EXPECTED.with_columns(value=pl.Series(value, strict=False))) == [
        ("value", 3, wrong),
        ("name", 3, 0),
    ]


def test_rows_that_are_missing_or_superfluous_are_wrong():
    assert compared(EXPECTED.head(2)) == [("value", 3, 1), ("name", 3, 1)]
    more = pl.concat([EXPECTED, pl.DataFrame({"key": [4], "value": [1.0], "name": ["d"]})])
    assert compared(more) == [("value", 4, 1), ("name", 4, 1)]


def test_the_worst_value_is_named():
    checks = exact(
        Area.curves, "w", EXPECTED, EXPECTED.with_columns(value=pl.Series([1.1, None, 3.0])), values=["value", "name"]
    )
    assert checks.row(0, named=True)["place"] == "key 3"
    assert checks.select("expected", "measured").row(0) == ("2.0000", "3.0000")


def test_limits_and_answers():
    rows = pl.concat(
        [
            within(Area.intervals, "w", "in", 0.5, low=0.0, high=1.0),
            within(Area.intervals, "w", "out", 1.5, low=0.0, high=1.0),
            within(Area.intervals, "w", "nothing", None, low=0.0, high=1.0),
            answer(Area.growth, "w", "right", ["yes", "yes"], allowed=["yes"]),
            answer(Area.growth, "w", "one wrong", ["yes", "no"], allowed=["yes"]),
            answer(Area.growth, "w", "none", [], allowed=["yes"]),
        ]
    )
    assert rows["n_wrong"].to_list() == [0, 1, 1, 0, 1, 1]
    assert rows["measured"].to_list() == ["0.5", "1.5", "none", "yes", "no", "none"]
