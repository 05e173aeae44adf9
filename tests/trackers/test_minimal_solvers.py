"""Samples of seven, five and two matches: the true relation is among those found, and outliers are told by it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import SettingsError
from tracknoise.geometry.cameras import Camera
from tracknoise.trackers.correspondence import Correspondence
from tracknoise.trackers.lucas_kanade import LucasKanade
from tracknoise.trackers.minimal_solvers import through_five, through_seven
from tracknoise.trackers.rejection import Consensus, Model, Rejection

CAMERA = Camera(width=640, height=480, fx=400.0, fy=420.0, cx=330.0, cy=235.0, distortion=(-0.25, 0.05, 0.0, 0.0))
TURN = cv2.Rodrigues(np.array([0.02, -0.05, 0.03]))[0]
"""camera_from_camera, from the frame before."""


def samples(size: int, count: int, *, flat: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rays of depth 1 (count, size, 2) in two views of points, and the essential matrices; `flat`: points on planes."""
    rng = np.random.default_rng(0)
    source, target, models = [], [], []
    for _ in range(count):
        points = rng.uniform([-3, -2, 4], [3, 2, 7], (size, 3))
        if flat:
            points[:, 2] = 5 + 0.3 * points[:, 0]
        turn, (x, y, z) = cv2.Rodrigues(rng.normal(0, 0.1, 3))[0], rng.normal(size=3)
        moved = points @ turn.T + [x, y, z]
        source.append(points[:, :2] / points[:, 2:])
        target.append(moved[:, :2] / moved[:, 2:])
        models.append(np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ turn)
    return np.array(source), np.array(target), np.array(models)


def equations(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    ahead = np.ones_like(source[..., :1])
    x, y = (np.concatenate([rays, ahead], axis=-1) for rays in (source, target))
    return np.einsum("bni,bnj->bnij", y, x).reshape(*source.shape[:2], 9)


def gap(models: np.ndarray, exists: np.ndarray, true: np.ndarray) -> np.ndarray:
    """How far the nearest of the models is from the true one, of length 1 each, whatever its sign."""
    models, true = (one / np.linalg.norm(one, axis=(-2, -1), keepdims=True) for one in (models, true[:, None]))
    apart = np.minimum(np.linalg.norm(models - true, axis=(2, 3)), np.linalg.norm(models + true, axis=(2, 3)))
    return np.where(exists, apart, np.inf).min(axis=1)


@pytest.mark.parametrize("flat", [False, True])
def test_the_true_essential_matrix_is_among_those_through_five_matches(flat):
    source, target, true = samples(5, 300, flat=flat)
    models, exists = through_five(equations(source, target))
    assert np.quantile(gap(models, exists, true), 0.98) < 1e-6
    found = models[exists] / np.linalg.norm(models[exists], axis=(1, 2), keepdims=True)
    assert 2 < exists.sum(axis=1).mean() < 10
    singular = np.linalg.svd(found, compute_uv=False)
    assert np.quantile(np.abs(singular - [np.sqrt(0.5), np.sqrt(0.5), 0]).max(axis=1), 0.98) < 1e-6
    left = np.einsum("bni,bsi->bsn", equations(source, target), models.reshape(300, 10, 9))
    assert np.quantile(np.abs(left[exists]).max(axis=1) / np.linalg.norm(models[exists], axis=(1, 2)), 0.98) < 1e-9


def test_the_true_fundamental_matrix_is_among_those_through_seven_matches():
    source, target, true = samples(7, 300)
    models, exists = through_seven(equations(source, target))
    assert np.quantile(gap(models, exists, true), 0.98) < 1e-8
    first, second = (rays[0] * 500 + [320, 240] for rays in (source, target))
    theirs = cv2.findFundamentalMat(first, second, cv2.FM_7POINT)[0].reshape(-1, 3, 3)
    ours, real = through_seven(equations(first[None], second[None]))
    assert real.sum() == len(theirs)
    for model in theirs:
        assert gap(ours, real, model[None]).item() < 1e-4


@pytest.mark.parametrize(("solve", "size"), [(through_five, 5), (through_seven, 7)])
def test_equal_matches_have_no_model(solve, size):
    assert not solve(np.ones((3, size, 9)))[1].any()
    assert len(solve(np.empty((0, size, 9)))[0]) == 0


def two_views(noise_px: float, *, flat: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Points seen by a camera that turns by `TURN` and moves. The first 50 of 300 matches are 15 to 30 px off."""
    rng = np.random.default_rng(0)
    points = rng.uniform([-3, -2, 4], [3, 2, 7], (300, 3))
    if flat:
        points[:, 2] = 5 + 0.3 * points[:, 0]
    source, target = CAMERA.project(points), CAMERA.project(points @ TURN.T + [0.3, 0.1, -0.4])
    target += rng.normal(0, noise_px, target.shape)
    target[:50] += rng.choice([-1, 1], (50, 2)) * rng.uniform(15, 30, (50, 2))
    return source, target


def context(setting, **others):
    """Frame 4 is seen after frame 2, from which the camera turned."""
    turns = {2: np.eye(3), 4: TURN.T}
    return replace(setting(speed=2), camera_at=lambda index: CAMERA, rotation_at=turns.__getitem__, **others)


@pytest.mark.parametrize("consensus", ["refined", "hypothesis"])
@pytest.mark.parametrize("model", [Model.seven_point, Model.five_point, Model.two_point])
def test_known_outliers_go_and_most_inliers_stay(setting, model, consensus):
    source, target = two_views(0.2)
    rejection = Rejection(model=model, coordinates="rays", threshold_px=1.0, consensus=consensus)
    mask = rejection.inliers_of(context(setting))(source, target, 4)
    assert mask[50:].mean() > 0.95
    assert mask[:50].mean() < 0.15


def test_five_matches_and_two_explain_a_plane_which_eight_do_not(setting):
    source, target = two_views(0.2, flat=True)
    kept = {}
    for model in (Model.essential, Model.five_point, Model.two_point):
        rejection = Rejection(model=model, threshold_px=1.0, consensus="refined")
        kept[model] = rejection.inliers_of(context(setting))(source, target, 4)
    assert kept[Model.essential][50:].mean() < 0.9
    for model in (Model.five_point, Model.two_point):
        assert kept[model][50:].mean() > 0.97
        assert kept[model][:50].mean() < 0.15


def test_a_wrong_rotation_is_not_explained(setting):
    source, target = two_views(0.2)
    rejection, right = Rejection(model=Model.two_point, threshold_px=1.0), context(setting)
    wrong = replace(right, rotation_at=lambda index: np.eye(3))
    assert rejection.inliers_of(wrong)(source, target, 4).mean() < 0.5
    unknown = replace(right, rotation_at=lambda index: np.full((3, 3), np.nan))
    assert rejection.inliers_of(unknown)(source, target, 4).all()


def test_a_known_rotation_needs_poses_and_the_previous_position(setting):
    with pytest.raises(SettingsError, match=r"two-point rejection in .*: no poses, expected their rotations"):
        LucasKanade(rejection=Rejection(model="two-point")).start(replace(context(setting), rotation_at=None))
    with pytest.raises(ValueError, match="reference is 'first', expected previous"):
        Rejection(model="two-point", reference="first")


@pytest.mark.parametrize("kind", [LucasKanade, Correspondence])
@pytest.mark.parametrize("model", [Model.seven_point, Model.five_point, Model.two_point])
def test_trackers_keep_what_moves_like_a_plane(sideways, setting, kind, model):
    still = replace(setting(), camera_at=lambda index: CAMERA, rotation_at=lambda index: np.eye(3))
    tracker = kind(rejection=Rejection(model=model, threshold_px=2.0)).start(still)
    steps = [tracker.step(frame) for frame in sideways[:3]]
    assert steps[-1].outliers < 0.15 * steps[-1].matched
    assert steps[-1].matched > 100


def test_magsac_finds_outliers_among_few_matches():
    source, target, _ = samples(25, 20)
    kept_right, kept_wrong = [], []
    rng = np.random.default_rng(1)
    for one, other in zip(source, target, strict=True):
        wrong = np.arange(25) < 7
        moved = np.where(wrong[:, None], other + rng.uniform(0.2, 0.5, (25, 2)), other)
        rejection = Rejection(model=Model.essential, consensus=Consensus.magsac, coordinates="rays", focal_px=400.0)
        kept = rejection.inliers(400.0 * one, 400.0 * moved, 0)
        kept_right.append(kept[~wrong].mean())
        kept_wrong.append(kept[wrong].mean())
    assert np.mean(kept_right) > 0.7
    assert np.mean(kept_wrong) < 0.4


def test_a_known_rotation_is_of_one_step_only():
    rejection = Rejection(model=Model.two_point)
    with pytest.raises(ValueError, match=r"max_missed_frames is 2, expected 0 with two-point"):
        Correspondence(rejection=rejection, max_missed_frames=2)
