"""The paper's findings as data, and beside what a run measured."""

from collections.abc import Callable

import polars as pl
import pytest

from tracknoise.experiments.load import load_experiment, preset_names
from tracknoise.report import factor_section, paper
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder
from tracknoise.words import SPACE, effect_text

LK, SIFT = "lucas-kanade", "correspondence"
TABLES = {
    ("dtu", "tracker"): ["no", "yes", "yes", "yes", "yes"],
    ("dtu", "lighting"): ["no", "no", "no", "no", "no"],
    ("dtu", "speed"): ["no", ("no", "yes"), ("no", "yes"), "yes", "yes"],
    ("kitti", "tracker"): ["no", "yes", "yes", "yes", "yes"],
    ("kitti", "speed"): ["yes", ("yes", "no"), ("yes", "no"), "yes", "yes"],
    ("gazebo-linear", "tracker"): ["yes", "yes", "yes", "yes", "yes"],
    ("gazebo-linear", "speed"): [("yes", "no"), "yes", "yes", "yes", ("yes", "no")],
    ("gazebo-arvr", "tracker"): ["yes", "yes", "yes", "yes", "yes"],
    ("gazebo-arvr", "speed"): ["no", ("no", "yes"), ("no", "yes"), "yes", ("yes", "no")],
}
"""The paper's summary tables, row by row; pairs are Lucas-Kanade's and correspondence's."""


@pytest.mark.parametrize(("table", "expected"), TABLES.items(), ids=lambda value: "-".join(map(str, value)))
def test_the_papers_cells(table: tuple[str, str], expected: list[str | tuple[str, str]]) -> None:
    for role, cell in zip(paper.STATISTICS, expected, strict=True):
        both = (cell, cell) if isinstance(cell, str) else cell
        assert tuple(paper.finding(*table, role, kind) for kind in (LK, SIFT)) == both


def test_the_paper_has_no_other_tables() -> None:
    found = {(name, factor) for name, tables in paper.findings().items() for factor in tables if factor != "title"}
    assert found == set(TABLES)


def test_every_preset_that_repeats_an_experiment_finds_it() -> None:
    repeated = {load_experiment(name, root=None).paper for name in ("gazebo-linear", "gazebo-arvr")}
    assert repeated <= set(paper.findings())
    assert set(paper.findings()) <= set(preset_names())


def test_where_the_paper_says_nothing_there_is_nothing() -> None:
    assert paper.finding(None, "tracker", "mean", None) is None
    assert paper.finding("kitti", "lighting", "mean", LK) is None
    assert paper.finding("dtu", "speed", "absolute", "oracle") is None
    assert paper.finding("dtu", "tracker", "central", None) is None


def with_effects(data: ReportData, **columns: object) -> ReportData:
    """The same data with other values in all rows of its effects."""
    changed = {name: pl.lit(value, dtype=data["effects"].schema[name]) for name, value in columns.items()}
    return data.with_tables(effects=data["effects"].with_columns(**changed))


def without_intervals(data: ReportData) -> ReportData:
    """The same data without paired verdicts."""
    return data.with_tables(dependence=data["dependence"].clear())


@pytest.fixture(scope="module")
def repeated(make_run: Callable[..., RunFolder]) -> ReportData:
    return ReportData.of(make_run(paper="kitti"))


def test_the_papers_yardstick_stands_beside_the_papers_verdicts(repeated: ReportData) -> None:
    table = with_effects(repeated, verdict="yes").comparison
    assert table.select("factor", "tracker").unique(maintain_order=True).rows() == [
        ("tracker", None), ("speed", LK), ("speed", SIFT),
    ]  # fmt: skip
    asked = table.filter(pl.col("role") != "core")
    agreed = asked.filter(tracker=SIFT)["yardstick_agreement"].to_list()
    assert agreed == ["agree", "disagree", "disagree", "agree", "agree"]
    assert paper.tally(table, of="yardstick_agreement") == {"agree": 12, "disagree": 3, "undecided": 0}
    undecided = with_effects(repeated, verdict="undecided").comparison
    assert paper.tally(undecided, of="yardstick_agreement") == {"agree": 0, "disagree": 0, "undecided": 15}


def test_the_core_is_compared_although_the_paper_has_none(repeated: ReportData) -> None:
    core = repeated.comparison.filter(role="core")
    assert core.height == 3
    assert core["yardstick_verdict"].null_count() == core["paper"].null_count() == 3
    assert set(core["verdict"]) == {"undecided"}


def test_what_was_measured_does_not_depend_on_the_paper(repeated: ReportData, run: RunFolder) -> None:
    ours = [
        data.comparison.drop("paper", "agreement", "yardstick_agreement") for data in (repeated, ReportData.of(run))
    ]
    assert ours[0].equals(ours[1])


def test_a_question_of_the_paper_is_kept_where_the_run_cannot_answer_it(make_run: Callable[..., RunFolder]) -> None:
    data = without_intervals(ReportData.of(make_run(paper="dtu", trackers=(LK,), speeds=(1,))))
    table = data.comparison
    assert table["factor"].unique(maintain_order=True).to_list() == ["tracker", "speed", "lighting"]
    assert set(table["yardstick_verdict"]) == {"undecided"}
    assert set(table["verdict"]) == {None}
    assert set(table["agreement"].drop_nulls()) == {"undecided"}
    rows = factor_section.details(data).rows
    assert rows[0][4] == "only one tracker was measured: lucas-kanade"


def test_other_factors_stand_there_without_the_papers_word(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(paper="kitti", views=((0, "forward"), (0, "backward"))))
    grid = factor_section.side_by_side(data.comparison)
    assert "direction, lucas-kanade: paired" in grid.columns
    assert "direction, lucas-kanade: paper" not in grid.columns
    assert data.comparison.filter(factor="direction")["agreement"].null_count() == 12


def test_the_table_has_the_papers_rows_and_our_effects(repeated: ReportData) -> None:
    grid = factor_section.side_by_side(with_effects(repeated, verdict="no", effect=0.0512).comparison)
    assert [name.replace(SPACE, " ") for name in grid["statistic"]] == [
        "mean error", "mean absolute error", "second moment", "core", "lifetime", "outlier ratio",
    ]  # fmt: skip
    said = ["yes", "no", "no", "–", "yes", "yes"]
    assert grid["speed, correspondence: paper"].to_list() == said
    marks = {"yes": "✗", "no": "✓"}
    assert [cell.replace(SPACE, " ") for cell in grid["speed, correspondence: paper's yardstick"]] == [
        f"no (5.1 %) {marks[one]}" if one in marks else "–" for one in said
    ]
    cells = factor_section.verdicts(repeated)
    assert list(cells.groups) == [("", 1), ("tracker", 3), (f"speed, {LK}", 3), (f"speed, {SIFT}", 3)]
    assert cells.headings == ["statistic", *["paper", "paper's yardstick", "paired"] * 3]


@pytest.mark.parametrize(
    ("effect", "expected"),
    [
        (None, ""),
        (0.0, "0.0 %"),
        (0.0999, "10.0 %"),
        (0.3, "30 %"),
        (9.9, "990 %"),
        (9.996, "> 1000 %"),
        (0.1996, "20 %"),
        (float("inf"), "> 1000 %"),
    ],
)
def test_effects_are_written_with_the_digits_that_the_margin_needs(effect: float | None, expected: str) -> None:
    assert effect_text(effect).replace("\N{NO-BREAK SPACE}", " ") == expected


def test_the_sentence_counts_the_cells(repeated: ReportData) -> None:
    (sentence,) = factor_section.sentences(with_effects(repeated, verdict="yes", share_of_absolute=0.5))
    cells = "The paper's table for KITTI has 15 cells that this run can be compared with."
    assert sentence.startswith(f"{cells} By the paper's yardstick, 12 agree with the paper and 3 disagree.")
    assert sentence.endswith("By paired verdicts, 0 agree with the paper, 0 disagree and 15 are undecided.")
    (sentence,) = factor_section.sentences(with_dependence(repeated, verdict="yes"))
    assert sentence.endswith("By paired verdicts, 12 agree with the paper and 3 disagree.")


def test_a_yes_on_hardly_any_bias_is_put_into_proportion(repeated: ReportData) -> None:
    small = with_effects(repeated, verdict="yes", share_of_absolute=None)
    row = (pl.col("factor") == "speed") & (pl.col("tracker") == LK) & (pl.col("statistic") == "nu")
    share = pl.when(row).then(0.04).otherwise("share_of_absolute")
    small = small.with_tables(effects=small["effects"].with_columns(share_of_absolute=share))
    assert (
        "Caution: by the paper's yardstick, the yes for the mean error of lucas-kanade by speed may be chance."
        in factor_section.sentences(small)[1]
    )
    assert "by at most 4.0\N{NO-BREAK SPACE}% of" in factor_section.sentences(small)[1]


def test_a_run_of_its_own_is_not_compared_with_the_paper(run: RunFolder) -> None:
    data = ReportData.of(run)
    assert factor_section.heading(data) == "Factor effects"
    assert not any("paper" in heading for heading in factor_section.verdicts(data).headings)
    assert not any("paper" in sentence for sentence in factor_section.sentences(data))


def test_a_run_that_varies_nothing_says_so(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(trackers=(LK,), speeds=(1,)))
    assert factor_section.sentences(data) == ["This run varies no factor, so there is nothing to compare."]
    assert factor_section.details(data).rows == []


def test_what_decided_names_levels_place_and_size(run: RunFolder) -> None:
    data = without_intervals(ReportData.of(run))
    effects = data["effects"].filter(factor="speed", tracker=LK, statistic="eta").row(0, named=True)
    cells = factor_section.details(data)
    (row,) = [row for row in cells.rows if row[:2] == ["speed", LK] and "absolute" in row[2]]
    place = f"{effects['coordinate']}, at age {effects['at']}"
    assert [cell.replace("\N{NO-BREAK SPACE}", " ") for cell in row[3:7]] == [
        effects["verdict"], "1 and 2", place, "1 of 1"
    ]  # fmt: skip
    assert len(row) == len(cells.headings) == len(cells.numeric)


def with_dependence(data: ReportData, **columns: object) -> ReportData:
    """The same data with other values in all rows of its verdicts with intervals."""
    changed = {name: pl.lit(value, dtype=data["dependence"].schema[name]) for name, value in columns.items()}
    return data.with_tables(dependence=data["dependence"].with_columns(**changed))


@pytest.fixture
def judged(make_run: Callable[..., RunFolder]) -> ReportData:
    data = with_effects(ReportData.of(make_run(paper="kitti")), verdict="yes", effect=0.45)
    found = {"unit": "ratio", "level_a": "1", "level_b": "2", "better": "1", "effect": 13.2, "low": 9.04, "high": 19.3}
    return with_dependence(data, verdict="no", **found, margin=1.1, n_scenes=9, why=None)


def test_both_verdicts_are_labelled_and_judged(judged: ReportData) -> None:
    table = judged.comparison
    assert set(table["verdict"]) == {"no"}
    assert set(table["yardstick_verdict"].drop_nulls()) == {"yes"}
    agreed = table.filter(pl.col("role") != "core", tracker=SIFT)["agreement"].to_list()
    assert agreed == ["disagree", "agree", "agree", "disagree", "disagree"]
    row = factor_section.verdicts(judged).rows[0]
    assert [cell.replace(SPACE, " ") for cell in row[-3:]] == ["yes", "yes (45 %) ✓", "no (13 times, 9.0 to 19) ✗"]


def test_intervals_name_the_better_level_and_what_is_missing(judged: ReportData) -> None:
    cells = factor_section.intervals(judged)
    assert cells is not None
    assert all(len(row) == len(cells.headings) == len(cells.numeric) for row in cells.rows)
    row = [cell.replace(SPACE, " ") for cell in cells.rows[0]]
    assert row[:7] == ["tracker", "–", "mean error", "no", "1 and 2", "13 times (9.0 to 19)", "1"]
    assert row[8:] == ["1.10 times", "9", "–", ""]
    nothing = {"level_a": None, "level_b": None, "better": None, "effect": None, "low": None, "high": None}
    why = "only 4 scenes, at least 6 are needed"
    open_ = with_dependence(judged, verdict="undecided", **nothing, n_scenes=4, more_scenes=1200, why=why)
    assert paper.tally(open_.comparison) == {"agree": 0, "disagree": 0, "undecided": 15}
    cells = factor_section.intervals(open_)
    assert cells is not None
    assert cells.rows[0][3:8] == ["undecided", "–", "–", "–", "–"]
    assert cells.rows[0][9:] == ["4", "1,200", why]


def test_the_yardstick_keeps_its_own_table(judged: ReportData) -> None:
    assert {row[3] for row in factor_section.details(judged).rows} == {"yes"}
    assert factor_section.intervals(without_intervals(judged)) is None
