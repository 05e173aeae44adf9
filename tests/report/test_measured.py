from collections.abc import Callable
from dataclasses import replace
from types import ModuleType

import polars as pl

from tracknoise.report import measured
from tracknoise.report.report_data import ReportData
from tracknoise.tables.schema import TrackEnd, TruthStatus
from tracknoise.tables.store import RunFolder
from tracknoise.topics.truth_topic import without_truth


def _integer(cell: str) -> int:
    return int(cell.split()[0].replace(",", ""))


def test_truth_counts_are_those_of_the_observations(run: RunFolder) -> None:
    shown = measured.truth_counts(ReportData.of(run))
    observations = pl.concat(run.sequence_tables("observations")).filter(tracker="correspondence", speed=2)
    (row,) = [row for row in shown.rows if row[:2] == ["correspondence", "2"]]
    assert _integer(row[2]) == observations.height
    for cell, status in zip(row[3:], TruthStatus, strict=True):
        assert _integer(cell) == observations.filter(truth=status.name).height


def test_end_counts_are_those_of_the_tracks(run: RunFolder) -> None:
    shown = measured.end_counts(ReportData.of(run))
    tracks = pl.concat(run.sequence_tables("tracks")).filter(tracker="lucas-kanade", speed=1)
    for cell, end in zip(shown.rows[0][3:], TrackEnd, strict=True):
        assert _integer(cell) == tracks.filter(end=end.name).height


def test_trackers_come_in_the_order_of_the_experiment(run: RunFolder) -> None:
    rows = measured.end_counts(ReportData.of(run)).rows
    assert [row[:2] for row in rows] == [
        ["lucas-kanade", "1"],
        ["lucas-kanade", "2"],
        ["correspondence", "1"],
        ["correspondence", "2"],
    ]


def test_settings_and_options_are_all_there(run: RunFolder) -> None:
    data = ReportData.of(run)
    rows = dict(measured.settings(data).rows)
    assert rows["speeds"] == "1 and 2"
    assert rows["dataset.options.frames"] == "30"
    assert rows["statistics.min_features"] == "40"
    assert measured.trackers(data).rows[0] == ["lucas-kanade", "lucas-kanade", "window = 15"]


def test_views_are_told_as_an_experiment_file_has_them(run: RunFolder) -> None:
    data = ReportData.of(run)
    views = [{"rotation": 0, "direction": "forward"}, {"rotation": 90, "lightings": ["diffuse", "LR0"]}]
    rows = measured.settings(replace(data, settings={"views": views})).rows
    assert [list(row) for row in rows] == [
        ["views[0].rotation", "0"],
        ["views[0].direction", "forward"],
        ["views[1].rotation", "90"],
        ["views[1].lightings", "diffuse and LR0"],
    ]


def test_sequences_that_failed_of_the_same_are_told_together(run: RunFolder) -> None:
    data = ReportData.of(run)
    failures = {"x@led-2": "torn", **{f"s@led-{number}": "dark" for number in range(6)}}
    failed = replace(data, manifest=replace(data.manifest, failures=failures))
    assert measured.failures(failed) == [("s@led-0, s@led-1, s@led-2 and 3 others", "dark"), ("x@led-2", "torn")]


def test_scenes_and_notes_are_told(run: RunFolder) -> None:
    data = ReportData.of(run)
    assert measured.scenes(data).rows[0] == [
        *("simulated", "fixating", "default", "0", "20"),
        *("160 × 120", "raycast"),
    ]
    assert measured.notes(data) == [("forward@default", "poses were projected to the nearest rotation, by up to 0.002")]


def test_a_page_does_not_depend_on_how_long_measuring_took(run: RunFolder) -> None:
    data = ReportData.of(run)
    slower = {key: replace(entry, seconds=99.0) for key, entry in data.manifest.sequences.items()}
    again = replace(data, manifest=replace(data.manifest, sequences=slower))
    assert measured.scenes(again) == measured.scenes(data)


def test_several_lightings_have_a_column(make_run: Callable[..., RunFolder], synthetic: ModuleType) -> None:
    run = make_run(**synthetic.DEGENERATE["two lightings"])
    assert measured.end_counts(ReportData.of(run)).headings[:3] == ["tracker", "speed", "lighting"]


def test_a_tracker_without_a_feature_stands_in_the_tables_with_zeros(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(scenes=("only",), speeds=(1,), featureless=("correspondence",)))
    for shown in (measured.truth_counts(data), measured.end_counts(data)):
        assert [row[0] for row in shown.rows] == ["lucas-kanade", "correspondence"]
        assert set(shown.rows[1][2:]) == {"0"}


def test_a_run_without_any_true_position_says_so_once(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(depth=False))
    n = data["counts"].filter(kind="truth")["n"].sum()
    told = f"100.0\N{NO-BREAK SPACE}% of {n:,} observations is unknown (100.0\N{NO-BREAK SPACE}% no depth)"
    assert measured.without_truth(data) == [
        ("The whole run", f"the true position of {told}. No error could be measured.")
    ]


def test_conditions_mostly_without_true_positions_are_named(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(depthless=("correspondence",)))
    places = [place for place, _ in measured.without_truth(data)]
    assert places == ["correspondence at speed 1", "correspondence at speed 2"]


def test_any_share_without_depth_from_images_is_told(make_run: Callable[..., RunFolder]) -> None:
    told = {}
    for truth in ("birth", "swept"):
        run = make_run(scenes=("a", "b", "c"), truth=truth, depthless=("b",))
        told[truth] = without_truth(ReportData.of(run))
    assert told["birth"] == ""
    assert told["swept"].endswith("of observations lack true positions.")


def test_scenes_mostly_without_true_positions_are_named(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(scenes=("a", "b", "c"), depthless=("b",)))
    ((place, sentence),) = measured.without_truth(data)
    assert place == "b@default"
    assert sentence.endswith("No error could be measured.")


def test_a_large_share_is_told_with_what_the_errors_rest_on(make_run: Callable[..., RunFolder]) -> None:
    run = make_run(scenes=("a", "b", "c"), trackers=("one",), speeds=(1,), depthless=("b", "c"))
    statuses = dict(pl.concat(run.sequence_tables("observations"))["truth"].value_counts().rows())
    share = f"{100 * statuses['no_depth'] / sum(statuses.values()):.1f}\N{NO-BREAK SPACE}%"
    sentence = dict(measured.without_truth(ReportData.of(run)))["one at speed 1"]
    assert sentence.startswith(f"the true position of {share} of ")
    assert sentence.endswith(f"({share} no depth). Errors are measured for the rest only.")


def test_few_unknown_true_positions_need_no_word(run: RunFolder) -> None:
    assert measured.without_truth(ReportData.of(run)) == []


def test_directions_have_a_column_where_there_are_several(make_run: Callable[..., RunFolder]) -> None:
    views = ((0, "forward"), (0, "backward"))
    data = ReportData.of(make_run(scenes=("there", "back"), speeds=(1,), views=views))
    shown = measured.scenes(data)
    assert shown.headings[3:5] == ["rotation (°)", "direction"]
    assert [row[4] for row in shown.rows] == ["forward", "backward"] * 2
    conditions = [row[:3] for row in measured.end_counts(data).rows]
    assert conditions[:2] == [["lucas-kanade", "1", "forward"], ["lucas-kanade", "1", "backward"]]


def test_scenes_that_were_left_out_are_told(own_run: RunFolder) -> None:
    manifest = own_run.manifest()
    manifest.excluded_scenes["parked"] = "the camera stands still in 80 of 100 frames."
    own_run.write_manifest(manifest)
    assert measured.excluded_scenes(ReportData.of(own_run)) == [
        ("parked", "the camera stands still in 80 of 100 frames.")
    ]


def test_the_same_note_of_many_sequences_is_told_once(make_run: Callable[..., RunFolder]) -> None:
    lightings = tuple(f"led-{i}" for i in range(6))
    run = make_run(scenes=("forward",), trackers=("one",), speeds=(1,), n_frames=6, lightings=lightings)
    ((place, _),) = measured.notes(ReportData.of(run))
    assert place == "forward@led-0, forward@led-1, forward@led-2 and 3 others"


def test_many_places_without_true_positions_are_told_together(make_run: Callable[..., RunFolder]) -> None:
    names = tuple(f"scene-{i}" for i in range(6))
    data = ReportData.of(make_run(scenes=names, trackers=("one",), speeds=(1,), depthless=names[1:]))
    told = dict(measured.without_truth(data))
    assert list(told) == ["one at speed 1", "scene-1@default, scene-2@default, scene-3@default and 2 others"]
    observations = pl.concat(data.run.sequence_tables("observations")).filter(pl.col("scene") != "scene-0")
    share = "100.0\N{NO-BREAK SPACE}%"
    assert f"the true position of {share} of {observations.height:,} observations" in list(told.values())[1]


def test_a_large_run_lists_the_conditions_of_its_view(
    make_run: Callable[..., RunFolder], synthetic: ModuleType
) -> None:
    data = ReportData.of(make_run(**synthetic.DEGENERATE["many conditions"]))
    for shown in (measured.summary(data), measured.truth_counts(data), measured.end_counts(data)):
        assert [row[:2] for row in shown.rows] == [["lucas-kanade", "1"]]
        assert shown.caption.endswith(", under lighting LR0; 40 other conditions in the table file")
    assert len(measured.scenes(data).rows) == 1
    assert measured.scenes(data).caption == "Sequences, under lighting LR0, of 41 sequences in all (41 lightings)"


def test_the_summary_speaks_of_frames_where_there_is_a_scan(make_run: Callable[..., RunFolder]) -> None:
    run = make_run(scenes=("only",), born=40, key_frame=8, truth="scan")
    shown = measured.summary(ReportData.of(run))
    place = shown.headings.index("frame")
    assert shown.headings[place + 1 : place + 3] == ["mean u", "mean v"]
    assert shown.rows[0][place] == "16"  # the last of both trackers


def test_what_a_scan_does_not_reach_is_not_called_depth(make_run: Callable[..., RunFolder]) -> None:
    data = ReportData.of(make_run(scenes=("only",), born=40, key_frame=8, truth="scan"))
    assert "not on the scan" in measured.truth_counts(data).headings
    assert "no depth" not in measured.truth_counts(data).headings
