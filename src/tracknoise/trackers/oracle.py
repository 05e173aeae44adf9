"""The oracle: true positions plus errors of known size. It tests the measurement, not a front end."""

import math
import zlib
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import require, require_at_least, require_share
from tracknoise.exceptions import SettingsError
from tracknoise.tables.schema import TrackEnd, TruthStatus
from tracknoise.trackers.features import ALIVE, Features, report
from tracknoise.trackers.frame import Frame
from tracknoise.trackers.tracker import OracleTruth, SequenceContext, Step

_BEGINNING_ROUNDS = 8

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Oracle:
    """Settings of the oracle.

    A feature is observed without error in its first frame. At age k, in frames of the nominal sequence, it is
    observed at its true position + `bias_px` + k `drift_px_per_frame` + noise.

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
        Random seed, combined with the sequence's identity, the speed and the experiment's seed.
    """

    kind: ClassVar[str] = "oracle"
    description: ClassVar[str] = "true positions plus bias, noise, drift, outliers and losses of known size"

    n_features: int = 200
    bias_px: Pair = (0.0, 0.0)
    covariance_px2: tuple[Pair, Pair] = ((0.25, 0.0), (0.0, 0.25))
    drift_px_per_frame: Pair = (0.0, 0.0)
    outlier_rate: float = 0.0
    loss_rate: float = 0.0
    margin_px: int = 8
    seed: int = 0

    def __post_init__(self) -> None:
        require_at_least("n_features", self.n_features, 1)
        for name in ("bias_px", "drift_px_per_frame"):
            require(all(map(math.isfinite, getattr(self, name))), name, getattr(self, name), "two finite numbers")
        (uu, uv), (vu, vv) = self.covariance_px2
        semidefinite = uv == vu and uu >= 0 and vv >= 0 and uv * uv <= uu * vv and math.isfinite(uu + vv)
        require(semidefinite, "covariance_px2", self.covariance_px2, "a symmetric matrix without negative eigenvalues")
        require_share("outlier_rate", self.outlier_rate)
        require_share("loss_rate", self.loss_rate)
        either = self.outlier_rate + self.loss_rate
        require(either <= 1, "outlier_rate", self.outlier_rate, "at most 1 together with loss_rate")
        require_at_least("margin_px", self.margin_px, 0)
        require_at_least("seed", self.seed, 0)

    def start(self, context: SequenceContext) -> "OracleTracker":
        """Start the oracle on one sequence at one speed.

        Raises
        ------
        SettingsError
            If the kind of truth cannot compute world points.
        """
        if context.truth is None:
            found = "a kind of truth that cannot place points"
            raise SettingsError(f"tracker 'oracle': {found}, expected one that can, such as 'birth' or 'raycast'")
        return OracleTracker(self, context, context.truth)


class OracleTracker:
    """The oracle on one sequence.

    In each step one random draw per feature decides whether it is lost, an outlier, or neither, so that both rates are
    relative to the features offered. A feature that is neither ends as ``masked`` if its true position has left the
    image. In a frame without a pose, true positions are unknown. Features then stay at their last one, and none begin.

    Parameters
    ----------
    settings
        The settings.
    context
        The sequence and condition.
    truth
        True positions.
    """

    def __init__(self, settings: Oracle, context: SequenceContext, truth: OracleTruth) -> None:
        self._settings = settings
        self._truth = truth
        self._size = context.size
        self._rng = _generator(settings.seed, context)
        self._root = _root(settings.covariance_px2)
        self._features = Features.begin(0, np.empty((0, 2)))
        self._points, self._true_uv = np.empty((0, 3)), np.empty((0, 2))
        self._without_pose = context.frames_without_pose
        self._born = np.empty(0, dtype=np.int64)
        self._next_id = 0

    def step(self, frame: Frame) -> Step:
        """Project the features into the next frame, and add the errors."""
        before = self._features
        true_uv = self._true_positions(frame.index)
        end = self._fates(true_uv)
        alive = end == ALIVE
        uv = true_uv + self._errors(frame.index - self._born)
        found = before.chosen(alive, uv[alive])
        new, points = self._begin(frame.index, len(found))
        self._features = found.joined(new)
        self._points = np.concatenate([self._points[alive], points])
        self._true_uv = np.concatenate([true_uv[alive], new.uv])
        self._born = np.concatenate([self._born[alive], np.full(len(new), frame.index)])
        self._next_id += len(new)
        return report(
            offered=before.ids,
            end=end,
            matched=len(found) + int(np.count_nonzero(end == TrackEnd.outlier)),
            found=found,
            new=new,
            response=np.full(len(new), np.nan, dtype=np.float32),
        )

    def _true_positions(self, index: int) -> NDArray[np.float64]:
        """True positions of the features; the last that are known where the frame has no pose."""
        return self._true_uv if index in self._without_pose else self._truth.project(index, self._points)

    def _fates(self, true_uv: NDArray[np.float64]) -> NDArray[np.int8]:
        draw = self._rng.random(len(true_uv))
        loss, outlier = self._settings.loss_rate, self._settings.outlier_rate
        inside = np.all((true_uv >= -0.5) & (true_uv < np.array(self._size) - 0.5), axis=1)
        end = np.where(inside, ALIVE, TrackEnd.masked).astype(np.int8)
        end[draw < loss + outlier] = TrackEnd.outlier
        end[draw < loss] = TrackEnd.lost
        return end

    def _errors(self, age: NDArray[np.int64]) -> NDArray[np.float64]:
        (uu, _), (vu, vv) = self._root
        first, second = self._rng.standard_normal((len(age), 2)).T
        noise = np.column_stack([uu * first, vu * first + vv * second])
        drift = age[:, None] * np.array(self._settings.drift_px_per_frame)
        errors: NDArray[np.float64] = noise + drift + np.array(self._settings.bias_px)
        return errors

    def _begin(self, index: int, alive: int) -> tuple[Features, NDArray[np.float64]]:
        """New features at random positions whose world point is known, and these points; fewer if they are rare."""
        uv, points = np.empty((0, 2)), np.empty((0, 3))
        low, high = self._settings.margin_px, np.array(self._size) - 1.0 - self._settings.margin_px
        wanted = self._settings.n_features - alive
        for _ in range(_BEGINNING_ROUNDS if np.all(high > low) else 0):
            if len(uv) >= wanted:
                break
            tried = self._rng.uniform(low, high, (2 * (wanted - len(uv)), 2))
            world, status = self._truth.anchor(index, tried)
            valid = status == TruthStatus.valid
            uv, points = np.concatenate([uv, tried[valid]]), np.concatenate([points, world[valid]])
        wanted = max(wanted, 0)
        return Features.begin(self._next_id, uv[:wanted]), points[:wanted]


def _generator(seed: int, context: SequenceContext) -> np.random.Generator:
    """Independent for every sequence and speed, and the same in every process, unlike `hash`."""
    sequence = context.sequence
    cameras = [sequence.camera] if sequence.camera else []
    names = (zlib.crc32(name.encode()) for name in (sequence.scene, sequence.lighting, sequence.direction, *cameras))
    again = [context.repeat] if context.repeat else []
    return np.random.default_rng([seed, context.seed, *names, sequence.rotation % 360, context.speed, *again])


def _root(covariance: tuple[Pair, Pair]) -> tuple[Pair, Pair]:
    """Lower triangular L with L L^T = covariance, which may be singular."""
    (uu, uv), (_, vv) = covariance
    first = math.sqrt(uu)
    mixed = uv / first if first > 0 else 0.0
    return (first, 0.0), (mixed, math.sqrt(max(vv - mixed * mixed, 0.0)))
