"""The table of results: every number of a run is a row of it."""

import polars as pl
import pytest

import tracknoise as tn
from tracknoise.exceptions import UnknownNameError
from tracknoise.tables.findings_schema import CORES, CURVES, FINDINGS, SUMMARY
from tracknoise.tables.main_columns import MAIN
from tracknoise.tables.quantities import QUANTITIES
from tracknoise.tables.result_rows import results_of, with_ids
from tracknoise.tables.results import IDENTITY, RESULTS
from tracknoise.tables.store import RunFolder
from tracknoise.topics.catalogue import EVERY_QUANTITY, RUN_TABLES, run_results


@pytest.fixture(scope="module")
def folder(run: tn.Run) -> RunFolder:
    return RunFolder(run.path)


ROWS = {name: table.rows for name, table in RUN_TABLES.items() if table.rows}


@pytest.mark.parametrize("name", sorted(ROWS))
def test_an_interval_has_its_level(name: str) -> None:
    assert all("level" in value.carried for value in ROWS[name].values if "low" in value.carried)


@pytest.mark.parametrize("name", sorted(ROWS))
def test_rows_name_columns_of_their_table(name: str) -> None:
    rows, columns = ROWS[name], RUN_TABLES[name]
    packed = {column for names in rows.packed.values() for column in names}
    of_values = {column for value in rows.values for column in (value.column, *value.carried.values(), *value.rows)}
    labelled = {key for value in rows.values for key in value.labels}
    keys = {column for key, column in rows.keys.items() if key not in labelled}
    assert (packed | of_values | keys) - {"shape", "growth"} <= columns.keys()  # verdicts without a number


def test_every_number_of_a_table_is_a_row_with_its_id(folder: RunFolder) -> None:
    results = {row["id"]: row["value"] for row in run_results(folder).iter_rows(named=True)}
    for name in ("curves", "zero_mean", "time_structure", "window_sigmas", "advice"):
        rows = with_ids(RUN_TABLES[name], folder.statistics(RUN_TABLES[name])).to_dicts()
        numbers = [(row["ids"][key], row[key]) for row in rows for key in row["ids"] if row.get(key) is not None]
        assert numbers
        assert all(results[id_] == pytest.approx(value, rel=1e-9, nan_ok=True) for id_, value in numbers)


def test_rows_have_different_ids_that_do_not_depend_on_values(folder: RunFolder) -> None:
    results = run_results(folder)
    assert results.columns == list(RESULTS)
    assert results["id"].is_unique().all()
    assert results.select(pl.struct(*IDENTITY)).is_unique().all()
    changed = {"core": folder.statistics(CORES).with_columns(pl.col("core_u_px") * 2)}
    ids = results_of({CORES: changed["core"]}).filter(quantity="core")["id"]
    assert set(ids) == set(results.filter(quantity="core", axis="age").filter(pl.col("n").is_not_null())["id"])


def test_a_number_that_two_tables_have_is_one_row(folder: RunFolder) -> None:
    curve = folder.statistics(CURVES).filter(statistic="Phi", weighting="features", population="visible")
    point = curve.row(0, named=True)
    rows = run_results(folder).filter(
        quantity="second_moment",
        aspect="all",
        weighting="features",
        population="visible",
        trimming=point["trimming"],
        tracker=point["tracker"],
        speed=point["speed"],
        at=point["at"],
        coordinate="u",
    )
    assert rows.height == 1
    assert rows["value"].item() == pytest.approx(point["u"], rel=1e-12)
    assert rows["n"].item() == point["n"]
    assert rows["unit"].item() == "px^2"


def test_findings_name_rows_that_exist_and_hold_their_numbers(folder: RunFolder) -> None:
    results = {row["id"]: row for row in run_results(folder).iter_rows(named=True)}
    findings = folder.statistics(FINDINGS)
    with_rows = [row for row in findings.iter_rows(named=True) if row["rows"]]
    assert {"noise", "bias", "lifetimes"} <= {row["topic"] for row in with_rows}
    for row in with_rows:
        assert set(row["rows"]) <= set(results)
        first = results[row["rows"][0]]
        if row["value"] is not None:
            roots = first["unit"] == "px^2" and row["unit"] == "px"
            assert row["value"] == pytest.approx(first["value"] ** 0.5 if roots else first["value"])
        for part in row["parts"]:
            assert part["text"] in row["text"]
            own = [results[name] for name in part["rows"]]
            assert part["tracker"] is None or {found["tracker"] for found in own} <= {part["tracker"], None}


def test_results_and_findings_are_chosen_by_name(run: tn.Run, folder: RunFolder) -> None:
    tracker = run_results(folder)["tracker"].drop_nulls()[0]
    ratio = run.results(quantity="outlier_ratio", tracker=tracker, speed=1)
    assert ratio["value"].item() == folder.statistics(SUMMARY).filter(tracker=tracker, speed=1)["outlier_ratio"].item()
    about = run.findings(tracker=tracker)
    assert 0 < about.height <= run.findings().height
    assert all({part["tracker"] for part in row["parts"]} == {tracker} for row in about.iter_rows(named=True))
    with pytest.raises(UnknownNameError, match="unknown quantity 'sigmas'"):
        run.results(quantity="sigmas")
    with pytest.raises(UnknownNameError, match="unknown tracker 'nobody'"):
        run.findings(tracker="nobody")


def test_results_have_twelve_columns_in_which_no_two_rows_are_alike(run: tn.Run) -> None:
    results, every = run.results(), run.results(columns="all")
    assert results.columns == list(MAIN)
    assert len(MAIN) == 12
    assert results.select("quantity", "tracker", "speed", "what").is_unique().all()
    assert every.columns == list(RESULTS)
    shared = [name for name in MAIN if name != "what"]
    assert results.select(shared).equals(every.select(shared))
    with pytest.raises(UnknownNameError, match="unknown choice of columns 'few'"):
        run.results(columns="few")


def test_a_row_says_in_words_what_the_others_of_its_quantity_are_not(run: tn.Run) -> None:
    every = run.results(columns="all", quantity="core")
    age = every["at"].drop_nulls()[0]
    rows = run.results(quantity="core", at=age)
    for column in ("coordinate", "trimming"):
        if every[column].n_unique() > 1:
            assert {*rows["what"].str.split(", ").explode()} >= {*map(str, every.filter(at=age)[column].drop_nulls())}
    assert rows["what"].str.starts_with(f"age {age}, ").all()
    assert run.results(quantity="core", at=...).equals(run.results(quantity="core"))


def test_a_quantity_is_declared_once() -> None:
    declared = [*QUANTITIES, *(name for table in RUN_TABLES.values() for name in table.quantities)]
    assert len(declared) == len(set(declared))


def test_every_quantity_says_what_it_estimates() -> None:
    used = {value.quantity for rows in ROWS.values() for value in rows.values}
    assert used == set(EVERY_QUANTITY)
    assert all(
        quantity.estimand.endswith(".") and len(quantity.estimand.split()) > 2 for quantity in EVERY_QUANTITY.values()
    )
