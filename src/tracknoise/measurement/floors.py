"""The truth floor of one tracker setup: how large errors are that come from the truth alone, by age or frame.

The second moment of these errors is the mean of the covariances of the true positions. The variance of their mean is
another matter, because all features of a frame share the error of its pose. Over the features of one sequence,

- the error that each step of the camera adds moves every feature that was fixed before the step and is seen after it;
  errors of different steps are independent. Few of them average out over long ages: a recording of N frames holds about
  N / k independent stretches of k frames;
- errors of single poses are independent, and act on features that are fixed in a frame and on those seen there with
  opposite signs;
- errors of depth are independent from track to track;
- a wrong clock, readout time or focal length is the same in all frames, and averages out only as far as motions do.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.measurement.recording import Recording
from tracknoise.sequences.sequence import SWEPT, Sequence, TruthKind, halves_of, joins_depths
from tracknoise.sequences.views import frame_step
from tracknoise.tables.enumerations import Axis, FloorSource
from tracknoise.tables.schema import AXIS, FLOOR_SOURCE, FLOORS, ORIGIN, TruthStatus
from tracknoise.truth.accuracies import AccuracyRule, known_accuracy
from tracknoise.truth.truth import TruePositions, Truth
from tracknoise.truth.uncertainty import TrueErrors, TruthDerivatives, anchored_points

if TYPE_CHECKING:
    from tracknoise.truth.uncertainty import AnchoredPoints, PoseLaws, Uncertainty


_ENTRIES = {"sum_uu": (0, 0), "sum_uv": (0, 1), "sum_vv": (1, 1)}


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Observations with a true position, and where they belong on the axis of curves."""

    points: "AnchoredPoints"  # their frames and points
    counted: NDArray[np.bool_]  # (n,): whether an observation counts: whether it is visible
    axis: Axis  # age or frame

    @property
    def at(self) -> NDArray[np.intp]:
        """Age or frame of each observation, (n,)."""
        return self.points.frame - self.points.anchor if self.axis == Axis.age else self.points.frame


class FloorSums:
    """Sums over the visible observations of one tracker setup, by source, and by age or frame."""

    __slots__ = ("_at", "_by_pose", "_n", "_own", "_pair", "_pairs", "_places", "_shared", "_sources", "_squares")

    def __init__(self, places: Places, sources: tuple[FloorSource, ...]) -> None:
        self._places, self._sources, self._at = places, sources, places.at
        counted = self._at[places.counted]
        self._n = np.bincount(counted)
        shape = (len(sources), len(self._n))
        self._squares, self._own, self._shared = (np.zeros((*shape, width)) for width in (3, 2, 2))
        ends = np.stack([self._at, places.points.anchor, places.points.frame])
        _, first, pair = np.unique(
            self._at * (places.points.anchor.max(initial=0) + 1) + places.points.anchor,
            return_index=True,
            return_inverse=True,
        )
        self._pairs, self._pair = ends[:, first].T, pair.reshape(-1)
        self._by_pose = np.zeros((len(self._pairs), 2, 6))

    def add(self, rows: slice, found: "Uncertainty") -> None:
        """Add the observations of `rows`."""
        counted = np.flatnonzero(self._places.counted[rows])
        at = self._at[rows][counted]
        for place, source in enumerate(self._sources):
            for column, (row, other) in enumerate(_ENTRIES.values()):
                self._squares[place, :, column] += self._binned(at, found.covariance[source][counted, row, other])
        for source, moved in found.moved_px.items():
            totals = self._own if source == FloorSource.depth else self._shared
            values = np.square(moved[counted]) if source == FloorSource.depth else moved[counted]
            for axis in (0, 1):
                totals[self._sources.index(source), :, axis] += self._binned(at, values[:, axis])
        pair, flat = self._pair[rows][counted], found.by_pose[counted].reshape(-1, 12)
        by_pair = [np.bincount(pair, column, len(self._pairs)) for column in flat.T]
        self._by_pose += np.stack(by_pair, axis=1).reshape(-1, 2, 6)

    def _binned(self, at: NDArray[np.intp], values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(at, values, len(self._n)), np.float64)

    def table(self, laws: "PoseLaws") -> pl.DataFrame:
        """Columns of `FLOORS` from `source` on."""
        if FloorSource.poses in self._sources:
            self._own[self._sources.index(FloorSource.poses)] = self._own_of_poses(laws)
        at = np.flatnonzero(self._n)
        parts = [
            pl.DataFrame({"at": at, "n": self._n[at]}).with_columns(
                pl.lit(source, dtype=FLOOR_SOURCE).alias("source"),
                *_columns(tuple(_ENTRIES), self._squares[place, at]),
                *_columns(("own_uu", "own_vv"), self._own[place, at]),
                *_columns(("shared_u", "shared_v"), self._shared[place, at]),
                axis=pl.lit(self._places.axis, dtype=AXIS),
            )
            for place, source in enumerate(self._sources)
        ]
        kinds = [pl.col(name).cast(FLOORS[name]) for name in FLOORS if name in parts[0].columns]
        return pl.concat(parts).select(kinds)

    def _own_of_poses(self, laws: "PoseLaws") -> NDArray[np.float64]:
        """(places, 2) float64: n^2 times the variance of the mean that comes from the poses."""
        variance = np.zeros((len(self._n), 2))
        starts = np.searchsorted(self._pairs[:, 0], np.arange(len(self._n) + 1))
        for at, (first, last) in enumerate(pairwise(starts)):
            if last > first:
                variance[at] = _variance_of_sum(self._pairs[first:last, 1:], self._by_pose[first:last], laws)
        return variance


def _columns(names: tuple[str, ...], values: NDArray[np.float64]) -> Iterator[pl.Series]:
    return (pl.Series(name, column) for name, column in zip(names, values.T, strict=True))


def _variance_of_sum(pairs: NDArray[np.intp], by_pose: NDArray[np.float64], laws: "PoseLaws") -> NDArray[np.float64]:
    """(2,) float64: variances in u and v of a sum over features, by the errors of poses.

    Shapes: pairs (p, 2), by_pose (p, 2, 6).
    """
    anchor, frame = (pairs - pairs.min()).T
    single, steps = (np.zeros((int(pairs.max() - pairs.min()) + 1, 2, 6)) for _ in range(2))
    single[anchor] += by_pose
    single[frame] -= by_pose
    steps[np.minimum(anchor, frame)] += by_pose
    steps[np.maximum(anchor, frame)] -= by_pose
    steady = np.einsum("p,pij->ij", (frame - anchor).astype(np.float64), by_pose)
    parts = (single * laws.white, np.cumsum(steps, axis=0) * laws.walk, steady[None] * laws.drift)
    return np.asarray(sum(np.square(part).sum(axis=(0, 2)) for part in parts))


_COLUMNS = {name: kind for name, kind in FLOORS.items() if name not in ORIGIN}
NO_FLOOR = pl.DataFrame(schema=_COLUMNS)
"""Columns of `FLOORS` without those of the origin: where nothing is known of the accuracy of a truth."""


@dataclass(frozen=True, slots=True, eq=False)
class TruthFloor:
    """Uncertainty of the truth of one sequence."""

    sequence: Sequence  # the sequence
    errors: TrueErrors | None  # of true positions; None where the kind of truth has no anchors, or nothing is known
    key_frame: int | None  # the frame in which a scan anchors all features, or None
    notes: tuple[str, ...] = ()  # what counts, and where the figures are from, one sentence each
    # whether the errors of poses, and of depths where they count, are stated; 0 where they are exact
    is_stated: bool = False

    @classmethod
    def of(cls, sequence: Sequence, truth: Truth, rule: AccuracyRule) -> "TruthFloor":
        """That of a sequence: for the kinds of truth that fix a point in one frame (all but fitted ones)."""
        if truth.kind not in (*TruthKind, SWEPT):
            return cls(sequence, None, truth.key_frame)
        accuracy = known_accuracy(sequence, truth.kind, rule)
        own_depth = truth.kind == SWEPT or (joins_depths(sequence) and "depth" not in accuracy.figures.topics)
        measures_itself = own_depth or halves_of(sequence) is not None
        if accuracy.figures.is_exact and not accuracy.is_complete and not measures_itself:
            return cls(sequence, None, truth.key_frame)
        step = frame_step(sequence)
        errors = TrueErrors(TruthDerivatives(sequence), accuracy.figures, step=step, own_depth=own_depth)
        return cls(sequence, errors, truth.key_frame, accuracy.notes, accuracy.is_complete)

    def add(self, recording: Recording, positions: TruePositions) -> tuple[TruePositions, pl.DataFrame]:
        """Fill in the covariances of true positions, unless the truth states them.

        `positions`: with covariances, where these are known and not all 0. `floors`: columns of `FLOORS` after those of
        the origin. No rows where nothing is known.
        """
        if positions.covariance is not None:
            return positions, self._stated(recording, positions, positions.covariance)
        if self.errors is None:
            return positions, NO_FLOOR
        if self.errors.is_exact:
            return positions, self._stated(recording, positions, np.zeros((len(positions.uv), 2, 2)))
        return self._propagated(self.errors, recording, positions)

    @property
    def _axis(self) -> Axis:
        return Axis.age if self.key_frame is None else Axis.frame

    def _propagated(
        self, errors: TrueErrors, recording: Recording, positions: TruePositions
    ) -> tuple[TruePositions, pl.DataFrame]:
        frame, track = recording.frame.astype(np.intp), recording.track.astype(np.intp)
        if not errors.own_depth:
            positions = replace(positions, depth_sigma_m=None)
        rows, points = anchored_points(self.sequence, frame, track, positions, key_frame=self.key_frame)
        covariance = np.full((len(frame), 2, 2), np.nan)
        visible = positions.status[rows] == TruthStatus.valid
        sums = FloorSums(Places(points, visible, self._axis), errors.sources)
        for part, uncertainty in errors.of(points):
            covariance[rows[part]] = sum(uncertainty.covariance.values())
            sums.add(part, uncertainty)
        return replace(positions, covariance=covariance), sums.table(errors.pose_laws)

    def _stated(self, recording: Recording, positions: TruePositions, covariance: NDArray[np.float64]) -> pl.DataFrame:
        """Floors of covariances whose causes are not known one by one; errors of the mean are known where all are 0."""
        age = recording.frame - recording.first_frame[recording.track]
        counted = (positions.status == TruthStatus.valid) & np.isfinite(covariance).all(axis=(1, 2))
        at = (age if self.key_frame is None else recording.frame)[counted].astype(np.intp)
        number = np.bincount(at)
        seen = np.flatnonzero(number)
        sums = {name: np.bincount(at, covariance[counted, *entry])[seen] for name, entry in _ENTRIES.items()}
        of_mean = None if covariance.any() else 0.0
        table = pl.DataFrame({"at": seen, "n": number[seen], **sums}).with_columns(
            pl.lit(FloorSource.all, dtype=FLOOR_SOURCE).alias("source"),
            pl.lit(self._axis, dtype=AXIS).alias("axis"),
            *(pl.lit(of_mean, dtype=pl.Float64).alias(name) for name in ("own_uu", "own_vv", "shared_u", "shared_v")),
        )
        return table.select(pl.col(name).cast(kind) for name, kind in _COLUMNS.items())
