"""Interfaces of trackers: settings that start a tracker, one step per frame, and checks of what a step reports."""

import re
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Protocol, TypeVar, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import TrackerError
from tracknoise.geometry.cameras import CameraModel
from tracknoise.geometry.stereo_pair import StereoPair
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import QUALITY_NAME, TrackEnd, covariances
from tracknoise.text import counted

T = TypeVar("T")


class Frame:
    """One grayscale image of a sequence.

    Parameters
    ----------
    index
        Frame of the nominal sequence.
    image
        (height, width) uint8. Trackers share it, and can only read it.
    read_second
        Reads the image of the second camera; None where there is none.

    Raises
    ------
    ValueError
        If the image is not 2-D uint8.
    """

    __slots__ = ("_memo", "_read_second", "image", "index")

    def __init__(
        self, index: int, image: NDArray[np.uint8], read_second: Callable[[], NDArray[np.uint8] | None] | None = None
    ) -> None:
        if image.ndim != 2 or image.dtype != np.uint8:
            raise ValueError(f"a frame is a 2-D uint8 image, not {image.ndim}-D {image.dtype}")
        self.index = index
        self.image = image.view()
        self.image.flags.writeable = False
        self._memo: dict[Hashable, object] = {}
        self._read_second = read_second

    @property
    def second(self) -> NDArray[np.uint8] | None:
        """(height, width) uint8: the image that a second camera took at the same time; None where there is none.

        Raises
        ------
        DataError
            If it cannot be read.
        """
        read = self._read_second
        return None if read is None else self.memo(_SECOND, lambda _: read())

    @property
    def size(self) -> tuple[int, int]:
        """(width, height), px."""
        height, width = self.image.shape
        return width, height

    def memo(self, key: Hashable, compute: Callable[[NDArray[np.uint8]], T]) -> T:
        """The result of `compute` on the image, computed at most once for each key.

        Trackers at all speeds share a frame, and so share work that depends only on the image and the settings.
        """
        if key not in self._memo:
            self._memo[key] = compute(self.image)
        return cast(T, self._memo[key])


_SECOND = "second"


def is_quality_name(name: str) -> bool:
    """Whether a name matches `QUALITY_NAME`."""
    return re.fullmatch(QUALITY_NAME, name) is not None


def check_quality(quality: Mapping[str, NDArray[np.float32]], count: int) -> None:
    """Check `tracknoise.trackers.tracker.Step.quality` of a step.

    Parameters
    ----------
    quality
        Values by name.
    count
        Number of observations in the step.

    Raises
    ------
    TrackerError
        If a name does not match `QUALITY_NAME`, values are not one float32 per observation, or a covariance among them
        has a negative eigenvalue.
    """
    for name, values in quality.items():
        if not is_quality_name(name):
            raise TrackerError(f"a tracker reported quality {name!r}, expected a name of the form {QUALITY_NAME}")
        if values.shape != (count,) or values.dtype != np.float32:
            actual = f"{values.dtype} of shape {values.shape}"
            raise TrackerError(f"a tracker reported quality {name!r} as {actual}, expected float32 of shape ({count},)")
    for names in covariances(quality):
        entries = np.array([quality[name] for name in names], dtype=np.float64)
        for row in np.flatnonzero(are_impossible(*entries))[:1]:
            stated = ", ".join(f"{number:g}" for number in entries[:, row])
            raise TrackerError(f"a tracker reported {', '.join(names)} as {stated}, expected no negative eigenvalue")


def are_impossible(uu: NDArray[np.float64], uv: NDArray[np.float64], vv: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which matrices of these entries (n,) have a negative eigenvalue, more than by rounding; NaN has none."""
    largest = _LARGEST_CORRELATION * np.sqrt(np.maximum(uu, 0.0)) * np.sqrt(np.maximum(vv, 0.0))
    return np.asarray((uu < 0.0) | (vv < 0.0) | (np.abs(uv) > largest))


_LARGEST_CORRELATION = 1.005
"""Above 1, for entries that were rounded when they were written."""


@dataclass(frozen=True, slots=True)
class Step:
    """What a tracker reports about one frame.

    Attributes
    ----------
    ids : (n,) int64
        Ids of the features that were found or began in this frame, in any order. An id is never reused.
    uv : (n, 2) float64
        Their positions, px.
    born : (n,) bool
        Whether each of them begins in this frame.
    response : (n,) float32
        Detector response of new features; NaN where unknown. Read only where `born`.
    ended_ids : (m,) int64
        Ids of the features that ended in this frame.
    ended : (m,) int8
        Why each ended: `tracknoise.tables.schema.TrackEnd` values.
    offered, matched, outliers, alive
        Number of features before the step, F(t-1); how many of them were found again; how many of those were
        rejected as outliers, f1(t); number of features after the step, F(t), including new ones.
    quality : (n,) float32 each
        What the tracker reports about each observation, by name; NaN where unknown. Names match
        ``[a-z][a-z0-9_]*``. Each becomes the column ``quality_<name>`` of the table `observations`.
    first_uv : (n, 2) float64, or None
        Of a tracker whose `uv` are positions in a second camera: the positions in the first, px. None for others.
    """

    ids: NDArray[np.int64]
    uv: NDArray[np.float64]
    born: NDArray[np.bool_]
    response: NDArray[np.float32]
    ended_ids: NDArray[np.int64]
    ended: NDArray[np.int8]
    offered: int
    matched: int
    outliers: int
    alive: int
    quality: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)
    first_uv: NDArray[np.float64] | None = None

    @property
    def new(self) -> int:
        """Number of features that begin in this frame, f2(t)."""
        return int(np.count_nonzero(self.born))


class Tracker(Protocol):
    """A tracker that runs on one sequence at one speed."""

    def step(self, frame: Frame) -> Step:
        """Track into the next frame that this tracker sees."""
        ...


@runtime_checkable
class OracleTruth(Protocol):
    """A truth that can place world points and project them: what the oracle tracker needs."""

    def anchor(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int8]]:
        """World points of features first seen in a frame.

        Parameters
        ----------
        index
            Frame.
        uv
            (n, 2) float64, px.

        Returns
        -------
        points_world : (n, 3) float64
            Metres; NaN where the status is not valid.
        status : (n,) int8
            `tracknoise.tables.schema.TruthStatus` values: valid, no_depth or edge.
        """
        ...

    def project(self, index: int, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels of world points in a frame.

        Parameters
        ----------
        index
            Frame.
        points_world
            (n, 3) float64, metres.

        Returns
        -------
        (n, 2) float64
            px; NaN behind the camera, and where the distortion model has no image point.
        """
        ...


@runtime_checkable
class DisplacingTruth(OracleTruth, Protocol):
    """A truth that can also move points across the line of sight: for oracles whose features leave their points."""

    def displaced(
        self, index: int, points_world: NDArray[np.float64], by_px: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """World points of the same depth whose positions in a frame lie beside those of others.

        Parameters
        ----------
        index
            Frame.
        points_world
            (n, 3) float64, metres.
        by_px
            (n, 2) float64: by how much their positions differ, px.

        Returns
        -------
        (n, 3) float64
            Metres; NaN where a point has no position, or the pixel no ray.
        """
        ...


@dataclass(frozen=True, slots=True)
class SequenceContext:
    """The sequence and condition for which a tracker is started, and further inputs of some trackers.

    Parameters
    ----------
    sequence
        Identity of the sequence.
    size
        (width, height) of its images, px.
    n_frames
        Number of frames of the whole sequence; a run may read fewer.
    speed
        The tracker sees frames 0, speed, 2 speed, ... of the nominal sequence.
    seed
        Random seed, for trackers that need one.
    truth
        True positions, for the oracle only; None if this kind of truth cannot place points.
    repeat
        Number of the repetition with other random seeds; 0 for the first measurement.
    first_frame
        Where the part of a long sequence begins that is measured; 0 where it is measured in one piece.
    frames_without_pose
        Frames in which no true position is known.
    timestamps_s
        (n_frames,) float64: the time of each frame, seconds, increasing; None where unknown.
    clock_start_ns
        Time 0 by the clock of the recording, ns; None where times are those of this clock, or unknown.
    source_frames
        Frames of the recording that are those of the sequence, where a part of it was chosen; None otherwise.
    camera_at
        Intrinsics of each frame, for trackers whose positions are rays; None where they are unknown.
    rotation_at
        (3, 3) float64: world_from_camera of each frame without its translation, NaN where unknown, for trackers that
        start from a known rotation; None where there are no poses.
    images
        All images that the tracker will see, in order, each (height, width) uint8, for trackers that need them before
        the first step; None where images come one by one only.
    image_names
        The image file of each frame; None where images are no files, or their names are unknown.
    pair
        The first camera and a second one beside it, of which `Frame.second` are the images; None without a second.
    """

    sequence: SequenceId
    size: tuple[int, int]
    n_frames: int
    speed: int
    seed: int
    truth: OracleTruth | None
    repeat: int = 0
    first_frame: int = 0
    frames_without_pose: frozenset[int] = frozenset()
    timestamps_s: NDArray[np.float64] | None = field(default=None, compare=False)
    clock_start_ns: int | None = None
    source_frames: range | None = None
    camera_at: Callable[[int], CameraModel] | None = field(default=None, compare=False)
    rotation_at: Callable[[int], NDArray[np.float64]] | None = field(default=None, compare=False)
    images: Callable[[], Iterator[NDArray[np.uint8]]] | None = field(default=None, compare=False)
    image_names: tuple[str, ...] | None = field(default=None, compare=False)
    pair: StereoPair | None = field(default=None, compare=False)


@runtime_checkable
class NotedTracker(Protocol):
    """A `Tracker` that states what should be known about its results."""

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence each, complete once the tracker has seen all frames."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class StatedPoints:
    """Positions that a tracker states of its points, also in frames in which it says that they are not visible."""

    point: NDArray[np.int64]  # (n,): which point
    frame: NDArray[np.int64]  # (n,): frame of the nominal sequence
    uv: NDArray[np.float64]  # (n, 2): px
    visible: NDArray[np.bool_]  # (n,): whether the tracker says that the point is visible


@runtime_checkable
class PointTracker(Protocol):
    """A `Tracker` that may state positions of points that it says are not visible."""

    @property
    def points(self) -> StatedPoints | None:
        """All that it states about its points, known when it starts; None where it states no such position."""
        ...


class TrackerSettings(Protocol):
    """A frozen dataclass whose fields are a tracker's settings, and which starts the tracker."""

    kind: ClassVar[str]
    description: ClassVar[str]

    def start(self, context: SequenceContext) -> Tracker:
        """Start the tracker on one sequence at one speed.

        Raises
        ------
        TracknoiseError
            If something that the settings name, such as a file, cannot be used.
        """
        ...


def reports_causes(settings: TrackerSettings) -> bool:
    """Whether a tracker reports why tracks end, and which features it rejects as outliers.

    Settings of a tracker that does not have a class variable ``reports_causes = False``. Causes of ends and numbers of
    outliers are then null in all tables.
    """
    return bool(getattr(settings, "reports_causes", True))


def needs_frames_only(settings: TrackerSettings) -> bool:
    """Whether a tracker needs successive frames and nothing else of a sequence, so that a long one can be in parts.

    Settings of a tracker that has a class variable ``needs_frames_only = True``. Others see each sequence as a whole.
    """
    return bool(getattr(settings, "needs_frames_only", False))


def begins_anywhere(settings: TrackerSettings) -> bool:
    """Whether a tracker that is started on a whole sequence can take its first step in any frame of it.

    Settings of a tracker that has a class variable ``begins_anywhere = True``. A part of a long sequence is then what
    it does in the frames of the part.
    """
    return bool(getattr(settings, "begins_anywhere", False))


def sees_second_camera(settings: TrackerSettings) -> bool:
    """Whether positions of a tracker are those in the images of a second camera.

    Settings of a tracker that has a class variable ``of_second_camera = True``. Its steps have `Step.first_uv`.
    """
    return bool(getattr(settings, "of_second_camera", False))


@dataclass(frozen=True, slots=True)
class RepeatedTracker:
    """A tracker with other random seeds.

    Parameters
    ----------
    settings
        The tracker.
    repeat
        See `SequenceContext`.
    """

    kind: ClassVar[str] = "repeated"
    description: ClassVar[str] = "another tracker with other random seeds"

    settings: TrackerSettings
    repeat: int

    @property
    def reports_causes(self) -> bool:
        """As the tracker itself: see `reports_causes`."""
        return reports_causes(self.settings)

    @property
    def needs_frames_only(self) -> bool:
        """As the tracker itself: see `needs_frames_only`."""
        return needs_frames_only(self.settings)

    @property
    def begins_anywhere(self) -> bool:
        """As the tracker itself: see `begins_anywhere`."""
        return begins_anywhere(self.settings)

    @property
    def of_second_camera(self) -> bool:
        """As the tracker itself: see `sees_second_camera`."""
        return sees_second_camera(self.settings)

    def start(self, context: SequenceContext) -> Tracker:
        """Start the tracker on one sequence at one speed."""
        return self.settings.start(replace(context, repeat=self.repeat))


_KINDS = {"ids": "iu", "uv": "fiu", "born": "b", "response": "f", "ended_ids": "iu", "ended": "iu"}
"""Kinds of elements that the arrays of a step may have, as NumPy abbreviates them."""
_NAMES = {"b": "bool", "f": "float", "fiu": "numbers", "iu": "whole numbers"}
_CAUSES = tuple(end for end in TrackEnd if end is not TrackEnd.sequence_end)
"""Why a track can end before the last frame."""


def check_step(step: "Step", live_ids: NDArray[np.int64]) -> None:
    """Check a step by itself, and against the features that were alive before it.

    Parameters
    ----------
    step
        What the tracker reported. Its quality is not looked at.
    live_ids
        (k,) int64: features that began in earlier steps and have not ended in one.

    Raises
    ------
    TrackerError
        If arrays have other shapes or types than promised, positions are not finite, a feature is reported or ends
        twice, began before, is unknown, is gone without having ended, or ends for no known reason, or if counts do not
        fit to each other or to the features that were alive.
    """
    mistake = next(_mistakes(step, live_ids), None)
    if mistake is not None:
        raise TrackerError(f"a tracker reported {mistake}")


def _mistakes(step: "Step", live_ids: NDArray[np.int64]) -> Iterator[str]:
    for name, kinds in _KINDS.items():
        values = getattr(step, name)
        if not isinstance(values, np.ndarray) or values.dtype.kind not in kinds:
            actual = values.dtype if isinstance(values, np.ndarray) else type(values).__name__
            yield f"{name} of type {actual}, expected an array of {_NAMES[kinds]}"
    n = len(step.ids)
    for name, shape in {"uv": (n, 2), "born": (n,), "response": (n,), "ended": (len(step.ended_ids),)}.items():
        if getattr(step, name).shape != shape:
            yield f"{name} of shape {getattr(step, name).shape}, expected {shape}"
    if step.first_uv is not None and step.first_uv.shape != (n, 2):
        yield f"first_uv of shape {step.first_uv.shape}, expected {(n, 2)}"
    for feature in step.ids[~np.isfinite(step.uv).all(axis=1)][:1]:
        yield f"feature {feature} at a position that is not finite"
    for ids, place in ((step.ids, "in one frame"), (step.ended_ids, "as ended")):
        for feature in _repeated(ids)[:1]:
            yield f"feature {feature} twice {place}"
    for place in np.flatnonzero(~np.isin(step.ended, _CAUSES))[:1]:
        expected = ", ".join(f"{cause.value} ({cause.name})" for cause in _CAUSES)
        yield f"reason {step.ended[place]} why feature {step.ended_ids[place]} ended, expected one of {expected}"
    yield from _contradictions(step, live_ids)
    yield from _miscounted(step, len(live_ids))


def _contradictions(step: "Step", live_ids: NDArray[np.int64]) -> Iterator[str]:
    """What does not fit to earlier steps."""
    left = live_ids[~np.isin(live_ids, step.ended_ids)]
    begun, followed = step.ids[step.born], step.ids[~step.born]
    for feature in (*step.ended_ids[~np.isin(step.ended_ids, live_ids)][:1], *followed[~np.isin(followed, left)][:1]):
        yield f"feature {feature}, which never began or has ended"
    for feature in begun[np.isin(begun, left)][:1]:
        yield f"feature {feature} as new, which began before and has not ended"
    alive = len(left) + len(begun)
    if step.alive != alive:
        yield f"{counted(step.alive, 'feature')} alive, expected {alive}: all that began and are not among ended_ids"


def _miscounted(step: "Step", live: int) -> Iterator[str]:
    """Counts that no step can have: outlier ratios are made of them."""
    if step.offered != live:
        yield f"{counted(step.offered, 'feature')} offered, expected {live}: all that were alive before"
    if not 0 <= step.outliers <= step.matched <= step.offered:
        counts = f"{counted(step.outliers, 'outlier')} and {step.matched} matched of {counted(step.offered, 'feature')}"
        yield f"{counts}, expected no more outliers than matched, and no more of these than were offered"


def _repeated(ids: NDArray[np.int64]) -> NDArray[np.int64]:
    ordered = np.sort(ids)
    repeated: NDArray[np.int64] = ordered[1:][ordered[1:] == ordered[:-1]]
    return repeated
