"""What the points of a check say about the truth, in the form of the audit and of the rigid share.

A point is born in the first frame of its pair and observed in the second. Its stated true position is that of the
stated poses, cameras and depths, (audit.prediction) without a correction.
"""

from collections.abc import Sequence as ListOf
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.cameras import Intrinsics
from tracknoise.geometry.pose import first_visits
from tracknoise.geometry.projection import FrameGeometry
from tracknoise.inference.units import BLOCKS, Resampled
from tracknoise.sequences.other_poses import path_between_frames
from tracknoise.sequences.sequence import Sequence, shutter_of, times_of
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import ORIGIN, RIGID, SEQUENCE, check
from tracknoise.truth_faults.audit_samples import AuditSamples, Paths, in_order, numbered
from tracknoise.truth_faults.audit_tables import BLOCKS_JOINED, enough, surrounded
from tracknoise.truth_faults.corrected_positions import predict
from tracknoise.truth_faults.depth_repeats import repeats_of_pairs
from tracknoise.truth_faults.fault_parameters import COUNT
from tracknoise.truth_faults.image_evidence import Evidence, Pair
from tracknoise.truth_faults.pose_errors import (
    REACH,
    PoseWitness,
    RigidRows,
    axes_of,
    by_motion,
    half_of,
    hashed_pixels,
    rigid_sums,
)

NAME = "the tracked points"
"""Of the tracker that the check is."""
MOST_POINTS = 4_000
"""Largest number of points in an audit, so that it takes seconds."""


def check_samples(followed: "Followed") -> AuditSamples | str:
    """Samples of an audit of one sequence, in blocks of frames; or why there is none."""
    return enough(_thinned(followed.samples))


def check_rigid(followed: "Followed") -> pl.DataFrame:
    """Table `RIGID` of one sequence, at all steps up to `REFERENCE_AGE`."""
    rows, axes = _rigid_rows(followed)
    names = {**{name: getattr(followed.id, name) for name in SEQUENCE}, "tracker": NAME, "speed": 1}
    tracker = PoseWitness.of(pl.DataFrame([names], schema=dict(ORIGIN)), rows, axes)
    return check(rigid_sums(tracker, [tracker], axes, steps=range(1, REFERENCE_AGE + 1)), RIGID, "rigid")


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """Points with depth whose frames have poses around them.

    Attributes
    ----------
    id
        Of their sequence.
    samples
        With the true positions that are stated.
    place : (n_frames,) intp
        Of each frame of the sequence: its number among the times of the paths of the samples.
    number : (times,) intp
        Of each time of the paths of the samples: number of the frame among those that the check read; -1 of others.
    poses : (frames, 4, 4) float64
        Stated poses of the frames that the check read.
    """

    id: SequenceId
    samples: AuditSamples
    place: NDArray[np.intp]
    number: NDArray[np.intp]
    poses: NDArray[np.float64]

    @classmethod
    def of(cls, evidence: Evidence, sequence: Sequence) -> "Followed | str":
        """Those of a sequence; or why there are none."""
        if not isinstance(evidence.camera, Intrinsics):
            return "the camera model is not known"
        followed = [*evidence.flow.steps, *evidence.flow.wide]
        pairs = [pair for pair in followed if np.isfinite(pair.depth_first_m).any()]
        if not pairs:
            any_point = any(len(pair.depth_first_m) for pair in followed)
            return "no point that was followed has a depth" if any_point else "no point could be followed"
        read = _are_read(pairs, len(evidence.poses))
        place, paths, unit = _paths(evidence, sequence)
        number = np.full(len(paths.times), -1)
        number[place[read]] = np.arange(read.sum())
        points = _Points.of(pairs)
        first = place[points.first]
        visits = first_visits(evidence.poses[read])
        block = visits[number[first]] * BLOCKS // (BLOCKS_JOINED * len(visits))
        cluster = numbered(block)
        shutter, n = shutter_of(sequence), len(first)
        samples = AuditSamples(
            trackers=(NAME,),
            tracker=np.zeros(n, np.intp),
            age=points.second - points.first,
            cluster=cluster,
            block=cluster,
            resampled=Resampled.blocks,
            n_scenes=1,
            birth=first,
            now=place[points.second],
            uv_at_birth=points.uv_first,
            observed=points.uv_second,
            stated=points.uv_second,
            depth=points.depth_m,
            depth_sd=repeats_of_pairs(evidence).at(points.depth_m),
            paths=paths,
            cameras=(evidence.camera,),
            camera=np.zeros(len(paths.times), np.intp),
            readout_of=np.full(len(paths.times), shutter.readout_s / (unit or 1.0) if shutter else 0.0),
            axis_of=np.full(len(paths.times), shutter.axis if shutter else 1, np.intp),
            interval_s=unit,
            z_depth_from=evidence.z_depth_from,
        )
        stated = _stated(surrounded(samples))
        if not len(stated.age):
            return "no point that was followed has a depth, and poses around its frames"
        return cls(sequence.id, stated, place, number, evidence.poses[read])

    def frames_of(self, places: NDArray[np.intp]) -> NDArray[np.intp]:
        """Frames of the sequence at places (n,) in the paths of the samples, (n,)."""
        return np.searchsorted(self.place, places).astype(np.intp)


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """Points of pairs, (n,) and (n, 2): frames, positions in px, depths in metres."""

    first: NDArray[np.intp]
    second: NDArray[np.intp]
    uv_first: NDArray[np.float64]
    uv_second: NDArray[np.float64]
    depth_m: NDArray[np.float64]

    @classmethod
    def of(cls, pairs: ListOf[Pair]) -> "_Points":
        """Those with depth."""
        depth = np.concatenate([pair.depth_first_m for pair in pairs])
        counts = [len(pair.depth_first_m) for pair in pairs]
        first = np.repeat([pair.first for pair in pairs], counts).astype(np.intp)
        second = np.repeat([pair.second for pair in pairs], counts).astype(np.intp)
        uv_first, uv_second = (
            np.concatenate(uv) for uv in zip(*((p.uv_first, p.uv_second) for p in pairs), strict=True)
        )
        has_depth = np.isfinite(depth)
        return cls(first[has_depth], second[has_depth], uv_first[has_depth], uv_second[has_depth], depth[has_depth])


def _are_read(pairs: ListOf[Pair], n_frames: int) -> NDArray[np.bool_]:
    """Which frames are in pairs, or between their frames, (n,)."""
    read = np.zeros(n_frames, np.bool_)
    for pair in pairs:
        read[pair.first : pair.second + 1] = True
    return read


def _paths(evidence: Evidence, sequence: Sequence) -> tuple[NDArray[np.intp], Paths, float | None]:
    """Where frames are among the times of the path, the path, and its unit of time, seconds; None without times."""
    times, n = times_of(sequence), len(evidence.poses)
    if times is None or n < 2:
        return np.arange(n), Paths.of(np.arange(n, dtype=np.float64), evidence.poses, np.zeros(n, np.intp)), None
    between = path_between_frames(sequence, n)
    between_s, between_poses = (np.empty(0), np.empty((0, 4, 4))) if between is None else (between.times, between.poses)
    order, place = in_order(times, between_s)
    unit = float(np.median(np.diff(times)))
    joined = np.concatenate([times, between_s])[order] / unit, np.concatenate([evidence.poses, between_poses])[order]
    return place, Paths.of(*joined, np.zeros(len(order), np.intp)), unit


def _stated(samples: AuditSamples) -> AuditSamples:
    """Samples with the true positions that are stated; those without one are left out."""
    stated = predict(samples, np.zeros(COUNT)).uv
    return replace(samples, stated=stated).chosen(np.flatnonzero(np.isfinite(stated).all(axis=1)))


def _thinned(samples: AuditSamples) -> AuditSamples:
    """At most `MOST_POINTS`, of all ages alike as far as there are so many, by a hash of the pixel."""
    order = np.lexsort((hashed_pixels(samples.birth, samples.uv_at_birth), samples.age))
    rank = np.empty(len(order), np.intp)
    rank[order] = np.arange(len(order)) - np.searchsorted(samples.age[order], samples.age[order])
    return samples.chosen(np.sort(np.argsort(rank, kind="stable")[:MOST_POINTS]))


def _rigid_rows(followed: Followed) -> tuple[RigidRows, NDArray[np.float64]]:
    """Equations of points between the frames that were read, and Ad of the poses of these frames."""
    samples = followed.samples
    zero, frame = followed.number[samples.birth], followed.number[samples.now]
    unit_m = float(np.median(samples.depth))
    stated = FrameGeometry(followed.poses, samples.cameras, np.zeros(len(followed.poses), np.intp)).in_units_of(unit_m)
    error = samples.observed - samples.stated
    points = stated.unproject(zero, samples.uv_at_birth, samples.depth / unit_m)
    rows = RigidRows(
        zero=zero,
        frame=frame,
        again=np.where(samples.age <= REACH, zero, -1),
        half=half_of(hashed_pixels(zero, samples.uv_at_birth)),
        jacobian=by_motion(stated, frame, points),
        error_px=error,
        again_px=error,
    )
    usable = np.flatnonzero(np.isfinite(rows.jacobian).all(axis=(1, 2)))
    return rows.chosen(usable), axes_of(stated.world_from_camera)
