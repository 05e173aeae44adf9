"""A second opinion: the same window adjusted by GTSAM, which shares no code with the bundle adjustment here.

Needs the extra `proof`. Each track is one factor with the covariance of all its observations. The first
pose is fixed, and so is the newest position along the line from the first one, as in
`tracknoise.estimators.linear_window.Gauge`.
"""

from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.noise.bundle import Assumption, Start
from benchmarks.noise.windows import Problem, TrackGroup, between
from tracknoise.estimators.kernels import NEWEST, normalised
from tracknoise.estimators.linear_window import Gauge
from tracknoise.exceptions import SettingsError, missing_extra
from tracknoise.geometry.cameras import Camera


def newest_pose_by_gtsam(
    problem: Problem, start: Start, assumption: Assumption
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Adjust a window with GTSAM.

    Returns pose (4, 4), covariance (5, 5). `pose`: world_from_camera of the newest frame. `covariance`: of the
    coordinates of the newest pose: three of its rotation, two of its position.
    """
    gtsam = _gtsam()
    gauge, true = problem.gauge, problem.world_from_camera
    graph, values = _graph(gtsam, problem, start, assumption)
    found = _optimised(gtsam, graph, _gauge_factors(gtsam, problem, gauge), values)
    pose = np.asarray(found.atPose3(_pose_key(gtsam, len(true) - 1)).matrix())
    covariance = _covariance(gtsam, graph.linearize(found), problem, pose)
    error = between(gauge, np.concatenate([true[:-1], pose[None]]), true)[-NEWEST:]
    return pose, covariance, normalised(error, covariance)


def _gtsam() -> ModuleType:
    try:
        import gtsam
    except ImportError as error:
        raise missing_extra("estimates by GTSAM", "proof") from error
    module: ModuleType = gtsam
    return module


def _pose_key(gtsam: Any, frame: int) -> int:
    return int(gtsam.symbol("x", frame))


def _covariance(gtsam: Any, linear: Any, problem: Problem, newest: NDArray[np.float64]) -> NDArray[np.float64]:
    """(5, 5): of the newest pose, from the Hessian of GTSAM without what is known."""
    ordering, n_frames = gtsam.Ordering(), len(problem.world_from_camera)
    for frame in range(n_frames):
        ordering.push_back(_pose_key(gtsam, frame))
    for number in range(problem.n_tracks):
        ordering.push_back(int(gtsam.symbol("l", number)))
    hessian, _ = linear.hessian(ordering)
    # GTSAM moves a position along the axes of the camera
    basis = np.eye(len(hessian))
    last = slice(6 * n_frames - 3, 6 * n_frames)
    basis[last, last] = newest[:3, :3].T @ np.column_stack([problem.gauge.across, np.cross(*problem.gauge.across.T)])
    free = np.delete(basis, [*range(6), 6 * n_frames - 1], axis=1)
    place = 6 * (n_frames - 1) - 1
    covariance = np.linalg.inv(free.T @ hessian @ free)
    return np.asarray(covariance[place - NEWEST : place, place - NEWEST : place], dtype=np.float64)


def _gauge_factors(gtsam: Any, problem: Problem, gauge: Gauge) -> Any:
    """The first pose is the true one, and the scale is the true one."""
    known = gtsam.NonlinearFactorGraph()
    known.add(gtsam.NonlinearEqualityPose3(_pose_key(gtsam, 0), gtsam.Pose3(problem.world_from_camera[0])))
    known.add(_scale_factor(gtsam, problem, gauge))
    return known


def _graph(gtsam: Any, problem: Problem, start: Start, assumption: Assumption) -> tuple[Any, Any]:
    """The factor graph of the tracks of a window, and the values where it starts."""
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for frame, pose in enumerate(start.poses):
        values.insert(_pose_key(gtsam, frame), gtsam.Pose3(pose))
    calibration = _calibration(gtsam, problem)
    number = 0
    for group, points, covariances in zip(problem.groups, start.points, assumption.covariances, strict=True):
        for place, (point, covariance) in enumerate(zip(points, covariances, strict=True)):
            key = int(gtsam.symbol("l", number))
            values.insert(key, point)
            graph.add(_track_factor(gtsam, calibration, group, place, key, covariance))
            number += 1
    return graph, values


def _calibration(gtsam: Any, problem: Problem) -> Any:
    camera = problem.camera
    if not isinstance(camera, Camera) or any(camera.distortion):
        raise SettingsError("the judge needs a pinhole camera without distortion")
    return gtsam.Cal3_S2(camera.fx, camera.fy, 0.0, camera.cx, camera.cy)


def _scale_factor(gtsam: Any, problem: Problem, gauge: Gauge) -> Any:
    """The newest position does not move along the line from the first one to it."""
    true = problem.world_from_camera
    along = np.cross(*gauge.across.T)
    key = _pose_key(gtsam, len(true) - 1)

    def error(_: Any, values: Any, jacobians: Any) -> NDArray[np.float64]:
        pose = values.atPose3(key)
        if jacobians is not None:
            jacobians[0] = np.hstack([np.zeros(3), along @ pose.rotation().matrix()])[None]
        return np.array([along @ (pose.translation() - true[-1, :3, 3])])

    return gtsam.CustomFactor(gtsam.noiseModel.Constrained.All(1), [key], error)


def _track_factor(
    gtsam: Any, calibration: Any, group: TrackGroup, place: int, point_key: int, covariance: NDArray[np.float64]
) -> Any:
    """All observations of a track."""
    keys = [_pose_key(gtsam, int(frame)) for frame in group.frames[place]]
    observed, count = group.uv[place], len(keys)

    def error(_: Any, values: Any, jacobians: Any) -> NDArray[np.float64]:
        point = values.atPoint3(point_key)
        residual, by_point = np.zeros(2 * count), np.zeros((2 * count, 3))
        for row, key in enumerate(keys):
            by_pose, by_one = np.zeros((2, 6), order="F"), np.zeros((2, 3), order="F")
            by_camera = np.zeros((2, 5), order="F")
            view = gtsam.PinholeCameraCal3_S2(values.atPose3(key), calibration)
            here = slice(2 * row, 2 * row + 2)
            residual[here] = view.project(point, by_pose, by_one, by_camera) - observed[row]
            by_point[here] = by_one
            if jacobians is not None:
                jacobians[row] = np.zeros((2 * count, 6))
                jacobians[row][here] = by_pose
        if jacobians is not None:
            jacobians[count] = by_point
        return residual

    return gtsam.CustomFactor(gtsam.noiseModel.Gaussian.Covariance(covariance), [*keys, point_key], error)


def _optimised(gtsam: Any, graph: Any, known: Any, values: Any) -> Any:
    both = gtsam.NonlinearFactorGraph(graph)
    both.push_back(known)
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setLinearSolverType("MULTIFRONTAL_QR")
    parameters.setRelativeErrorTol(1e-15)
    parameters.setAbsoluteErrorTol(1e-15)
    parameters.setMaxIterations(50)
    return gtsam.LevenbergMarquardtOptimizer(both, values, parameters).optimize()
