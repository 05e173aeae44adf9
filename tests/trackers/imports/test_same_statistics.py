"""Imported tracks have the statistics of the same tracks measured natively, in every format."""

import numpy as np
import polars as pl
import pytest
from polars.testing import assert_frame_equal
from tests.writers.track_files import WRITERS, Observed

import tracknoise as tn
from tracknoise.sequences.arrays import Sequence
from tracknoise.statistics.summarise import STATISTICS, statistics_of
from tracknoise.tables.schema import BY_CAUSE

N_FRAMES = 8
START_S = 1_403_636_579.763
CAUSES = {"counts": pl.col("kind") != "end", "ends": pl.lit(value=True)}
WITHOUT = {"ends": [*BY_CAUSE], "tracks": ["end", "response"], "frames": ["outliers", "matched"]}


@pytest.fixture(scope="module")
def sequence() -> Sequence:
    """A simulated sequence with the timestamps of a recording."""
    simulated = tn.open_sequence(
        "simulated", motions=["forward"], frames=N_FRAMES, width=160, height=120, supersampling=1
    )
    return Sequence.from_arrays(
        [simulated.image(index) for index in range(N_FRAMES)],
        simulated.world_from_camera,
        simulated.camera,
        [simulated.depth(index).depth_m for index in range(N_FRAMES)],
        timestamps_s=START_S + 0.05 * np.arange(N_FRAMES),
    )


@pytest.fixture(scope="module")
def native(sequence: Sequence) -> tn.Measurement:
    return tn.measure(sequence, tn.LucasKanade(min_features=100, max_features=150))


@pytest.fixture(scope="module")
def seen(sequence: Sequence, native: tn.Measurement) -> Observed:
    columns = native.observations.select("track", "frame", "u_px", "v_px")
    arrays = [column.to_numpy() for column in columns]
    return Observed(*(array.astype(np.int64) for array in arrays[:2]), *arrays[2:], sequence.timestamps_s)


def comparable(measured: tn.Measurement) -> dict[str, pl.DataFrame]:
    """All tables, without the name of the tracker and what depends on the causes of ends."""
    tables = statistics_of(measured.prepared, list(STATISTICS))
    tables |= {"observations": measured.observations, "tracks": measured.tracks, "frames": measured.frames}
    return {
        name: table.filter(CAUSES.get(name, pl.lit(value=True))).drop(
            "tracker", pl.selectors.starts_with("quality_"), *WITHOUT.get(name, []), strict=False
        )
        for name, table in tables.items()
    }


@pytest.mark.parametrize("name", WRITERS)
def test_statistics_are_those_of_the_same_tracks_measured_natively(name, sequence, native, seen, tmp_path):
    path = tmp_path / name
    WRITERS[name](path, seen)
    imported = tn.measure(sequence, tn.Imported(str(path)))
    expected, found = comparable(native), comparable(imported)
    assert len(found["observations"]) > 500
    assert found["tracks"]["lifetime"].n_unique() > 4
    for table in expected:
        exact = name != "colmap.db"  # which holds float32
        assert_frame_equal(found[table], expected[table], check_exact=exact, rel_tol=1e-3, abs_tol=1e-3)
    assert imported.notes == ()


def test_arrays_in_memory_too(sequence, native, seen):
    imported = tn.measure(sequence, tn.Imported.from_arrays(seen.track, seen.frame, seen.u, seen.v))
    expected, found = comparable(native), comparable(imported)
    for table in expected:
        assert_frame_equal(found[table], expected[table], check_exact=True)


def test_causes_and_outliers_are_null_and_the_rest_of_the_counts_is_known(sequence, seen):
    imported = tn.measure(sequence, tn.Imported.from_arrays(seen.track, seen.frame, seen.u, seen.v))
    assert imported.frames["outliers"].null_count() == N_FRAMES
    alive = imported.tracks["first_frame"] + imported.tracks["lifetime"] == N_FRAMES
    assert imported.tracks["end"].is_null().equals(~alive)
    assert set(imported.tracks["end"].drop_nulls()) == {"sequence_end"}
    ratio = tn.outlier_ratios(imported.frames).row(0, named=True)
    assert (ratio["n_frames"], ratio["n_scenes"], ratio["outliers"], ratio["pooled_ratio"]) == (
        N_FRAMES - 1,
        1,
        None,
        None,
    )
    lived = tn.lifetimes(imported.tracks)
    assert lived["survival_until_failure"].null_count() == len(lived)
    assert lived.select(*BY_CAUSE).null_count().row(0) == (len(lived),) * len(BY_CAUSE)
    counts = statistics_of(imported.prepared, ["counts"])["counts"].filter(kind="end")
    assert dict(counts.select("name", "n").iter_rows()) == {
        **dict.fromkeys(("lost", "outlier", "displaced", "masked")),
        "sequence_end": int(alive.sum()),
    }


def test_a_chosen_part_of_a_recording_has_the_frame_numbers_of_the_recording(sequence, seen, tmp_path):
    """Every second frame from frame 2 on: what a tracker at speed 2 sees."""
    for name in ("table.csv", "timed.csv", "points.npz", "colmap.db"):
        WRITERS[name](tmp_path / name, seen)
        part = tn.measure(sequence, tn.Imported(str(tmp_path / name)), frames=(2, 7, 2))
        assert part.observations["frame"].unique().to_list() == [0, 1, 2]
        uv = part.observations.filter(frame=1).select("u_px", "v_px").sort("u_px", "v_px").to_numpy()
        rows = seen.frame == 4
        expected = np.column_stack([seen.u, seen.v])[rows]
        np.testing.assert_allclose(uv, expected[np.lexsort([expected[:, 1], expected[:, 0]])], atol=1e-4)


def test_measuring_imports_and_a_native_tracker_together_keeps_the_native_tables(sequence, native, seen):
    settings = tn.LucasKanade(min_features=100, max_features=150)
    both = tn.measure(
        sequence, {"lucas-kanade": settings, "mine": tn.Imported.from_arrays(seen.track, seen.frame, seen.u, seen.v)}
    )
    assert_frame_equal(both.frames.filter(tracker="lucas-kanade"), native.frames)
    assert_frame_equal(both.tracks.filter(tracker="lucas-kanade"), native.tracks)
