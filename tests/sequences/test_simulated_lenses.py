"""Simulated sequences through lenses: truth with the full model, against the exact surface."""

import json
import pickle
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.sequences.folder import Folder, write_folder
from tracknoise.sequences.reader_registry import make_reader
from tracknoise.sequences.simulated import Simulated, SimulatedSequence
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.truth_registry import make_truth

OPTIONS = {
    "radtan": {"distortion": (-0.28, 0.07, 0.0002, 0.00002), "hfov_deg": 80.0},
    "equidistant": {"distortion": (-0.02, 0.01, -0.01, 0.001), "hfov_deg": 120.0},
    "double_sphere": {"distortion": (-0.18, 0.59), "hfov_deg": 120.0},
    "omni": {"distortion": (0.95, -0.2, 0.04, 0.0002, -0.0003), "hfov_deg": 110.0},
    "eucm": {"distortion": (0.6, 1.1), "hfov_deg": 120.0},
    "fov": {"distortion": (0.93,), "hfov_deg": 110.0},
}
LENSES = pytest.mark.parametrize("lens", OPTIONS)


def simulated(lens: str, motion: str = "sideways", **changes: object) -> SimulatedSequence:
    options = {"frames": 11, "width": 320, "height": 240, "supersampling": 1} | OPTIONS[lens] | changes
    reader = Simulated(motions=(motion,), lens=lens, **options)
    return reader.open(reader.sequences()[0])


@LENSES
def test_the_field_of_view_is_that_of_the_lens(lens):
    camera = simulated(lens).camera
    edge = camera.bearings(np.array([camera.width - 0.5, camera.cy]))
    half = np.rad2deg(np.arctan2(np.hypot(*edge[:2]), 1.0))
    assert half == pytest.approx(OPTIONS[lens]["hfov_deg"] / 2.0, abs=0.2)  # tangential terms tilt the edge
    assert camera.fx == camera.fy


@LENSES
@pytest.mark.parametrize("motion", ["sideways", "arvr", "forward"])
def test_truth_from_depth_is_truth_from_the_exact_surface(lens, motion):
    """The limit is a median of 0.02 px; interpolation along a wall is off by less than 0.0001 px."""
    sequence = simulated(lens, motion)
    birth, exact = make_truth(sequence, "birth"), make_truth(sequence, "raycast")
    uv = np.random.default_rng(0).uniform((4.0, 4.0), (315.0, 235.0), (4000, 2))
    points, status = birth.anchor(0, uv)
    truly, _ = exact.anchor(0, uv)
    assert (status == TruthStatus.valid).mean() > 0.4
    for index in (3, 10):
        at, seen = birth.locate(index, points)
        expected, visible = exact.locate(index, truly)
        both = (status == TruthStatus.valid) & (seen == TruthStatus.valid) & (visible == TruthStatus.valid)
        assert both.sum() > 300
        assert np.median(np.linalg.norm(at - expected, axis=1)[both]) <= 1e-4


@LENSES
def test_points_of_a_frame_are_not_hidden_in_it(lens):
    sequence = simulated(lens)
    truth = make_truth(sequence, "raycast")
    uv = np.random.default_rng(1).uniform((0.0, 0.0), (319.0, 239.0), (2000, 2))
    points, status = truth.anchor(4, uv)
    at, seen = truth.locate(4, points)
    known = status == TruthStatus.valid
    np.testing.assert_allclose(at[known], uv[known], atol=1e-6)
    assert np.all(seen[known] == TruthStatus.valid)


@LENSES
def test_images_move_as_the_full_model_says(lens):
    """Lucas-Kanade knows nothing of cameras. A pinhole of the same focal length would be off by pixels."""
    sequence = simulated(lens, width=480, height=360, supersampling=2)
    start, end = (sequence.image(index) for index in (0, 2))
    corners = cv2.goodFeaturesToTrack(start, 400, 0.01, 6)
    moved, found, _ = cv2.calcOpticalFlowPyrLK(start, end, corners, None, winSize=(15, 15))
    back, again, _ = cv2.calcOpticalFlowPyrLK(end, start, moved, None, winSize=(15, 15))
    uv, followed = corners[:, 0].astype(np.float64), moved[:, 0]
    truth = make_truth(sequence, "raycast")
    points, _ = truth.anchor(0, uv)
    expected, seen = truth.locate(2, points)
    sure = (found & again).ravel().astype(bool) & (np.linalg.norm(back - corners, axis=2).ravel() < 0.3)
    good = sure & (seen == TruthStatus.valid)
    off = followed[good] - expected[good]
    assert good.sum() > 100
    assert np.median(np.linalg.norm(off, axis=1)) < 0.12
    assert np.abs(np.median(off, axis=0)).max() < 0.05


def test_a_lens_beyond_90_degrees_gives_its_corners_no_truth():
    sequence = simulated("equidistant", width=240, height=240, hfov_deg=150.0, distortion=(0.0, 0.0, 0.0, 0.0))
    truth = make_truth(sequence, "raycast")
    points, status = truth.anchor(0, np.array([[0.0, 0.0], [120.0, 120.0]]))
    assert status.tolist() == [TruthStatus.no_depth, TruthStatus.valid]
    assert np.isnan(points[0]).all()
    assert sequence.image(0)[0, 0] < 20


@LENSES
def test_a_folder_keeps_the_lens(lens, tmp_path: Path):
    sequence = simulated(lens, frames=2, width=64, height=48)
    write_folder(sequence, tmp_path / "scene")
    reader = Folder(tmp_path / "scene")
    read = reader.open(reader.sequences()[0])
    assert read.camera == sequence.camera
    assert pickle.loads(pickle.dumps(read)).camera == sequence.camera
    np.testing.assert_array_equal(read.image(1), sequence.image(1))
    model = json.loads((tmp_path / "scene/camera.json").read_text()).get("model", "radtan")
    assert model == lens


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"lens": "radtan", "distortion": [0.1]}, "expected 0, 4, 5 or 8 numbers"),
        ({"distortion": [0.1, 0.0, 0.0, 0.0]}, "expected no numbers for the model pinhole"),
        ({"lens": "double_sphere"}, r"expected 2 numbers \(xi, alpha\)"),
        ({"lens": "double_sphere", "distortion": [5.0, 0.5]}, "xi must be above -1"),
        ({"lens": "radtan", "distortion": [-5.0, 0, 0, 0]}, "expected a lens that shows the ray at half of hfov_deg"),
    ],
)
def test_an_impossible_lens_is_refused(options, message):
    with pytest.raises(SettingsError, match=f"reader 'simulated': .*{message}"):
        make_reader("simulated", None, options)


def test_an_unknown_lens_is_refused():
    with pytest.raises(
        UnknownNameError,
        match=r"unknown lens 'fish'.*known: double_sphere, equidistant, eucm, fov, omni, pinhole, radtan",
    ):
        make_reader("simulated", None, {"lens": "fish"})
