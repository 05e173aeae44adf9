"""A tracker: Shi-Tomasi corners of the first frame, followed by OpenCV's Lucas-Kanade."""

from dataclasses import dataclass
from typing import ClassVar

import cv2
import numpy as np

from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.tracker import Frame, SequenceContext, Step


@dataclass(frozen=True)
class Corners:
    """Settings. Each field is an option of the tracker."""

    kind: ClassVar[str] = "corners"
    description: ClassVar[str] = "Shi-Tomasi corners of the first frame, followed by OpenCV's Lucas-Kanade"

    most: int = 200

    def start(self, context: SequenceContext) -> "CornersTracker":
        """Start the tracker on one sequence at one speed."""
        return CornersTracker(self.most)


class CornersTracker:
    """The tracker: ids and positions of the live features, and the image in which they were found."""

    def __init__(self, most: int) -> None:
        self.most, self.image = most, None
        self.ids, self.uv = np.empty(0, np.int64), np.empty((0, 2), np.float32)

    def step(self, frame: Frame) -> Step:
        """Find the features again in the next frame."""
        before, is_first, found = self.ids, self.image is None, np.empty(0, bool)
        if is_first:
            corners = cv2.goodFeaturesToTrack(frame.image, self.most, qualityLevel=0.01, minDistance=10)
            self.uv = self.uv if corners is None else corners.reshape(-1, 2)
            self.ids = np.arange(len(self.uv))
        elif len(before):
            uv, status, _ = cv2.calcOpticalFlowPyrLK(self.image, frame.image, self.uv, None)
            found = status.ravel() == 1
            self.ids, self.uv = before[found], uv[found]
        self.image, n = frame.image, len(self.ids)
        return Step(
            ids=self.ids,
            uv=self.uv.astype(np.float64),
            born=np.full(n, is_first),
            response=np.full(n, np.nan, np.float32),
            ended_ids=before[~found],
            ended=np.full((~found).sum(), TrackEnd.lost, np.int8),
            offered=len(before),
            matched=int(found.sum()),
            outliers=0,
            alive=n,
        )
