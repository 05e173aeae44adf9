"""A file of results: others add their trackers, and what is not comparable is refused."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from tracknoise.exceptions import SettingsError
from tracknoise.report.report_data import ReportData
from tracknoise.report.results_file import (
    Results,
    Round,
    StatedPoses,
    joined,
    read_results,
    results_json,
    round_of,
    standings,
)
from tracknoise.tables.manifest import PoseFit
from tracknoise.tables.store import RunFolder


@pytest.fixture(scope="module")
def made(make_run: Callable[..., RunFolder]) -> Round:
    run = make_run(scenes=tuple("abcdef"), trackers=("one", "two"), speeds=(1, 2), n_frames=8, born=30)
    return round_of(ReportData.of(run))


def test_what_is_written_is_read_again(made: Round, tmp_path: Path) -> None:
    results = joined(Results(), "first", made)
    path = tmp_path / "results.json"
    path.write_text(results_json(results))
    assert read_results(path) == results
    assert list(made.trackers) == ["one", "two"]
    assert set(made.trackers["one"].scenes) == set("abcdef") == set(made.groups)
    assert "root" not in made.experiment
    assert "trackers" not in made.experiment


def test_a_tracker_joins_a_round_or_takes_its_own_place(made: Round) -> None:
    results = joined(Results(), "first", replace(made, trackers={"one": made.trackers["one"]}))
    other = replace(made.trackers["two"], cpu_ms=5.0)
    results = joined(results, "first", replace(made, trackers={"two": other}))
    assert list(results.rounds["first"].trackers) == ["one", "two"]
    results = joined(results, "first", replace(made, trackers={"two": replace(other, cpu_ms=7.0)}))
    assert results.rounds["first"].trackers["two"].cpu_ms == 7.0
    shown = standings(results.rounds["first"]).cells()
    assert {row[0] for row in shown.rows} == {"one", "two"}
    assert "7\N{NO-BREAK SPACE}ms" in {row[-1] for row in shown.rows}


def test_what_cannot_be_compared_is_refused(made: Round) -> None:
    made = replace(made, versions={"numpy": "2.0"})
    results = joined(Results(), "first", made)
    key = next(iter(made.sequences))
    for other, message in [
        (replace(made, versions={"numpy": "0.1"}), "version of numpy: found 0.1, expected 2.0"),
        (replace(made, experiment=f"{made.experiment}x = 1\n"), "settings: found x = 1, expected nothing else"),
        (replace(made, sequences={"z": made.sequences[key]}), "sequences: found z, expected "),
        (
            replace(made, sequences={**made.sequences, key: {**made.sequences[key], "frames": "99"}}),
            f"frames of {key}: found 99, expected {made.sequences[key]['frames']}",
        ),
        (
            replace(made, sequences={**made.sequences, key: {**made.sequences[key], "poses": "refined"}}),
            f"poses of {key}: found refined, expected stated",
        ),
    ]:
        with pytest.raises(SettingsError, match="round first: ") as refused:
            joined(results, "first", other)
        assert message in str(refused.value)


def test_another_frame_is_no_other_data(made: Round) -> None:
    key = next(iter(made.sequences))
    other = {**made.sequences, key: {**made.sequences[key], "image": "frame 99: abc"}}
    joined(joined(Results(), "first", made), "first", replace(made, sequences=other))


def test_the_same_frame_of_a_recording_has_the_same_image(made: Round) -> None:
    """Noise of simulated images depends on the processor."""
    key = next(iter(made.sequences))
    frame = made.sequences[key]["image"].partition(":")[0]
    other = replace(made, sequences={**made.sequences, key: {**made.sequences[key], "image": f"{frame}: abc"}})
    joined(joined(Results(), "first", replace(made, folder="")), "first", replace(other, folder=""))
    with pytest.raises(SettingsError, match="round first: image of "):
        joined(joined(Results(), "first", replace(made, folder="data")), "first", replace(other, folder="data"))


def test_results_say_how_wrong_stated_poses_are(make_run: Callable[..., RunFolder], tmp_path: Path) -> None:
    run = RunFolder(Path(shutil.copytree(make_run(scenes=tuple("ab"), n_frames=8, born=30).path, tmp_path / "run")))
    assert round_of(ReportData.of(run)).stated_poses is None
    growth = {"rotation_deg_per_sqrt_frame": 0.05, "translation_m_per_sqrt_frame": 0.002}
    fit = PoseFit(True, 300.0, left_px=0.1, stated_px=1.5, age=10, next_px=0.4, stated_errors=growth)
    manifest = run.manifest()
    manifest.sequences = {key: replace(entry, pose_fit=fit) for key, entry in manifest.sequences.items()}
    run.write_manifest(manifest)
    assert round_of(ReportData.of(run)).stated_poses == StatedPoses(0.05, 0.002, 0.4, 1.5, 0.1, 10)


def test_refined_poses_rank_nobody(made: Round) -> None:
    refined = {key: {**facts, "poses": "refined"} for key, facts in made.sequences.items()}
    assert standings(made).is_ranked
    assert not standings(replace(made, sequences=refined)).is_ranked


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[", "damaged"),
        ('{"rounds": 1}', "rounds: Input should be an object"),
        ('{"format": 9, "rounds": {}}', "found format 9, expected 1"),
    ],
)
def test_damaged_files_are_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "results.json"
    path.write_text(text)
    with pytest.raises(SettingsError) as refused:
        read_results(path)
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


def test_results_are_plain_json(made: Round) -> None:
    assert json.loads(results_json(joined(Results(), "first", made)))["format"] == 1
