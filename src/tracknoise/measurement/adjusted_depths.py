"""Depths of a recording by its reference tracks: what they say of stated depths beyond what other poses explain.

A law of errors that no poses absorb is corrected where it is established: an offset of depths, or of inverse depths.
Its scale is that of the poses. Random errors of single maps are lowered by joining them, (depth.joined), where joined
depths predict reference tracks better.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.corrections import Corrections
from tracknoise.geometry.pose import invert, transform
from tracknoise.sequences.corrected import corrected
from tracknoise.sequences.other_poses import OtherPoses
from tracknoise.sequences.sequence import Sequence
from tracknoise.truth.joined_depths import JoinedDepths
from tracknoise.truth.pose_adjustment import PoseAdjustment, State
from tracknoise.truth.uncertainty import TruthDerivatives
from tracknoise.truth.visibility import SequenceGeometry

Array = NDArray[np.float64]

LAWS: Mapping[str, tuple[int, float]] = {"inverse_depth_offset_per_m": (1, -1.0), "depth_offset_m": (-1, 1.0)}
"""A unit of each correction adds s Z^p to the logarithm of a depth Z: the power p and the sign s."""
_SETTLED, _STEPS = 0.05, 8
"""Steps to the size of a law end at one of this part of it, or after so many."""
_LOWER = 0.99
"""Ratio of the sizes of residuals by joined and by single depths, below which maps are joined."""
_SAMPLED = 12
_OLDEST = 10
_NAME = "reference tracks"


@dataclass(frozen=True, slots=True, eq=False)
class AdjustedDepths:
    """Poses and depths that fit reference tracks, with corrected depths."""

    sequence: Sequence  # with its depths corrected
    adjustment: PoseAdjustment  # of it
    best: State
    corrections: Mapping[str, float]
    stated_m: Array  # (m,): depths of tracks that the stated ones would give them in the place of those of `best`

    @classmethod
    def of(cls, sequence: Sequence, adjustment: PoseAdjustment, best: State) -> "AdjustedDepths":
        """Correct the depths of a sequence by one law, if one is established."""
        found = cls(sequence, adjustment, best, {}, best.depth_m)
        if not np.isfinite(adjustment.tracks.depth_m).any():
            return found
        named: dict[str, float] = {}
        for _ in range(_STEPS):
            step = _step(found, named)
            if step is None:
                break
            name, size = step
            named = {name: named.get(name, 0.0) + size}
            found = found._corrected(sequence, adjustment, named)
            if abs(size) <= _SETTLED * abs(named[name]):
                break
        return found

    def _corrected(self, sequence: Sequence, stated: PoseAdjustment, named: Mapping[str, float]) -> "AdjustedDepths":
        corrections = depth_corrections(named)
        depth_m = corrections.depths_m(stated.tracks.depth_m)
        tracks = replace(stated.tracks, depth_m=np.where(depth_m > 0.0, depth_m, np.nan))
        adjustment = PoseAdjustment(sequence, tracks)
        before = self.adjustment.tracks.depth_m
        near_m = self.best.depth_m * np.where(np.isfinite(tracks.depth_m), tracks.depth_m / before, 1.0)
        best = adjustment.best(State(self.best.poses, near_m))
        factor = np.where(np.isfinite(tracks.depth_m), stated.tracks.depth_m / tracks.depth_m, 1.0)
        return AdjustedDepths(corrected(sequence, corrections), adjustment, best, named, best.depth_m * factor)

    def displaced_by_camera(self) -> tuple[Array, Array]:
        """(n, 2) each: displacements, px, by the relative focal length, and by depths that are distances on rays."""
        tracks, best = self.adjustment.tracks, self.best
        points = self.adjustment.anchored_points(best.poses, best.depth_m, np.arange(len(tracks.frame)))
        moved = TruthDerivatives(OtherPoses(self.sequence, best.poses, _NAME)).sensitivity(points)
        there = transform(invert(best.poses[points.anchor]), points.points_world)
        return moved.focal, moved.depth * (np.linalg.norm(there, axis=1) - moved.depth_m)[:, None]

    def joined_are_better(self) -> bool:
        """Whether depths that are joined over maps predict reference tracks better, in some frames."""
        tracks = self.adjustment.tracks
        known = np.isfinite(tracks.depth_m)
        births = np.unique(tracks.birth[known])
        births = births[np.unique(np.linspace(0, len(births) - 1, min(len(births), _SAMPLED)).astype(int))]
        poses = OtherPoses(self.sequence, self.best.poses, _NAME)
        maps = JoinedDepths(SequenceGeometry(poses))
        joined_m = np.full(len(known), np.nan)
        for index in births.tolist():
            some = np.flatnonzero(known & (tracks.birth == index))
            joined_m[some] = maps.of(index, tracks.birth_uv[some], tracks.depth_m[some])
        if not np.isfinite(joined_m).any():
            return False
        young = tracks.frame - tracks.birth[tracks.track] <= _OLDEST
        used = young & np.isfinite(joined_m)[tracks.track]
        single, joined = (
            np.linalg.norm(self.adjustment.residuals(self.best.poses, depth_m)[used], axis=1)
            for depth_m in (tracks.depth_m, joined_m)
        )
        return bool(np.nanmedian(joined) < _LOWER * np.nanmedian(single))


def depth_corrections(named: Mapping[str, float]) -> Corrections:
    """Corrections of depths by their names: those of `LAWS`."""
    found: dict[str, Any] = dict(named)
    return Corrections(**found)


def _step(now: AdjustedDepths, named: Mapping[str, float]) -> tuple[str, float] | None:
    """The step of a law; at first of the one that explains most, or None where an error of the camera explains more."""
    slope = now.adjustment.by_log_depth(now.best)
    depth_m = now.best.depth_m[now.adjustment.tracks.track, None]
    faults = {
        name: now.adjustment.fault(now.best, sign * slope * depth_m**power)
        for name, (power, sign) in LAWS.items()
        if name in named or not named
    }
    name, fault = max(faults.items(), key=lambda one: one[1].explained)
    if named:
        return name, fault.size
    if not fault.is_established:
        return None
    others = (now.adjustment.fault(now.best, displaced) for displaced in now.displaced_by_camera())
    return (name, fault.size) if all(fault.explained > other.explained for other in others) else None
