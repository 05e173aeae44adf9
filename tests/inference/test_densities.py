"""The Gaussian, Student's t and the mixture: what they have in common, and that fits are the most likely ones."""

import numpy as np
import pytest
from scipy import stats

from tracknoise.inference.densities import (
    Mixture,
    Student,
    fit_gaussian,
    fit_mixture,
    fit_student,
    squared_distances,
    terms,
)

FITS = (fit_gaussian, fit_student, fit_mixture)
SHAPE = np.array([[1.0, 0.3], [0.0, 0.5]])


@pytest.fixture(scope="module")
def heavy() -> np.ndarray:
    """Student's t of 4 degrees of freedom, turned and moved."""
    rng = np.random.default_rng(0)
    scale = np.sqrt(4 / rng.chisquare(4, 4000))
    return rng.standard_normal((4000, 2)) * scale[:, None] @ SHAPE + [0.2, -0.1]


@pytest.fixture(scope="module")
def contaminated() -> np.ndarray:
    """Eight percent with five times the spread."""
    rng = np.random.default_rng(1)
    scale = np.where(rng.random(4000) < 0.08, 5.0, 1.0)
    return rng.standard_normal((4000, 2)) * scale[:, None] @ SHAPE + [0.2, -0.1]


def test_squared_distances_are_those_of_mahalanobis() -> None:
    points = np.random.default_rng(2).normal(size=(20, 2))
    mean, covariance = np.array([0.3, -0.4]), np.array([[2.0, 0.5], [0.5, 1.0]])
    away = points - mean
    expected = np.einsum("ni,ij,nj->n", away, np.linalg.inv(covariance), away)
    found = squared_distances(terms([points]), mean[None], np.array([[2.0, 0.5, 1.0]]))
    assert found[0] == pytest.approx(expected, rel=1e-9)


def test_log_densities_are_those_of_scipy() -> None:
    points = np.random.default_rng(3).normal(size=(20, 2))
    mean, scatter, matrix = np.array([[0.3, -0.4]]), np.array([[2.0, 0.5, 1.0]]), np.array([[2.0, 0.5], [0.5, 1.0]])
    nu, share, ratio = np.array([3.5]), np.array([0.2]), np.array([9.0])
    student = Student(mean, scatter, nu).log_density(terms([points]))[0]
    assert student == pytest.approx(stats.multivariate_t(mean[0], matrix, df=3.5).logpdf(points), rel=1e-9)
    wide, core = (stats.multivariate_normal(mean[0], factor * matrix).pdf(points) for factor in (9.0, 1.0))
    mixture = Mixture(mean, scatter, share, ratio).log_density(terms([points]))[0]
    assert mixture == pytest.approx(np.log(0.2 * wide + 0.8 * core), rel=1e-9)
    gaussian = fit_gaussian(terms([points]))
    expected = stats.multivariate_normal(points.mean(axis=0), np.cov(points.T, ddof=0)).logpdf(points)
    assert gaussian.log_density(terms([points]))[0] == pytest.approx(expected, rel=1e-9)


def test_parameters_of_a_student_come_back(heavy) -> None:
    fit = fit_student(terms([heavy]))
    assert fit.nu[0] == pytest.approx(4.0, abs=0.6)
    assert fit.mean[0] == pytest.approx([0.2, -0.1], abs=0.07)
    assert fit.scatter[0] == pytest.approx([1.0, 0.3, 0.34], rel=0.1)


def test_parameters_of_a_mixture_come_back(contaminated) -> None:
    fit = fit_mixture(terms([contaminated]))
    assert fit.share[0] == pytest.approx(0.08, abs=0.015)
    assert fit.ratio[0] == pytest.approx(25.0, rel=0.2)
    assert fit.scatter[0] == pytest.approx([1.0, 0.3, 0.34], rel=0.1)


def test_parameters_of_a_mixture_that_is_mostly_wide_come_back() -> None:
    rng = np.random.default_rng(5)
    wide = rng.random((4000, 1)) < 0.8
    fit = fit_mixture(terms([rng.normal(size=(4000, 2)) * np.where(wide, 4.5, 1.0)]))
    assert fit.share[0] == pytest.approx(0.8, abs=0.03)
    assert fit.ratio[0] == pytest.approx(4.5**2, rel=0.15)


@pytest.mark.parametrize("factor", [0.97, 1.03])
def test_no_parameter_near_the_fit_is_more_likely(heavy, contaminated, factor: float) -> None:
    samples = terms([heavy, contaminated])
    student, mixture = fit_student(samples), fit_mixture(samples)
    others = [
        Student(student.mean, student.scatter, student.nu * factor),
        Student(student.mean, student.scatter * factor, student.nu),
        Student(student.mean * factor, student.scatter, student.nu),
    ]
    assert all((other.log_density(samples).sum(1) < student.log_density(samples).sum(1)).all() for other in others)
    others = [
        Mixture(mixture.mean, mixture.scatter * factor, mixture.share, mixture.ratio),
        Mixture(mixture.mean, mixture.scatter, mixture.share * factor, mixture.ratio),
        Mixture(mixture.mean, mixture.scatter, mixture.share, mixture.ratio * factor),
    ]
    assert all((other.log_density(samples).sum(1) < mixture.log_density(samples).sum(1)).all() for other in others)


def test_a_gaussian_sample_makes_the_others_gaussian() -> None:
    samples = terms([np.random.default_rng(4).normal(size=(5000, 2))])
    best = fit_gaussian(samples).log_density(samples).mean()
    assert fit_student(samples).nu[0] > 40
    for fit in (fit_student, fit_mixture):
        assert fit(samples).log_density(samples).mean() == pytest.approx(best, abs=1e-3)


@pytest.mark.parametrize("fit", FITS)
def test_samples_of_other_sizes_beside_it_change_nothing(fit, heavy) -> None:
    alone, beside = fit(terms([heavy[:100]])), fit(terms([heavy[:100], heavy[:900]]))
    assert beside.scatter[0] == pytest.approx(alone.scatter[0], rel=1e-9)
    points = terms([heavy[:100]])
    assert beside.log_density(terms([heavy[:100]] * 2))[0] == pytest.approx(alone.log_density(points)[0], rel=1e-9)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_step_too_far_does_not_make_a_scatter_a_line() -> None:
    """Few points near a line, one of them far away: an extrapolated correlation was 1, and its inverse infinite."""
    rng = np.random.default_rng(5433)
    n = int(rng.integers(4, 14))
    points = rng.normal(size=(n, 2))
    points[:, 1] = points[:, 0] * rng.uniform(-1, 1) + 0.05 * points[:, 1]
    points[-1] *= rng.uniform(1, 60)
    fit = fit_mixture(terms([points]))
    assert np.isfinite(fit.log_density(terms([points]))).all()
