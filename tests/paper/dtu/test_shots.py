import pickle

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera
from tracknoise.paper import dtu
from tracknoise.paper.dtu import WEIGHT_STEPS, Relit, Taken, mix, sums_of_four, weights
from tracknoise.paper.light_stage import led_positions

CAMERA = Camera(64, 48, 50.0, 50.0, 31.5, 23.5)
WEIGHTS = weights(led_positions())


@pytest.fixture
def images() -> np.ndarray:
    """(2 frames, 19 LEDs, 48, 64)"""
    return np.random.default_rng(0).integers(0, 256, (2, 19, 48, 64), dtype=np.uint8)


@pytest.fixture
def paths(tmp_path, images):
    for frame, leds in enumerate(images):
        for led, image in enumerate(leds):
            cv2.imwrite(str(tmp_path / f"{frame}_{led}.bmp"), image)
    return [[tmp_path / f"{frame}_{led}.bmp" for led in range(19)] for frame in range(2)]


def expected(images: np.ndarray, lighting: int) -> np.ndarray:
    """One frame, in whole numbers: the shares are multiples of 1 / 16384, and a pixel is the mean of four."""
    steps = np.rint(WEIGHTS[lighting] * WEIGHT_STEPS).astype(np.int64)
    fours = images.astype(np.int64).reshape(19, 24, 2, 32, 2).sum(axis=(2, 4))
    total, unit = np.einsum("l,lvu->vu", steps, fours), 4 * WEIGHT_STEPS
    return (total // unit + ((total % unit) * 2 + (total // unit) % 2 > unit)).astype(np.uint8)  # halves to even


def test_relit_images_are_exact_to_the_rounding(images, paths) -> None:
    relit = Relit(paths, WEIGHTS, CAMERA, halve=True)
    for frame in (0, 1, 0):
        for lighting in range(19):
            np.testing.assert_array_equal(relit.image(frame, lighting), expected(images[frame], lighting))


def test_images_of_half_the_size_are_taken_as_they_are(images, paths) -> None:
    relit = Relit(paths, np.eye(19), CAMERA, halve=False)
    np.testing.assert_array_equal(relit.image(1, 7), images[1, 7])
    np.testing.assert_array_equal(Taken(paths, CAMERA, halve=False).image(1, 7), images[1, 7])


def test_a_halved_pixel_is_the_mean_of_the_four_that_it_covers(images, paths) -> None:
    area = cv2.resize(images[1, 7].astype(np.float64), (32, 24), interpolation=cv2.INTER_AREA)
    np.testing.assert_array_equal(Taken(paths, CAMERA, halve=True).image(1, 7), np.rint(area).astype(np.uint8))
    np.testing.assert_array_equal(Relit(paths, np.eye(19), CAMERA, halve=True).image(1, 7), np.rint(area))


@pytest.mark.parametrize("height", [2, 6, 130, 300])
def test_sums_of_four_at_every_height_of_the_last_band(height) -> None:
    image = np.random.default_rng(height).integers(0, 256, (height, 10), dtype=np.uint8)
    sums = np.empty((height // 2, 5), np.float32)
    sums_of_four(image, out=sums)
    np.testing.assert_array_equal(sums, image.astype(np.float32).reshape(height // 2, 2, 5, 2).sum(axis=(1, 3)))


def test_white_stays_white(monkeypatch) -> None:
    monkeypatch.setattr(dtu, "_PIXELS_AT_ONCE", 7)
    light = np.full((19, 5, 6), 255.0, np.float32)
    assert (mix(light, WEIGHTS.astype(np.float32)) == 255).all()


def test_the_images_of_a_frame_are_decoded_once_for_all_lightings(paths, monkeypatch) -> None:
    decoded = []
    read = dtu.read_gray
    monkeypatch.setattr(dtu, "read_gray", lambda path, camera: decoded.append(path) or read(path, camera))
    relit = Relit(paths, WEIGHTS, CAMERA, halve=True)
    for frame in (0, 1):
        for lighting in range(19):
            relit.image(frame, lighting)
    assert decoded == [*paths[0], *paths[1]]


def test_images_that_are_shared_cannot_be_changed(paths) -> None:
    image = Relit(paths, WEIGHTS, CAMERA, halve=True).image(0, 0)
    with pytest.raises(ValueError, match="read-only"):
        image[0, 0] = 1


def test_earlier_images_stay_as_they_were(images, paths) -> None:
    relit = Relit(paths, WEIGHTS, CAMERA, halve=True)
    first = relit.image(0, 3)
    relit.image(1, 3)
    np.testing.assert_array_equal(first, expected(images[0], 3))


def test_a_pickle_holds_no_images(paths) -> None:
    relit = Relit(paths, WEIGHTS, CAMERA, halve=True)
    image = relit.image(0, 3)
    pickled = pickle.dumps(relit)
    assert len(pickled) < 12_000
    np.testing.assert_array_equal(pickle.loads(pickled).image(0, 3), image)


def test_a_truncated_image_is_refused(paths) -> None:
    broken = paths[0][18]
    broken.write_bytes(broken.read_bytes()[:-1])
    relit = Relit(paths, WEIGHTS, CAMERA, halve=True)
    with pytest.raises(DataError, match=r"0_18\.bmp: truncated or damaged image"):
        relit.image(0, 0)
    assert relit.image(1, 0).shape == (24, 32)
    with pytest.raises(DataError, match=r"0_18\.bmp: truncated or damaged image"):
        relit.image(0, 0)
