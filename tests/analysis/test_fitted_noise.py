"""Noise of tracks with triangulated truth: from observations to the table, the sentences and the report."""

import numpy as np
import polars as pl
import pytest
from benchmarks.validity.triangulated import make_tracks, sideways
from tests.lean import without_audit, without_depths

import tracknoise
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.tables.identity import SequenceId
from tracknoise.words import SELF_REFERENTIAL

FRAMES, COUNT, NOISE_PX = 12, 60, 0.5


def sequence_of(scene: str) -> RecordedSequence:
    made = sideways(FRAMES)
    return RecordedSequence(
        id=SequenceId("made", scene),
        source="made",
        camera=made.camera,
        world_from_camera=made.world_from_camera,
        images=made.images,
    )


def track_file(path, sequence, seed: int) -> str:
    """Tracks of 2 to 12 observations with white noise, as a file of tracks."""
    rng = np.random.default_rng(seed)
    observed = make_tracks(sequence, count=COUNT, length=FRAMES, noise_px=NOISE_PX, rng=rng).observed
    lives = rng.integers(2, FRAMES + 1, COUNT)
    rows = [
        {"frame": index, "track": track, "u_px": observed[track, index, 0], "v_px": observed[track, index, 1]}
        for index in range(FRAMES)
        for track in range(COUNT)
        if index < lives[track]
    ]
    pl.DataFrame(rows).write_parquet(path)
    return str(path)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tracks")
    measured = []
    for number in range(8):
        sequence = sequence_of(f"scene-{number}")
        tracker = tracknoise.Imported(path=track_file(folder / f"{number}.parquet", sequence, number))
        measured.append(tracknoise.measure(sequence, tracker, truth="triangulated"))
    with without_audit(), without_depths():
        return tracknoise.analyse(measured)


def test_the_noise_that_was_injected_is_measured_for_all_lengths_with_an_interval(run):
    table = run.table("triangulated_noise", trimming="untrimmed")
    every = table.filter(pl.col("length_low").is_null())
    assert every.select("measure", "coordinate").rows() == [
        ("triangulated", "both"),
        ("triangulated", "u"),
        ("triangulated", "v"),
        ("epipolar", "both"),
    ]
    assert (every["low"] < NOISE_PX).all()
    assert (every["high"] > NOISE_PX).all()
    assert every["sigma_px"].to_numpy() == pytest.approx(NOISE_PX, rel=0.05)
    assert every["n_scenes"].unique().to_list() == [8]
    assert every["resampled"].unique().to_list() == ["scenes"]
    classes = table.filter(coordinate="both").drop_nulls("length_low")
    found = classes.select("measure", "length_low", "length_high").rows()
    assert ("triangulated", 2, 2) not in found
    assert ("epipolar", 2, 2) in found
    assert ("triangulated", 3, 4) in found
    assert classes["sigma_px"].to_numpy() == pytest.approx(NOISE_PX, rel=0.25)  # the shortest has 45 observations


def test_degrees_of_freedom_are_those_of_the_tracks(run):
    sums = run.table("fitted_noise", measure="triangulated", trimming="untrimmed")
    lives = run.tracks().filter(pl.col("lifetime") >= 3)["lifetime"].cast(pl.Int64)
    assert sums["freedom"].sum() == pytest.approx((2 * lives - 3).sum(), rel=1e-6)
    assert sums["n"].sum() == lives.sum()


def test_the_findings_begin_with_what_errors_hide_and_withhold_what_they_cannot_tell(run):
    findings = run.findings()
    assert findings["text"][0].startswith(SELF_REFERENTIAL)
    assert not set(findings["topic"]) & {"bias", "shape", "growth", "survivorship", "trimming"}
    noise = findings.filter(topic="noise").row(0, named=True)
    assert noise["table"] == "triangulated_noise"
    assert noise["low"] < NOISE_PX < noise["high"]
    for name in ("zero_mean", "gaussianity", "radii", "time_structure"):
        assert run.table(name).is_empty()
    assert run.table("dependence").drop_nulls("axis").is_empty()
    assert all(SELF_REFERENTIAL in notes for notes in run.sequences()["notes"])


def test_other_kinds_of_truth_have_no_such_table():
    sequence = tracknoise.open_sequence(
        "simulated", motions=["sideways"], frames=5, width=80, height=60, supersampling=1
    )
    run = tracknoise.analyse(tracknoise.measure(sequence, tracknoise.Oracle(n_features=20)))
    assert run.table("triangulated_noise").is_empty()
    assert run.table("fitted_noise").is_empty()
    assert SELF_REFERENTIAL not in " ".join(run.findings()["text"])
