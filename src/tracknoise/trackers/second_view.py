"""The features of another tracker, found in the images of a second camera.

Each feature that begins is searched in the image that the second camera took at the same time. As long as it is found
there in every frame, it goes on; a feature that is not found when it begins has no track here.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from tracknoise.checks import Positive, bounds_of, require, require_bounds, require_within, settle_members
from tracknoise.exceptions import DataError, SettingsError
from tracknoise.geometry.stereo_pair import StereoPair
from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.aligned_patches import AlignedPatches
from tracknoise.trackers.alignment import Alignment, Brightness, Warp, pyramid_of
from tracknoise.trackers.descriptor_search import DescriptorSearch
from tracknoise.trackers.imported import ImportedTracker
from tracknoise.trackers.line_search import LineSearch
from tracknoise.trackers.lucas_kanade import LARGEST_WINDOW_PX, MOST_LEVELS, aligned
from tracknoise.trackers.patch_samples import Shape, offsets
from tracknoise.trackers.preprocessing import Preprocessing
from tracknoise.trackers.tracker import (
    Frame,
    NotedTracker,
    SequenceContext,
    Step,
    Tracker,
    TrackerSettings,
    begins_anywhere,
    needs_frames_only,
)
from tracknoise.words import percent

Array = NDArray[np.float64]
Frames = tuple[Frame, Frame]


class Search(StrEnum):
    """Where features are searched that began before.

    first: in each image of the second camera anew, from the position in the first camera, as in VINS-Fusion. last: from
    image to image of the second camera, as in OpenVINS and Basalt. line: anew along the epipolar line, as in Kimera.
    descriptor: anew among keypoints near the epipolar line, by descriptors, as in ORB-SLAM3 and OKVIS2. imported: not
    at all; both positions are imported, and tracks have the same names for both cameras.
    """

    first = "first"
    last = "last"
    line = "line"
    descriptor = "descriptor"
    imported = "imported"


class Method(StrEnum):
    """How features are followed from image to image: by pyramidal Lucas-Kanade, or as by the tracker `patch`."""

    lucas_kanade = "lucas-kanade"
    patch = "patch"


@dataclass(frozen=True, slots=True)
class PatchSettings:
    """Settings of patches: see `tracknoise.trackers.aligned_patches.AlignedPatches`.

    Parameters
    ----------
    shape
        Which pixels count.
    warp
        What may happen to a patch besides a shift.
    brightness
        How its gray values may change.
    """

    shape: Shape = Shape.square
    warp: Warp = Warp.se2
    brightness: Brightness = Brightness.both

    def __post_init__(self) -> None:
        settle_members(self, shape=Shape, warp=Warp, brightness=Brightness)


class Start(StrEnum):
    """Where the search from the first camera starts: at the same pixel, or where a point at infinity would be."""

    same = "same"
    infinity = "infinity"


@dataclass(frozen=True, slots=True)
class SecondView:
    """Settings of a tracker that finds the features of another one in the images of a second camera.

    Parameters
    ----------
    of
        The other tracker: one of those that `tracknoise trackers` lists, or a preset.
    options
        Its options that differ from its defaults.
    search
        From where features are searched that began before: see `Search`.
    start_at
        Where a search from the first camera starts: see `Start`.
    line, descriptors
        Of the search along lines, and of that by descriptors: see `tracknoise.trackers.line_search.LineSearch` and
        `tracknoise.trackers.descriptor_search.DescriptorSearch`.
    second
        Options of the imported tracks in the second camera that differ from `options`, such as ``camera``.
    method, patch
        Of the searches `first` and `last`: see `Method`, and `PatchSettings` of patches.
    window_px, extra_levels, iterations, epsilon
        As of `tracknoise.trackers.lucas_kanade.LucasKanade`; a patch has up to 99 px.
    backward_px
        Each feature is followed back, and dropped if that ends farther than this from where it began, px. None: it is
        not followed back.
    epipolar_px
        A feature farther than this from the epipolar line of its position in the first camera is an outlier, px. None:
        none is.
    preprocessing
        What is done to both images before.
    """

    kind: ClassVar[str] = "second-view"
    description: ClassVar[str] = "features of another tracker, found in the images of a second camera"
    of_second_camera: ClassVar[bool] = True

    of: str = "lucas-kanade"
    options: Mapping[str, object] = field(default_factory=dict)
    search: Search = Search.first
    start_at: Start = Start.same
    line: LineSearch = field(default_factory=LineSearch)
    descriptors: DescriptorSearch = field(default_factory=DescriptorSearch)
    second: Mapping[str, object] = field(default_factory=dict)
    method: Method = Method.lucas_kanade
    patch: PatchSettings = field(default_factory=PatchSettings)
    window_px: Annotated[int, Ge(3), Le(LARGEST_WINDOW_PX)] = 21
    extra_levels: Annotated[int, Ge(0), Le(MOST_LEVELS)] = 3
    iterations: Annotated[int, Ge(1)] = 30
    epsilon: Positive = 0.01
    backward_px: Positive | None = 0.5
    epipolar_px: Positive | None = 2.0
    preprocessing: Preprocessing = field(default_factory=Preprocessing)

    def __post_init__(self) -> None:
        settle_members(self, search=Search, start_at=Start, method=Method)
        require_bounds(self)
        if self.method is Method.patch:
            require_within("window_px", self.window_px, bounds_of(AlignedPatches)["window_px"])
        is_imported = self.search is Search.imported
        require(self.of == "imported" or not is_imported, "of", self.of, 'imported, as search = "imported"')
        require(is_imported or not self.second, "second", dict(self.second), 'nothing without search = "imported"')
        self._made(self.options)

    def __hash__(self) -> int:
        return hash(json.dumps(asdict(self), sort_keys=True, default=str))

    @property
    def needs_frames_only(self) -> bool:
        """As the tracker of the first camera: see `tracknoise.trackers.tracker.needs_frames_only`."""
        return needs_frames_only(self._made(self.options))

    @property
    def begins_anywhere(self) -> bool:
        """As the tracker of the first camera: see `tracknoise.trackers.tracker.begins_anywhere`."""
        return begins_anywhere(self._made(self.options))

    def start(self, context: SequenceContext) -> "SecondViewTracker":
        """Start the tracker on one sequence at one speed."""
        if context.pair is None:
            raise DataError(context.sequence.scene, "one camera", f"a second one, for the tracker {self.kind!r}")
        first = self._made(self.options).start(context)
        reported = None
        if isinstance(first, ImportedTracker) and self.search is Search.imported:
            camera = context.pair.second
            beside = replace(context, size=(camera.width, camera.height), camera_at=lambda _: camera)
            other = self._made({**self.options, **self.second}).start(beside)
            assert isinstance(other, ImportedTracker), "of the same kind"
            reported = _Reported(first, other)
        return SecondViewTracker(self, first, context.pair, reported)

    def _made(self, options: Mapping[str, object]) -> TrackerSettings:
        from tracknoise.trackers.tracker_registry import make_tracker  # which lists this tracker

        settings = make_tracker(self.of, options)
        if isinstance(settings, SecondView):
            raise SettingsError(f"of = {self.of!r}, expected a tracker of one camera")
        return settings


@dataclass(frozen=True, slots=True, eq=False)
class _Reported:
    """Imported tracks of both cameras."""

    first: ImportedTracker
    second: ImportedTracker

    def found(self, index: int, ids: NDArray[np.int64]) -> Array:
        """(n, 2): positions in the second camera of features of the first by their ids; NaN where it has none."""
        names, (named, uv) = self.first.names_of(ids), self.second.rows_of(index)
        place = np.searchsorted(named, names)
        there = np.flatnonzero(place < len(named))
        there = there[named[place[there]] == names[there]]
        found = np.full((len(ids), 2), np.nan)
        found[there] = uv[place[there]]
        return found


class SecondViewTracker:
    """The tracker on one sequence: its positions are those in the second camera, and `Step.first_uv` the others."""

    def __init__(self, settings: SecondView, first: Tracker, pair: StereoPair, reported: _Reported | None) -> None:
        self._settings, self._first, self._pair, self._reported = settings, first, pair, reported
        self._begun, self._found_at_first = 0, 0
        self._ids: NDArray[np.int64] = np.empty(0, np.int64)
        self._uv: Array = np.empty((0, 2))
        self._on_lines = settings.line.of(pair) if settings.search is Search.line else None
        self._by_descriptors = settings.descriptors.of(pair) if settings.search is Search.descriptor else None
        self._images: Frames | None = None
        patch = settings.patch
        self._patches = Alignment(
            offsets(settings.window_px, patch.shape),
            patch.warp,
            patch.brightness,
            settings.iterations,
            settings.epsilon,
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of the other tracker, and how many of its features were found."""
        others = self._first.notes if isinstance(self._first, NotedTracker) else ()
        if not self._begun:
            return others
        share = f"{percent(self._found_at_first / self._begun)} of {self._begun:,} features"
        return (*others, f"{share} that began in the first camera were found in the second")

    def step(self, frame: Frame) -> Step:
        """Track in the first camera, and find what goes on in the second."""
        first = self._first.step(frame)
        alive = np.isin(first.ids, self._ids)
        rows = np.flatnonzero(alive | first.born)
        images = self._prepared(frame)
        if self._reported is None:
            found_uv = self._tracked(images, first.uv[rows], first.ids[rows], alive[rows])
        else:
            found_uv = self._reported.found(frame.index, first.ids[rows])
        end = self._ends(first.uv[rows], found_uv)
        kept, going = end < 0, alive[rows]
        shown = rows[kept]
        lost = rows[~kept & going]
        gone = np.isin(first.ended_ids, self._ids)
        missing = ~np.isin(self._ids, first.ids) & ~np.isin(self._ids, first.ended_ids)
        offered = len(self._ids)
        self._begun += first.new
        self._found_at_first += int(np.count_nonzero(first.born[shown]))
        self._images = images
        self._ids = np.concatenate([self._ids[missing], first.ids[shown]])
        self._uv = np.concatenate([self._uv[missing], found_uv[kept]])
        ended = np.concatenate([first.ended[gone], end[~kept & going]])
        return Step(
            ids=first.ids[shown],
            uv=found_uv[kept],
            born=first.born[shown],
            response=first.response[shown],
            ended_ids=np.concatenate([first.ended_ids[gone], first.ids[lost]]),
            ended=ended,
            offered=offered,
            matched=int(np.count_nonzero(kept & going) + np.count_nonzero(ended != TrackEnd.lost)),
            outliers=int(np.count_nonzero(ended == TrackEnd.outlier)),
            alive=len(self._ids),
            first_uv=first.uv[shown],
        )

    def _prepared(self, frame: Frame) -> Frames | None:
        """Both images of a frame; None where the second camera has none."""
        second, prepared = frame.second, self._settings.preprocessing.applied
        return None if second is None else (prepared(frame), prepared(Frame(frame.index, second)))

    def _tracked(
        self,
        images: Frames | None,
        first_uv: Array,
        ids: NDArray[np.int64],
        alive: NDArray[np.bool_],
    ) -> Array:
        """(n, 2): positions in the second image; NaN where not found."""
        uv = np.full(first_uv.shape, np.nan)
        if images is None:
            return uv
        goes_on = alive & (self._settings.search is Search.last) & (self._images is not None)
        if goes_on.any() and self._images is not None:
            order = np.argsort(self._ids)
            before = self._uv[order[np.searchsorted(self._ids, ids[goes_on], sorter=order)]]
            uv[goes_on] = self._followed(self._images[1], images[1], before, before)
        uv[~goes_on] = self._searched(images, first_uv[~goes_on])
        return uv

    def _ends(self, first_uv: Array, uv: Array) -> NDArray[np.int8]:
        """(n,): why features end at these positions; -1 of those that go on."""
        end = np.full(len(uv), TrackEnd.lost, np.int8)
        found = np.flatnonzero(np.isfinite(uv).all(axis=1))
        found = found[self._pair.second.contains(uv[found])]
        end[found] = -1
        if self._settings.epipolar_px is not None:
            off = np.abs(self._pair.epipolar_px(first_uv[found], uv[found])) > self._settings.epipolar_px
            end[found[off]] = TrackEnd.outlier
        return end

    def _searched(self, images: Frames, first_uv: Array) -> Array:
        """(n, 2): positions in the second image of features of the first; NaN where not found."""
        if self._by_descriptors is not None:
            return self._by_descriptors.found(images, first_uv)
        if self._on_lines is not None:
            return self._on_lines.found((images[0].image, images[1].image), first_uv)
        start = first_uv
        if self._settings.start_at is Start.infinity:
            start = self._pair.at_infinity(first_uv)
        return self._followed(*images, first_uv, np.where(np.isfinite(start), start, first_uv))

    def _followed(self, source: Frame, target: Frame, uv: Array, start: Array) -> Array:
        """(n, 2): positions in another image; NaN where not found."""
        if not len(uv):
            return uv
        moved, found = self._aligned(source, target, uv, start)
        found = found & np.isfinite(moved).all(axis=1)
        if self._settings.backward_px is not None:
            back, returned = self._aligned(target, source, moved, moved)
            found &= returned & (np.linalg.norm(back - uv, axis=1) <= self._settings.backward_px)
        return np.where(found[:, None], moved, np.nan)

    def _aligned(self, source: Frame, target: Frame, uv: Array, start: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Positions (n, 2) in another image, and which of them were found (n,)."""
        given = self._settings
        if given.method is Method.patch:
            before, after = (pyramid_of(frame, given.extra_levels, given.window_px) for frame in (source, target))
            seen = self._patches.follow(before, after, uv, start)
            return seen.uv, seen.found
        patch, guess = uv.astype(np.float32), start.astype(np.float32)
        moved, found, _ = aligned(given, source.image, target.image, patch, guess, given.extra_levels)
        return moved.astype(np.float64), found
