"""Observations of a tracker, ready for the fit of pose errors.

The stated pose T_f of frame f differs from the real one, T_f exp(xi_f), by a small motion xi_f of the camera. With
eta_f = Ad(T_f) xi_f, the same motion in the axes of the world, a track that begins in frame i at the point X has in
frame j, beside the error of its tracker, to first order the error

    e = J (eta_i - eta_j),  J = d pi_j(X) / dX [I, -[X]x]    (rigid)

Nothing changes if all eta change by the same motion: where the world is does not matter.

A track of many frames begins again every `REACH` steps, at its observed position and stated depth, so that no equation
is between distant frames. What its tracker did before that is subtracted, and its noise there is added.
"""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.frame_geometry import FrameGeometry
from tracknoise.statistics.prepared import PreparedSequence
from tracknoise.statistics.scattered import scattered

REACH = 16
"""Most steps of the tracker between the two frames of an equation."""


@dataclass(frozen=True, slots=True, eq=False)
class RigidRows:
    """Visible observations of one tracker, without those whose error is zero by construction.

    Attributes
    ----------
    row : (n,) intp
        Row of the observations table.
    zero, frame : (n,) int64
        Where the error is zero, and where the observation is: numbers of the frames that the tracker saw, from 0.
    again : (n,) int64
        Where the track began, or began again, for the equation of the fit; -1 where there is no equation.
    half : (n,) bool
        Half of the tracks that it belongs to. All tracks that begin at one pixel of a frame are in one half.
    jacobian : (n, 2, 6) float64
        J of (rigid): px per unit of length, px per rad.
    error_px, again_px : (n, 2) float64
        Observed minus true position, since `zero` and since `again`.
    """

    row: NDArray[np.intp]
    zero: NDArray[np.int64]
    frame: NDArray[np.int64]
    again: NDArray[np.int64]
    half: NDArray[np.bool_]
    jacobian: NDArray[np.float64]
    error_px: NDArray[np.float64]
    again_px: NDArray[np.float64]

    def chosen(self, which: NDArray[np.bool_]) -> "RigidRows":
        """Some of the rows, (n,) bool."""
        return RigidRows(**{item.name: getattr(self, item.name)[which] for item in fields(self)})


@dataclass(frozen=True, slots=True, eq=False)
class TrackPoints:
    """Where the tracks of a sequence began.

    Attributes
    ----------
    world : (tracks, 3) float64
        True point; NaN where unknown.
    hashed : (tracks,) uint64
        A pseudo-random number of the first frame and of the pixel there.
    """

    world: NDArray[np.float64]
    hashed: NDArray[np.uint64]

    @classmethod
    def of(cls, sequence: PreparedSequence, geometry: FrameGeometry, unit_m: float) -> "TrackPoints":
        """Those of one sequence, whose geometry is in units of `unit_m`, metres."""
        return cls(_points_world(sequence, geometry, unit_m), _hashes(sequence))


def rigid_rows(
    sequence: PreparedSequence, condition: int, geometry: FrameGeometry, points: TrackPoints, *, most: int
) -> RigidRows:
    """The rows of one condition of a sequence.

    Parameters
    ----------
    sequence
        Of one sequence.
    condition
        Row of `sequence.seen.conditions`.
    geometry, points
        Of the sequence, in the same unit of length.
    most
        About as many rows at most: tracks are left out at random, by the hash of where they began.
    """
    mine = sequence.seen.visible & (sequence.seen.condition == condition)
    has_point: NDArray[np.bool_] = np.isfinite(points.world[:, 0])
    known = mine & has_point[sequence.track_row]
    share = min(1.0, most / max(int(np.count_nonzero(known)), 1))
    used = (points.hashed >> np.uint64(11)) * 2.0**-53 < share
    rows = sequence.ordered_where(known & used[sequence.track_row])
    return _with_equations(sequence, geometry, rows, points)


def _points_world(sequence: PreparedSequence, geometry: FrameGeometry, unit_m: float) -> NDArray[np.float64]:
    """True point of each track, from its true position and depth in its first frame, (tracks, 3); NaN where unknown."""
    seen = sequence.seen
    true_uv = sequence.observations.select("u_true_px", "v_true_px").to_numpy()
    depth = sequence.tracks["depth_m"].to_numpy() / unit_m
    born = np.flatnonzero((seen.age == 0) & np.isfinite(true_uv).all(axis=1) & np.isfinite(depth[sequence.track_row]))
    track = sequence.track_row[born]
    points = np.full((len(depth), 3), np.nan)
    points[track] = geometry.unproject(seen.frame[born], true_uv[born], depth[track])
    return points


def _hashes(sequence: PreparedSequence) -> NDArray[np.uint64]:
    """A pseudo-random number of the frame and the pixel in which each track began, (tracks,)."""
    born = np.flatnonzero(sequence.seen.age == 0)
    uv = np.rint(sequence.observations.select("u_px", "v_px").to_numpy()[born]).astype(np.int64)
    place = np.column_stack([sequence.seen.frame[born], uv]).astype(np.uint64)
    hashed = np.zeros(sequence.tracks.height, np.uint64)
    mixed = np.zeros(len(born), np.uint64)
    for column in place.T:
        mixed = scattered(mixed ^ column)
    hashed[sequence.track_row[born]] = mixed
    return hashed


def _with_equations(
    sequence: PreparedSequence,
    geometry: FrameGeometry,
    rows: NDArray[np.intp],
    points: TrackPoints,
) -> RigidRows:
    """Equations of the rows of observations, which are sorted by track and frame."""
    seen, track = sequence.seen, sequence.track_row[rows]
    frame, errors = seen.frame[rows], seen.error_px[rows]
    first = sequence.tracks["first_frame"].to_numpy().astype(np.int64)[track]
    zero = first if sequence.key_frame is None else np.full(len(rows), sequence.key_frame)
    again, before = _beginnings(track, frame, zero, seen.speed[rows])
    place = points.world[track]
    by_point = geometry.jacobian(frame, place)
    moved = np.zeros_like(errors)
    late = np.flatnonzero(before >= 0)
    shift = _displacement(sequence, geometry, rows[before[late]], points.world)
    moved[late] = np.einsum("nij,nj->ni", by_point[late], shift)
    speed = seen.speed[rows]
    made = RigidRows(
        row=rows,
        zero=zero // speed,
        frame=frame // speed,
        again=np.where(again < 0, -1, again // speed),
        half=(points.hashed[track] & np.uint64(1)).astype(bool),
        jacobian=np.concatenate([by_point, by_point @ _minus_cross(place)], axis=2),
        error_px=errors,
        again_px=errors - moved,
    )
    return made.chosen((frame != zero) & np.isfinite(made.jacobian).all(axis=(1, 2)))


def _beginnings(
    track: NDArray[np.intp], frame: NDArray[np.int64], zero: NDArray[np.int64], speed: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Frame in which the track of each row began again, -1 if it was not seen there; and the row there, else -1."""
    place_of_track = np.cumsum(np.diff(track, prepend=track[:1]) != 0)  # ascending, as rows are sorted by track
    steps = np.maximum(np.abs(frame - zero) // speed - 1, 0) // REACH * REACH
    again = zero + np.sign(frame - zero) * steps * speed
    wide = frame.max(initial=0) + 1
    numbers, wanted = place_of_track * wide + frame, place_of_track * wide + again
    place = np.minimum(np.searchsorted(numbers, wanted), max(len(numbers) - 1, 0))
    found = numbers[place] == wanted
    return np.where(found | (steps == 0), again, -1), np.where(found & (steps > 0), place, -1)


def _displacement(
    sequence: PreparedSequence, geometry: FrameGeometry, rows: NDArray[np.intp], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """From the true points of observations to those at their observed positions and true depths, world, (n, 3)."""
    frame = sequence.seen.frame[rows]
    depth = geometry.to_camera(frame, points[sequence.track_row[rows]])[:, 2]
    observed, true = (
        sequence.observations.select(names).to_numpy()[rows] for names in (("u_px", "v_px"), ("u_true_px", "v_true_px"))
    )
    return geometry.unproject(frame, observed, depth) - geometry.unproject(frame, true, depth)


def _minus_cross(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """-[X]x of each point, (n, 3, 3): the derivative of phi x X by phi."""
    x, y, z = points.T
    zeros = np.zeros_like(x)
    return np.stack([zeros, z, -y, -z, zeros, x, y, -x, zeros], axis=1).reshape(-1, 3, 3)
