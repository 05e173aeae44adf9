"""Truth against what the data sets know themselves: TartanAir v2's optical flow, and depth seen from two places."""

import cv2
import numpy as np
import pytest

from tracknoise.geometry.depth import interpolate
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.anchored import AnchoredTruth
from tracknoise.truth.truth_registry import make_truth

SAMPLES = pytest.mark.parametrize(
    ("reader", "name"),
    [
        ("sevenscenes", "sevenscenes"),
        ("tartanair", "tartanair_v1"),
        ("tartanair", "tartanair_v2"),
        ("tum", "tum_rgbd"),
    ],
)


def every_pixel(width: int, height: int, step: int) -> np.ndarray:
    u, v = np.meshgrid(np.arange(0.0, width, step), np.arange(0.0, height, step))
    return np.stack([u.ravel(), v.ravel()], axis=-1)


def flow_of(path, uv: np.ndarray) -> np.ndarray:
    """Flow at pixels: 16-bit integers, 1/64 px, offset 32768, channels u and v."""
    raw = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    columns, rows = uv.astype(int).T
    return (raw[rows, columns, :2].astype(np.float64) - 32768.0) / 64.0


def flow_error(truth: AnchoredTruth, index: int, uv: np.ndarray, flow: np.ndarray) -> np.ndarray:
    """How far truth and flow are apart, px, where a pixel has depth and is seen in the next frame."""
    points, status = truth.anchor(index, uv)
    usable = status == TruthStatus.valid
    usable[usable] = truth.locate(index + 1, points[usable])[1] == TruthStatus.valid
    return np.linalg.norm(truth.project(index + 1, points[usable]) - uv[usable] - flow[usable], axis=1)


def test_truth_agrees_with_the_optical_flow_of_tartanair_v2(sample):
    """The flow is rounded to 1/64 px, so that errors of up to 0.011 px are its own: truth has next to none.

    The bounds are tight because half a pixel in the principal point of one axis (median 0.023 px, 95th percentile
    0.057 px) and five parts in 10,000 of the focal length (0.013 px, 0.039 px) must not pass.
    """
    folder = sample("tartanair_v2")
    sequence = open_sequence("tartanair", folder)
    truth, uv = make_truth(sequence), every_pixel(640, 640, 4)
    flows = folder / "P000" / "flow_lcam_front"
    errors = [
        flow_error(truth, index, uv, flow_of(flows / f"{index:06d}_{index + 1:06d}_flow.png", uv))
        for index in range(len(sequence) - 1)
    ]
    assert min(map(len, errors)) > 5000
    together = np.concatenate(errors)
    assert np.median(together) <= 0.01
    assert np.percentile(together, 95) <= 0.015
    assert together.max() <= 0.05


@SAMPLES
def test_age_0_has_no_error(sample, reader, name):
    sequence = open_sequence(reader, sample(name))
    truth, camera = make_truth(sequence), sequence.camera
    uv = every_pixel(camera.width - 1, camera.height - 1, 7) + np.array([0.31, 0.64])
    for index in range(0, len(sequence), 9):
        points, status = truth.anchor(index, uv)
        valid = status == TruthStatus.valid
        assert valid.mean() > 0.3
        assert np.abs(truth.project(index, points) - uv)[valid].max() < 1e-9
        assert np.isnan(points[~valid]).all()


@SAMPLES
def test_most_of_what_is_seen_is_seen_in_the_next_frame(sample, reader, name):
    sequence = open_sequence(reader, sample(name))
    truth, camera = make_truth(sequence), sequence.camera
    points, status = truth.anchor(0, every_pixel(camera.width, camera.height, 11))
    points = points[status == TruthStatus.valid]
    assert np.mean(truth.locate(0, points)[1] == TruthStatus.valid) == 1.0
    later = truth.locate(1, points)[1]
    assert np.mean(later == TruthStatus.valid) > 0.9
    assert np.mean(later == TruthStatus.occluded) < 0.03


@pytest.mark.parametrize(
    ("reader", "name", "gap", "median", "high"),
    # v1 stores half floats (2e-4 on average); a Kinect's depth and KinectFusion's poses agree to centimetres.
    # TUM's depth maps are half a frame off in time, and the camera turns fast.
    [
        ("tartanair", "tartanair_v1", 15, 2.2e-4, 6e-4),
        ("sevenscenes", "sevenscenes", 10, 1e-2, 5e-2),
        ("tum", "tum_rgbd", 10, 1e-2, 5e-2),
    ],
)
def test_depth_agrees_between_frames(sample, reader, name, gap, median, high):
    """A pixel's depth, moved to another frame, is the depth measured there: poses and intrinsics are right."""
    sequence = open_sequence(reader, sample(name))
    truth, camera = make_truth(sequence), sequence.camera
    uv = every_pixel(camera.width, camera.height, 5)
    relative = []
    for index in range(0, min(len(sequence), 30) - gap, 2):
        points, status = truth.anchor(index, uv)
        points = points[status == TruthStatus.valid]
        points = points[truth.locate(index + gap, points)[1] == TruthStatus.valid]
        measured = interpolate(sequence.depth(index + gap), truth.project(index + gap, points), camera)
        moved = transform(invert(sequence.world_from_camera[index + gap]), points)[:, 2]
        relative.append(np.abs(moved / measured.depth_m - 1.0)[measured.valid])
    assert np.median(np.concatenate(relative)) <= median
    assert np.percentile(np.concatenate(relative), 95) <= high
