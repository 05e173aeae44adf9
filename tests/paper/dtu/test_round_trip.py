"""From the stage to files and back: the truth that is read must be that of the stage."""

import numpy as np
import pytest

from tracknoise.paper.light_stage import LightStage
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.sequence import Sequence, TruthKind
from tracknoise.sequences.views import turned
from tracknoise.tables.schema import TruthStatus
from tracknoise.truth.truth_registry import make_truth

KEY = 24
ROTATIONS = pytest.mark.parametrize("degrees", [0, 90, 270])


@pytest.fixture(scope="module")
def read(simulated) -> Sequence:
    return open_sequence("dtu", simulated, lighting="diffuse")


def full_from_used(uv: np.ndarray, degrees: int, size: tuple[int, int]) -> np.ndarray:
    """Pixels of the stage's images from those of turned ones of half the size: a pixel covers two by two."""
    width, height = size
    u, v = uv[:, 0], uv[:, 1]
    upright = {0: (u, v), 90: (width - 1 - v, u), 270: (v, height - 1 - u)}[degrees]
    return 2.0 * np.stack(upright, axis=-1) + 0.5


def on_stage(stage: LightStage, index: int, points_world: np.ndarray) -> np.ndarray:
    """Where the stage's camera sees points, (n, 2) px."""
    pose, camera = stage.world_from_camera[index], stage.camera
    x, y, z = ((points_world - pose[:3, 3]) @ pose[:3, :3]).T
    return np.stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy], axis=-1)


@ROTATIONS
def test_exact_points_are_seen_where_the_stage_sees_them(read, stage, degrees) -> None:
    """Cameras and poses alone, without the scan."""
    sequence = turned(read, degrees)
    truth = make_truth(sequence, TruthKind.scan)
    uv = np.random.default_rng(0).uniform(0, 1, (200, 2)) * (sequence.camera.width - 1, sequence.camera.height - 1)
    size = read.camera.width, read.camera.height
    points, hit = stage.cast(KEY, full_from_used(uv, degrees, size))
    assert hit.all()
    for index in (0, 13, KEY, 48):
        seen = full_from_used(truth.project(index, points), degrees, size)
        np.testing.assert_allclose(seen, on_stage(stage, index, points), atol=1e-8)


@ROTATIONS
def test_truth_from_the_scan_is_the_stages_own(read, stage, degrees) -> None:
    """At any sub-pixel place: the nearest scan point is up to 0.25 px away, on slanted surfaces at another depth."""
    sequence = turned(read, degrees)
    truth = make_truth(sequence, TruthKind.scan)
    uv = np.random.default_rng(1).uniform(0, 1, (2000, 2)) * (sequence.camera.width - 1, sequence.camera.height - 1)
    size = read.camera.width, read.camera.height
    assert truth.key_frame == KEY
    anchored, status = truth.anchor(KEY, uv)
    found = status == TruthStatus.valid
    assert found.mean() > 0.7  # the scan covers the middle of the stage only
    exact, _ = stage.cast(KEY, full_from_used(uv[found], degrees, size))
    errors = {}
    for index in range(0, 49, 4):
        seen = full_from_used(truth.project(index, anchored[found]), degrees, size)
        errors[index] = np.linalg.norm(seen - on_stage(stage, index, exact), axis=1) / 2.0
    assert np.median(np.stack(list(errors.values()))) < 0.05
    assert errors[KEY].max() < 1e-9  # each feature's own ray
    assert max(np.median(errors[index]) for index in range(8, 44, 4)) < 0.05
    assert max(np.median(error) for error in errors.values()) < 0.07


def test_images_are_the_means_of_what_the_stage_shows(read, stage) -> None:
    leds = np.mean(list(stage.images(7)), axis=0)
    halved = leds.reshape(read.camera.height, 2, read.camera.width, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(read.image(7), halved, atol=0.6)
