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
