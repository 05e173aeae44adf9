"""The formulas against errors drawn straight from what they describe."""

import numpy as np
import pytest
from tests.selfcheck.known_errors import curve_point, mean_lifetime, share, survival

from tracknoise.trackers.oracle import Oracle

N = 40
ORACLE = Oracle(
    bias_px=(0.3, -0.5),
    drift_px_per_frame=(0.02, 0.05),
    covariance_px2=((0.6, 0.2), (0.2, 0.3)),
    outlier_rate=0.05,
    loss_rate=0.1,
    n_features=50,
)


@pytest.fixture(scope="module")
def errors() -> np.ndarray:
    """Many samples of N errors of age 5: (samples, N, 2)."""
    return np.random.default_rng(1).multivariate_normal([0.4, -0.25], ORACLE.covariance_px2, (20000, N))


def estimates(errors: np.ndarray, statistic: str, first: int, second: int) -> np.ndarray:
    a, b = errors[..., first], errors[..., second]
    if statistic == "nu":
        return a.mean(axis=1)
    if statistic == "eta":
        return abs(a).mean(axis=1)
    if statistic == "Phi":
        return (a * b).mean(axis=1)
    return ((a - a.mean(axis=1, keepdims=True)) * (b - b.mean(axis=1, keepdims=True))).sum(axis=1) / (N - 1)


@pytest.mark.parametrize(
    ("statistic", "coordinate"),
    [
        *((statistic, coordinate) for statistic in ("nu", "eta", "Phi", "central") for coordinate in ("u", "v")),
        *((statistic, "uv") for statistic in ("Phi", "central")),
    ],
)
def test_points_of_curves(errors, statistic, coordinate):
    found = estimates(errors, statistic, *{"u": (0, 0), "v": (1, 1), "uv": (0, 1)}[coordinate])
    known = curve_point(ORACLE, statistic=statistic, coordinate=coordinate, age=5, n=N)
    assert found.mean() == pytest.approx(known.value, abs=4 * known.standard_error / np.sqrt(len(found)))
    assert found.std() == pytest.approx(known.standard_error, rel=0.04)


def lives(frames: int, n_samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean lifetime, survival beyond 3 frames (Kaplan-Meier), and how many were at risk; who ends is replaced."""
    rng = np.random.default_rng(2)
    age = np.ones((n_samples, ORACLE.n_features), dtype=int)
    tracks, at_risk, ended = np.full(n_samples, ORACLE.n_features), np.zeros((n_samples, 3)), np.zeros((n_samples, 3))
    for _ in range(frames - 1):
        dies = rng.random(age.shape) < ORACLE.loss_rate + ORACLE.outlier_rate
        for lifetime in (1, 2, 3):
            at_risk[:, lifetime - 1] += (age == lifetime).sum(axis=1)
            ended[:, lifetime - 1] += (dies & (age == lifetime)).sum(axis=1)
        age = np.where(dies, 1, age + 1)
        tracks += dies.sum(axis=1)
    return frames * ORACLE.n_features / tracks, np.prod(1 - ended / at_risk, axis=1), at_risk


def test_lifetimes_and_shares():
    means, survivals, at_risk = lives(frames=12, n_samples=5000)
    known = mean_lifetime(ORACLE, frames=12, n_scenes=1)
    assert means.mean() == pytest.approx(known.value, rel=0.005)
    assert means.std() == pytest.approx(known.standard_error, rel=0.04)
    known = survival(ORACLE, at_risk.mean(axis=0).astype(int))
    assert survivals.mean() == pytest.approx(known.value, rel=0.005)
    assert survivals.std() == pytest.approx(known.standard_error, rel=0.06)
    shares = np.random.default_rng(3).binomial(200, 0.05, 20000) / 200
    known = share(0.05, 200)
    assert (shares.mean(), shares.std()) == pytest.approx((known.value, known.standard_error), rel=0.03)
