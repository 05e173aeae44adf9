"""What noise assumptions learn from windows of training scenes.

- From windows of training scenes, and a noise model if there is one, to what the arms need to know.

The noise of tracks, from windows of training scenes, by the likelihood of what their points cannot absorb.

The error of each track is projected on what is left when its 3-D point is fitted with the true poses. What remains is
Gaussian with a covariance that is linear in A, W and Q, which are found by maximum likelihood (training.likelihood).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.optimize import minimize

from tracknoise.estimators.linear_window import LinearTracks, PointTracks, consistent_sigma, linear_tracks
from tracknoise.estimators.model import Purpose
from tracknoise.estimators.proof_windows import ROUNDING_PX, Problem, TrackGroup, errors_of
from tracknoise.estimators.track_noise import TrackNoise
from tracknoise.estimators.trial import Beliefs, PlantedNoise, Student, try_arms

_LEAST_PX, _MOST_PX, _START_PX = 1e-3, 30.0, 0.2
_LEAST_NU, _MOST_NU = 2.05, 200.0
_NEGLIGIBLE = 1e-3
"""A component with a variance below this share of the largest one is 0."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedNoise:
    """What was learned from training windows.

    Attributes
    ----------
    noise : TrackNoise
        Isotropic A, W and Q.
    exponent : float
        W of a track is multiplied by exp(-2 exponent covariate); 0 where that was not fitted.
    log_likelihood : float
        Per track, natural units.
    """

    noise: TrackNoise
    exponent: float
    log_likelihood: float


@dataclass(frozen=True, slots=True, eq=False)
class _Projected:
    """Tracks of one length after their points: errors (tracks, 2 n - 3), and what each component contributes."""

    left: NDArray[np.float64]
    first: NDArray[np.float64]
    white: NDArray[np.float64]
    walk: NDArray[np.float64]
    covariate: NDArray[np.float64]

    def _whitened(
        self, variances: NDArray[np.float64], exponent: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Squared norms of the whitened errors, (tracks,), and logarithms of determinants of the roots."""
        factor = np.exp(-2.0 * exponent * self.covariate)[:, None, None]
        covariance = variances[0] * self.first + variances[1] * factor * self.white + variances[2] * self.walk
        root = np.linalg.cholesky(covariance)
        whitened = np.linalg.solve(root, self.left[:, :, None])[:, :, 0]
        return np.square(whitened).sum(axis=1), np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)

    def log_likelihood(self, variances: NDArray[np.float64], exponent: float) -> float:
        squares, logs = self._whitened(variances, exponent)
        return float(-0.5 * squares.sum() - logs.sum())

    def mean_squares(self, variances: NDArray[np.float64], exponent: float) -> NDArray[np.float64]:
        """(tracks,): mean of the squared whitened errors of each track."""
        return np.asarray(self._whitened(variances, exponent)[0] / self.left.shape[1])


def fit_noise(problems: Sequence[Problem], *, with_covariate: bool = False) -> FittedNoise:
    """Isotropic A, W and Q of windows, and how W depends on the covariate if asked for: (training.likelihood)."""
    groups = [part for problem in problems for part in _projected(problem)]
    n_tracks = sum(len(group.left) for group in groups)

    def loss(values: NDArray[np.float64]) -> float:
        variances, exponent = np.exp(2.0 * values[:3]), values[3] if with_covariate else 0.0
        return -sum(group.log_likelihood(variances, exponent) for group in groups) / n_tracks

    found, value = _minimum(loss, 4 if with_covariate else 3)
    variances = np.exp(2.0 * found[:3])
    kept = np.sqrt(np.where(variances > _NEGLIGIBLE * variances.max(), variances, 0.0))
    noise = TrackNoise.isotropic(first=float(kept[0]), white=float(kept[1]), walk=float(kept[2]))
    return FittedNoise(noise, float(found[3]) if with_covariate else 0.0, -value)


def _minimum(loss: Callable[[NDArray[np.float64]], float], count: int) -> tuple[NDArray[np.float64], float]:
    start = np.array([np.log(_START_PX)] * 3 + [0.0])[:count]
    limits = [(np.log(_LEAST_PX), np.log(_MOST_PX))] * 3 + [(-3.0, 3.0)]
    found = minimize(loss, start, method="L-BFGS-B", bounds=limits[:count])
    return np.asarray(found.x), float(found.fun)


def _projected(problem: Problem) -> list[_Projected]:
    pairs = zip(problem.groups, errors_of(problem), strict=True)
    return [_of_group(problem, group, errors) for group, errors in pairs]


def _of_group(problem: Problem, group: TrackGroup, errors: NDArray[np.float64]) -> _Projected:
    tracks = PointTracks(group.frames, group.points)
    linear = linear_tracks(problem.camera, problem.world_from_camera, tracks)
    span = np.asarray(np.linalg.qr(linear.by_point, mode="complete")[0][:, :, 3:], dtype=np.float64)
    across = np.swapaxes(span, 1, 2)

    def share(noise: TrackNoise) -> NDArray[np.float64]:
        return np.asarray(across @ noise.covariance(linear.magnification, ages=group.ages) @ span)

    # a track that began before the window begins there with the independent noise of any other observation
    own, other = share(TrackNoise.isotropic(first=1.0)), share(TrackNoise.isotropic(white=1.0))
    born = group.born[:, None, None]
    return _Projected(
        left=(across @ errors.reshape(len(errors), -1, 1))[:, :, 0],
        first=np.where(born, own, 0.0),
        white=np.where(born, other, own + other),
        walk=share(TrackNoise.isotropic(walk=1.0)),
        covariate=group.covariate,
    )


def student_of_tracks(problems: Sequence[Problem], noise: TrackNoise) -> tuple[float, float]:
    """Student's distribution of whole tracks about isotropic noise: degrees of freedom, and scale of the covariance.

    By maximum likelihood. Infinitely many degrees of freedom where there is no sign of tails.
    """
    variances = np.array([float(np.trace(part)) / 2.0 for part in (noise.first, noise.white, noise.walk)])
    least = np.maximum(variances, _LEAST_PX**2)
    groups = [part for problem in problems for part in _projected(problem)]
    sizes = np.concatenate([np.full(len(group.left), group.left.shape[1]) for group in groups])
    return student(np.concatenate([group.mean_squares(least, 0.0) for group in groups]), sizes)


def student(mean_squares: NDArray[np.float64], sizes: NDArray[np.int64]) -> tuple[float, float]:
    """Degrees of freedom and squared scale of Student's distribution, from mean squares of blocks of some sizes."""

    def loss(values: NDArray[np.float64]) -> float:
        nu, scale = np.exp(values)
        return -float(np.mean(stats.f.logpdf(mean_squares / scale, sizes, nu) - np.log(scale)))

    limits = [(np.log(_LEAST_NU), np.log(_MOST_NU)), (None, None)]
    start = [np.log(8.0), np.log(np.median(mean_squares))]
    nu, scale = np.exp(minimize(loss, start, method="L-BFGS-B", bounds=limits).x)
    return (float(nu) if nu < 0.5 * _MOST_NU else float("inf")), float(scale)


def student_of_errors(problems: Sequence[Problem]) -> tuple[float, float]:
    """The same of single errors that are not 0: degrees of freedom, and squared scale, px^2."""
    errors = np.concatenate([part.reshape(-1, 2) for problem in problems for part in errors_of(problem)])
    squares = np.square(errors).mean(axis=1)
    positive = squares[squares > ROUNDING_PX**2]
    return student(positive, np.full(len(positive), 2))


def mean_drift(problems: Sequence[Problem]) -> NDArray[np.float64]:
    """(2,) float64, px per frame: the mean error of all tracks as a multiple of their age, by least squares."""
    ages, errors = _about_first(problems)
    return np.asarray(ages @ errors / (ages @ ages))


def mean_square_about_birth(problems: Sequence[Problem]) -> float:
    """Mean square of each coordinate of the errors about the first observation of tracks in the window, px^2."""
    return float(np.square(_about_first(problems)[1]).mean())


def _about_first(problems: Sequence[Problem]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Ages (n,) and errors (n, 2) about the first position, first observations left out."""
    ages, errors = [], []
    for problem in problems:
        for group, error in zip(problem.groups, errors_of(problem), strict=True):
            tracks = PointTracks(group.frames, group.points)
            magnification = linear_tracks(problem.camera, problem.world_from_camera, tracks).magnification
            about = error - magnification[:, :, None] * error[:, :1]
            ages.append(group.ages[:, 1:].ravel())
            errors.append(about[:, 1:].reshape(-1, 2))
    return np.concatenate(ages).astype(np.float64), np.concatenate(errors)


_MOST_BENCHMARKS = 8
"""Training windows of which the linear benchmark is averaged."""


def learn(
    problems: Sequence[Problem],
    *,
    noise: TrackNoise | None = None,
    planted: PlantedNoise | None = None,
) -> Beliefs:
    """What the arms need to know."""
    by_covariate = fit_noise(problems, with_covariate=True)
    components = noise or fit_noise(problems).noise
    benchmarks = problems[:: max(1, len(problems) // _MOST_BENCHMARKS)][:_MOST_BENCHMARKS]
    newest, innovations = (
        float(np.mean([_equivalent(problem, components, purpose) for problem in benchmarks]))
        for purpose in (Purpose.NEWEST_POSE, Purpose.INNOVATIONS)
    )
    draft = Beliefs(
        noise=components,
        tuned_px=1.0,
        about_birth_px=float(np.sqrt(mean_square_about_birth(problems))),
        newest_pose_px=newest,
        innovations_px=innovations,
        by_covariate=by_covariate.noise,
        exponent=by_covariate.exponent,
        drift_px=mean_drift(problems),
        of_errors=Student(*student_of_errors(problems)),
        of_tracks=Student(*student_of_tracks(problems, components)),
        planted=None if planted is None else planted.noise,
        planted_exponent=0.0 if planted is None else planted.texture_exponent,
    )
    return tuned(draft, problems)


def tuned(beliefs: Beliefs, problems: Sequence[Problem]) -> Beliefs:
    """The same with the standard deviation that makes the newest pose of windows consistent."""
    nees = try_arms(problems, beliefs, arms=["0"])["nees_newest"].to_numpy()
    return replace(beliefs, tuned_px=float(np.sqrt(np.mean(nees))))


def _equivalent(problem: Problem, noise: TrackNoise, purpose: Purpose) -> float:
    return consistent_sigma(_linear(problem), noise, purpose=purpose)


def _linear(problem: Problem) -> list[LinearTracks]:
    return [
        linear_tracks(problem.camera, problem.world_from_camera, PointTracks(group.frames, group.points, group.born))
        for group in problem.groups
    ]
