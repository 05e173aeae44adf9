"""Bundle adjustment of a window: poses and points from tracks, with any covariance and robust loss.

Residuals of a track are whitened by the covariance of the track that is assumed, its point is eliminated, and
Gauss-Newton steps are halved until the cost falls. A point is held as direction and inverse depth in the frame of the
first pose that sees it, where it starts. The claimed covariance is the inverse of the Gauss-Newton Hessian at the
solution, as Ceres, GTSAM and g2o report it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

from benchmarks.noise.windows import Problem, TrackGroup, images, moved
from tracknoise.estimators.linear_window import PointTracks, linear_tracks, without
from tracknoise.estimators.losses import OF_POINT, PLAIN, Loss, LossKind, squared_norms
from tracknoise.geometry.pose import invert, transform

_MOST_STEPS, _MOST_HALVINGS = 60, 8
_CONVERGED = 1e-12
"""A step that changes the cost by a smaller share is the last one."""


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """Where an estimator starts: poses (frames, 4, 4), and points (tracks, 3) of each group, world."""

    poses: NDArray[np.float64]
    points: tuple[NDArray[np.float64], ...]


@dataclass(frozen=True, slots=True)
class StudentLoss:
    """Student's distribution of the residuals of a whole track.

    The point of the track is integrated out, which takes three numbers from the residuals.
    """

    nu: float  # degrees of freedom

    def weights(self, whitened: NDArray[np.float64]) -> NDArray[np.float64]:
        """(tracks, 2 n) float64: how much each residual counts."""
        size = whitened.shape[1]
        weight = (self.nu + size - OF_POINT) / (self.nu + np.square(whitened).sum(axis=1))
        return np.repeat(weight[:, None], size, axis=1)


@dataclass(frozen=True, slots=True, eq=False)
class Assumption:
    """The noise that an estimator assumes."""

    covariances: Sequence[NDArray[np.float64]]  # (tracks, 2 n, 2 n) float64 for each group, px^2
    loss: Loss | StudentLoss = PLAIN  # of the whitened residuals


@dataclass(frozen=True, slots=True, eq=False)
class Adjusted:
    """The answer of a bundle adjustment."""

    poses: NDArray[np.float64]  # (frames, 4, 4)
    points: tuple[NDArray[np.float64], ...]  # world, metres
    # (p, p): covariance of the coordinates of poses, see `tracknoise.estimators.linear_window.Gauge`
    claimed: NDArray[np.float64]
    innovations: float  # sum of the squared whitened residuals over their degrees of freedom
    steps: int
    converged: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Chart:
    """Coordinates of points: x / z, y / z and 1 / z in fixed frames, (tracks, 4, 4)."""

    world_from_frame: NDArray[np.float64]

    def coordinates(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y, z = transform(invert(self.world_from_frame), points).T
        return np.stack([x / z, y / z, 1.0 / z], axis=1)

    def points(self, coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
        direction = np.hstack([coordinates[:, :2], np.ones((len(coordinates), 1))])
        return transform(self.world_from_frame, direction / coordinates[:, 2:])

    def derivative(self, coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
        """(tracks, 3, 3): of the points by their coordinates."""
        inverse = coordinates[:, 2]
        local = np.zeros((len(coordinates), 3, 3))
        local[:, 0, 0] = local[:, 1, 1] = 1.0 / inverse
        local[:, :, 2] = -np.hstack([coordinates[:, :2], np.ones((len(coordinates), 1))]) / inverse[:, None] ** 2
        return np.asarray(self.world_from_frame[:, :3, :3] @ local)


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    poses: NDArray[np.float64]
    coordinates: tuple[NDArray[np.float64], ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Eliminated:
    """Normal equations of the poses, and how the point coordinates of each group follow from the step of the poses."""

    information: NDArray[np.float64]
    gradient: NDArray[np.float64]
    triangles: list[NDArray[np.float64]]
    spans: list[NDArray[np.float64]]
    by_pose: list[NDArray[np.float64]]
    residuals: list[NDArray[np.float64]]

    def points_step(self, step: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        parts = zip(self.triangles, self.spans, self.by_pose, self.residuals, strict=True)
        steps = (
            np.linalg.solve(triangle, np.swapaxes(span, 1, 2) @ (residual - by_pose @ step)[:, :, None])[:, :, 0]
            for triangle, span, by_pose, residual in parts
        )
        return [np.asarray(found, dtype=np.float64) for found in steps]


def adjust(problem: Problem, start: Start, assumption: Assumption) -> Adjusted:
    """Poses and points of a window, their claimed covariance, and how the search went."""
    work = _Work(problem, start, assumption)
    state, cost = work.start(), np.inf
    cost, converged, steps = work.cost(state), False, 0
    while not converged and steps < _MOST_STEPS:
        equations = work.equations(state)
        step = np.asarray(np.linalg.solve(equations.information, equations.gradient), dtype=np.float64)
        state, reached = work.best(state, step, equations.points_step(step), cost)
        converged, cost, steps = cost - reached <= _CONVERGED * cost, reached, steps + 1
    found = work.equations(state)
    return Adjusted(
        poses=state.poses,
        points=work.points(state),
        claimed=np.asarray(np.linalg.inv(found.information), dtype=np.float64),
        innovations=work.squares(state) / work.freedom,
        steps=steps,
        converged=converged,
    )


def gate_ratios(
    problem: Problem, found: Adjusted, covariances: Sequence[NDArray[np.float64]]
) -> list[NDArray[np.float64]]:
    """Squared whitened residuals of tracks, over the limit that 95 % of Gaussian tracks pass: (tracks,) of each group.

    As a filter tests a track at its predicted poses: the point takes three numbers from the residuals.
    """
    ratios = []
    for group, points, covariance in zip(problem.groups, found.points, covariances, strict=True):
        tracks = PointTracks(group.frames, points)
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        error = (group.uv - images(problem.camera, found.poses, tracks)).reshape(len(points), -1, 1)
        linear = linear_tracks(problem.camera, found.poses, tracks, problem.gauge)
        residual, span = whiten @ error, np.linalg.qr(whiten @ linear.by_point)[0]
        left = without(residual, span)
        limit = 2.0 * gammaincinv(0.5 * (error.shape[1] - OF_POINT), 0.95)  # quantile of chi square
        ratios.append(np.asarray(np.square(left).sum(axis=(1, 2)) / limit))
    return ratios


def cost(loss: Loss | StudentLoss, whitened: NDArray[np.float64]) -> float:
    """Twice the cost of residuals (tracks, 2 n) under a loss."""
    if isinstance(loss, StudentLoss):
        squares = np.square(whitened).sum(axis=1)
        return float(((loss.nu + whitened.shape[1] - OF_POINT) * np.log1p(squares / loss.nu)).sum())
    squares = squared_norms(whitened)
    match loss.kind:
        case LossKind.HUBER:
            beyond = np.maximum(np.sqrt(squares) - loss.knee, 0.0)
            return float((squares - beyond**2).sum())
        case LossKind.CAUCHY:
            return float((loss.knee**2 * np.log1p(squares / loss.knee**2)).sum())
        case _:
            return float(squares.sum())


class _Work:
    """A problem with what stays the same from step to step."""

    def __init__(self, problem: Problem, start: Start, assumption: Assumption) -> None:
        self._problem, self._start, self._loss = problem, start, assumption.loss
        self._gauge = problem.gauge
        self._whiten = [np.linalg.inv(np.linalg.cholesky(covariance)) for covariance in assumption.covariances]
        self._charts = [_Chart(start.poses[group.frames[:, 0]]) for group in problem.groups]

    @property
    def freedom(self) -> int:
        """Degrees of freedom of all residuals."""
        observed = sum(group.uv.size - group.points.size for group in self._problem.groups)
        return observed - (6 * len(self._problem.world_from_camera) - 7)

    def start(self) -> _State:
        placed = zip(self._charts, self._start.points, strict=True)
        return _State(self._start.poses, tuple(chart.coordinates(points) for chart, points in placed))

    def points(self, state: _State) -> tuple[NDArray[np.float64], ...]:
        placed = zip(self._charts, state.coordinates, strict=True)
        return tuple(chart.points(coordinates) for chart, coordinates in placed)

    def _whitened(self, state: _State) -> list[NDArray[np.float64]]:
        """(tracks, 2 n) of each group: observed minus predicted positions, whitened."""
        parts = zip(self._problem.groups, self.points(state), self._whiten, strict=True)
        return [self._residual(state, group, points, whiten) for group, points, whiten in parts]

    def _residual(
        self, state: _State, group: TrackGroup, points: NDArray[np.float64], whiten: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        predicted = images(self._problem.camera, state.poses, PointTracks(group.frames, points))
        error = (group.uv - predicted).reshape(len(points), -1, 1)
        return np.asarray(whiten @ error)[:, :, 0]

    def cost(self, state: _State) -> float:
        """Infinite where a point has no image."""
        found = sum(cost(self._loss, residual) for residual in self._whitened(state))
        return found if np.isfinite(found) else np.inf

    def squares(self, state: _State) -> float:
        return float(sum(np.square(residual).sum() for residual in self._whitened(state)))

    def best(
        self, state: _State, step: NDArray[np.float64], points_step: list[NDArray[np.float64]], cost: float
    ) -> tuple[_State, float]:
        """The state after the step, halved until the cost falls; the same state if it never does."""
        for halving in range(_MOST_HALVINGS):
            share = 0.5**halving
            steps = zip(state.coordinates, points_step, strict=True)
            tried = _State(
                moved(self._gauge, state.poses, share * step), tuple(own + share * move for own, move in steps)
            )
            reached = self.cost(tried)
            if reached <= cost:
                return tried, reached
        return state, cost

    def equations(self, state: _State) -> _Eliminated:
        """Normal equations of the poses at a state."""
        size = 6 * len(state.poses) - 7
        found = _Eliminated(np.zeros((size, size)), np.zeros(size), [], [], [], [])
        for place, residual in enumerate(self._whitened(state)):
            self._add(found, state, place, residual)
        return found

    def _add(self, found: _Eliminated, state: _State, place: int, residual: NDArray[np.float64]) -> None:
        """Add what the tracks of one group say."""
        root = np.sqrt(self._loss.weights(residual))
        chart, coordinates = self._charts[place], state.coordinates[place]
        tracks = PointTracks(self._problem.groups[place].frames, chart.points(coordinates))
        linear = linear_tracks(self._problem.camera, state.poses, tracks, self._gauge)
        whiten = root[:, :, None] * self._whiten[place]
        by_pose, weighted = whiten @ linear.by_pose, root * residual
        span, triangle = np.linalg.qr(whiten @ linear.by_point @ chart.derivative(coordinates))
        left = without(by_pose, span)
        rows = left.reshape(-1, left.shape[2])
        found.information[:] += rows.T @ rows
        found.gradient[:] += rows.T @ weighted.ravel()
        found.triangles.append(triangle)
        found.spans.append(span)
        found.by_pose.append(by_pose)
        found.residuals.append(weighted)
