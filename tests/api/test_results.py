"""The table of results: every number of a run is a row of it, and every table of numbers is a view of it."""

import polars as pl
import pytest
from polars.testing import assert_frame_equal

import tracknoise as tn
from tracknoise.exceptions import UnknownNameError
from tracknoise.tables.quantities import QUANTITIES
from tracknoise.tables.result_views import VIEWS, results_of, view
from tracknoise.tables.results import IDENTITY, RESULTS
from tracknoise.tables.schema import check, empty
from tracknoise.tables.store import FINDINGS_TABLES, STATISTICS_TABLES, RunFolder

SCHEMAS = {**STATISTICS_TABLES, **FINDINGS_TABLES}
RARE = {"seed_spread", "triangulated_noise", "point_tracking_metrics", "two_truths", "pose_disagreement", "ranks"}
OF_ONE_TRACKER = {"effects", "tracker_differences"}
"""Tables that compare trackers, of which this run has one."""
OF_COVARIANCES = {"own_covariances"}
"""Tables of trackers that predict covariances, which this one does not."""


@pytest.fixture(scope="module")
def folder(run: tn.Run) -> RunFolder:
    return RunFolder(run.path)


def one_row(schema: dict[str, pl.DataType]) -> pl.DataFrame:
    """A table with one row in which every cell has a value of its own."""
    values = {}
    for place, (name, kind) in enumerate(schema.items()):
        dtype = kind() if isinstance(kind, type) else kind
        if isinstance(dtype, pl.Enum):
            values[name] = dtype.categories[0]
        elif dtype == pl.String:
            values[name] = f"text {place}"
        elif dtype == pl.Boolean:
            values[name] = True
        else:
            values[name] = place + 1
    return pl.DataFrame([values], schema=dict(schema))


@pytest.mark.parametrize("name", sorted(VIEWS))
def test_a_view_has_the_columns_of_its_table(name: str) -> None:
    made = view(results_of({name: empty(SCHEMAS[name])}), name)
    assert check(made, SCHEMAS[name], name).is_empty()


@pytest.mark.parametrize("name", sorted(VIEWS))
def test_an_interval_has_its_level(name: str) -> None:
    assert all("level" in value.carried for value in VIEWS[name].values if "low" in value.carried)


@pytest.mark.parametrize("name", sorted(RARE))
def test_tables_of_rare_runs_come_back_as_they_were(name: str) -> None:
    table = one_row(SCHEMAS[name])
    if name == "two_truths":
        table = table.with_columns(statistic=pl.lit("mean"))
    if name in ("seed_spread", "ranks"):
        table = table.with_columns(axis=pl.lit("age"))
    assert_frame_equal(view(results_of({name: table}), name), table)


def test_every_table_of_a_run_comes_back_as_it_was(folder: RunFolder) -> None:
    tables = {name: folder.statistics(name) for name in VIEWS}
    again = results_of(tables)
    assert_frame_equal(again.sort("id"), folder.results().sort("id"))
    assert {name for name in VIEWS if tables[name].is_empty()} <= RARE | OF_ONE_TRACKER | OF_COVARIANCES


def test_rows_have_different_ids_that_do_not_depend_on_values(folder: RunFolder) -> None:
    results = check(folder.results(), RESULTS, "results")
    assert results["id"].is_unique().all()
    assert results.select(pl.struct(*IDENTITY)).is_unique().all()
    changed = {"core": folder.statistics("cores").with_columns(pl.col("core_u_px") * 2)}
    ids = results_of({"cores": changed["core"]}).filter(quantity="core")["id"]
    assert set(ids) == set(results.filter(quantity="core", axis="age").filter(pl.col("n").is_not_null())["id"])


def test_a_number_that_two_tables_have_is_one_row(folder: RunFolder) -> None:
    curve = folder.statistics("curves").filter(statistic="Phi", weighting="features", population="visible")
    point = curve.row(0, named=True)
    rows = folder.results().filter(
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
    results = {row["id"]: row for row in folder.results().iter_rows(named=True)}
    findings = folder.statistics("findings")
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
    tracker = folder.results()["tracker"].drop_nulls()[0]
    ratio = run.results(quantity="outlier_ratio", tracker=tracker, speed=1)
    assert (
        ratio["value"].item() == folder.statistics("summary").filter(tracker=tracker, speed=1)["outlier_ratio"].item()
    )
    about = run.findings(tracker=tracker)
    assert 0 < about.height <= run.findings().height
    assert all({part["tracker"] for part in row["parts"]} == {tracker} for row in about.iter_rows(named=True))
    with pytest.raises(UnknownNameError, match="unknown quantity 'sigmas'"):
        run.results(quantity="sigmas")
    with pytest.raises(UnknownNameError, match="unknown tracker 'nobody'"):
        run.findings(tracker="nobody")


def test_every_quantity_says_what_it_estimates() -> None:
    used = {value.quantity for chosen in VIEWS.values() for value in chosen.values}
    assert used == set(QUANTITIES)
    assert all(
        quantity.estimand.endswith(".") and len(quantity.estimand.split()) > 2 for quantity in QUANTITIES.values()
    )
