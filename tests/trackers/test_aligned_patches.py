"""Aligned patches: warps of known size are found, whatever happens to the brightness; what cannot be found is lost."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.aligned_patches import AlignedPatches
from tracknoise.trackers.alignment import Aligned, Alignment, Brightness, Warp, pyramid
from tracknoise.trackers.key_frames import Template
from tracknoise.trackers.patch_samples import Shape, offsets
from tracknoise.trackers.rejection import Model, Rejection
from tracknoise.trackers.tracker import Frame

FREE = Rejection(model=Model.none)
FEW = {"min_features": 100, "max_features": 120, "rejection": FREE}
STILL = np.eye(2)


def turned(degrees: float) -> np.ndarray:
    return cv2.getRotationMatrix2D((0, 0), -degrees, 1)[:, :2]


class Views:
    """A smooth texture at four times the resolution, from which images are rendered with a warp about their centre."""

    size = (320, 240)
    centre = np.array([159.5, 119.5])

    def __init__(self) -> None:
        rng = np.random.default_rng(2)
        coarse, fine = (cv2.GaussianBlur(rng.normal(size=(1400, 1800)), (0, 0), sigma) for sigma in (22.0, 6.0))
        self._fine = np.clip(128 + 300 * coarse / np.ptp(coarse) + 300 * fine / np.ptp(fine), 0, 255).astype(np.float32)

    def image(self, matrix: np.ndarray = STILL, shift: tuple[float, float] = (0, 0), seed: int = 0) -> np.ndarray:
        v, u = np.indices(self.size[::-1]).reshape(2, -1)
        back = (np.column_stack([u, v]) - self.centre - shift) @ np.linalg.inv(matrix).T
        places = (4 * back + [900, 700]).astype(np.float32).reshape(*self.size[::-1], 2)
        noise = np.random.default_rng(seed).normal(0, 1.5, self.size[::-1])
        seen = cv2.remap(self._fine, places, None, cv2.INTER_CUBIC) + noise
        return np.clip(np.rint(seen), 0, 255).astype(np.uint8)

    def where(self, uv: np.ndarray, matrix: np.ndarray = STILL, shift: tuple[float, float] = (0, 0)) -> np.ndarray:
        return (uv - self.centre) @ matrix.T + self.centre + shift


@pytest.fixture(scope="module")
def views() -> Views:
    return Views()


def corners(image: np.ndarray) -> np.ndarray:
    uv = cv2.goodFeaturesToTrack(image, 300, 0.01, 8)[:, 0].astype(float)
    return uv[((uv > 30) & (uv < np.array(image.shape[::-1]) - 30)).all(axis=1)]


def align(
    before: np.ndarray, after: np.ndarray, uv: np.ndarray, warp: Warp, brightness=Brightness.both, shape=Shape.square
) -> Aligned:
    alignment = Alignment(offsets(15, shape), warp, brightness, iterations=20, epsilon=0.005)
    templates = alignment.templates(pyramid(before, 3, 15), uv)
    return alignment.align(templates, pyramid(after, 3, 15), uv, np.broadcast_to(np.eye(2), (len(uv), 2, 2)))


def off(views: Views, found: Aligned, uv: np.ndarray, matrix: np.ndarray, shift: tuple[float, float]) -> np.ndarray:
    """Errors (n, 2) of what was found, px."""
    return (found.uv - views.where(uv, matrix, shift))[found.found]


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.25, -0.4), (0.5, 0.5), (7.3, -4.6)])
def test_shifts_are_found_as_well_as_by_opencv(views, shift):
    """Bilinear values draw positions towards those between pixels, here by less than 0.02 px; OpenCV's as much."""
    before, after = views.image(), views.image(shift=shift, seed=1)
    uv = corners(before)
    points = uv.astype(np.float32)
    theirs = cv2.calcOpticalFlowPyrLK(before, after, points, None, winSize=(15, 15), maxLevel=3)[0] - uv - shift
    size = np.median(np.hypot(*theirs.T))
    plain = off(views, align(before, after, uv, Warp.shift, Brightness.same), uv, STILL, shift)
    assert np.median(np.hypot(*(plain - theirs).T)) < 0.004
    for warp in Warp:
        errors = off(views, align(before, after, uv, warp), uv, STILL, shift)
        assert len(errors) == len(uv) > 150
        assert np.abs(errors.mean(axis=0)).max() < 0.02
        assert np.median(np.hypot(*errors.T)) < 1.5 * size < 0.04


@pytest.mark.parametrize(
    ("matrix", "warps"),
    [
        (turned(3), [Warp.se2, Warp.affine]),
        (turned(12), [Warp.se2, Warp.affine]),
        (1.1 * STILL, [Warp.affine]),
        (np.array([[1.05, 0.08], [-0.02, 0.94]]), [Warp.affine]),
    ],
)
def test_turns_and_stretches_are_found_with_their_size(views, matrix, warps):
    before, after = views.image(), views.image(matrix, (1.3, 0.4), seed=1)
    uv = corners(before)
    plain = off(views, align(before, after, uv, Warp.shift), uv, matrix, (1.3, 0.4))
    for warp in warps:
        found = align(before, after, uv, warp)
        errors = off(views, found, uv, matrix, (1.3, 0.4))
        assert len(errors) > 0.98 * len(uv)
        assert np.abs(np.median(errors, axis=0)).max() < 0.01
        assert np.median(np.hypot(*errors.T)) < min(0.06, np.median(np.hypot(*plain.T)) / 2)
        np.testing.assert_allclose(np.median(found.matrix, axis=0), matrix, atol=0.004)


def test_what_the_brightness_may_do_is_no_error(views):
    before, plain = views.image(), views.image(shift=(0.6, -1.2), seed=1).astype(float)
    uv = corners(before)
    changed = {"offset": plain + 12, "gain": plain * 0.8, "both": plain * 0.8 + 25}
    rms = {}
    for brightness in Brightness:
        for change, image in changed.items():
            found = align(before, np.clip(np.rint(image), 0, 255).astype(np.uint8), uv, Warp.se2, brightness)
            errors = off(views, found, uv, STILL, (0.6, -1.2))
            rms[brightness, change] = np.sqrt(np.mean(errors**2))
    good = {("offset", "offset"), ("gain", "gain"), *(("both", change) for change in changed)}
    assert max(rms[Brightness(name), change] for name, change in good) < 0.04
    assert min(rms[Brightness.same, change] for change in changed) > 0.1


def test_every_sample_counts_once_and_a_disc_has_no_corners(views):
    before, after = views.image(), views.image(turned(5), seed=1)
    uv = corners(before)
    for shape in Shape:
        found = align(before, after, uv, Warp.se2, shape=shape)
        assert np.median(np.hypot(*off(views, found, uv, turned(5), (0, 0)).T)) < 0.06
        assert np.nanmedian(found.ncc) > 0.98
        assert np.nanmedian(found.residual) < 3


def test_patches_at_the_border_count_with_what_the_image_has_of_them(views):
    before, after = views.image(), views.image(shift=(2.4, 0.3), seed=1)
    edge = np.column_stack([np.full(40, 2.0), np.linspace(30, 200, 40)])
    found = align(before, after, edge, Warp.se2)
    assert found.found.mean() > 0.8
    assert np.median(np.hypot(*off(views, found, edge, STILL, (2.4, 0.3)).T)) < 0.1
    assert not align(before, after, edge - [300, 0], Warp.se2).found.any()


def test_patches_without_texture_are_not_found(views):
    image = views.image()
    flat = np.full_like(image, 90)
    edge = np.where(np.arange(320) < 160, 60, 180).astype(np.uint8) * np.ones((240, 1), np.uint8)
    for bare in (flat, edge):
        assert not align(bare, bare, np.array([[159.0, 120.0], [60.0, 50.0]]), Warp.affine).found.any()


def test_patches_that_shrink_to_a_point_are_not_found(views):
    """Small affine patches in an image of something else often do."""
    before, after = views.image(), np.rot90(views.image(), 2).copy()
    uv = corners(before)
    alignment = Alignment(offsets(5, Shape.square), Warp.affine, Brightness.both, iterations=30, epsilon=0.005)
    still = np.broadcast_to(np.eye(2), (len(uv), 2, 2))
    found = alignment.align(alignment.templates(pyramid(before, 1, 5), uv), pyramid(after, 1, 5), uv, still)
    areas = np.linalg.det(found.matrix)
    assert (areas <= 0.01).any()
    assert (areas[found.found] > 0.01).all()


@pytest.fixture(scope="module")
def turning(views) -> list[Frame]:
    """A texture that turns by 3 degrees a frame, and slides."""
    return [Frame(k, views.image(turned(3 * k), (1.5 * k, -0.8 * k), seed=k)) for k in range(10)]


def drift(views: Views, settings: AlignedPatches, frames: list[Frame], context) -> tuple[float, int]:
    """Median error of features of the first frame in the last one, px, and how many are left."""
    tracker = settings.start(context)
    first, *_, last = [tracker.step(frame) for frame in frames]
    start, k = dict(zip(first.ids.tolist(), first.uv, strict=True)), len(frames) - 1
    old = [i for i in last.ids.tolist() if i in start]
    true = views.where(np.array([start[i] for i in old]), turned(3 * k), (1.5 * k, -0.8 * k))
    return float(np.median(np.hypot(*(last.uv[: len(old)] - true).T))), len(old)


@pytest.mark.parametrize("warp", [Warp.se2, Warp.affine])
def test_a_turn_is_carried_on_from_frame_to_frame(views, turning, setting, warp):
    errors, left = {}, {}
    for template in Template:
        settings = AlignedPatches(warp=warp, template=template, keyframe_share=0.85, **FEW)
        errors[template], left[template] = drift(views, settings, turning, setting())
    assert min(left.values()) > 60
    assert errors[Template.first] < 0.03
    assert errors[Template.first] < 0.8 * errors[Template.previous]
    shifted = AlignedPatches(warp=Warp.shift, **FEW)
    assert errors[Template.first] < 0.2 * drift(views, shifted, turning, setting())[0]


@pytest.mark.parametrize("check", [{"backward_px": 0.3}, {"min_ncc": 0.8}])
def test_what_is_covered_is_lost(views, turning, setting, check):
    shown = [frame.image.copy() for frame in turning[:2]]
    shown[1][80:160, 100:220] = np.random.default_rng(5).integers(0, 255, (80, 120))
    frames = [Frame(k, image) for k, image in enumerate(shown)]
    kept = {}
    for name, options in (("free", {}), ("checked", check)):
        tracker = AlignedPatches(**FEW, **options).start(setting())
        _, second = [tracker.step(frame) for frame in frames]
        uv = second.uv[~second.born]
        inside = ((uv > [105, 85]) & (uv < [215, 155])).all(axis=1)
        kept[name] = inside.sum(), (~inside).sum()
        if name == "checked":
            assert np.count_nonzero(second.ended == TrackEnd.lost) > 5
    assert kept["checked"][0] < 0.2 * kept["free"][0]
    assert kept["checked"][1] > 0.9 * kept["free"][1]


def test_quality_tells_how_well_patches_agree(turning, setting):
    tracker = AlignedPatches(**FEW).start(setting())
    tracker.step(turning[0])
    step = tracker.step(turning[1])
    followed = ~step.born
    assert np.nanmedian(step.quality["patch_ncc"][followed]) > 0.97
    assert 0.5 < np.nanmedian(step.quality["patch_residual"][followed]) < 4
    assert np.isnan(step.quality["patch_ncc"][step.born]).all()


@pytest.mark.parametrize(
    "wrong",
    [
        {"warp": "projective"},
        {"brightness": "auto"},
        {"shape": "ring"},
        {"window_px": 2},
        {"min_ncc": 1.5},
        {"keyframe_share": 0.0},
        {"start_at": "gyro"},
    ],
)
def test_impossible_settings_are_refused_by_name(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        replace(AlignedPatches(), **wrong)
