"""Pyramidal Lucas-Kanade: the patch around each feature is aligned from frame to frame."""

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import cv2
import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from tracknoise.checks import Positive, require, require_bounds, require_odd
from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.detection import MOST_FEATURES, Detection, Mask, keypoints
from tracknoise.trackers.features import ALIVE, Features, displacement_px, report
from tracknoise.trackers.rejection import Inliers, ReferencePosition, Rejection
from tracknoise.trackers.tracker import Frame, SequenceContext, Step

_EIGENVALUE_UNIT = np.float32(1024)  # OpenCV's derivatives are 32 times too large, its structure tensor 2^20 too small

_LARGEST_WINDOW_PX, _MOST_LEVELS = 999, 16
"""Beyond them OpenCV takes all memory; no image is as large."""


@dataclass(frozen=True, slots=True)
class LucasKanade:
    """Settings of the Lucas-Kanade tracker. The defaults are those of XIVO's, which the paper used.

    Parameters
    ----------
    detection, rejection
        Where features may begin and stay; which of them are outliers.
    window_px
        Side of the patch, px; odd.
    extra_levels
        Levels of the image pyramid above the full resolution.
    iterations, epsilon
        Convergence: at most this many iterations, or until the update is smaller than `epsilon` px.
    max_displacement_px
        A feature that moved this far or farther in one step is dropped.
    min_features, max_features
        New features are detected when fewer than `min_features` are left, up to `max_features`.
    """

    kind: ClassVar[str] = "lucas-kanade"
    description: ClassVar[str] = "corners tracked by pyramidal Lucas-Kanade, with outlier rejection"

    detection: Detection = field(default_factory=Detection)
    rejection: Rejection = field(default_factory=Rejection)
    window_px: Annotated[int, Ge(3), Le(_LARGEST_WINDOW_PX)] = 15
    extra_levels: Annotated[int, Ge(0), Le(_MOST_LEVELS)] = 4
    iterations: Annotated[int, Ge(1)] = 30
    epsilon: Positive = 0.01
    max_displacement_px: Positive = 64.0
    min_features: Annotated[int, Ge(1)] = 1000
    max_features: Annotated[int, Ge(1), Le(MOST_FEATURES)] = 1200

    def __post_init__(self) -> None:
        require_bounds(self)
        require_odd("window_px", self.window_px)
        expected = f"a number not below min_features, {self.min_features}"
        require(self.max_features >= self.min_features, "max_features", self.max_features, expected)

    def start(self, context: SequenceContext) -> "LucasKanadeTracker":
        """Start the tracker on one sequence at one speed."""
        return LucasKanadeTracker(self, self.rejection.repeated(context.repeat).inliers)


@dataclass(frozen=True, slots=True, eq=False)
class _Flow:
    """What Lucas-Kanade found of n live features: positions (n, 2), whether they were found, and residuals (n,)."""

    uv: NDArray[np.float64]
    found: NDArray[np.bool_]
    residual: NDArray[np.float32]


class LucasKanadeTracker:
    """The Lucas-Kanade tracker on one sequence.

    A step applies these tests to the live features, oldest first, in the order of XIVO's tracker:

    1. Lucas-Kanade finds the feature (else ``lost``). `Step.matched` counts those found.
    2. It moved less than the largest displacement (else ``displaced``).
    3. It lies outside the margin, and outside the squares of the features that passed this test before it in
       this frame (else ``masked``). A feature that passes occupies its square.
    4. The outlier rejection between the previous and current positions of the remaining features keeps it (else
       ``outlier``). An outlier's square stays occupied in this frame, so that it is not detected again at once.
    5. If fewer than `min_features` are left, the strongest keypoints outside margin and squares are added, up to
       `max_features`; each occupies its square.

    The quality of an observation is the mean absolute difference between the feature's patches in the previous and
    the current image (``lk_residual``, gray values), and the smallest eigenvalue of the mean structure tensor of the
    patch in the previous image, from Scharr derivatives (``lk_min_eigenvalue``, (gray values / px)^2). Both are
    OpenCV's; the eigenvalue is scaled so that a derivative has its unit.
    """

    def __init__(self, settings: LucasKanade, inliers: Inliers) -> None:
        self._settings = settings
        self._inliers = inliers
        self._image: NDArray[np.uint8] | None = None
        self._features = Features.begin(0, np.empty((0, 2)))
        self._next_id = 0

    def step(self, frame: Frame) -> Step:
        """Track into the next frame."""
        before, mask = self._features, Mask(frame.size, self._settings.detection)
        flow = self._flow(frame.image)
        end = self._judge(flow, frame.index, mask)
        alive = end == ALIVE
        found = before.chosen(alive, flow.uv[alive])
        quality = {"lk_residual": flow.residual[alive], "lk_min_eigenvalue": self._min_eigenvalue(alive)}
        new, response = self._detect(frame, mask, len(found))
        self._image, self._features = frame.image, found.joined(new)
        self._next_id += len(new)
        return report(
            offered=before.ids,
            end=end,
            matched=int(np.count_nonzero(flow.found)),
            found=found,
            new=new,
            response=response,
            quality=quality,
        )

    def _judge(self, flow: _Flow, frame: int, mask: Mask) -> NDArray[np.int8]:
        """Tests 1 to 4: the outcome for every live feature."""
        before, uv = self._features, flow.uv
        end = np.full(len(before), TrackEnd.lost, dtype=np.int8)
        near = flow.found & (displacement_px(before.uv, uv) < self._settings.max_displacement_px)
        end[flow.found] = TrackEnd.displaced
        rows = np.flatnonzero(near)
        end[rows] = TrackEnd.masked
        rows = rows[mask.claim(uv[rows])]
        first = self._settings.rejection.reference is ReferencePosition.first
        source = before.first_uv if first else before.uv
        inlier = self._inliers(source[rows], uv[rows], frame)
        end[rows] = np.where(inlier, ALIVE, TrackEnd.outlier)
        return end

    def _flow(self, image: NDArray[np.uint8]) -> _Flow:
        """Track the live features into an image."""
        if self._image is None or not len(self._features):
            return _Flow(np.empty((0, 2)), np.zeros(0, dtype=np.bool_), np.empty(0, dtype=np.float32))
        settings = self._settings
        start = self._features.uv.astype(np.float32)
        uv, status, residual = cv2.calcOpticalFlowPyrLK(
            self._image,
            image,
            start,
            start.copy(),
            winSize=(settings.window_px, settings.window_px),
            maxLevel=settings.extra_levels,
            criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, settings.iterations, settings.epsilon),
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        )
        positions = np.asarray(uv, dtype=np.float64)
        found = (status[:, 0] == 1) & np.isfinite(positions).all(axis=1)
        return _Flow(positions, found, np.asarray(residual[:, 0], dtype=np.float32))

    def _min_eigenvalue(self, alive: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Smallest eigenvalue of the patches of some live features: a call without iterations, which takes little time.

        OpenCV reports either the residual or the eigenvalue, never both.
        """
        start = self._features.uv[alive].astype(np.float32)
        if self._image is None or not len(start):
            return np.empty(0, dtype=np.float32)
        _, _, eigenvalue = cv2.calcOpticalFlowPyrLK(
            self._image,
            self._image,
            start,
            start.copy(),
            winSize=(self._settings.window_px, self._settings.window_px),
            maxLevel=0,
            criteria=(cv2.TERM_CRITERIA_COUNT, 0, 0.0),
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW | cv2.OPTFLOW_LK_GET_MIN_EIGENVALS,
        )
        return np.asarray(eigenvalue[:, 0], dtype=np.float32) * _EIGENVALUE_UNIT

    def _detect(self, frame: Frame, mask: Mask, alive: int) -> tuple[Features, NDArray[np.float32]]:
        """Test 5: new features, and their responses."""
        if alive >= self._settings.min_features:
            return Features.begin(self._next_id, np.empty((0, 2))), np.empty(0, dtype=np.float32)
        points = keypoints(frame, self._settings.detection)
        rows = mask.claim(points.uv, limit=self._settings.max_features - alive)
        return Features.begin(self._next_id, points.uv[rows]), points.response[rows]
