"""Dense optical flow between images, sampled at features."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, Any, ClassVar

import cv2
import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from tracknoise.checks import Between0And1, Positive, settle_members
from tracknoise.trackers.detection import MOST_FEATURES, Detection
from tracknoise.trackers.features import Features, displacement_px
from tracknoise.trackers.following import Flow, FollowingSettings, FollowingTracker, Order
from tracknoise.trackers.key_frames import Occasion
from tracknoise.trackers.preprocessing import Preprocessing
from tracknoise.trackers.rejection import Rejection
from tracknoise.trackers.tracker import Frame, SequenceContext

_SMALLEST_SIDE_PX = 16
"""The flow of smaller images is not computed."""


class Method(StrEnum):
    """How the flow is computed.

    dis-ultrafast, dis-fast, dis-medium: dense inverse search, with OpenCV's settings of these names. farneback: by
    expansion into polynomials, with 3 levels, a window of 15 px and 3 iterations.
    """

    dis_ultrafast = "dis-ultrafast"
    dis_fast = "dis-fast"
    dis_medium = "dis-medium"
    farneback = "farneback"


_PRESETS = {
    Method.dis_ultrafast: cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST,
    Method.dis_fast: cv2.DISOPTICAL_FLOW_PRESET_FAST,
    Method.dis_medium: cv2.DISOPTICAL_FLOW_PRESET_MEDIUM,
}


@dataclass(frozen=True, slots=True)
class DenseFlow(FollowingSettings):
    """Settings of the tracker by dense optical flow.

    The other parameters are those of `tracknoise.trackers.following.FollowingSettings`.

    Parameters
    ----------
    method
        How the flow is computed: see `tracknoise.trackers.dense_flow.Method`.
    backward_px
        The flow back is computed too, and features are dropped that it leads farther than this from where they were,
        px. None: it is not computed.
    """

    kind: ClassVar[str] = "dense-flow"
    description: ClassVar[str] = "corners carried along by dense optical flow (DIS, Farneback), with outlier rejection"
    needs_frames_only: ClassVar[bool] = True

    detection: Detection = field(default_factory=Detection)
    rejection: Rejection = field(default_factory=Rejection)
    method: Method = Method.dis_medium
    backward_px: Positive | None = 1.0
    max_displacement_px: Positive = 64.0
    min_features: Annotated[int, Ge(1)] = 1000
    max_features: Annotated[int, Ge(1), Le(MOST_FEATURES)] = 1200
    preprocessing: Preprocessing = field(default_factory=Preprocessing)
    order: Order = Order.spacing_first
    keyframe_share: Between0And1 = 0.5
    keyframe_every: Annotated[int, Ge(1)] | None = None
    detect_at: Occasion = Occasion.every_frame
    reject_at: Occasion = Occasion.every_frame
    max_age: Annotated[int, Ge(1)] | None = None

    def __post_init__(self) -> None:
        settle_members(self, method=Method)
        FollowingSettings.__post_init__(self)

    def start(self, context: SequenceContext) -> FollowingTracker:
        """Start the tracker on one sequence at one speed."""
        return FollowingTracker(self, _Carried(self.method, self.backward_px), self.inliers_of(context))


@dataclass(frozen=True, slots=True)
class _Carried:
    """Features that the flow carries along; it is interpolated between the pixels around each."""

    method: Method
    backward_px: float | None
    quality_names: tuple[str, ...] = ()

    def follow(self, before: Frame, after: Frame, features: Features) -> Flow:
        """Where features of one image are in the next."""
        if min(before.size) < _SMALLEST_SIDE_PX:
            return Flow(features.uv, np.zeros(len(features), dtype=np.bool_))
        uv = features.uv + _sampled(self._flow(before, after), features.uv)
        is_found = np.isfinite(uv).all(axis=1) & np.all((uv >= 0) & (uv <= np.array(after.size) - 1), axis=1)
        if self.backward_px is not None:
            back = uv + _sampled(self._flow(after, before), np.where(is_found[:, None], uv, 0.0))
            is_found &= displacement_px(features.uv, back) <= self.backward_px
        return Flow(uv, is_found)

    def _flow(self, before: Frame, after: Frame) -> NDArray[np.float32]:
        """Displacement of each pixel, (height, width, 2), px."""
        nothing: Any = None  # where OpenCV may write the flow; its annotations do not know that it need not be given
        if self.method is Method.farneback:
            flow = cv2.calcOpticalFlowFarneback(before.image, after.image, nothing, 0.5, 3, 15, 3, 5, 1.2, 0)
        else:
            flow = cv2.DISOpticalFlow.create(_PRESETS[self.method]).calc(before.image, after.image, nothing)
        return np.asarray(flow, dtype=np.float32)


def _sampled(flow: NDArray[np.float32], uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements at positions (n, 2) in the image, bilinear."""
    most = np.array(flow.shape[1::-1]) - 1
    corner = np.clip(np.floor(uv), 0, most - 1).astype(np.intp)
    right, down = np.clip(uv - corner, 0.0, 1.0).T[:, :, None]
    column, row = corner.T
    above = (1 - right) * flow[row, column] + right * flow[row, column + 1]
    below = (1 - right) * flow[row + 1, column] + right * flow[row + 1, column + 1]
    return np.asarray((1 - down) * above + down * below, dtype=np.float64)
