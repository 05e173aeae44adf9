import cv2
import numpy as np
import pytest

from tracknoise.trackers.consensus import best_hypothesis, hypotheses_needed, marginal_support
from tracknoise.trackers.rejection import (
    Consensus,
    Fundamental,
    Homography,
    Model,
    ReferencePosition,
    Rejection,
)

H = np.array([[1.02, 0.01, 3.0], [-0.01, 0.99, 2.0], [1e-5, 2e-5, 1.0]])


def matches(n: int, outliers: float, noise_px: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points under H with noise; the last `outliers` share is 20 to 60 px off."""
    rng = np.random.default_rng(seed)
    source = rng.uniform(0, 640, (n, 2))
    homogeneous = np.column_stack([source, np.ones(n)]) @ H.T
    target = homogeneous[:, :2] / homogeneous[:, 2:] + rng.normal(0, noise_px, (n, 2))
    wrong = np.arange(n) >= n - round(n * outliers)
    angle, radius = rng.uniform(0, 2 * np.pi, n), rng.uniform(20, 60, n)
    target[wrong] += (radius * [np.cos(angle), np.sin(angle)]).T[wrong]
    return source, target, ~wrong


def two_views(noise_px: float) -> tuple[np.ndarray, np.ndarray]:
    """Points in space, seen by a camera that moves. The first 60 of 300 matches are 20 to 40 px off."""
    rng = np.random.default_rng(0)
    points = rng.uniform([-2, -2, 3], [2, 2, 8], (300, 3))
    source = 500 * points[:, :2] / points[:, 2:]
    moved = points + np.array([0.4, 0.1, -0.2])
    target = 500 * moved[:, :2] / moved[:, 2:] + rng.normal(0, noise_px, (300, 2))
    target[:60] += rng.choice([-1, 1], (60, 2)) * rng.uniform(20, 40, (60, 2))
    return source, target


def one_by_one(source: np.ndarray, target: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The best minimal hypothesis, by the definition: one sample at a time, and a linear system each."""
    n, judged, needed, most, best = len(source), 0, 2000, 3, None
    triples = [(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)]
    while judged < needed:
        rows = rng.integers(n, size=4)
        areas = [[float(np.linalg.det(np.c_[x[rows][list(t)], np.ones(3)])) for t in triples] for x in (source, target)]
        signs = np.sign(np.round(areas, 6))
        if len(set(rows.tolist())) < 4 or (signs == 0).any() or abs((signs[0] * signs[1]).sum()) < 4:
            continue
        left, right = [], []
        for (x, y), (u, v) in zip(source[rows], target[rows], strict=True):
            left += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
            right += [u, v]
        model = np.append(np.linalg.solve(left, right), 1.0).reshape(3, 3)
        reached = np.column_stack([source, np.ones(n)]) @ model.T
        mask = np.linalg.norm(reached[:, :2] / reached[:, 2:] - target, axis=1) <= 3
        judged += 1
        if mask.sum() > most:
            best, most = mask, int(mask.sum())
            failure = 1 - (most / n) ** 4
            needed = 0 if failure <= 0 else min(needed, round(np.log(0.005) / np.log(failure)))
    assert best is not None
    return best


@pytest.mark.parametrize(("outliers", "noise_px"), [(0.0, 0.3), (0.1, 1.0), (0.3, 0.5), (0.6, 0.8)])
def test_the_hypothesis_is_the_one_that_the_sequential_definition_finds(outliers, noise_px):
    for frame in range(4):
        source, target, _ = matches(150, outliers, noise_px, seed=frame)
        expected = one_by_one(source, target, np.random.default_rng([5, frame]))
        assert (
            Rejection(consensus=Consensus.hypothesis, seed=5).inliers(source, target, frame).tolist()
            == expected.tolist()
        )


def test_the_refined_mask_is_opencvs():
    differing = []
    for seed in range(20):
        source, target, _ = matches(500, 0.2, 1.0, seed)
        ours = Rejection(consensus=Consensus.refined).inliers(source, target, seed)
        _, mask = cv2.findHomography(source, target, cv2.RANSAC, 3.0, maxIters=2000, confidence=0.995)
        differing.append(np.count_nonzero(ours != (mask[:, 0] > 0)))
    assert np.mean(differing) < 0.02 * 500


@pytest.mark.parametrize("consensus", list(Consensus))
@pytest.mark.parametrize("outliers", [0.05, 0.4])
def test_known_outliers_go_and_most_inliers_stay(consensus, outliers):
    kept, false = [], []
    for seed in range(10):
        source, target, true = matches(400, outliers, 0.5, seed)
        mask = Rejection(consensus=consensus).inliers(source, target, seed)
        kept.append(mask[true].mean())
        false.append(mask[~true].mean())
    assert np.mean(kept) > (0.99 if consensus is Consensus.refined else 0.93)
    assert np.mean(false) < 0.01


def test_refining_keeps_more_than_a_minimal_hypothesis_does():
    source, target, _ = matches(800, 0.1, 1.2)
    shares = [Rejection(consensus=consensus).inliers(source, target, 0).mean() for consensus in Consensus]
    assert shares[0] < shares[1]


def test_the_fundamental_matrix_tells_what_moves_by_itself():
    source, target = two_views(noise_px=0.2)
    for consensus in Consensus:
        mask = Rejection(model=Model.fundamental, consensus=consensus).inliers(source, target, 0)
        assert mask[60:].mean() > 0.95
        assert mask[:60].mean() < 0.25  # a match that moves along its epipolar line cannot be told
    assert Rejection().inliers(source, target, 0)[60:].mean() < 0.9  # no plane: a homography does not explain it


@pytest.mark.parametrize("model", list(Model))
def test_too_few_matches_have_no_outliers(model):
    for n in range(3 if model is Model.two_point else 5):
        source, target, _ = matches(n, 1.0, 1.0)
        assert Rejection(model=model).inliers(source, target, 0).tolist() == [True] * n


@pytest.mark.parametrize("model", list(Model))
def test_points_on_a_line_have_no_outliers(model):
    line = np.column_stack([np.arange(50.0), 2 * np.arange(50.0)])
    assert Rejection(model=model).inliers(line, line + 1, 0).all()
    assert Rejection(model=model).inliers(np.full((50, 2), 7.0), np.full((50, 2), 9.0), 0).all()


def test_no_model_rejects_nothing():
    source, target, _ = matches(100, 0.5, 1.0)
    assert Rejection(model=Model.none).inliers(source, target, 0).all()


def test_the_draw_depends_on_seed_and_frame_alone():
    source, target, _ = matches(300, 0.3, 1.5)
    rejections = [Rejection(consensus=Consensus.hypothesis, seed=seed) for seed in (0, 1)]
    masks = {
        (rejection.seed, frame): rejection.inliers(source, target, frame).tobytes()
        for rejection in rejections
        for frame in (0, 1)
    }
    assert len(set(masks.values())) == 4
    assert rejections[1].inliers(source, target, 0).tobytes() == masks[1, 0]


@pytest.mark.parametrize("model", [Model.homography, Model.fundamental])
def test_local_optimisation_makes_the_seed_matter_far_less(model):
    # Noise near the threshold, where the inliers of a minimal hypothesis depend most on its sample.
    source, target = two_views(noise_px=1.0) if model is Model.fundamental else matches(300, 0.3, 1.2)[:2]
    spread = {}
    for consensus in Consensus:
        kept = [Rejection(model=model, consensus=consensus, seed=seed).inliers(source, target, 0) for seed in range(12)]
        spread[consensus] = np.mean(np.std(kept, axis=0))
    assert spread[Consensus.refined] < 0.5 * spread[Consensus.hypothesis]


def test_with_a_loose_threshold_magsac_depends_less_on_the_seed_and_keeps_fewer_outliers():
    """At 12 px, noise of 0.5 px: models that explain few matches well have as many inliers as the right one."""
    source, target = two_views(noise_px=0.5)
    spread, wrong = {}, {}
    for consensus in (Consensus.refined, Consensus.magsac):
        options = {"model": Model.fundamental, "consensus": consensus, "threshold_px": 12.0}
        kept = [Rejection(**options, seed=seed).inliers(source, target, 0) for seed in range(10)]
        spread[consensus], wrong[consensus] = np.mean(np.std(kept, axis=0)), np.mean(kept, axis=0)[:60].mean()
        assert np.mean(kept, axis=0)[60:].mean() > 0.98
    assert spread[Consensus.magsac] < 0.3 * spread[Consensus.refined]
    assert wrong[Consensus.magsac] < wrong[Consensus.refined]


def test_support_is_one_less_the_loss_that_is_averaged_over_all_scales():
    """By integrals: the density of an error in four dimensions, then r w(r)."""
    cut, errors = 3.64, np.linspace(1e-4, 1, 2001)
    weight = np.zeros_like(errors)
    for sigma in np.linspace(1e-4, 1 / cut, 4001):
        within = errors < cut * sigma
        weight[within] += errors[within] ** 3 / sigma**4 * np.exp(-(errors[within] ** 2) / (2 * sigma**2))
    loss = np.cumsum(errors * weight)
    found = marginal_support(errors[None] ** 2)[0]
    np.testing.assert_allclose(found, 1 - loss / loss[-1], atol=0.005)
    assert marginal_support(np.array([[0.0, 1.0, 4.0, np.inf]])).tolist() == [[1.0, 0.0, 0.0, 0.0]]


@pytest.mark.parametrize("geometry", [Homography(), Fundamental()])
def test_what_agrees_has_an_error_below_the_threshold(geometry):
    source, target, _ = matches(200, 0.3, 1.0)
    size = geometry.sample_size
    models, usable = geometry.hypotheses(*(points[:160].reshape(-1, size, 2) for points in (source, target)))
    squared = geometry.squared_errors(models[usable], source, target)
    assert (geometry.agrees(models[usable], source, target, 3.0) == (squared <= 9.0)).all()


def test_a_refit_that_loses_inliers_is_not_kept():
    class Shrinking(Homography):
        def refine(self, model, source, target):
            return np.diag([2.0, 2.0, 1.0])

    source, target, _ = matches(100, 0.2, 0.5)
    options = {"threshold": 3.0, "confidence": 0.995, "max_hypotheses": 200}
    plain, refitted = (
        best_hypothesis(Shrinking(), source, target, **options, rng=np.random.default_rng(0), max_refits=refits)
        for refits in (0, 5)
    )
    assert plain.inliers.tolist() == refitted.inliers.tolist()


@pytest.mark.parametrize(("share", "needed"), [(1.0, 0), (0.95, 3), (0.5, 82), (0.1, 2000), (0.0, 2000), (1e-6, 2000)])
def test_hypotheses_needed(share, needed):
    assert hypotheses_needed(share, 4, 0.995, 2000) == needed


@pytest.mark.parametrize(
    "wrong", [{"threshold_px": 0.0}, {"confidence": 1.0}, {"max_hypotheses": 0}, {"seed": -1}, {"threshold_px": np.inf}]
)
def test_impossible_settings_are_refused_by_name(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Rejection(**wrong)


def test_names_do_for_members_and_unknown_ones_are_refused():
    assert Rejection(consensus="hypothesis", reference="first", model="none") == Rejection(
        consensus=Consensus.hypothesis, reference=ReferencePosition.first, model=Model.none
    )
    with pytest.raises(ValueError, match=r"consensus is 'best', expected one of hypothesis, refined, magsac"):
        Rejection(consensus="best")
