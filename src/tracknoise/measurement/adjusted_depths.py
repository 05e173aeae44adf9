"""Depths of a recording by its reference tracks: what they say of stated depths beyond what other poses explain.

A law of errors that no poses absorb is corrected where it is established: an offset of depths, or of inverse depths.
Its scale is that of the poses. Random errors of single maps are lowered by joining them, (depth.joined), where joined
depths predict reference tracks better.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.corrections import Corrections
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.corrected import corrected
from tracknoise.sequences.other_poses import OtherPoses
from tracknoise.sequences.sequence import Sequence
from tracknoise.truth.joined_depths import JoinedDepths
from tracknoise.truth.pose_adjustment import Fault, PoseAdjustment, State
from tracknoise.truth.uncertainty import TruthDerivatives
from tracknoise.truth.visibility import SequenceGeometry

Array = NDArray[np.float64]

LAWS: Mapping[str, tuple[int, float]] = {"inverse_depth_offset_per_m": (1, -1.0), "depth_offset_m": (-1, 1.0)}
"""A unit of each correction adds s Z^p to the logarithm of a depth Z: the power p and the sign s."""
READOUT, FOCAL, ALONG_RAY = "readout_ms", "focal_relative", "depth_along_ray"
"""Faults that are not of the depths, by the figures of `TruthAccuracy` and `Corrections`."""
_RADIAL = "k1"
_SETTLED, _STEPS = 0.05, 8
"""Steps to the size of a law end at one of this part of it, or after so many."""
_LOWER = 0.99
"""Ratio of the sizes of residuals by joined and by single depths, below which maps are joined."""
_PLACES, _SUCCESSIVE = 4, 3
"""Places in a sequence where maps are joined to see whether that is better, and frames with births at each. Successive
frames share most of the maps that are read."""
_OLDEST = 10
_LEAST_PX = 0.005
"""Median displacement of young tracks below which a law of depths looks like a bias of the tracks."""
_NAME = "reference tracks"


@dataclass(frozen=True, eq=False)
class AdjustedDepths:
    """Poses and depths that fit reference tracks, with corrected depths."""

    sequence: Sequence  # with its depths corrected
    adjustment: PoseAdjustment  # of it
    best: State
    corrections: Mapping[str, float]
    stated_m: Array  # (m,): depths of tracks that the stated ones would give them in the place of those of `best`
    joins_depths: bool = False  # whether maps are joined

    @classmethod
    def of(cls, sequence: Sequence, adjustment: PoseAdjustment, best: State) -> "AdjustedDepths":
        """Join the maps of a sequence, if that is better, and correct its depths by one law, if one is established."""
        single = cls(sequence, adjustment, best, {}, best.depth_m)
        if not np.isfinite(adjustment.tracks.depth_m).any():
            return single
        corrected = stated = single._joined() if single._is_better_joined() else single
        named: dict[str, float] = {}
        for _ in range(_STEPS):
            step = _step(corrected, named)
            if step is None:
                break
            name, size = step
            named = {name: named.get(name, 0.0) + size}
            corrected = corrected._corrected(stated, named)
            if abs(size) <= _SETTLED * abs(named[name]):
                break
        return corrected

    def _joined(self) -> "AdjustedDepths":
        adjustment, best = self._adjusted(self._joined_m(np.unique(self.adjustment.tracks.birth)))
        return AdjustedDepths(self.sequence, adjustment, best, {}, best.depth_m, joins_depths=True)

    def _corrected(self, stated: "AdjustedDepths", named: Mapping[str, float]) -> "AdjustedDepths":
        corrections = depth_corrections(named)
        stated_m = stated.adjustment.tracks.depth_m
        depth_m = corrections.depths_m(stated_m)
        depth_m[~(depth_m > 0.0)] = np.nan
        adjustment, best = self._adjusted(depth_m)
        factor = np.where(np.isfinite(depth_m), stated_m / depth_m, 1.0)
        sequence = corrected(stated.sequence, corrections)
        return AdjustedDepths(sequence, adjustment, best, named, best.depth_m * factor, stated.joins_depths)

    def _adjusted(self, depth_m: Array) -> tuple[PoseAdjustment, State]:
        """Poses and depths that fit tracks with other depths (m,), NaN where there are none."""
        tracks, best = self.adjustment.tracks, self.best
        adjustment = self.adjustment.with_depths(depth_m)
        ratio = np.where(np.isfinite(depth_m) & np.isfinite(tracks.depth_m), depth_m / tracks.depth_m, 1.0)
        return adjustment, adjustment.best(State(best.poses, best.depth_m * ratio))

    @cached_property
    def displaced(self) -> Mapping[str, NDArray[np.float32]]:
        """(n, 2) each: displacements of true positions, px, by one unit of the faults that are not of the depths."""
        tracks, best = self.adjustment.tracks, self.best
        derivatives = TruthDerivatives(OtherPoses(self.sequence, best.poses, _NAME))
        displaced = {name: np.empty(tracks.uv.shape, np.float32) for name in (READOUT, FOCAL, ALONG_RAY)}
        for rows in self.adjustment.blocks():
            points = self.adjustment.anchored_points(best.poses, best.depth_m, rows)
            moved = derivatives.sensitivity(points)
            there = transform(invert(best.poses[points.anchor]), points.points_world)
            beyond = (np.linalg.norm(there, axis=1) - moved.depth_m)[:, None]
            of_rows = 1e-3 * moved.readout, moved.focal, moved.depth * beyond
            for array, values in zip(displaced.values(), of_rows, strict=True):
                array[rows] = values
        return displaced

    @cached_property
    def faults(self) -> Mapping[str, Fault]:
        """How much of these faults reference tracks hold."""
        return self.adjustment.faults(self.best, self.displaced)

    @cached_property
    def radial(self) -> Fault | None:
        """How much of an error of k1 reference tracks hold; None where a camera has no k1."""
        unit = 1e-3
        try:
            other = self.with_camera(Corrections(k1=unit))
        except DataError:
            return None
        moved = self.by_best - other.residuals(self.best.poses, self.best.depth_m)
        return self.adjustment.faults(self.best, {_RADIAL: moved / unit})[_RADIAL]

    @cached_property
    def by_stated(self) -> Array:
        """Residuals (n, 2) of reference tracks by stated poses and depths, px."""
        return self.adjustment.residuals(self.sequence.world_from_camera, self.stated_m)

    @cached_property
    def by_best(self) -> Array:
        """Residuals (n, 2) of reference tracks by the poses and depths that fit them, px."""
        return self.adjustment.residuals(self.best.poses, self.best.depth_m)

    def with_camera(self, corrections: Corrections) -> PoseAdjustment:
        """The adjustment with a corrected camera.

        Raises
        ------
        DataError
            If the camera has no such number, or no rays then.
        """
        return self.adjustment.with_cameras(corrected(self.sequence, corrections))

    def _is_better_joined(self) -> bool:
        """Whether depths that are joined over maps predict reference tracks better, in some frames."""
        tracks = self.adjustment.tracks
        births = np.unique(tracks.birth[np.isfinite(tracks.depth_m)])
        places = np.linspace(0, max(len(births) - _SUCCESSIVE, 0), _PLACES).astype(int)
        chosen = np.unique(np.minimum(places[:, None] + np.arange(_SUCCESSIVE), len(births) - 1))
        joined_m = self._joined_m(births[chosen])
        young = tracks.frame - tracks.birth[tracks.track] <= _OLDEST
        used = young & np.isfinite(joined_m)[tracks.track]
        if not used.any():
            return False
        single, joined = (
            np.linalg.norm(self.adjustment.residuals(self.best.poses, depth_m)[used], axis=1)
            for depth_m in (tracks.depth_m, joined_m)
        )
        return bool(np.nanmedian(joined) < _LOWER * np.nanmedian(single))

    def _joined_m(self, births: NDArray[np.intp]) -> Array:
        """(m,): joined depths of the tracks of some frames, by the adjusted poses; NaN for all others."""
        tracks = self.adjustment.tracks
        maps = JoinedDepths(SequenceGeometry(OtherPoses(self.sequence, self.best.poses, _NAME)))
        joined_m, has_depth = np.full(len(tracks.depth_m), np.nan), np.isfinite(tracks.depth_m)
        for index in births.tolist():
            born = np.flatnonzero(has_depth & (tracks.birth == index))
            joined_m[born] = maps.of(index, tracks.birth_uv[born], tracks.depth_m[born])[0]
        return joined_m


def depth_corrections(named: Mapping[str, float]) -> Corrections:
    """Corrections of depths by their names: those of `LAWS`."""
    values: dict[str, Any] = dict(named)
    return Corrections(**values)


def _step(now: AdjustedDepths, named: Mapping[str, float]) -> tuple[str, float] | None:
    """The step of a law; at first of the one that explains most, or None where an error of the camera explains more."""
    slope, track = now.adjustment.by_log_depth(now.best), now.adjustment.tracks.track
    of_tracks = {name: sign * now.best.depth_m**power for name, (power, sign) in LAWS.items()}
    displaced = {
        name: slope * factor.astype(np.float32)[track, None]
        for name, factor in of_tracks.items()
        if name in named or not named
    }
    name, fault = max(now.adjustment.faults(now.best, displaced).items(), key=lambda item: item[1].explained)
    if named:
        return name, fault.size
    if not fault.is_established:
        return None
    young = now.adjustment.tracks.frame - now.adjustment.tracks.birth[track] <= _OLDEST
    if abs(fault.size) * np.nanmedian(np.linalg.norm(displaced[name][young], axis=1)) <= _LEAST_PX:
        return None
    camera = (now.faults[FOCAL], now.faults[ALONG_RAY])
    return (name, fault.size) if all(fault.explained > rival.explained for rival in camera) else None
