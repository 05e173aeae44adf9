"""Correspondence: features are matched from frame to frame by their descriptors."""

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from tracknoise.checks import Positive, require, require_bounds
from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.description import Described, Descriptor, describe
from tracknoise.trackers.detection import MOST_FEATURES, Detection
from tracknoise.trackers.features import ALIVE, Features, displacement_px, report
from tracknoise.trackers.frame import Frame
from tracknoise.trackers.matching import mutual_nearest
from tracknoise.trackers.rejection import Inliers, ReferencePosition, Rejection
from tracknoise.trackers.tracker import SequenceContext, Step


@dataclass(frozen=True, slots=True)
class Correspondence:
    """Settings of the correspondence tracker. The defaults are those of XIVO's matching tracker, with one difference.

    Differences from the paper: `Rejection.reference` is ``previous`` by default. XIVO's matching tracker compares
    each track's *first* position with its present one; set ``first`` to do the same.

    Parameters
    ----------
    detection, rejection
        How keypoints are detected (margin and squares do not apply, see `CorrespondenceTracker`); which matches
        are outliers.
    descriptor
        What keypoints are matched by: see `tracknoise.trackers.description.Descriptor`.
    max_displacement_px
        A feature that moved this far or farther since it was last found is dropped.
    max_features
        Unmatched keypoints become new features up to this number.
    max_missed_frames
        Number of consecutive frames for which a feature is kept without a match; 0 drops it at once.
    """

    kind: ClassVar[str] = "correspondence"
    description: ClassVar[str] = "corners matched by their descriptors, with outlier rejection"

    detection: Detection = field(default_factory=Detection)
    rejection: Rejection = field(default_factory=Rejection)
    descriptor: Descriptor = Descriptor.sift
    max_displacement_px: Positive = 64.0
    max_features: Annotated[int, Ge(1), Le(MOST_FEATURES)] = 1200
    max_missed_frames: Annotated[int, Ge(0)] = 0

    def __post_init__(self) -> None:
        require(self.descriptor in tuple(Descriptor), "descriptor", self.descriptor, f"one of {', '.join(Descriptor)}")
        object.__setattr__(self, "descriptor", Descriptor(self.descriptor))  # so that a name will do for the member
        require_bounds(self)

    def start(self, context: SequenceContext) -> "CorrespondenceTracker":
        """Start the tracker on one sequence at one speed."""
        return CorrespondenceTracker(self, self.rejection.repeated(context.repeat).inliers)


class CorrespondenceTracker:
    """The correspondence tracker on one sequence.

    A step applies these tests to the live features, in the order of XIVO's matching tracker:

    1. Feature and keypoint are mutual nearest neighbours by descriptor. A feature without a match is kept for up to
       `max_missed_frames` frames in a row (else ``lost``). `Step.matched` counts the matches.
    2. The keypoint is closer to the feature's last position than the largest displacement (else ``displaced``).
    3. The outlier rejection keeps the match (else ``outlier``).
    4. The strongest keypoints that belong to no feature begin new ones, up to `max_features` alive. Keypoints whose
       match was displaced or an outlier are among them.

    As in XIVO, keypoints may lie anywhere: neither margin nor squares apply. The descriptor of a feature is that of
    its first frame.

    The quality of an observation is the distance between the descriptors of feature and keypoint
    (``descriptor_distance``; of bits, the root of how many differ), and that distance over the distance of the second
    best keypoint in the frame (``descriptor_ratio``): see `tracknoise.trackers.matching.Matches`.

    Parameters
    ----------
    settings
        The settings.
    inliers
        The outlier rejection.
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
        points, before = describe(frame, self._settings.detection, self._settings.descriptor), self._features
        matches = mutual_nearest(self._descriptors, points.descriptors)
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
            quality={"descriptor_distance": matches.distance[seen], "descriptor_ratio": matches.ratio[seen]},
        )

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
