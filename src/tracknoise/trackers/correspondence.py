"""Correspondence: features are matched from frame to frame by their descriptors."""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, ClassVar

import cv2
import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import NDArray

from tracknoise.checks import Positive, Share, require, require_bounds, settle_members
from tracknoise.exceptions import TrackerError
from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.detection import (
    MOST_FEATURES,
    Detection,
    Detector,
    network_keypoints,
    sift_descriptors,
)
from tracknoise.trackers.features import ALIVE, Features, displacement_px, report
from tracknoise.trackers.match_network import network_matches, require_matcher
from tracknoise.trackers.matching import DISTANCE, RATIO, Matches, mutual_nearest, supported
from tracknoise.trackers.preprocessing import Preprocessing
from tracknoise.trackers.rejection import Inliers, Model, ReferencePosition, Rejection
from tracknoise.trackers.spacing import spread_keypoints
from tracknoise.trackers.tracker import Frame, SequenceContext, Step

_CORNER_SIZE_PX = 7.0
"""Size of the keypoints of AGAST and FAST."""
_BEBLID_SCALE = 5.0
"""OpenCV's, for keypoints of that size: the window is so many times as wide."""


class Descriptor(StrEnum):
    """What a keypoint is recognised by.

    sift: 128 gradients. orb, brisk and freak: 256, 512 and 512 comparisons of gray values. beblid: 512 learned
    comparisons of means. akaze: 486 comparisons of means and derivatives in a nonlinear scale space. network: what the
    network that finds the keypoints states.
    """

    sift = "sift"
    orb = "orb"
    brisk = "brisk"
    freak = "freak"
    beblid = "beblid"
    akaze = "akaze"
    network = "network"

    @property
    def size(self) -> int:
        """Length of a descriptor; 0 for that of a network, which is known once it has run."""
        bits = {Descriptor.orb: 256, Descriptor.akaze: 488, Descriptor.network: 0}  # 486 of AKAZE fill bytes
        return 128 if self is Descriptor.sift else bits.get(self, 512)


@dataclass(frozen=True, slots=True)
class Described:
    """Keypoints with descriptors, strongest first."""

    uv: NDArray[np.float64]  # (n, 2): positions, px
    response: NDArray[np.float32]  # (n,): of the detector
    # (n, size): Of SIFT, whole numbers from 0 to 255, of length about 512. Of the others, one bit per comparison, so
    # that the squared distance of two descriptors is the number of bits that differ.
    descriptors: NDArray[np.float32]
    # (n, 3): of the positions, px^2: uu, uv and vv; None where nothing predicts them
    covariances: NDArray[np.float32] | None = None
    octave: NDArray[np.intp] | None = None  # (n,): of ORB's own keypoints, the level of their pyramid; None: all 0

    @property
    def level(self) -> NDArray[np.intp]:
        """(n,): level of the image pyramid of each keypoint; 0 is the full resolution."""
        return np.zeros(len(self.uv), dtype=np.intp) if self.octave is None else self.octave

    def quality(self, rows: NDArray[np.intp]) -> dict[str, NDArray[np.float32]]:
        """Quality of observations at some of the keypoints: the covariances, if there are any."""
        if self.covariances is None:
            return {}
        return dict(zip(("cov_uu", "cov_uv", "cov_vv"), self.covariances[rows].T, strict=True))


def describe(frame: Frame, detection: Detection, descriptor: Descriptor = Descriptor.sift) -> Described:
    """Descriptors of all keypoints of the whole image, computed once per frame.

    With a grid, they are those of its cells. With circles or cells to keep them apart, margin and distance apply to
    them; squares and their margin do not.

    Keypoints of `sift`, `orb` and `akaze` are described with their own size and direction if the descriptor is of the
    same kind. All others are described as AGAST's are: with a size of 7 px, and upright or, by `brisk`, `freak` and
    `akaze`, along a direction that they find themselves. A descriptor may drop keypoints, such as those near the
    border; only those that it returns are used.
    """

    def compute(image: NDArray[np.uint8]) -> Described:
        if descriptor is Descriptor.network:
            return _by_network(frame, detection)
        if descriptor is Descriptor.sift and _is_all_sift(detection):
            of_all, points = sift_descriptors(frame, detection), spread_keypoints(frame, detection)
            return Described(points.uv, points.response, of_all[points.order])
        points = spread_keypoints(frame, detection)
        own = _is_own(detection, descriptor)
        raw = [points.raw[index] for index in points.order.tolist()] if own else _corners(points.uv, points.response)
        return _computed(image, raw, descriptor)

    return frame.memo(("descriptors", descriptor, detection), compute)


def describe_at(
    frame: Frame, uv: NDArray[np.float64], detection: Detection, descriptor: Descriptor
) -> tuple[Described, NDArray[np.intp]]:
    """Descriptors at positions in the image, to be compared with those that `describe` has of another image.

    Where keypoints have their own size and direction, a position must be that of a keypoint, whose descriptor it has.

    `uv`: (n, 2) float64, px. Returns descriptors, and which of them is that of each position: (n,), -1 where there is
    none.
    """
    if _is_own(detection, descriptor):
        found = describe(frame, detection, descriptor)
    else:
        found = _computed(frame.image, _corners(uv, np.zeros(len(uv), np.float32)), descriptor)
    place = {tuple(position): row for row, position in enumerate(found.uv.astype(np.float32).tolist())}
    rows = [place.get(tuple(position), -1) for position in uv.astype(np.float32).tolist()]
    return found, np.array(rows, dtype=np.intp)


def _is_own(detection: Detection, descriptor: Descriptor) -> bool:
    """Whether keypoints are described with the size and direction that they were found with."""
    return detection.detector.value == descriptor.value


def _computed(image: NDArray[np.uint8], raw: list[cv2.KeyPoint], descriptor: Descriptor) -> Described:
    """Descriptors of keypoints, as far as there are any."""
    kept, descriptors = _extractor(descriptor).compute(image, raw) if raw else ((), None)
    uv = np.asarray(cv2.KeyPoint.convert(kept), dtype=np.float64).reshape(-1, 2)
    response = np.array([point.response for point in kept], dtype=np.float32)
    order = np.argsort(-response, kind="stable")  # ORB returns its keypoints by level
    octave = np.array([point.octave for point in kept], dtype=np.intp)[order] if descriptor is Descriptor.orb else None
    return Described(uv[order], response[order], _as_numbers(descriptors, descriptor)[order], octave=octave)


def _by_network(frame: Frame, detection: Detection) -> Described:
    """Keypoints of a network with its own descriptors."""
    points, of_network = spread_keypoints(frame, detection), network_keypoints(frame, detection)
    if of_network.descriptors is None:
        raise TrackerError(f"{detection.network}: the network has no output descriptors, expected them as descriptor")
    rows = np.array([points.raw[index].class_id for index in points.order.tolist()], dtype=np.intp)
    covariances = None if of_network.covariances is None else of_network.covariances[rows]
    return Described(points.uv, points.response, of_network.descriptors[rows], covariances)


def _is_all_sift(detection: Detection) -> bool:
    """Whether keypoints are described as SIFT finds them in the whole image."""
    return detection.detector is Detector.sift and not (detection.network or detection.grid or detection.subpixel_px)


def _corners(uv: NDArray[np.float64], response: NDArray[np.float32]) -> list[cv2.KeyPoint]:
    """Positions (n, 2) as keypoints of one size."""
    return [  # AKAZE's descriptor reads the level of its scale space from the class: the finest
        cv2.KeyPoint(u, v, _CORNER_SIZE_PX, response=response, class_id=0)
        for (u, v), response in zip(uv.tolist(), response.tolist(), strict=True)
    ]


def _extractor(descriptor: Descriptor) -> cv2.Feature2D:
    if descriptor is Descriptor.sift:  # as `tracknoise.trackers.detection` finds its keypoints: where it looks at them
        return cv2.SIFT.create(enable_precise_upscale=True)
    return _EXTRACTORS[descriptor]()


_EXTRACTORS: dict[Descriptor, Callable[[], cv2.Feature2D]] = {
    Descriptor.orb: lambda: cv2.ORB.create(),
    Descriptor.brisk: lambda: cv2.xfeatures2d.BRISK.create(),
    Descriptor.freak: lambda: cv2.xfeatures2d.FREAK.create(),
    Descriptor.beblid: lambda: cv2.xfeatures2d.BEBLID.create(_BEBLID_SCALE),
    Descriptor.akaze: lambda: cv2.xfeatures2d.AKAZE.create(),
}


def _as_numbers(descriptors: NDArray[Any] | None, descriptor: Descriptor) -> NDArray[np.float32]:
    """Descriptors (n, size) as numbers whose squared distance means something; bytes become bits."""
    if descriptors is None:
        return np.empty((0, descriptor.size), dtype=np.float32)
    numbers = descriptors if descriptor is Descriptor.sift else np.unpackbits(descriptors, axis=1)
    return np.asarray(numbers, dtype=np.float32).reshape(-1, descriptor.size)


@dataclass(frozen=True, slots=True)
class Correspondence:
    """Settings of the correspondence tracker. The defaults are those of XIVO's matching tracker, with one difference.

    Differences from the paper: `Rejection.reference` is ``previous`` by default. XIVO's matching tracker compares
    each track's *first* position with its present one; set ``first`` to do the same.

    Parameters
    ----------
    detection, rejection
        How keypoints are detected (margin and squares do not apply, see `CorrespondenceTracker`; circles and cells do);
        which matches are outliers.
    descriptor
        What keypoints are matched by: see `tracknoise.trackers.correspondence.Descriptor`.
    max_displacement_px
        A feature that moved this far or farther since it was last found is dropped.
    max_features
        Unmatched keypoints become new features up to this number.
    max_missed_frames
        Number of consecutive frames for which a feature is kept without a match; 0 drops it at once.
    preprocessing
        What is done to each image before keypoints are detected and described in it.
    max_ratio
        Largest distance of a match, as a share of that of the second best keypoint: see
        `tracknoise.trackers.matching.mutual_nearest`. None: any.
    max_distance
        Largest distance of a match; of bits, the root of how many differ. None: any.
    grid_statistics
        Whether matches need the support of those around them: see `tracknoise.trackers.matching.supported`.
    matcher
        An ONNX file with a network that matches keypoints by descriptor and position, such as LightGlue, instead of
        mutual nearest neighbours: see docs/trackers.md. It needs the extra `learned`, and descriptors of a network.
    match_score
        Least score of its matches.
    """

    kind: ClassVar[str] = "correspondence"
    description: ClassVar[str] = "corners matched by their descriptors, with outlier rejection"
    needs_frames_only: ClassVar[bool] = True

    detection: Detection = field(default_factory=Detection)
    rejection: Rejection = field(default_factory=Rejection)
    descriptor: Descriptor = Descriptor.sift
    max_displacement_px: Positive = 64.0
    max_features: Annotated[int, Ge(1), Le(MOST_FEATURES)] = 1200
    max_missed_frames: Annotated[int, Ge(0)] = 0
    preprocessing: Preprocessing = field(default_factory=Preprocessing)
    max_ratio: Annotated[float, Gt(0), Le(1)] | None = None
    max_distance: Positive | None = None
    grid_statistics: bool = False
    matcher: Path | None = None
    match_score: Share = 0.0

    def __post_init__(self) -> None:
        settle_members(self, descriptor=Descriptor)
        require_bounds(self)
        is_given = self.descriptor is not Descriptor.network or self.detection.network is not None
        require(is_given, "descriptor", str(self.descriptor), "another one, or detection.network")
        learned = self.matcher is None or self.descriptor is Descriptor.network
        require(learned, "descriptor", str(self.descriptor), "network with a matcher")
        for name in ("max_ratio", "max_distance"):
            value = getattr(self, name)
            require(
                self.matcher is None or value is None, name, value, "none with a matcher, whose matches have scores"
            )
        has_reference = self.rejection.reference is not ReferencePosition.keyframe
        require(has_reference, "rejection.reference", "keyframe", "previous or first, without key frames")
        one_step = self.rejection.model is not Model.two_point or not self.max_missed_frames
        require(one_step, "max_missed_frames", self.max_missed_frames, "0 with two-point, which knows one rotation")

    def start(self, context: SequenceContext) -> "CorrespondenceTracker":
        """Start the tracker on one sequence at one speed."""
        self.detection.require_usable()
        if self.matcher is not None:
            require_matcher(self.matcher)
        return CorrespondenceTracker(self, self.rejection.repeated(context.repeat).inliers_of(context))


class CorrespondenceTracker:
    """The correspondence tracker on one sequence.

    A step applies these tests to the live features, in the order of XIVO's matching tracker:

    1. Feature and keypoint are mutual nearest neighbours by descriptor, near and unambiguous enough, or a matcher gives
       them a high enough score; and others support them enough. A feature without a match is kept for up to
       `max_missed_frames` frames in a row (else ``lost``). `Step.matched` counts the matches.
    2. The keypoint is closer to the feature's last position than the largest displacement (else ``displaced``).
    3. The outlier rejection keeps the match (else ``outlier``).
    4. The strongest keypoints that belong to no feature begin new ones, up to `max_features` alive. Keypoints whose
       match was displaced or an outlier are among them.

    As in XIVO, keypoints may lie anywhere: neither margin nor squares apply, unless circles or cells are asked for. The
    descriptor of a feature is that of its first frame. With a matcher, which compares two images, it is that of the
    frame in which the feature was found last.

    The quality of an observation is the distance between the descriptors of feature and keypoint
    (``descriptor_distance``; of bits, the root of how many differ), and that distance over the distance of the second
    best keypoint in the frame (``descriptor_ratio``): see `tracknoise.trackers.matching.mutual_nearest`. With a
    matcher, it is the score of the match instead (``match_score``). Where a network predicts covariances, they are
    ``cov_uu``, ``cov_uv`` and ``cov_vv``, px^2.
    """

    def __init__(self, settings: Correspondence, inliers: Inliers) -> None:
        self._settings = settings
        self._inliers = inliers
        self._features = Features.begin(0, np.empty((0, 2)))
        self._descriptors = np.empty((0, settings.descriptor.size), dtype=np.float32)
        self._missed = np.empty(0, dtype=np.int64)
        self._next_id = 0

    def step(self, frame: Frame) -> Step:
        """Track into the next frame."""
        settings, before = self._settings, self._features
        points = describe(settings.preprocessing.applied(frame), settings.detection, settings.descriptor)
        if not len(self._descriptors):
            self._descriptors = points.descriptors[:0]
        matches = self._matches(points, frame.size)
        if settings.grid_statistics:
            ends = before.uv[matches.query_rows], points.uv[matches.train_rows]
            matches = matches.chosen(supported(*ends, frame.size))
        rows, columns = matches.query_rows, matches.train_rows
        end, seen = self._judge(rows, points.uv[columns], frame.index)
        alive = end == ALIVE
        uv = before.uv.copy()
        uv[rows[seen]] = points.uv[columns[seen]]
        missed = self._missed + 1
        missed[rows[seen]] = 0
        fresh = self._unused(points, columns[seen], int(np.count_nonzero(alive)))
        new = Features.begin(self._next_id, points.uv[fresh])
        self._features = before.chosen(alive, uv[alive]).joined(new)
        if settings.matcher is not None:
            self._descriptors[rows[seen]] = points.descriptors[columns[seen]]
        self._descriptors = np.concatenate([self._descriptors[alive], points.descriptors[fresh]])
        self._missed = np.concatenate([missed[alive], np.zeros(len(fresh), dtype=np.int64)])
        self._next_id += len(new)
        return report(
            offered=before.ids,
            end=end,
            matched=len(rows),
            found=before.chosen(rows[seen], uv[rows[seen]]),
            new=new,
            response=points.response[fresh],
            missed=int(np.count_nonzero(alive)) - int(np.count_nonzero(seen)),
            quality={
                **matches.chosen(seen).quality,
                **points.quality(np.concatenate([columns[seen], fresh])),
            },
        )

    def _matches(self, points: Described, size: tuple[int, int]) -> Matches:
        """Features and keypoints that belong together; one without a second best keypoint is unambiguous."""
        settings = self._settings
        if settings.matcher is not None:
            before, after = (self._features.uv, self._descriptors), (points.uv, points.descriptors)
            return network_matches(settings.matcher, before, after, size, settings.match_score)
        matches = mutual_nearest(self._descriptors, points.descriptors)
        far = np.zeros(len(matches.query_rows), dtype=np.bool_)
        if settings.max_ratio is not None:
            far |= matches.quality[RATIO] > settings.max_ratio
        if settings.max_distance is not None:
            far |= matches.quality[DISTANCE] > settings.max_distance
        return matches.chosen(~far)

    def _judge(
        self, rows: NDArray[np.intp], uv: NDArray[np.float64], frame: int
    ) -> tuple[NDArray[np.int8], NDArray[np.bool_]]:
        """Tests 1 to 3: the outcome for every live feature, and which matches passed them all."""
        settings, features = self._settings, self._features
        end = np.where(self._missed < settings.max_missed_frames, ALIVE, TrackEnd.lost).astype(np.int8)
        seen = displacement_px(features.uv[rows], uv) < settings.max_displacement_px
        end[rows] = TrackEnd.displaced
        near = rows[seen]
        source = features.first_uv if settings.rejection.reference is ReferencePosition.first else features.uv
        inlier = self._inliers(source[near], uv[seen], frame)
        end[near] = np.where(inlier, ALIVE, TrackEnd.outlier)
        seen[seen] = inlier
        return end, seen

    def _unused(self, points: Described, used: NDArray[np.intp], alive: int) -> NDArray[np.intp]:
        """Test 4: the strongest keypoints that belong to no feature."""
        free = np.ones(len(points.uv), dtype=np.bool_)
        free[used] = False
        return np.flatnonzero(free)[: max(self._settings.max_features - alive, 0)]
