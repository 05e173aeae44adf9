import numpy as np
import pytest

from tracknoise.analysis.error_shape import ORDERS, mardia, transformed, whitening


def sums(pairs: np.ndarray) -> np.ndarray:
    """Power sums, each by itself."""
    return np.array([(pairs[:, 0] ** p * pairs[:, 1] ** q).sum() for p, q in ORDERS])


def by_definition(pairs: np.ndarray) -> tuple[float, float]:
    """Mardia's double sum over all pairs of points."""
    z = pairs - pairs.mean(axis=0)
    products = z @ np.linalg.inv(z.T @ z / len(z)) @ z.T
    return float((products**3).mean()), float((np.diag(products) ** 2).mean())


@pytest.fixture(scope="module")
def pairs() -> np.ndarray:
    rng = np.random.default_rng(0)
    return rng.exponential(size=(200, 2)) @ np.array([[1.0, 0.4], [0.0, 0.3]]) + [2.0, -1.0]


def test_skewness_and_kurtosis_are_those_of_the_definition(pairs) -> None:
    assert mardia(sums(pairs)) == pytest.approx(by_definition(pairs), rel=1e-9)


def test_they_do_not_change_with_the_axes(pairs) -> None:
    moved = pairs @ np.array([[0.3, -2.0], [1.0, 0.7]]) + [5.0, 3.0]
    assert mardia(sums(moved)) == pytest.approx(mardia(sums(pairs)), rel=1e-8)


def test_a_gaussian_has_0_and_8_and_a_uniform_disc_16_thirds() -> None:
    rng = np.random.default_rng(1)
    normal = rng.standard_normal((50_000, 2))
    disc = normal / np.hypot(*normal.T)[:, None] * np.sqrt(rng.random((50_000, 1)))
    assert mardia(sums(normal)) == pytest.approx([0.0, 8.0], abs=0.15)  # four standard errors: 4 sqrt(64 / n) = 0.14
    assert mardia(sums(disc)) == pytest.approx([0.0, 16 / 3], abs=0.05)


def test_power_sums_of_moved_pairs_follow_from_those_of_the_pairs(pairs) -> None:
    centre, (a, b, c) = np.array([0.5, -0.7]), (2.0, -0.3, 0.6)
    moved = (pairs - centre) @ np.array([[a, 0.0], [b, c]]).T
    assert transformed(sums(pairs), centre, np.array([a, b, c])) == pytest.approx(sums(moved), rel=1e-9)


def test_some_power_sums_are_those_of_all(pairs) -> None:
    centre, root = np.array([0.5, -0.7]), np.array([2.0, -0.3, 0.6])
    every = dict(zip(ORDERS, transformed(sums(pairs), centre, root), strict=True))
    some = ((2, 2), (0, 3), (1, 0))
    assert transformed(sums(pairs), centre, root, orders=some).tolist() == [every[order] for order in some]


def test_whitened_pairs_have_mean_zero_and_unit_covariance(pairs) -> None:
    n, u, v, uu, uv, vv = transformed(sums(pairs), *whitening(sums(pairs)))[:6] / len(pairs)
    assert [n, u, v, uu, uv, vv] == pytest.approx([1, 0, 0, 1, 0, 1], abs=1e-9)


def test_many_samples_at_once_are_as_one_by_one(pairs) -> None:
    parts = [sums(pairs[:80]), sums(pairs[80:])]
    assert np.array_equal(mardia(np.stack(parts, axis=-1)), np.stack([mardia(part) for part in parts], axis=-1))


@pytest.mark.parametrize("slope", [0.0, 1.0, -0.5])
def test_pairs_on_a_line_have_none(slope: float) -> None:
    u = np.linspace(-1, 1, 50)
    assert np.isnan(mardia(sums(np.column_stack([u, slope * u])))).all()
