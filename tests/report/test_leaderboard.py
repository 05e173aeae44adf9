"""The leaderboard: who leads, ranks, and costs."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from tracknoise.analysis.factors import RANKS
from tracknoise.exceptions import StoreError
from tracknoise.report.answer import number_of
from tracknoise.report.figures.rankings import _apart, ranking_figures
from tracknoise.report.leaderboard import leaderboard
from tracknoise.report.report_data import ReportData
from tracknoise.tables.costs import COSTS_JSON, read_costs, write_costs
from tracknoise.tables.store import RunFolder
from tracknoise.topics.answer_summary import NoiseToSet
from tracknoise.topics.factor_topic import accuracy
from tracknoise.words import SPACE

SPANS = {"best": (1, 1), "alike": (2, 3), "other": (2, 3)}


def ranked(run: RunFolder, spans: dict[str, tuple[int, int]] = SPANS) -> ReportData:
    """A run with ranks by the core, and by the RMS that tells nothing."""
    data = ReportData.of(run)
    held = data.nominal(data["summary"]).row(0, named=True)
    every = {name: (1, len(spans)) for name in spans}
    rows = [
        {name: held.get(name) for name in RANKS}
        | {"statistic": statistic, "axis": "age", "tracker": name, "best": best, "worst": worst}
        | {"n_trackers": len(spans), "n_scenes": 8, "level": 0.95}
        for statistic, found in (("core", spans), ("Phi", every))
        for name, (best, worst) in found.items()
    ]
    return data.with_tables(ranks=pl.DataFrame(rows, schema=dict(RANKS)))


@pytest.fixture(scope="module")
def three(make_run: Callable[..., RunFolder]) -> RunFolder:
    return make_run(scenes=("one", "two"), trackers=("best", "alike", "other"), speeds=(1,), n_frames=6, born=4)


def setting(tracker: str, sigma_px: float, *, is_bound: bool = False) -> NoiseToSet:
    sigma, innovations = (number_of(value, None, None) for value in (sigma_px, 0.1))
    return NoiseToSet(tracker, "#000000", 11, None, sigma, is_bound, "", innovations)


def test_the_board_has_the_best_first_with_ranges_of_ranks(three: RunFolder) -> None:
    found = leaderboard(ranked(three))
    assert found is not None
    assert [(row.tracker, row.span("core")) for row in found.rows] == [
        ("best", "1"),
        ("alike", "2 to 3"),
        ("other", "2 to 3"),
    ]
    assert {row.span("second") for row in found.rows} == {"1 to 3"}
    first, second, _ = found.rows
    assert found.why(first, "core") == "distinguished from all others; shown to be better than 2"
    assert found.why(second, "core") == "not distinguished from 1 of 2 others; shown to be worse than 1"
    of_alike = "Rank 2 to 3 (alike): 1 is shown to be better by more than 10\N{NO-BREAK SPACE}%, 0 worse."
    assert found.reading == of_alike
    assert "Ranks are from 8 scenes." in found.cells().caption
    assert replace(found, scenes=1).reading == f"Ranks are from 1 scene. {of_alike}"
    assert [row[0] for row in found.cells().rows] == ["best", "alike", "other"]


def test_of_those_that_share_the_first_rank_the_smallest_sigma_leads(three: RunFolder) -> None:
    found = leaderboard(ranked(three, {"best": (1, 2), "alike": (1, 2), "other": (3, 3)}))
    assert found is not None
    told = found.leader_with([setting("best", 0.3), setting("alike", 0.2), setting("other", 0.1)]).replace(SPACE, " ")
    shared = "2 of 3 trackers share the first rank in typical error;"
    assert told == f"alike: set 0.200 px. {shared} alike has the smallest sigma of these."
    bound = found.leader_with([setting("best", 0.2, is_bound=True), setting("alike", 0.3, is_bound=True)])
    assert bound.replace(SPACE, " ").startswith("best: sigma is at most 0.200 px.")
    assert found.leader_with([]) == "2 of 3 trackers share the first rank."


def test_where_nobody_is_shown_to_be_better_this_is_said(three: RunFolder) -> None:
    found = leaderboard(ranked(three, dict.fromkeys(SPANS, (1, 3))))
    assert found is not None
    assert "none is shown to have smaller typical errors" in found.leader_with([setting("other", 0.2)])


def test_without_ranks_there_is_no_table_and_no_figure(run: RunFolder) -> None:
    data = ReportData.of(run)
    assert leaderboard(data) is None
    assert ranking_figures(data) == []


@pytest.mark.parametrize(
    ("spans", "text"),
    [
        (SPANS, "best has the smallest typical error of 3 trackers."),
        (
            {"a": (1, 2), "b": (1, 2), "c": (3, 3)},
            "2 of 3 trackers share the first rank in typical error: a and b.",
        ),
        (
            {**dict.fromkeys("abcd", (1, 4)), "e": (5, 5)},
            "4 of 5 trackers share the first rank in typical error: a, b and 2 others.",
        ),
    ],
)
def test_the_first_screen_names_who_leads(run: RunFolder, spans: dict[str, tuple[int, int]], text: str) -> None:
    assert accuracy(ranked(run, spans), {}).text.startswith(text)


def test_where_nothing_is_shown_nobody_leads(run: RunFolder) -> None:
    assert "typical error" not in accuracy(ranked(run, dict.fromkeys("abc", (1, 3))), {}).text


def test_costs_are_kept_and_read(own_run: RunFolder) -> None:
    assert read_costs(own_run) == {}
    write_costs(own_run, {"a": 1.5})
    assert read_costs(own_run) == {"a": 1.5}


@pytest.mark.parametrize("text", ["[" * 100_000, "[1]", '{"a": "much"}', '{"a": [1]}'])
def test_damaged_costs_are_named(own_run: RunFolder, text: str) -> None:
    own_run.write_statistics({}, documents={COSTS_JSON: text})
    with pytest.raises(StoreError, match=r"costs\.json: damaged .*, expected CPU times of trackers"):
        read_costs(own_run)


def test_labels_do_not_cover_each_other() -> None:
    right, up = np.array([10.0, 20.0, 30.0, 300.0]), np.array([50.0, 51.0, 52.0, 50.0])
    moved = _apart(right, up, ["vins-mono", "openvins", "kimera", "far"])
    heights = np.sort((up + moved)[:3])
    assert np.diff(heights).min() >= 12.0 - 1e-9
    assert moved[3] == 0.0
