"""A study measures what `tracknoise.measure` measures in each sequence alone, though sequences share their work."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from benchmarks.effects.schema import CLEAN, EFFECT_CHANGES, Size
from benchmarks.effects.study import (
    SharedTracker,
    Study,
    base_options,
    chosen_effects,
    measure_scene,
    merged,
    run_study,
)

import tracknoise
from tracknoise.exceptions import SettingsError, StoreError
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import check
from tracknoise.trackers.lucas_kanade import LucasKanade
from tracknoise.trackers.tracker import Frame, SequenceContext

NAMES = ["auto exposure", "clock offset", "late depth"]


def small(**changes: object) -> Study:
    size = {"motions": ["fixating"], "worlds": 2, "frames": 5, "width": 120, "height": 90}
    quick = {"imaging": {"auto_exposure": {"period_frames": 2, "delay_frames": 1}}}
    options = merged(merged(base_options(), size), quick)
    study = {"effects": chosen_effects(NAMES), "trackers": {"lucas-kanade": {}}, "ages": (2,), "sizes": (Size.bad,)}
    return Study(options, **{**study, **changes})


@pytest.fixture(scope="module")
def values() -> pl.DataFrame:
    return measure_scene(small(), "fixating-00", Size.bad)


def test_values_are_those_of_each_sequence_measured_alone(values: pl.DataFrame) -> None:
    study = small()
    for effect in (None, *study.effects):
        reader = study.reader if effect is None else study.changed(effect, Size.bad)
        alone = tracknoise.measure(reader.open(reader.sequences()[0]), "lucas-kanade", truth="birth")
        chosen = {"population": "visible", "trimming": "trimmed", "axis": "age", "at": 2}
        (row,) = alone.moments.filter(**chosen).to_dicts()
        found = values.filter(effect=CLEAN if effect is None else effect.name)
        statistics = dict(zip(found["statistic"], found["value"], strict=True))
        assert statistics["mean_u"] == row["mean_u"]
        assert statistics["mean_v"] == row["mean_v"]
        errors = alone.observations.filter(kept=True, truth="valid", age=2)
        squares = (errors["du_px"] ** 2 + errors["dv_px"] ** 2).mean()
        assert statistics["second_moment"] == pytest.approx(squares, rel=1e-9)
        frames = alone.frames
        assert statistics["outlier_ratio"] == frames["outliers"].sum() / frames["offered"].sum()


def test_faults_change_errors_and_not_tracks(values: pl.DataFrame) -> None:
    by_effect = values.pivot("statistic", index="effect", values="value")
    clean, clock = (by_effect.filter(effect=name).to_dicts()[0] for name in (CLEAN, "clock offset"))
    assert clock["mean_u"] != clean["mean_u"]
    assert (clock["lifetime"], clock["outlier_ratio"]) == (clean["lifetime"], clean["outlier_ratio"])


def test_an_interrupted_study_resumes_and_more_scenes_can_be_added(tmp_path: Path) -> None:
    done: list[tuple[str, int, int]] = []

    def note(part: tuple[str, Size], count: int, total: int) -> None:
        done.append((part[0], count, total))

    study = small(effects=chosen_effects(["clock offset"]))
    one = Study(merged(study.options, {"worlds": 1}), study.effects, study.trackers, study.sizes, study.ages)
    run_study(one, tmp_path, done=note)
    changes = run_study(study, tmp_path, done=note)
    assert done == [("fixating-00", 1, 1), ("fixating-01", 2, 2)]
    check(changes, EFFECT_CHANGES, "changes")
    again = run_study(study, tmp_path, done=note)
    assert len(done) == 2
    assert again.equals(changes)
    row = changes.filter(statistic="mean_u").to_dicts()[0]
    assert (row["n_scenes"], row["shown"], row["kind"], row["unit"]) == (2, "30 ms", "truth", "px")
    assert row["change_low"] < row["change"] < row["change_high"]

    with pytest.raises(StoreError, match="a study with other settings"):
        run_study(small(), tmp_path, done=note)
    part = tmp_path / "scenes" / "fixating-01-bad.parquet"
    part.write_bytes(b"no table")
    with pytest.raises(StoreError, match=r"fixating-01-bad\.parquet: damaged"):
        run_study(study, tmp_path, done=note)


def test_other_files_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(StoreError, match="holds other files"):
        run_study(small(), tmp_path, done=lambda part, count, total: None)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_an_age_that_no_track_can_reach_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="age 5 of 5 frames, expected an age of at most 4"):
        run_study(small(ages=(2, 5)), tmp_path, done=lambda part, count, total: None)


def test_a_shared_tracker_follows_images_that_differ_from_a_later_frame_on() -> None:
    rng = np.random.default_rng(0)
    images = rng.integers(0, 255, (5, 60, 80), dtype=np.uint8).repeat(2, axis=1).repeat(2, axis=2)
    images[1:] = images[0]
    other = images.copy()
    other[3:] = np.roll(images[3:], 2, axis=2)
    context = SequenceContext(SequenceId("made", "up"), (160, 120), 5, 1, 0, None)
    shared = SharedTracker(LucasKanade())
    together = [shared.start(context) for _ in range(3)]
    alone = [LucasKanade().start(context) for _ in range(3)]
    for index in range(5):
        for one, own, shown in zip(together, alone, (images, images, other), strict=True):
            found, expected = (tracker.step(Frame(index, shown[index])) for tracker in (one, own))
            np.testing.assert_array_equal(found.ids, expected.ids)
            np.testing.assert_array_equal(found.uv, expected.uv)
    assert len(found.ids) > 10
