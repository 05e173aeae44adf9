"""Trackers that detect features and follow each from image to image, whatever finds it again."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tracknoise.checks import require, require_bounds, settle_members
from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.detection import Detection
from tracknoise.trackers.features import ALIVE, Features, displacement_px, report
from tracknoise.trackers.key_frames import KeyFrames, Occasion
from tracknoise.trackers.preprocessing import Preprocessing
from tracknoise.trackers.rejection import Inliers, ReferencePosition, Rejection
from tracknoise.trackers.spacing import Places, places_in
from tracknoise.trackers.tracker import Frame, SequenceContext, Step


class Order(StrEnum):
    """In which order a step does its parts, after the features were followed.

    spacing_first: distances are kept, outliers rejected, new features detected, as in XIVO. rejection_first: outliers
    are rejected, distances kept, new features detected, as in VINS-Mono. detection_first: before the features are
    followed, distances are kept and new features detected in the previous image; outliers are rejected afterwards. The
    first observation of a feature is then where its first step ends, as in OpenVINS.
    """

    spacing_first = "spacing-first"
    rejection_first = "rejection-first"
    detection_first = "detection-first"


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """What became of n features in the next image.

    Attributes
    ----------
    uv : (n, 2) float64
        Their positions, px; anything where they were not found.
    found : (n,) bool
        Whether they were found, at a finite position.
    quality : (n,) float32 each
        See `tracknoise.trackers.tracker.Step.quality`.
    """

    uv: NDArray[np.float64]
    found: NDArray[np.bool_]
    quality: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)


class Follower(Protocol):
    """What finds features of one image in another."""

    @property
    def quality_names(self) -> tuple[str, ...]:
        """Names of the quality of each `Flow`."""
        ...

    def follow(self, before: Frame, after: Frame, features: Features) -> Flow:
        """Where the features, one at least, are in the next image. Their latest positions are those in `before`."""
        ...


class FollowingSettings:
    """Settings that these trackers have in common.

    Attributes
    ----------
    detection, rejection
        Where features may begin and stay; which of them are outliers.
    max_displacement_px
        A feature that moved this far or farther in one step is dropped.
    min_features, max_features
        New features are detected when fewer than `min_features` are left, up to `max_features`.
    preprocessing
        What is done to each image before features are detected and followed in it.
    order
        In which order distances are kept, outliers rejected and new features detected: see
        `tracknoise.trackers.following.Order`.
    keyframe_share, keyframe_every
        There is a new key frame when fewer than this share of the features of the last one are left, or after so many
        frames of the nominal sequence. None: after any number.
    detect_at, reject_at
        In which images new features are detected, and outliers rejected: see
        `tracknoise.trackers.key_frames.Occasion`.
    max_age
        A feature older than this is dropped, frames of the nominal sequence. None: at any age it stays.
    """

    __slots__ = ()

    detection: Detection
    rejection: Rejection
    max_displacement_px: float
    min_features: int
    max_features: int
    preprocessing: Preprocessing
    order: Order
    keyframe_share: float
    keyframe_every: int | None
    detect_at: Occasion
    reject_at: Occasion
    max_age: int | None

    def __post_init__(self) -> None:
        settle_members(self, order=Order, detect_at=Occasion, reject_at=Occasion)
        require_bounds(self)
        expected = f"a number not below min_features, {self.min_features}"
        require(self.max_features >= self.min_features, "max_features", self.max_features, expected)

    def inliers_of(self, context: SequenceContext) -> Inliers:
        """The outlier rejection on one sequence, once the detection is known to work; SettingsError if it does not."""
        self.detection.require_usable()
        return self.rejection.repeated(context.repeat).inliers_of(context)

    def key_frames(self) -> KeyFrames:
        """Those of one tracker on one sequence."""
        return KeyFrames(self.keyframe_share, self.keyframe_every)


class FollowingTracker:
    """A tracker that follows features, on one sequence.

    A step applies these tests to the live features, oldest first. With the default order, they are those of XIVO:

    1. The feature is found again (else ``lost``). `Step.matched` counts those found.
    2. It moved less than the largest displacement (else ``displaced``), and is not too old (else ``masked``).
    3. It lies outside the margin, and far enough from the features that passed this test before it in this frame (else
       ``masked``). A feature that passes occupies its place.
    4. The outlier rejection between the reference and current positions of the remaining features keeps it (else
       ``outlier``). An outlier's place stays occupied in this frame, so that it is not detected again at once. With
       `reject_at` key frames, that is asked in these only.
    5. If fewer than `min_features` are left, the strongest keypoints in free places are added, up to `max_features`;
       each occupies its place. With `detect_at` key frames, that is done in these only.

    Whether the image is a key frame is decided between tests 4 and 5, or before test 4 if that waits for key frames.

    With `Order.rejection_first`, features inside the margin end first, and test 4 comes before the distances of test 3.
    With `Order.detection_first`, tests 3 and 5 are made in the previous image before test 1, and test 3 in the present
    image asks only whether the feature lies in it. Features that do not survive their first step are never reported.
    A step without live features only detects new ones, in the present image.
    """

    def __init__(
        self, settings: FollowingSettings, follower: Follower, inliers: Inliers, key_frames: KeyFrames | None = None
    ) -> None:
        self._settings = settings
        self._follower = follower
        self._inliers = inliers
        self._key_frames = key_frames or settings.key_frames()
        self._before: Frame | None = None
        self._features = Features.begin(0, np.empty((0, 2)))
        self._response = np.empty(0, dtype=np.float32)  # of features that were not reported yet
        self._next_id = 0

    def step(self, frame: Frame) -> Step:
        """Track into the next frame."""
        image = self._settings.preprocessing.applied(frame)
        step = self._step_to(image) if self._settings.order is not Order.detection_first else self._step_from(image)
        self._before = image
        return step

    def _step_to(self, frame: Frame) -> Step:
        """One step, in which new features are detected in the present image."""
        before, places = self._features, places_in(frame.size, self._settings.detection)
        flow = self._flow(frame, before)
        end = self._judge(before, flow, frame, places)
        alive = end == ALIVE
        tracked = before.chosen(alive, flow.uv[alive])
        new, response = self._detect(frame, places, len(tracked))
        self._features = tracked.joined(new)
        self._key_frames.complete(frame.index, self._features)
        return report(
            offered=before.ids,
            end=end,
            matched=int(np.count_nonzero(flow.found)),
            found=tracked,
            new=new,
            response=response,
            quality={name: values[alive] for name, values in flow.quality.items()},
        )

    def _step_from(self, frame: Frame) -> Step:
        """One step, in which new features are detected in the previous image."""
        offered, end = self._with_new_features()
        rows = np.flatnonzero(end == ALIVE)
        followed = offered.chosen(rows, offered.uv[rows])
        followed = Features(followed.ids, followed.uv, followed.first_uv, offered.before_uv[rows], followed.born)
        flow = self._flow(frame, followed)
        end[rows] = self._judge(followed, flow, frame, places_in(frame.size, self._settings.detection))
        alive = end[rows] == ALIVE
        is_old = np.ones(len(offered), dtype=np.bool_)
        is_old[len(is_old) - len(self._response) :] = False
        old, seen = alive & is_old[rows], alive & ~is_old[rows]
        order = np.concatenate([np.flatnonzero(old), np.flatnonzero(seen)])
        tracked, new = (followed.chosen(chosen, flow.uv[chosen]) for chosen in (old, seen))
        step = report(
            offered=offered.ids[is_old],
            end=end[is_old],
            matched=int(np.count_nonzero(flow.found & is_old[rows])),
            found=tracked,
            new=new,
            response=self._response[(end == ALIVE)[~is_old]],
            quality={name: values[order] for name, values in flow.quality.items()},
        )
        self._features, self._response = tracked.joined(new), np.empty(0, dtype=np.float32)
        if not len(offered):
            self._features, self._response = self._detect(frame, places_in(frame.size, self._settings.detection), 0)
        return step

    def _with_new_features(self) -> tuple[Features, NDArray[np.int8]]:
        """The live features and new ones of the previous image, and which of them end there."""
        live, before = self._features, self._before
        end = np.full(len(live), TrackEnd.masked, dtype=np.int8)
        if before is None or not len(live):
            return live, end
        places = places_in(before.size, self._settings.detection)
        kept = places.claim(live.uv)
        end[kept] = ALIVE
        new, response = self._detect(before, places, len(kept))
        self._response = np.concatenate([self._response, response])
        self._key_frames.complete(before.index, live.chosen(kept, live.uv[kept]).joined(new))
        return live.joined(new), np.concatenate([end, np.full(len(new), ALIVE, dtype=np.int8)])

    def _flow(self, frame: Frame, features: Features) -> Flow:
        """Track features into an image."""
        if self._before is None or not len(features):
            nothing = {name: np.empty(0, dtype=np.float32) for name in self._follower.quality_names}
            return Flow(np.empty((0, 2)), np.zeros(0, dtype=np.bool_), nothing)
        return self._follower.follow(self._before, frame, features)

    def _judge(self, features: Features, flow: Flow, frame: Frame, places: Places) -> NDArray[np.int8]:
        """Tests 1 to 4: the outcome for every feature that was followed."""
        settings, uv = self._settings, flow.uv
        end = np.full(len(features), TrackEnd.lost, dtype=np.int8)
        near = flow.found & (displacement_px(features.uv, uv) < settings.max_displacement_px)
        end[flow.found] = TrackEnd.displaced
        end[near] = TrackEnd.masked
        young = settings.max_age is None or frame.index - features.born <= settings.max_age
        rows = np.flatnonzero(near & young)
        if settings.order is Order.spacing_first:
            rows = rows[places.claim(uv[rows])]
        elif settings.order is Order.rejection_first:
            rows = rows[places.inside(uv[rows])]
        else:
            rows = rows[np.all((uv[rows] >= 0) & (uv[rows] < frame.size), axis=1)]
        waits = settings.reject_at is Occasion.keyframes
        inlier = np.ones(len(rows), dtype=np.bool_)
        if not waits or self._key_frames.decide(frame.index, features.ids[rows]):
            source = self._reference(features)[rows]
            has_source = np.isfinite(source).all(axis=1)
            inlier[has_source] = self._inliers(source[has_source], uv[rows[has_source]], frame.index)
        end[rows] = np.where(inlier, ALIVE, TrackEnd.outlier)
        if settings.order is Order.rejection_first:
            rows = rows[inlier]
            end[rows] = TrackEnd.masked
            end[rows[places.claim(uv[rows])]] = ALIVE
        if not waits:
            self._key_frames.decide(frame.index, features.ids[end == ALIVE])
        return end

    def _reference(self, features: Features) -> NDArray[np.float64]:
        """Positions (n, 2) with which present ones are compared; NaN where there is none."""
        match self._settings.rejection.reference:
            case ReferencePosition.first:
                return features.first_uv
            case ReferencePosition.keyframe:
                return self._key_frames.positions(features.ids)
        return features.uv

    def _detect(self, frame: Frame, places: Places, alive: int) -> tuple[Features, NDArray[np.float32]]:
        """Test 5: new features of an image, and their responses."""
        uv, response = np.empty((0, 2)), np.empty(0, dtype=np.float32)
        in_every_frame = self._settings.detect_at is Occasion.every_frame
        if alive < self._settings.min_features and (in_every_frame or self._key_frames.is_latest(frame.index)):
            uv, response = places.births(frame, self._settings.max_features - alive)
        new = Features.begin(self._next_id, uv, frame.index)
        self._next_id += len(new)
        return new, response
