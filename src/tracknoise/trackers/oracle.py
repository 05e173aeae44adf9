"""The oracle: true positions plus errors of known size. It tests the measurement, not a front end.

Each kind of error has a stream of random numbers of its own, so that one kind does not change another.
"""

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Gt
from numpy.typing import NDArray

from tracknoise.checks import NotNegative, Share, require, require_bounds, require_finite
from tracknoise.exceptions import SettingsError
from tracknoise.tables.schema import TrackEnd, TruthStatus
from tracknoise.trackers.features import ALIVE, Features, report
from tracknoise.trackers.gradient import min_eigenvalue
from tracknoise.trackers.tracker import DisplacingTruth, Frame, OracleTruth, SequenceContext, Step


class Stream(IntEnum):
    """What random numbers are for."""

    white = 0
    birth = 1
    walk = 2
    common = 3


class RandomErrors:
    """Streams of random vectors. `nu`: degrees of freedom of Student's t, above 2; None for Gaussian errors."""

    __slots__ = ("_nu", "_streams")

    def __init__(self, key: Sequence[int], nu: float | None) -> None:
        self._nu = nu
        self._streams = [np.random.default_rng(np.random.SeedSequence(list(key), spawn_key=(kind,))) for kind in Stream]

    def gaussian(self, stream: Stream, count: int) -> NDArray[np.float64]:
        """(count, 2) float64: independent numbers of standard deviation 1."""
        return self._streams[stream].standard_normal((count, 2))

    def heavy_tailed(self, stream: Stream, gaussian: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vectors (n, 2) of Student's t in two dimensions from Gaussian ones. They keep their covariance."""
        if self._nu is None:
            return gaussian
        return gaussian * np.sqrt((self._nu - 2) / self._streams[stream].chisquare(self._nu, (len(gaussian), 1)))

    def steps(self, stream: Stream, count: int) -> NDArray[np.float64]:
        """(count, 2) float64: vectors of Student's t whose coordinates have standard deviation 1."""
        return self.heavy_tailed(stream, self.gaussian(stream, count))


def random_key(seed: int, context: SequenceContext) -> list[int]:
    """Key of random numbers: different for every sequence and speed, and the same in every process, unlike `hash`."""
    sequence = context.sequence
    cameras = [sequence.camera] if sequence.camera else []
    names = (zlib.crc32(name.encode()) for name in (sequence.scene, sequence.lighting, sequence.direction, *cameras))
    again = [context.repeat] if context.repeat else []
    part = [0, context.first_frame] if context.first_frame else []
    return [seed, context.seed, *names, sequence.rotation % 360, context.speed, *again, *part]


USUAL_TEXTURE = 30.0
"""Texture strength at which noise has its stated size, (gray values / px)^2."""
USUAL_MOTION_PX = 1.0
"""Motion at which noise has its stated size, px per frame."""
_WEAKEST_TEXTURE, _LEAST_MOTION_PX = 1.0, 0.1


def texture_factor(strength: NDArray[np.float32], exponent: float) -> NDArray[np.float64]:
    """What noise is multiplied by at texture of some strength. Returns: 1 where the strength is NaN."""
    return _power(strength.astype(np.float64), _WEAKEST_TEXTURE, USUAL_TEXTURE, -exponent)


def motion_factor(motion_px: NDArray[np.float64], exponent: float) -> NDArray[np.float64]:
    """What noise is multiplied by at some motion. Returns: 1 where the motion is NaN."""
    return _power(motion_px, _LEAST_MOTION_PX, USUAL_MOTION_PX, exponent)


def _power(values: NDArray[np.float64], least: float, usual: float, exponent: float) -> NDArray[np.float64]:
    return np.where(np.isnan(values), 1.0, (np.fmax(values, least) / usual) ** exponent)


_BEGINNING_ROUNDS = 8

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Oracle:
    """Settings of the oracle.

    A feature follows a point of the scene. At age k, in frames of the nominal sequence, it is observed at the position
    of this point + `bias_px` + k `drift_px_per_frame` + noise. Without `birth_px` and `walk_px_per_sqrt_frame`, the
    point is that of its first position, so that this position has no error.

    With them, the point lies beside that of the first position, at the same depth, and moves in each frame. The error
    that this makes is then carried along by the magnification of the image, as those of real trackers are. With depths
    Z_i of the point in the frames after the first, it is

        - (Z_0 / Z_k) b + sum_{1 <= i <= k} (Z_i / Z_k) q_i        (without roll)

    Parameters
    ----------
    n_features
        Number of features that are kept alive: new ones replace those that end.
    bias_px
        Mean error in u and v.
    covariance_px2
        Covariance of the Gaussian noise, independent from frame to frame: ((uu, uv), (uv, vv)).
    drift_px_per_frame
        Growth of the mean error per frame of the nominal sequence, in u and v.
    outlier_rate, loss_rate
        Probability that a live feature is rejected as an outlier, or is lost, in each step; never both.
    margin_px
        Features begin at least this far inside the image.
    seed
        Random seed, combined with the sequence's identity, the speed and the experiment's seed. Oracles of one run draw
        the same random numbers if they have the same seed: those with errors of their own need one each.
    birth_px
        Standard deviation of b, the error of the first position, in each coordinate.
    walk_px_per_sqrt_frame
        Standard deviation of q, the step of a random walk, in each coordinate and frame of the nominal sequence.
    common_px
        Standard deviation of Gaussian noise, in each coordinate, that all features have in common, except in their
        first frames.
    student_nu
        Degrees of freedom of Student's t, above 2, from which the noise, b and q are drawn with the same covariances;
        by default they are Gaussian.
    texture_exponent
        The noise and the steps of the walk are multiplied by `texture_factor`. If not 0, the strength of the texture is
        reported as the quality ``min_eigenvalue``.
    motion_exponent
        They are also multiplied by `motion_factor`, for the motion of the point since the last frame seen.
    """

    kind: ClassVar[str] = "oracle"
    description: ClassVar[str] = "true positions plus bias, noise, drift, outliers and losses of known size"
    needs_frames_only: ClassVar[bool] = True

    n_features: Annotated[int, Ge(1)] = 200
    bias_px: Pair = (0.0, 0.0)
    covariance_px2: tuple[Pair, Pair] = ((0.25, 0.0), (0.0, 0.25))
    drift_px_per_frame: Pair = (0.0, 0.0)
    outlier_rate: Share = 0.0
    loss_rate: Share = 0.0
    margin_px: Annotated[int, Ge(0)] = 8
    seed: Annotated[int, Ge(0)] = 0
    birth_px: NotNegative = 0.0
    walk_px_per_sqrt_frame: NotNegative = 0.0
    common_px: NotNegative = 0.0
    student_nu: Annotated[float, Gt(2)] | None = None
    texture_exponent: float = 0.0
    motion_exponent: float = 0.0

    def __post_init__(self) -> None:
        require_bounds(self)
        for name in ("bias_px", "drift_px_per_frame"):
            require(all(map(math.isfinite, getattr(self, name))), name, getattr(self, name), "two finite numbers")
        (uu, uv), (vu, vv) = self.covariance_px2
        semidefinite = uv == vu and uu >= 0 and vv >= 0 and uv * uv <= uu * vv and math.isfinite(uu + vv)
        require(semidefinite, "covariance_px2", self.covariance_px2, "a symmetric matrix without negative eigenvalues")
        for name in ("texture_exponent", "motion_exponent"):
            require_finite(name, getattr(self, name))
        either = self.outlier_rate + self.loss_rate
        require(either <= 1, "outlier_rate", self.outlier_rate, "at most 1 together with loss_rate")

    def start(self, context: SequenceContext) -> "OracleTracker":
        """Start the oracle on one sequence at one speed.

        Raises
        ------
        SettingsError
            If the kind of truth cannot compute world points, or cannot move them although features leave theirs.
        """
        truth = context.truth
        if truth is None:
            raise _unfit("place points")
        leave = self.birth_px > 0 or self.walk_px_per_sqrt_frame > 0
        if leave and not isinstance(truth, DisplacingTruth):
            raise _unfit("move points")
        return OracleTracker(self, context, truth)


def _unfit(lacking: str) -> SettingsError:
    kind = f"a kind of truth that cannot {lacking}"
    return SettingsError(f"tracker 'oracle': {kind}, expected one that can, such as 'birth' or 'raycast'")


class OracleTracker:
    """The oracle on one sequence.

    In each step one random draw per feature decides whether it is lost, an outlier, or neither, so that both rates are
    relative to the features offered. A feature that is neither ends as ``masked`` if the point that it follows has left
    the image. In a frame without a pose, positions of points are unknown. Features then stay at the last one, and none
    begin.
    """

    def __init__(self, settings: Oracle, context: SequenceContext, truth: OracleTruth) -> None:
        self._settings = settings
        self._truth = truth
        self._size = context.size
        key = random_key(settings.seed, context)
        self._rng, self._random = np.random.default_rng(key), RandomErrors(key, settings.student_nu)
        self._root = _root(settings.covariance_px2)
        self._features = Features.begin(0, np.empty((0, 2)))
        self._points, self._point_uv = np.empty((0, 3)), np.empty((0, 2))
        self._without_pose = context.frames_without_pose
        self._posed = 0  # the last frame with a pose
        self._born = np.empty(0, dtype=np.int64)
        self._next_id = 0

    def step(self, frame: Frame) -> Step:
        """Project the points of the features into the next frame, and add the errors."""
        before = self._features
        elapsed = 0 if frame.index in self._without_pose else frame.index - self._posed
        motion_px = self._follow(frame.index, elapsed)
        texture = min_eigenvalue(frame, self._point_uv) if self._settings.texture_exponent else None
        noise = self._noise_factor(texture, motion_px)
        self._walk(frame.index, elapsed, noise)
        self._posed += elapsed
        end = self._fates(self._point_uv)
        alive = end == ALIVE
        uv = self._point_uv + self._errors(frame.index - self._born, noise)
        tracked = before.chosen(alive, uv[alive])
        self._points, self._point_uv, self._born = self._points[alive], self._point_uv[alive], self._born[alive]
        new = self._begin(frame.index, len(tracked))
        self._features = tracked.joined(new)
        return report(
            offered=before.ids,
            end=end,
            matched=len(tracked) + int(np.count_nonzero(end == TrackEnd.outlier)),
            found=tracked,
            new=new,
            response=np.full(len(new), np.nan, dtype=np.float32),
            quality={} if texture is None else {"min_eigenvalue": texture[alive]},
        )

    def _follow(self, index: int, elapsed: int) -> NDArray[np.float64]:
        """Find the positions of the points in a frame; the last that are known where the frame has no pose.

        Returns their motion, (n,) px per frame of the nominal sequence, NaN where it is unknown.
        """
        if elapsed == 0:
            return np.full(len(self._points), np.nan)
        before, self._point_uv = self._point_uv, self._truth.project(index, self._points)
        return np.asarray(np.linalg.norm(self._point_uv - before, axis=1) / elapsed)

    def _noise_factor(
        self, texture: NDArray[np.float32] | None, motion_px: NDArray[np.float64]
    ) -> float | NDArray[np.float64]:
        """What noise and steps of the walk are multiplied by: (n, 1), or one number."""
        exponent = self._settings.motion_exponent
        of_motion = motion_factor(motion_px, exponent)[:, None] if exponent else 1.0
        if texture is None:
            return of_motion
        return of_motion * texture_factor(texture, self._settings.texture_exponent)[:, None]

    def _walk(self, index: int, elapsed: int, noise: float | NDArray[np.float64]) -> None:
        """Move the points by their walk in the frames that have elapsed."""
        size = self._settings.walk_px_per_sqrt_frame
        if size == 0 or elapsed == 0:
            return
        by_px = size * math.sqrt(elapsed) * noise * self._random.steps(Stream.walk, len(self._points))
        self._points, self._point_uv = self._displaced(index, self._points, by_px), self._point_uv + by_px

    def _displaced(self, index: int, points: NDArray[np.float64], by_px: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points moved across the line of sight."""
        assert isinstance(self._truth, DisplacingTruth)  # checked before the tracker was started
        return self._truth.displaced(index, points, by_px)

    def _fates(self, true_uv: NDArray[np.float64]) -> NDArray[np.int8]:
        draw = self._rng.random(len(true_uv))
        loss, outlier = self._settings.loss_rate, self._settings.outlier_rate
        inside = np.all((true_uv >= -0.5) & (true_uv < np.array(self._size) - 0.5), axis=1)
        end = np.where(inside, ALIVE, TrackEnd.masked).astype(np.int8)
        end[draw < loss + outlier] = TrackEnd.outlier
        end[draw < loss] = TrackEnd.lost
        return end

    def _errors(self, age: NDArray[np.int64], noise: float | NDArray[np.float64]) -> NDArray[np.float64]:
        (uu, _), (vu, vv) = self._root
        first, second = self._rng.standard_normal((len(age), 2)).T
        white = self._random.heavy_tailed(Stream.white, np.column_stack([uu * first, vu * first + vv * second]))
        drift = age[:, None] * np.array(self._settings.drift_px_per_frame)
        common = self._settings.common_px * self._random.gaussian(Stream.common, 1)
        errors: NDArray[np.float64] = noise * white + drift + np.array(self._settings.bias_px) + common
        return errors

    def _begin(self, index: int, alive: int) -> Features:
        """New features at random positions whose world point is known; fewer if they are rare."""
        uv, points = self._beginnings(index, max(self._settings.n_features - alive, 0))
        point_uv = uv
        if self._settings.birth_px:
            by_px = -self._settings.birth_px * self._random.steps(Stream.birth, len(uv))
            points, point_uv = self._displaced(index, points, by_px), uv + by_px
        self._points, self._point_uv = (
            np.concatenate([self._points, points]),
            np.concatenate([self._point_uv, point_uv]),
        )
        self._born = np.concatenate([self._born, np.full(len(uv), index)])
        self._next_id += len(uv)
        return Features.begin(self._next_id - len(uv), uv)

    def _beginnings(self, index: int, wanted: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Up to `wanted` random positions, and their world points."""
        uv, points = np.empty((0, 2)), np.empty((0, 3))
        low, high = self._settings.margin_px, np.array(self._size) - 1.0 - self._settings.margin_px
        for _ in range(_BEGINNING_ROUNDS if np.all(high > low) else 0):
            if len(uv) >= wanted:
                break
            tried = self._rng.uniform(low, high, (2 * (wanted - len(uv)), 2))
            world, status = self._truth.anchor(index, tried)
            valid = status == TruthStatus.valid
            uv, points = np.concatenate([uv, tried[valid]]), np.concatenate([points, world[valid]])
        return uv[:wanted], points[:wanted]


def _root(covariance: tuple[Pair, Pair]) -> tuple[Pair, Pair]:
    """Lower triangular L with L L^T = covariance, which may be singular."""
    (uu, uv), (_, vv) = covariance
    first = math.sqrt(uu)
    mixed = uv / first if first > 0 else 0.0
    return (first, 0.0), (mixed, math.sqrt(max(vv - mixed * mixed, 0.0)))
