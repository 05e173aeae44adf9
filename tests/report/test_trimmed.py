"""Where the percentile of trimming falls among errors that are zero by construction."""

from collections.abc import Callable
from typing import Any

import polars as pl

from tracknoise.report.report_data import ReportData
from tracknoise.tables.findings_schema import TRIMS
from tracknoise.tables.store import RunFolder
from tracknoise.topics import trimming_topic
from tracknoise.words import percent

MOSTLY_SEEN_ONCE: dict[str, Any] = {"loss": 0.97, "hidden": 0.0, "trackers": ("one",), "speeds": (1,)}


def test_where_most_tracks_were_seen_once_next_to_nothing_is_kept_of_the_others(
    make_run: Callable[..., RunFolder],
) -> None:
    run = make_run(**MOSTLY_SEEN_ONCE)
    ((place, sentence),) = trimming_topic.cut_at_zero(ReportData.of(run))
    tracks = pl.concat(run.sequence_tables("tracks"))
    once = int((tracks["lifetime"] == 1).sum())
    assert place == "one at speed 1"
    assert sentence.startswith(f"{percent(once / tracks.height)} of the tracks with a known error ")
    assert "This affects 2 of 2 scenes." in sentence
    assert f"Of the {tracks.height - once} tracks seen for longer, 0 are kept." in sentence
    assert tracks.filter(pl.col("lifetime") > 1)["kept"].sum() == 0


def test_where_the_percentile_is_of_the_others_all_is_well(make_run: Callable[..., RunFolder]) -> None:
    run = make_run(**MOSTLY_SEEN_ONCE, trim_among="followed")
    assert trimming_topic.cut_at_zero(ReportData.of(run)) == []
    assert trimming_topic.percentile_of(ReportData.of(run)) == (
        "those tracks of the same scene and condition that were followed beyond their first frame"
    )
    followed = pl.concat(run.sequence_tables("tracks")).filter(pl.col("lifetime") > 1)
    assert 0.7 < followed["kept"].mean() < 0.95  # type: ignore[operator]


def test_where_most_tracks_go_on_there_is_nothing_to_say(run: RunFolder) -> None:
    assert trimming_topic.cut_at_zero(ReportData.of(run)) == []
    assert trimming_topic.percentile_of(ReportData.of(run)) == "all tracks of the same scene and condition"


def test_scenes_in_which_it_is_so_are_counted(make_run: Callable[..., RunFolder]) -> None:
    run = make_run(scenes=("once", "on"), trackers=("one",), speeds=(1,), n_frames=12, hidden=0.0, percentile=15.0)
    trims = run.statistics(TRIMS).with_columns(share=100 * pl.col("n_anchor_only") / pl.col("n_measured"))
    decided = trims.filter(pl.col("share") >= pl.col("percentile"))
    ((_, sentence),) = trimming_topic.cut_at_zero(ReportData.of(run))
    assert f"This affects {decided.height} of 2 scenes." in sentence


def test_many_such_conditions_are_told_together(make_run: Callable[..., RunFolder]) -> None:
    settings = MOSTLY_SEEN_ONCE | {"scenes": ("only",), "trackers": ("one", "two"), "speeds": (1, 2, 4)}
    ((place, _),) = trimming_topic.cut_at_zero(ReportData.of(make_run(**settings)))
    assert place == "one at speed 1, one at speed 2, one at speed 4 and 3 others"


def test_nothing_trimmed_needs_no_word(make_run: Callable[..., RunFolder]) -> None:
    assert trimming_topic.cut_at_zero(ReportData.of(make_run(**MOSTLY_SEEN_ONCE, percentile=None))) == []
