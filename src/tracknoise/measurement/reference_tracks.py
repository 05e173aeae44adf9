"""Tracks of the program's own, by which poses are adjusted: of two unlike kinds, spread over the image.

They belong to a recording. Those that are measured are never among them.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import version
from math import ceil, sqrt
from typing import Protocol

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.depth import sample
from tracknoise.measurement.recording import Recorder
from tracknoise.measurement.tracking import Progress, TrackerSetup, start_tracker
from tracknoise.sequences.sequence import Sequence
from tracknoise.tables.schema import REFERENCES
from tracknoise.trackers.correspondence import Correspondence
from tracknoise.trackers.detection import Detection, Detector, Spacing
from tracknoise.trackers.lucas_kanade import LucasKanade
from tracknoise.trackers.preprocessing import resized
from tracknoise.trackers.rejection import Model, Rejection
from tracknoise.trackers.tracker import Frame, Step, Tracker, TrackerSettings
from tracknoise.truth.pose_adjustment import ReferenceTracks
from tracknoise.truth.visibility import SequenceGeometry

KINDS = FOLLOWED, MATCHED = "followed", "matched"
PER_KIND = 1000
"""Features of each kind in a frame, at most."""
LONGEST = 48
"""Frames of a track, at most: older ones begin again."""
_RENEWED = 0.85
"""Share of the followed features below which new ones begin."""
_PACKING = 0.7
_MATCHED_PX = 100_000
"""Pixels of the images, at most, in which features are matched: descriptors take most of the time."""
_MATCHED_APART_PX, _CONTRAST, _MISSED_FRAMES = 4, 0.02, 5
_DEPTH_RELATIVE = 0.01
"""Standard deviation of a depth of unknown accuracy, relative to it."""


def reference_trackers(width: int, height: int) -> Mapping[str, TrackerSettings]:
    """The two kinds: corners that are followed forward and back, and blobs that are matched by their descriptors."""
    apart = max(3, ceil(_PACKING * sqrt(width * height / PER_KIND)))
    free = Rejection(model=Model.none)
    return {
        FOLLOWED: LucasKanade(
            detection=Detection(detector=Detector.gftt, spacing=Spacing.circles, distance_px=apart),
            rejection=free,
            min_features=int(_RENEWED * PER_KIND),
            max_features=PER_KIND,
            backward_px=0.5,
            max_age=LONGEST,
        ),
        MATCHED: Correspondence(
            detection=Detection(
                detector=Detector.sift, contrast=_CONTRAST, spacing=Spacing.circles, distance_px=_MATCHED_APART_PX
            ),
            rejection=free,
            max_features=PER_KIND,
            max_missed_frames=_MISSED_FRAMES,
            max_ratio=0.8,
        ),
    }


class KeptTracks(Protocol):
    """Where the reference tracks of a sequence are kept, as the table `REFERENCES`."""

    def read(self) -> pl.DataFrame | None:
        """What was kept; None if nothing was."""
        ...

    def write(self, table: pl.DataFrame) -> None:
        """Keep it."""
        ...


def reference_tracks(
    sequence: Sequence, n_frames: int, *, kept: KeptTracks | None = None, progress: Progress | None = None
) -> ReferenceTracks:
    """Follow and match features through a sequence, unless tracks in the same images are kept."""
    before = None if kept is None else kept.read()
    if before is not None and before.height:
        images = _Images(sequence)
        for index in range(n_frames):
            images.add(sequence.image(index))
            if progress is not None:
                progress(index + 1, n_frames)
        if images.checksum(before) == before["sha256"][0]:
            return _joined(sequence, n_frames, before)
    table = _followed(sequence, n_frames, progress)
    if kept is not None:
        kept.write(table)
    return _joined(sequence, n_frames, table)


class _Images:
    """Checksum of images, and of the settings and libraries of the trackers."""

    def __init__(self, sequence: Sequence) -> None:
        settings = dict(reference_trackers(sequence.camera.width, sequence.camera.height))
        versions = [version(name) for name in _LIBRARIES]
        self._sum = hashlib.sha256(repr((settings, _MATCHED_PX, versions)).encode())

    def add(self, image: NDArray[np.uint8]) -> None:
        self._sum.update(repr(image.shape).encode())
        self._sum.update(image.tobytes())

    def checksum(self, table: pl.DataFrame) -> str:
        """With the tracks in them."""
        checksum = self._sum.copy()
        for column in table.drop("sha256", strict=False):
            checksum.update(column.to_numpy().tobytes())
        return checksum.hexdigest()


_LIBRARIES = ("tracknoise", "numpy", "opencv-contrib-python-headless")


def _followed(sequence: Sequence, n_frames: int, progress: Progress | None) -> pl.DataFrame:
    """The table `REFERENCES` of a sequence."""
    width, height = sequence.camera.width, sequence.camera.height
    setups = [TrackerSetup(name, settings, 1) for name, settings in reference_trackers(width, height).items()]
    running = [start_tracker(setup, sequence, None, 0, n_frames) for setup in setups]
    recorders = [Recorder() for _ in setups]
    small = min(1.0, sqrt(_MATCHED_PX / (width * height)))
    size = max(1, round(small * width)), max(1, round(small * height))
    images = _Images(sequence)
    for index in range(n_frames):
        frame = Frame(index, sequence.image(index))
        images.add(frame.image)
        for setup, tracker, recorder in zip(setups, running, recorders, strict=True):
            step = tracker.step(frame) if setup.tracker == FOLLOWED else _step_in(tracker, frame, size)
            recorder.add(index, step, gradient_rad=lambda uv: np.full(len(uv), np.nan, np.float32))
        if progress is not None:
            progress(index + 1, n_frames)
    recordings = [recorder.finish() for recorder in recorders]
    offsets = np.cumsum([0, *(len(recording.first_frame) for recording in recordings)])
    table = pl.concat(
        pl.DataFrame({"track": run.track + offset, "frame": run.frame, "u_px": run.uv[:, 0], "v_px": run.uv[:, 1]})
        .select(pl.lit(kind, pl.UInt8).alias("kind"), pl.all())
        .cast({"track": pl.UInt32})
        for kind, (run, offset) in enumerate(zip(recordings, offsets[:-1], strict=True))
    )
    return table.with_columns(pl.lit(images.checksum(table)).alias("sha256")).select(list(REFERENCES))


def _step_in(tracker: Tracker, frame: Frame, size: tuple[int, int]) -> Step:
    """A step in an image of another size, with positions in the one that is given."""
    if size == frame.size:
        return tracker.step(frame)
    step = tracker.step(resized(frame, size))
    return replace(step, uv=(step.uv + 0.5) * (np.array(frame.size) / size) - 0.5)


def _joined(sequence: Sequence, n_frames: int, table: pl.DataFrame) -> ReferenceTracks:
    """The reference tracks, in frames with a pose, of the table `REFERENCES` of a sequence.

    A track that began in a frame without a pose begins in its first frame with one.
    """
    geometry = SequenceGeometry(sequence)
    posed = np.array([geometry.has_pose(index) for index in range(n_frames)], np.bool_)
    table = table.filter(posed[table["frame"].to_numpy()])
    track, frame = (table[name].to_numpy().astype(np.intp) for name in ("track", "frame"))
    uv = table.select("u_px", "v_px").to_numpy()
    begun, births = np.unique(track, return_index=True)  # rows of a track are in the order of frames
    birth, kind = np.zeros((2, int(track.max(initial=-1)) + 1), np.intp)
    birth[begun], kind[begun] = frame[births], table["kind"].to_numpy()[births]
    at_birth = frame == birth[track]
    birth_uv = np.full((len(birth), 2), np.nan)
    birth_uv[track[at_birth]] = uv[at_birth]
    later = ~at_birth & (frame - birth[track] <= LONGEST)
    used = np.zeros(len(birth), np.bool_)
    used[track[later]] = True
    order = np.flatnonzero(used)[np.argsort(birth[used], kind="stable")]
    number = np.full(len(birth), -1, np.intp)
    number[order] = np.arange(len(order))
    rows = np.flatnonzero(later)
    rows = rows[np.lexsort((frame[rows], number[track[rows]]))]
    unknown = np.full(len(order), np.nan)
    references = ReferenceTracks(
        birth=birth[order],
        birth_uv=birth_uv[order],
        depth_m=unknown,
        depth_sigma=unknown,
        kind=kind[order],
        track=number[track[rows]].astype(np.int32),
        frame=frame[rows].astype(np.int32),
        uv=uv[rows],
    )
    return with_depths(sequence, references)


def with_depths(sequence: Sequence, tracks: ReferenceTracks) -> ReferenceTracks:
    """The tracks with the depths of a sequence, where it has one."""
    geometry = SequenceGeometry(sequence)
    depth_m, sigma = np.full((2, len(tracks.birth)), np.nan)
    for index in np.unique(tracks.birth).tolist():
        rows = np.flatnonzero(tracks.birth == index)
        depth = geometry.depth(index)
        if depth is None:
            continue
        read = sample(depth, tracks.birth_uv[rows], geometry.camera_at(index))
        usable = rows[read.valid & ~read.edge]
        depth_m[usable] = read.depth_m[read.valid & ~read.edge]
        sigma[usable] = np.maximum(depth.accuracy.sigma_m(depth_m[usable]) / depth_m[usable], _DEPTH_RELATIVE)
    return replace(tracks, depth_m=depth_m, depth_sigma=sigma)
