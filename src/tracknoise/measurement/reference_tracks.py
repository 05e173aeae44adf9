"""Tracks of the program's own, by which poses are adjusted: of two unlike kinds, spread over the image.

They belong to a recording. Those that are measured are never among them.
"""

from collections.abc import Mapping
from functools import partial
from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.depth import sample
from tracknoise.measurement.recording import Recorder, Recording
from tracknoise.measurement.tracking import Progress, TrackerSetup, start_tracker
from tracknoise.sequences.sequence import Sequence
from tracknoise.trackers.correspondence import Correspondence
from tracknoise.trackers.detection import Detection, Detector, Spacing
from tracknoise.trackers.lucas_kanade import LucasKanade
from tracknoise.trackers.rejection import Model, Rejection
from tracknoise.trackers.tracker import Frame, TrackerSettings
from tracknoise.truth.pose_adjustment import ReferenceTracks
from tracknoise.truth.visibility import SequenceGeometry

KINDS = FOLLOWED, MATCHED = "followed", "matched"
PER_KIND = 1000
"""Features of each kind that are wanted in a frame."""
LONGEST = 48
"""Frames of a track, at most: older ones begin again."""
_PACKING = 0.7
_DEPTH_RELATIVE = 0.01
"""Standard deviation of a depth of unknown accuracy, relative to it."""


def reference_trackers(width: int, height: int) -> Mapping[str, TrackerSettings]:
    """The two kinds: corners that are followed forward and back, and corners that are matched by their descriptors."""
    apart = max(3, ceil(_PACKING * sqrt(width * height / PER_KIND)))
    spread = partial(Detection, spacing=Spacing.circles, distance_px=apart)
    return {
        FOLLOWED: LucasKanade(
            detection=spread(detector=Detector.gftt),
            rejection=Rejection(model=Model.none),
            min_features=PER_KIND,
            max_features=PER_KIND,
            backward_px=0.5,
            max_age=LONGEST,
        ),
        MATCHED: Correspondence(
            detection=spread(subpixel_px=3), rejection=Rejection(model=Model.none), max_features=PER_KIND, max_ratio=0.8
        ),
    }


def reference_tracks(sequence: Sequence, n_frames: int, *, progress: Progress | None = None) -> ReferenceTracks:
    """Follow and match features through a sequence."""
    trackers = reference_trackers(sequence.camera.width, sequence.camera.height)
    setups = [TrackerSetup(name, settings, 1) for name, settings in trackers.items()]
    running = [start_tracker(setup, sequence, None, 0, n_frames) for setup in setups]
    recorders = [Recorder() for _ in setups]
    for index in range(n_frames):
        frame = Frame(index, sequence.image(index))
        for tracker, recorder in zip(running, recorders, strict=True):
            recorder.add(index, tracker.step(frame), gradient_rad=lambda uv: np.full(len(uv), np.nan, np.float32))
        if progress is not None:
            progress(index + 1, n_frames)
    return _joined(sequence, n_frames, [recorder.finish() for recorder in recorders])


def _joined(sequence: Sequence, n_frames: int, recordings: list[Recording]) -> ReferenceTracks:
    geometry = SequenceGeometry(sequence)
    offsets = np.cumsum([0, *(len(one.first_frame) for one in recordings)])
    track = np.concatenate([one.track + offset for one, offset in zip(recordings, offsets[:-1], strict=True)])
    frame, uv = (np.concatenate([getattr(one, name) for one in recordings]) for name in ("frame", "uv"))
    kind = np.repeat(np.arange(len(recordings)), np.diff(offsets))
    birth = np.concatenate([one.first_frame for one in recordings]).astype(np.intp)
    at_birth = frame == birth[track]
    birth_uv = np.full((len(birth), 2), np.nan)
    birth_uv[track[at_birth]] = uv[at_birth]
    posed = np.array([geometry.has_pose(index) for index in range(n_frames)], np.bool_)
    later = ~at_birth & posed[frame] & posed[birth[track]] & (frame - birth[track] <= LONGEST)
    used = np.zeros(len(birth), np.bool_)
    used[track[later]] = True
    depth_m, sigma = _depths(geometry, birth, birth_uv, used)
    if np.isfinite(depth_m).any():
        used &= np.isfinite(depth_m)
    order = np.flatnonzero(used)[np.argsort(birth[used], kind="stable")]
    number = np.full(len(birth), -1, np.intp)
    number[order] = np.arange(len(order))
    rows = np.flatnonzero(later & (number[track] >= 0))
    rows = rows[np.lexsort((frame[rows], number[track[rows]]))]
    return ReferenceTracks(
        birth=birth[order],
        birth_uv=birth_uv[order],
        depth_m=depth_m[order],
        depth_sigma=sigma[order],
        kind=kind[order],
        track=number[track[rows]],
        frame=frame[rows].astype(np.intp),
        uv=uv[rows],
    )


def _depths(
    geometry: SequenceGeometry, birth: NDArray[np.intp], uv: NDArray[np.float64], used: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depth of tracks at their birth, metres, NaN where there is none, and its relative standard deviation."""
    depth_m, sigma = np.full((2, len(birth)), np.nan)
    for index in np.unique(birth[used]).tolist():
        rows = np.flatnonzero(used & (birth == index))
        depth = geometry.depth(index)
        if depth is None:
            continue
        read = sample(depth, uv[rows])
        known = rows[read.valid & ~read.edge]
        depth_m[known] = read.depth_m[read.valid & ~read.edge]
        sigma[known] = np.maximum(depth.accuracy.sigma_m(depth_m[known]) / depth_m[known], _DEPTH_RELATIVE)
    return depth_m, sigma
