from collections.abc import Callable

import polars as pl

from tracknoise.report import measured
from tracknoise.report.evidence import Evidence
from tracknoise.tables.schema import TrackEnd, TruthStatus
from tracknoise.tables.store import RunFolder


def _integer(cell: str) -> int:
    return int(cell.split()[0].replace(",", ""))


def test_truth_counts_are_those_of_the_observations(run: RunFolder) -> None:
    shown = measured.truth_counts(Evidence.of(run))
    observations = pl.concat(run.sequence_tables("observations")).filter(tracker="correspondence", speed=2)
    (row,) = [row for row in shown.rows if row[:2] == ["correspondence", "2"]]
    assert _integer(row[2]) == observations.height
    for cell, status in zip(row[3:], TruthStatus, strict=True):
        assert _integer(cell) == observations.filter(truth=status.name).height


def test_end_counts_are_those_of_the_tracks(run: RunFolder) -> None:
    shown = measured.end_counts(Evidence.of(run))
    tracks = pl.concat(run.sequence_tables("tracks")).filter(tracker="lucas-kanade", speed=1)
    for cell, end in zip(shown.rows[0][3:], TrackEnd, strict=True):
        assert _integer(cell) == tracks.filter(end=end.name).height


def test_trackers_come_in_the_order_of_the_experiment(run: RunFolder) -> None:
    rows = measured.end_counts(Evidence.of(run)).rows
    assert [row[:2] for row in rows] == [
        ["lucas-kanade", "1"],
        ["lucas-kanade", "2"],
        ["correspondence", "1"],
        ["correspondence", "2"],
    ]


def test_settings_and_options_are_all_there(run: RunFolder) -> None:
    evidence = Evidence.of(run)
    rows = dict(measured.settings(evidence).rows)
    assert rows["speeds"] == "1 and 2"
    assert rows["dataset.options.frames"] == "30"
    assert rows["statistics.min_features"] == "40"
    assert measured.trackers(evidence).rows[0] == ["lucas-kanade", "lucas-kanade", "window = 15"]


def test_scenes_and_notes_are_told(run: RunFolder) -> None:
    evidence = Evidence.of(run)
    assert measured.scenes(evidence).rows[0] == [
        *("simulated", "fixating", "default", "0", "20"),
        *("160 × 120", "raycast", "3.2"),
    ]
    assert measured.notes(evidence) == [
        ("forward@default", "poses were projected to the nearest rotation, by up to 0.002")
    ]


def test_several_lightings_have_a_column(make_run: Callable[..., RunFolder]) -> None:
    run = make_run(lightings=("led-1", "led-2"), scenes=("only",), speeds=(1,))
    assert measured.end_counts(Evidence.of(run)).headings[:3] == ["tracker", "speed", "lighting"]


def test_a_tracker_without_a_feature_stands_in_the_tables_with_zeros(make_run: Callable[..., RunFolder]) -> None:
    evidence = Evidence.of(make_run(scenes=("only",), speeds=(1,), featureless=("correspondence",)))
    for shown in (measured.truth_counts(evidence), measured.end_counts(evidence)):
        assert [row[0] for row in shown.rows] == ["lucas-kanade", "correspondence"]
        assert set(shown.rows[1][2:]) == {"0"}


def test_a_run_without_any_true_position_says_so_once(make_run: Callable[..., RunFolder]) -> None:
    evidence = Evidence.of(make_run(depth=False))
    n = evidence.counts.filter(kind="truth")["n"].sum()
    told = f"100.0\N{NO-BREAK SPACE}% of {n:,} observations is unknown (100.0\N{NO-BREAK SPACE}% no depth)"
    assert measured.without_truth(evidence) == [
        ("The whole run", f"the true position of {told}; no error could be measured.")
    ]


def test_conditions_mostly_without_true_positions_are_named(make_run: Callable[..., RunFolder]) -> None:
    evidence = Evidence.of(make_run(depthless=("correspondence",)))
    places = [place for place, _ in measured.without_truth(evidence)]
    assert places == ["correspondence at speed 1", "correspondence at speed 2"]


def test_scenes_mostly_without_true_positions_are_named(make_run: Callable[..., RunFolder]) -> None:
    evidence = Evidence.of(make_run(scenes=("a", "b", "c"), depthless=("b",)))
    ((place, sentence),) = measured.without_truth(evidence)
    assert place == "b@default"
    assert sentence.endswith("no error could be measured.")


def test_a_large_share_is_told_with_what_the_errors_rest_on(make_run: Callable[..., RunFolder]) -> None:
    run = make_run(scenes=("a", "b", "c"), trackers=("one",), speeds=(1,), depthless=("b", "c"))
    statuses = dict(pl.concat(run.sequence_tables("observations"))["truth"].value_counts().rows())
    share = f"{100 * statuses['no_depth'] / sum(statuses.values()):.1f}\N{NO-BREAK SPACE}%"
    sentence = dict(measured.without_truth(Evidence.of(run)))["one at speed 1"]
    assert sentence.startswith(f"the true position of {share} of ")
    assert sentence.endswith(f"({share} no depth); its errors are of the rest alone.")


def test_few_unknown_true_positions_need_no_word(run: RunFolder) -> None:
    assert measured.without_truth(Evidence.of(run)) == []
