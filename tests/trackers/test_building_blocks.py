"""What the options of trackers do: what is done to images, where features begin and stay, how they are followed."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import SettingsError
from tracknoise.geometry.cameras import Camera
from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.correspondence import Correspondence
from tracknoise.trackers.dense_flow import DenseFlow, Method
from tracknoise.trackers.detection import Detection, Detector, Spacing
from tracknoise.trackers.key_frames import Template
from tracknoise.trackers.lucas_kanade import BackwardStart, LucasKanade
from tracknoise.trackers.matching import supported
from tracknoise.trackers.patch_samples import Shape, correlation, offsets, sampled
from tracknoise.trackers.preprocessing import Equalisation, Preprocessing
from tracknoise.trackers.rejection import Coordinates, Model, Rejection
from tracknoise.trackers.search_start import Start
from tracknoise.trackers.spacing import suppression_radii
from tracknoise.trackers.tracker import Frame, Step, TrackerSettings

FEW = {"min_features": 100, "max_features": 120}
FREE = Rejection(model=Model.none)
MOTION = np.array([3, -2])


def run(settings: TrackerSettings, frames: Sequence[Frame], setting) -> list[Step]:
    tracker = settings.start(setting(size=frames[0].size))
    return [tracker.step(frame) for frame in frames]


def errors(steps: list[Step], motion: np.ndarray = MOTION) -> np.ndarray:
    """Observed minus true positions of all observations after the first, by the first position; (n, 2) px."""
    start, found = {}, []
    for index, step in enumerate(steps):
        for i, uv, born in zip(step.ids.tolist(), step.uv, step.born, strict=True):
            if born:
                start[i] = uv - index * motion
            else:
                found.append(uv - index * motion - start[i])
    return np.array(found)


def sliding(texture: np.ndarray, motion: np.ndarray, count: int, noise: float = 0.0) -> list[Frame]:
    """A texture of which every frame shows another part, with noise of its own."""
    rng, images = np.random.default_rng(1), []
    for k in range(count):
        shift = np.array([[1, 0, motion[0] * k - 60], [0, 1, motion[1] * k - 40]], dtype=float)
        moved = cv2.warpAffine(texture.astype(np.float64), shift, (320, 240), flags=cv2.INTER_CUBIC)
        images.append(np.clip(np.rint(moved + rng.normal(0, noise, moved.shape)), 0, 255).astype(np.uint8))
    return [Frame(k, image) for k, image in enumerate(images)]


@pytest.fixture(scope="module")
def texture() -> np.ndarray:
    rng = np.random.default_rng(0)
    coarse, fine = (cv2.GaussianBlur(rng.normal(size=(420, 560)), (0, 0), sigma) for sigma in (5.0, 1.6))
    return np.clip(128 + 300 * coarse / np.ptp(coarse) + 300 * fine / np.ptp(fine), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("kind", [LucasKanade, DenseFlow, Correspondence])
@pytest.mark.parametrize("equalisation", [Equalisation.histogram, Equalisation.clahe])
def test_an_equalisation_does_what_equalised_images_do(sideways, setting, kind, equalisation):
    dark = [Frame(frame.index, frame.image // 4) for frame in sideways[:3]]
    clahe = cv2.createCLAHE(2.0, (4, 4))
    equalise = cv2.equalizeHist if equalisation is Equalisation.histogram else clahe.apply
    by_hand = run(kind(), [Frame(frame.index, equalise(frame.image)) for frame in dark], setting)
    steps = run(kind(preprocessing=Preprocessing(equalisation, clip_limit=2.0, tiles=4)), dark, setting)
    assert [step.uv.tolist() for step in steps] == [step.uv.tolist() for step in by_hand]
    assert steps[0].uv.tolist() != run(kind(), dark, setting)[0].uv.tolist()


def test_a_motion_that_grows_is_found_from_where_the_last_step_leads(texture, setting):
    way = [np.array([1.5 * k * (k + 1), 0]) for k in range(6)]
    frames = [Frame(k, sliding(texture, offset, 2)[1].image) for k, offset in enumerate(way)]
    right = {}
    for start_at in (Start.last, Start.velocity):
        settings = LucasKanade(start_at=start_at, extra_levels=0, rejection=FREE, **FEW)
        first, *_, last = run(settings, frames, setting)
        start = dict(zip(first.ids.tolist(), first.uv, strict=True))
        moved = np.array([uv - start[i] for i, uv in zip(last.ids.tolist(), last.uv, strict=True) if i in start])
        right[start_at] = np.count_nonzero(np.abs(moved - way[-1]).max(axis=1) < 0.5)
    assert right[Start.velocity] > 2 * right[Start.last]
    assert right[Start.velocity] > 40


def test_windows_may_have_an_even_side(sideways, setting):
    steps = run(LucasKanade(window_px=24, **FEW), sideways, setting)
    assert np.quantile(np.abs(errors(steps)), 0.99) < 0.1


@pytest.mark.parametrize("start", BackwardStart)
def test_what_does_not_come_back_is_lost(sideways, setting, start):
    covered = [frame.image.copy() for frame in sideways[:2]]
    covered[1][80:160, 100:220] = np.random.default_rng(5).integers(0, 255, (80, 120))
    frames = [Frame(k, image) for k, image in enumerate(covered)]
    free = run(LucasKanade(rejection=FREE, **FEW), frames, setting)
    checked = run(LucasKanade(rejection=FREE, backward_px=0.5, backward_start=start, **FEW), frames, setting)
    wrong, kept = (np.abs(errors(steps)).max(axis=1) > 0.5 for steps in (free, checked))
    assert wrong.sum() > 5
    assert kept.sum() < wrong.sum() / 2
    assert (~kept).sum() > 0.9 * (~wrong).sum()


def test_the_first_patch_is_aligned_from_the_last_position(texture, setting):
    frames = sliding(texture, np.array([0.9, 0.4]), 6, noise=4.0)
    steps = run(LucasKanade(template=Template.first, rejection=FREE, **FEW), frames, setting)
    start, last, end = (dict(zip(steps[k].ids.tolist(), steps[k].uv, strict=True)) for k in (0, -2, -1))
    old = [i for i in end if i in start]
    patch, guess = (np.float32([uv[i] for i in old]) for uv in (start, last))
    options = {"winSize": (15, 15), "maxLevel": 4, "criteria": (3, 30, 0.01), "flags": cv2.OPTFLOW_USE_INITIAL_FLOW}
    expected = cv2.calcOpticalFlowPyrLK(frames[0].image, frames[-1].image, patch, guess, **options)[0]
    assert len(old) > 50
    assert [end[i].tolist() for i in old] == expected.tolist()


def turning(texture: np.ndarray, camera: Camera, angles: Sequence[float]) -> tuple[list[Frame], list[np.ndarray]]:
    """A texture at infinity, seen by a camera that turns about its vertical axis, and the rotations of the camera."""
    turns = [cv2.Rodrigues(np.array([0.0, angle, 0.0]))[0] for angle in angles]
    v, u = np.indices((camera.height, camera.width)).reshape(2, -1).astype(float)
    frames = []
    for k, turn in enumerate(turns):
        rays = camera.bearings(np.column_stack([u, v])) @ turn.T
        place = (rays[:, :2] / rays[:, 2:] * 300 + [280, 210]).astype(np.float32).reshape(camera.height, -1, 2)
        frames.append(Frame(k, cv2.remap(texture, place, None, cv2.INTER_LINEAR)))
    return frames, turns


def test_a_turn_of_the_camera_is_found_from_its_known_rotation(texture, setting):
    camera = Camera(width=320, height=240, fx=300.0, fy=300.0, cx=159.5, cy=119.5)
    frames, turns = turning(texture, camera, [0.0, 0.05, -0.05, 0.05])
    context = replace(setting(), camera_at=lambda index: camera, rotation_at=lambda index: turns[index])
    found = {}
    for start_at in Start:
        tracker = LucasKanade(start_at=start_at, extra_levels=0, rejection=FREE, **FEW).start(context)
        before, count = {}, 0
        for k, step in enumerate(map(tracker.step, frames)):
            present = dict(zip(step.ids.tolist(), step.uv, strict=True))
            old = [i for i in present if i in before]
            if old:
                rays = camera.bearings(np.array([before[i] for i in old])) @ turns[k - 1].T @ turns[k]
                off = np.hypot(*(camera.project(rays) - [present[i] for i in old]).T)
                count += np.count_nonzero(off < 0.3)
            before = present
        found[start_at] = count
    assert found[Start.rotation] > 150
    assert found[Start.rotation] > 5 * max(found[Start.last], found[Start.velocity])


def test_a_known_rotation_needs_poses_and_goes_on_without_one(sideways, setting):
    with pytest.raises(SettingsError, match=r"start_at is 'rotation' in .*: no camera or poses, expected both"):
        LucasKanade(start_at=Start.rotation).start(setting())
    camera = Camera(width=320, height=240, fx=300.0, fy=300.0, cx=159.5, cy=119.5)
    context = replace(setting(), camera_at=lambda index: camera, rotation_at=lambda index: np.full((3, 3), np.nan))
    steps = []
    for start_at in (Start.rotation, Start.last):
        tracker = LucasKanade(start_at=start_at, **FEW).start(context)
        steps.append([tracker.step(frame).uv.tolist() for frame in sideways])
    assert steps[0] == steps[1]


def test_the_patch_is_that_of_the_first_frame_until_half_of_its_features_are_gone(texture, setting):
    frames = sliding(texture, np.array([17.3, -4.6]), 12, noise=4.0)
    seen = {}
    for template in Template:
        settings = LucasKanade(template=template, keyframe_share=0.5, min_features=1, max_features=120, rejection=FREE)
        seen[template] = [step.uv.tolist() for step in run(settings, frames, setting)]
    renewed = next(k for k, uv in enumerate(seen[Template.keyframe]) if len(uv) < 60)
    assert 3 < renewed < 11
    assert seen[Template.keyframe][: renewed + 1] == seen[Template.first][: renewed + 1]
    assert seen[Template.keyframe][renewed + 1] != seen[Template.first][renewed + 1]
    assert seen[Template.keyframe][2] != seen[Template.previous][2]


def test_what_no_longer_looks_like_its_first_patch_is_lost(sideways, setting):
    frames = [frame.image.copy() for frame in sideways[:3]]
    for k in (1, 2):  # half of the texture fades to another one
        other = np.random.default_rng(8).integers(0, 255, (240, 160)).astype(np.uint8)
        frames[k][:, 160:] = cv2.addWeighted(
            frames[k][:, 160:], 1 - 0.4 * k, cv2.GaussianBlur(other, (0, 0), 1.2), 0.4 * k, 0
        )
    shown = [Frame(k, image) for k, image in enumerate(frames)]
    faded = {}
    for least in (None, 0.8):
        steps = run(LucasKanade(min_ncc=least, rejection=FREE, min_features=1, max_features=300), shown, setting)
        right = steps[-1].uv[:, 0] > 170
        faded[least] = np.count_nonzero(right), np.count_nonzero(~right)
    assert faded[0.8][0] < 0.3 * faded[None][0]
    assert faded[0.8][1] > 0.9 * faded[None][1]


def test_correlation_is_that_of_the_gray_values_and_needs_texture():
    rng = np.random.default_rng(0)
    first, second = rng.normal(100, 20, (2, 5, 49)).astype(np.float32)
    expected = [np.corrcoef(a, b)[0, 1] for a, b in zip(first, second, strict=True)]
    np.testing.assert_allclose(correlation(first, second), expected, atol=1e-6)
    np.testing.assert_allclose(correlation(first, 3 * first - 40), 1.0, atol=1e-6)
    assert np.isnan(correlation(first, np.full_like(first, 7))).all()


def test_samples_are_bilinear_and_missing_beyond_the_image():
    image = np.random.default_rng(0).uniform(0, 255, (20, 30)).astype(np.float32)
    uv = np.random.default_rng(1).uniform(0, [28.9, 18.9], (4, 7, 2)).astype(np.float32)
    column, row = np.floor(uv).astype(int).transpose(2, 0, 1)
    right, down = (uv - np.floor(uv)).transpose(2, 0, 1)
    above = (1 - right) * image[row, column] + right * image[row, column + 1]
    below = (1 - right) * image[row + 1, column] + right * image[row + 1, column + 1]
    np.testing.assert_allclose(sampled(image, uv), (1 - down) * above + down * below, atol=1e-3)
    assert np.isnan(sampled(image, np.float32([[[-0.1, 3], [29.1, 3], [3, 19.5], [np.nan, 3]]]))).all()
    assert sampled(image, np.full((40_000, 2, 2), 3, np.float32)).shape == (40_000, 2)
    assert len(offsets(8, Shape.disc)) == 52


def test_features_end_when_they_are_too_old(sideways, setting):
    steps = run(LucasKanade(max_age=2, **FEW), sideways, setting)
    seen = np.bincount(np.concatenate([step.ids for step in steps]))
    assert seen.max() == 3
    assert (seen == 3).sum() > 100


def test_circles_keep_features_apart(sideways, setting):
    for detector in (Detector.gftt, Detector.fast):
        detection = Detection(detector=detector, spacing=Spacing.circles, distance_px=20, margin_px=5)
        for step in run(LucasKanade(detection=detection, **FEW), sideways, setting):
            apart = np.hypot(*np.moveaxis(step.uv[:, None] - step.uv[None], 2, 0)) + 100 * np.eye(len(step.uv))
            assert apart.min() > 19
            assert (np.rint(step.uv) >= 5).all()
            assert len(step.uv) > 40


def test_adaptive_suppression_spreads_features_over_the_image(setting):
    """A texture whose contrast falls from left to right: the strongest corners are all on one side."""
    rng = np.random.default_rng(0)
    noise = cv2.GaussianBlur(rng.normal(size=(240, 320)), (0, 0), 1.5)
    image = np.clip(128 + 500 * noise / np.ptp(noise) * np.linspace(1, 0.25, 320), 0, 255).astype(np.uint8)
    used = {}
    for spacing in (Spacing.circles, Spacing.anms):
        detection = Detection(spacing=spacing, distance_px=5, margin_px=8)
        settings = LucasKanade(detection=detection, min_features=1, max_features=60, rejection=FREE)
        uv = run(settings, [Frame(0, image)], setting)[0].uv
        used[spacing] = len(np.unique(np.floor(uv / 40).astype(int), axis=0))
        assert len(uv) == 60
    assert used[Spacing.anms] > 1.4 * used[Spacing.circles]
    assert used[Spacing.anms] > 40


def test_suppression_radii_are_distances_to_clearly_stronger_keypoints():
    rng = np.random.default_rng(1)
    uv, response = rng.uniform(0, 300, (700, 2)), rng.uniform(1, 9, 700).astype(np.float32)
    live = rng.uniform(0, 300, (3, 2))
    for old in (live, live[:0]):
        expected = np.full(700, np.inf)
        for i, (position, own) in enumerate(zip(uv, response, strict=True)):
            others = np.concatenate([uv[own < np.float32(0.9) * response], old])
            if len(others):
                expected[i] = np.hypot(*(others - position).T).min()
        found = suppression_radii(uv, response, old)
        assert np.mean(np.isclose(found, expected)) > 0.99  # ties at nine tenths round either way
        assert np.isinf(found).any() == (len(old) == 0)


def test_each_cell_of_a_grid_gives_its_share(sideways, setting):
    detection = Detection(detector=Detector.fast, grid=(4, 3), per_cell=5, refill_below=3, square_px=1, margin_px=0)
    settings = LucasKanade(detection=detection, min_features=1000, rejection=FREE)
    steps = run(settings, sideways, setting)
    cells = np.floor(steps[0].uv / 80).astype(int) @ [3, 1]
    assert np.bincount(cells, minlength=12).tolist() == [5] * 12
    assert (np.diff(cells) >= 0).all()
    for step in steps[1:]:
        kept = np.bincount(np.floor(step.uv[~step.born] / 80).astype(int) @ [3, 1], minlength=12)
        begun = np.bincount(np.floor(step.uv[step.born] / 80).astype(int) @ [3, 1], minlength=12)
        assert begun[kept >= 3].sum() == 0


def test_a_cell_without_keypoints_is_tried_with_lower_thresholds(sideways, setting):
    faint = sideways[0].image.copy()
    faint[:, :160] = 128 + (faint[:, :160].astype(int) - 128) // 3
    frames = [Frame(0, faint)]
    plain = Detection(detector=Detector.fast, threshold=90, min_response=0, grid=(2, 1), per_cell=50, margin_px=0)
    counts = [
        np.count_nonzero(run(LucasKanade(detection=detection), frames, setting)[0].uv[:, 0] < 160)
        for detection in (plain, replace(plain, retry_thresholds=(60, 20, 10)))
    ]
    assert counts[0] == 0
    assert counts[1] > 10


@pytest.mark.parametrize("kind", [LucasKanade, Correspondence])
def test_refined_births_are_nearer_to_the_corners(setting, kind):
    """Corners of a checkerboard that is drawn between pixels."""
    shift = np.array([0.3, -0.4])
    large = (np.indices((240 * 10, 320 * 10)) // 200).sum(axis=0) % 2 * 180 + 40
    moved = cv2.warpAffine(large.astype(np.uint8), np.float64([[1, 0, 10 * shift[0]], [0, 1, 10 * shift[1]]]), None)
    image = cv2.resize(cv2.GaussianBlur(moved, (0, 0), 8), (320, 240), interpolation=cv2.INTER_AREA)
    gap = {}
    for half in (0, 5):
        detection = Detection(detector=Detector.gftt, quality=0.3, subpixel_px=half, spacing=Spacing.circles)
        uv = run(kind(detection=detection), [Frame(0, image)], setting)[0].uv
        inner = uv[((uv > 30) & (uv < np.array([290, 210]))).all(axis=1)]
        corner = np.rint((inner - shift + 0.5) / 20) * 20 + shift - 0.5
        gap[half] = np.abs(inner - corner).max()
        assert len(inner) > 50
    assert gap[5] < 0.1 < gap[0]


@pytest.mark.parametrize("spacing", Spacing)
def test_refined_births_are_apart_too(sideways, setting, spacing):
    """Otherwise those that moved to one corner would end in the next frame."""
    detection = Detection(subpixel_px=5, spacing=spacing, margin_px=0)
    settings = LucasKanade(detection=detection, rejection=FREE, **FEW)
    first, second = run(settings, sideways[:2], setting)
    assert np.count_nonzero(second.ended == TrackEnd.masked) < 0.1 * first.new


@pytest.mark.parametrize("method", Method)
def test_dense_flow_follows_the_image(texture, setting, method):
    steps = run(DenseFlow(method=method, rejection=FREE, **FEW), sliding(texture, MOTION, 4), setting)
    off = errors(steps)
    assert len(off) > 200
    assert np.median(np.hypot(*off.T)) < 0.3


def test_dense_flow_drops_what_the_flow_back_does_not_confirm(sideways, setting):
    covered = [frame.image.copy() for frame in sideways[:2]]
    covered[1][80:160, 100:220] = 90
    frames = [Frame(k, image) for k, image in enumerate(covered)]
    free, checked = (
        run(DenseFlow(backward_px=bound, rejection=FREE, **FEW), frames, setting)[1] for bound in (None, 0.5)
    )
    assert checked.matched < free.matched


def test_ambiguous_and_distant_matches_are_dropped(sideways, setting):
    for option, quality, bound in (("max_ratio", "descriptor_ratio", 0.6), ("max_distance", "descriptor_distance", 90)):
        plain, strict = (run(Correspondence(**options), sideways[:3], setting)[2] for options in ({}, {option: bound}))
        assert np.nanmax(plain.quality[quality]) > bound
        assert np.nanmax(strict.quality[quality]) <= bound
        assert 0 < strict.matched < plain.matched


@pytest.mark.parametrize("turn_deg", [0, 5])
def test_supported_matches_are_those_of_opencv(texture, turn_deg):
    motion = cv2.getRotationMatrix2D((280, 210), turn_deg, 1.02)
    moved = cv2.warpAffine(texture, motion, texture.shape[::-1])
    orb = cv2.ORB.create(3000, fastThreshold=0)
    (first, query), (second, train) = (orb.detectAndCompute(image, None) for image in (texture, moved))
    matches = cv2.BFMatcher(cv2.NORM_HAMMING).match(query, train)
    size = texture.shape[::-1]
    theirs = cv2.xfeatures2d.matchGMS(size, size, first, second, matches)
    source, target = (
        np.array([keypoints[getattr(match, name)].pt for match in matches])
        for keypoints, name in ((first, "queryIdx"), (second, "trainIdx"))
    )
    ours = supported(source, target, size)
    kept = {match.queryIdx for match in theirs}
    agreement = np.array([match.queryIdx in kept for match in matches]) == ours  # but at borders of cells, by rounding
    assert agreement.mean() > 0.99
    right = np.hypot(*(source @ motion[:, :2].T + motion[:, 2] - target).T) < 3
    assert right[ours].mean() > right.mean()
    assert ours[right].mean() > 0.9


def test_matches_without_support_are_dropped(sideways, setting):
    mixed = sideways[1].image.copy()
    mixed[80:160, 100:220] = mixed[80:160, 100:220][::-1, ::-1]  # that part turns by itself
    plain, supported_only = (
        run(Correspondence(grid_statistics=on, rejection=FREE), [sideways[0], Frame(1, mixed)], setting)[1]
        for on in (False, True)
    )
    assert 0 < supported_only.matched < plain.matched


CAMERA = Camera(width=640, height=480, fx=400.0, fy=420.0, cx=330.0, cy=235.0, distortion=(-0.25, 0.05, 0.0, 0.0))


def two_views(noise_px: float) -> tuple[np.ndarray, np.ndarray]:
    """Points in space, seen by a camera that turns and moves. The first 50 of 300 matches are 15 to 30 px off."""
    rng = np.random.default_rng(0)
    points = rng.uniform([-3, -2, 4], [3, 2, 7], (300, 3))
    turn = cv2.Rodrigues(np.array([0.01, 0.04, 0.02]))[0]
    source, target = CAMERA.project(points), CAMERA.project(points @ turn.T + [0.3, 0.1, -1.0])
    target += rng.normal(0, noise_px, target.shape)
    target[:50] += rng.choice([-1, 1], (50, 2)) * rng.uniform(15, 30, (50, 2))
    return source, target


@pytest.mark.parametrize("model", [Model.essential, Model.fundamental])
@pytest.mark.parametrize("focal_px", [None, 460.0])
def test_outliers_are_found_along_the_rays_of_a_distorted_camera(setting, model, focal_px):
    source, target = two_views(0.1)
    context = replace(setting(), camera_at=lambda index: CAMERA)
    rejection = Rejection(model=model, coordinates=Coordinates.rays, focal_px=focal_px, threshold_px=1.0)
    mask = rejection.inliers_of(context)(source, target, 0)
    assert mask[50:].mean() > 0.97
    assert mask[:50].mean() < 0.15
    in_the_image = Rejection(model=Model.fundamental, threshold_px=1.0).inliers(source, target, 0)
    assert in_the_image[50:].mean() < mask[50:].mean()


def test_a_match_without_a_ray_is_an_outlier(setting):
    source, target = two_views(0.1)
    target[60] = [5000.0, 4000.0]
    rejection = Rejection(model=Model.essential, threshold_px=1.0)
    mask = rejection.inliers_of(replace(setting(), camera_at=lambda index: CAMERA))(source, target, 0)
    assert not mask[60]
    assert mask[61:].mean() > 0.95


def test_rays_need_a_camera(setting):
    with pytest.raises(SettingsError, match=r"no camera, expected intrinsics"):
        LucasKanade(rejection=Rejection(model=Model.essential)).start(setting())
    odd = replace(setting(), camera_at=lambda index: object())
    with pytest.raises(SettingsError, match=r"object has no fx and fy, expected focal_px"):
        LucasKanade(rejection=Rejection(coordinates="rays")).start(odd)
