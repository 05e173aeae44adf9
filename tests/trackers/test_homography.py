import cv2
import numpy as np
import pytest

from tracknoise.trackers.rejection import Homography

H = np.array([[1.1, 0.05, 0.2], [-0.1, 0.9, -0.1], [0.02, -0.03, 1.0]])


def mapped(model: np.ndarray, points: np.ndarray) -> np.ndarray:
    homogeneous = np.column_stack([points, np.ones(len(points))]) @ model.T
    return homogeneous[:, :2] / homogeneous[:, 2:]


def by_linear_system(source: np.ndarray, target: np.ndarray) -> np.ndarray:
    rows = []
    for (x, y), (u, v) in zip(source, target, strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
    return np.append(np.linalg.solve(rows, target.ravel()), 1.0).reshape(3, 3)


def test_four_matches_determine_the_homography():
    rng = np.random.default_rng(0)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    source, target = corners + rng.uniform(-0.5, 0.5, (2, 200, 4, 2))
    models, usable = Homography().hypotheses(source, target)
    assert usable.all()
    for model, x, y in zip(models, source, target, strict=True):
        assert np.abs(mapped(model, x) - y).max() < 1e-10
        assert model / model[2, 2] == pytest.approx(by_linear_system(x, y), rel=1e-8, abs=1e-10)


@pytest.mark.parametrize(
    ("points", "usable"),
    [
        ([[0, 0], [1, 0], [1, 1], [0, 1]], True),
        ([[0, 0], [1, 0], [2, 0], [0, 1]], False),  # three on a line
        ([[0, 0], [1, 0], [0, 1], [1, 1]], False),  # two corners swapped: a bow tie
        ([[0, 1], [1, 1], [1, 0], [0, 0]], True),  # seen from behind: all triangles turned
        ([[0, 0], [0, 0], [1, 1], [0, 1]], False),  # two the same
    ],
)
def test_degenerate_samples_are_told(points, usable):
    square = np.array([[[0, 0], [1, 0], [1, 1], [0, 1]]], dtype=np.float64)
    target = np.array([points], dtype=np.float64)
    assert Homography().hypotheses(square, target)[1].tolist() == [usable]
    assert Homography().hypotheses(target, square)[1].tolist() == [usable]


def test_agreement_is_by_forward_reprojection_error():
    source = np.random.default_rng(0).uniform(-1, 1, (50, 2))
    offset = np.linspace(0, 0.02, 50)
    target = mapped(H, source) + np.column_stack([0.6 * offset, 0.8 * offset])
    agrees = Homography().agrees(np.stack([H, -3 * H, np.eye(3)]), source, target, 0.01)
    assert agrees[0].tolist() == (offset <= 0.01).tolist()
    assert agrees[1].tolist() == agrees[0].tolist()
    assert agrees[2].sum() < 5


def test_points_on_the_horizon_never_agree():
    model = np.array([[1.0, 0, 0], [0, 1, 0], [1, 0, 0]])
    assert not Homography().agrees(model[None], np.array([[0.0, 1.0]]), np.array([[0.0, 0.0]]), 1e6).any()


def test_refinement_reaches_the_minimum_that_opencv_finds():
    rng = np.random.default_rng(1)
    source = rng.uniform(-1, 1, (400, 2))
    target = mapped(H, source) + rng.normal(0, 0.01, (400, 2))
    four = [int(np.argmin(np.abs(source - corner).sum(1))) for corner in ([-1, -1], [1, -1], [1, 1], [-1, 1])]
    (start,), _ = Homography().hypotheses(source[None, four], target[None, four])
    refined = Homography().refine(start, source, target)
    expected, _ = cv2.findHomography(source, target, 0)

    def cost(model: np.ndarray) -> float:
        return float(((mapped(model, source) - target) ** 2).sum())

    assert cost(refined) < cost(start)
    assert cost(refined) <= cost(expected) * (1 + 1e-6)
    assert np.abs(refined / refined[2, 2] - expected).max() < 1e-4
