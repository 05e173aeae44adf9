import cv2
import numpy as np

from tracknoise.trackers.rejection import Fundamental


def two_views(n: int, noise: float = 0.0, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    points = rng.uniform([-2, -2, 3], [2, 2, 8], (n, 3))
    rotation, _ = cv2.Rodrigues(np.array([0.05, -0.1, 0.02]))
    moved = points @ rotation.T + (0.5, 0.1, -0.2)
    source, target = points[:, :2] / points[:, 2:], moved[:, :2] / moved[:, 2:]
    return source, target + rng.normal(0, noise, target.shape)


def test_eight_matches_of_a_rigid_scene_determine_what_all_others_fulfil():
    source, target = two_views(60)
    (model,), (usable,) = Fundamental().hypotheses(source[None, :8], target[None, :8])
    assert usable
    assert abs(np.linalg.det(model)) < 1e-12
    assert Fundamental().agrees(model[None], source, target, 1e-9).all()


def test_matches_off_their_epipolar_line_do_not_agree():
    source, target = two_views(200)
    model = Fundamental().refine(np.eye(3), source, target)
    lines = np.column_stack([source, np.ones(200)]) @ model.T
    across = lines[:, :2] / np.linalg.norm(lines[:, :2], axis=1, keepdims=True)
    assert Fundamental().agrees(model[None], source, target + 0.001 * across, 0.001).all()
    assert not Fundamental().agrees(model[None], source, target + 0.003 * across, 0.001).any()
    along = across[:, ::-1] * (-1, 1)
    assert Fundamental().agrees(model[None], source, target + 0.003 * along, 0.001).all()


def test_the_distance_is_opencvs():
    source, target = two_views(30, noise=0.003)
    model = Fundamental().refine(np.eye(3), source, target)
    for s, t in zip(source, target, strict=True):
        distance = np.sqrt(cv2.sampsonDistance(np.append(s, 1.0), np.append(t, 1.0), model))
        assert Fundamental().agrees(model[None], s[None], t[None], distance * 1.001).all()
        assert not Fundamental().agrees(model[None], s[None], t[None], distance * 0.999).any()


def test_eight_equal_matches_are_degenerate_and_leave_the_model_alone():
    same = np.full((8, 2), 0.5)
    assert not Fundamental().hypotheses(same[None], same[None])[1].any()
    assert (Fundamental().refine(np.eye(3), same, same) == np.eye(3)).all()
