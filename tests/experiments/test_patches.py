"""Patches of tracks show the images at the places that the tables hold, of the tracks with the stated errors."""

from functools import cache

import cv2
import numpy as np
import polars as pl
import pytest

from tracknoise.experiments.measure import Measurement, measure, measure_together
from tracknoise.experiments.pictures import track_patches
from tracknoise.sequences.reader_registry import make_reader
from tracknoise.sequences.sequence import Sequence
from tracknoise.statistics.definitions import PLACE_AGES
from tracknoise.statistics.samples import EACH, extreme_tracks
from tracknoise.tables.defaults import LONGEST_STRIP, PATCH_PX
from tracknoise.tables.schema import PATCHES, check

SIMULATED = {"motions": ["arvr"], "frames": 12, "width": 160, "height": 120, "supersampling": 1}
NOISE = 6.0
"""Mean difference of grey values between a patch and its WebP image."""


@pytest.fixture(scope="module")
def measured() -> Measurement:
    reader = make_reader("simulated", None, SIMULATED)
    return measure(reader.open(reader.sequences()[0]), {"lk": "lucas-kanade", "co": "correspondence"}, speeds=(1, 2))


@pytest.fixture(scope="module")
def patches(measured: Measurement) -> pl.DataFrame:
    return track_patches(measured, speed=1)


def image_of(encoded: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_GRAYSCALE)


@cache
def shown(sequence: Sequence, frame: int) -> np.ndarray:
    """An image, which takes long to make."""
    return sequence.image(frame)


def around(measured: Measurement, frame: int, u: float, v: float) -> np.ndarray:
    """The patch of an image, by another way: the image is padded first."""
    reach = PATCH_PX // 2
    padded = np.pad(shown(measured.sequence, frame), reach, mode="edge")
    return padded[round(v) : round(v) + PATCH_PX, round(u) : round(u) + PATCH_PX]


def test_there_is_a_row_for_every_tracker_and_age(patches: pl.DataFrame) -> None:
    check(patches, PATCHES, "patches")
    assert patches.select("tracker", "at").rows() == [
        (name, at) for name in ("co", "lk") for at in PLACE_AGES if at < 12
    ]
    assert patches["speed"].unique().to_list() == [1]


def test_the_chosen_have_the_largest_the_middle_and_the_smallest_errors(
    measured: Measurement, patches: pl.DataFrame
) -> None:
    for row in patches.to_dicts():
        seen = measured.observations.filter(tracker=row["tracker"], speed=1, age=row["at"], truth="valid")
        sizes = np.sort(np.hypot(seen["du_px"], seen["dv_px"]))
        found = np.hypot(row["du_px"], row["dv_px"])
        n = row["n_each"]
        assert n == min(EACH, len(sizes) // 3)
        np.testing.assert_array_equal(found[:n], sizes[::-1][:n])
        np.testing.assert_array_equal(found[2 * n :], sizes[:n])
        assert abs(np.median(found[n : 2 * n]) - np.median(sizes)) <= np.diff(sizes).max()


def test_patches_are_those_of_the_images(measured: Measurement, patches: pl.DataFrame) -> None:
    for row in patches.to_dicts():
        sheet = image_of(row["sheet"])
        assert sheet.shape == (3 * row["n_each"] * PATCH_PX, 2 * PATCH_PX)
        observed = measured.observations.filter(tracker=row["tracker"], speed=1)
        for place, track in enumerate(row["track"]):
            for column, frame in enumerate((row["anchor_frame"][place], row["frame"][place])):
                u, v = observed.filter(track=track, frame=frame).select("u_px", "v_px").row(0)
                patch = sheet[place * PATCH_PX :, column * PATCH_PX :][:PATCH_PX, :PATCH_PX]
                assert np.abs(patch.astype(float) - around(measured, frame, u, v)).mean() < NOISE


def test_the_strip_follows_the_worst_track(measured: Measurement, patches: pl.DataFrame) -> None:
    row = patches.filter(tracker="lk", at=5).row(0, named=True)
    strip = image_of(row["strip"])
    observed = measured.observations.filter(tracker="lk", speed=1, track=row["track"][0])
    path = observed.filter(pl.col("frame").is_between(row["anchor_frame"][0], row["frame"][0])).sort("frame")
    assert strip.shape == (PATCH_PX, path.height * PATCH_PX)
    assert path.height <= LONGEST_STRIP
    for place, (frame, u, v) in enumerate(path.select("frame", "u_px", "v_px").iter_rows()):
        patch = strip[:, place * PATCH_PX :][:, :PATCH_PX]
        assert np.abs(patch.astype(float) - around(measured, frame, u, v)).mean() < NOISE


def test_the_same_measurement_gives_the_same_bytes(measured: Measurement, patches: pl.DataFrame) -> None:
    assert track_patches(measured, speed=1).equals(patches)


def test_few_tracks_are_shared_between_the_kinds(measured: Measurement) -> None:
    few = measured.observations.filter(tracker="lk", speed=1, age=1, truth="valid").head(7)
    ((n_each, chosen),) = extreme_tracks(few, speed=1, population="visible", key_frame=None)
    assert n_each == 2
    assert chosen["track"].n_unique() == chosen.height == 6
    assert list(extreme_tracks(few.head(2), speed=1, population="visible", key_frame=None)) == []


def test_a_run_with_a_scan_is_anchored_in_its_key_frame(measured: Measurement) -> None:
    found = list(extreme_tracks(measured.observations, speed=1, population="visible", key_frame=4))
    assert found
    assert all(set(rows["anchor_frame"]) == {4} for _, rows in found)
    assert {at - 4 for _, rows in found for at in rows["at"]} <= set(PLACE_AGES)


def test_nothing_with_an_error_has_no_patches(measured: Measurement) -> None:
    assert list(extreme_tracks(measured.observations.clear(), speed=1, population="visible", key_frame=None)) == []


def test_kept_images_are_not_read_again(measured: Measurement, patches: pl.DataFrame, monkeypatch) -> None:
    reader = make_reader("simulated", None, SIMULATED)
    trackers = {"lk": "lucas-kanade", "co": "correspondence"}
    (kept,) = measure_together([reader.open(reader.sequences()[0])], trackers, speeds=(1, 2), kept_bytes=5 * 160 * 120)
    assert sorted(kept.images) == [0, 1, 2, 3, 4]
    asked: list[int] = []
    read = kept.sequence.image
    monkeypatch.setattr(type(kept.sequence), "image", lambda _self, index: asked.append(index) or read(index))
    assert track_patches(kept, speed=1).equals(patches)
    assert asked == sorted(set(asked))
    assert set(asked) == set(range(5, 12))
