"""Pyramidal Lucas-Kanade: the patch around each feature is aligned from frame to frame."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, ClassVar, Protocol

import cv2
import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from tracknoise.checks import Between0And1, Positive, settle_members
from tracknoise.trackers.detection import MOST_FEATURES, Detection
from tracknoise.trackers.features import Features, displacement_px
from tracknoise.trackers.following import Flow, FollowingSettings, FollowingTracker, Order
from tracknoise.trackers.gradient import shift_covariance
from tracknoise.trackers.key_frames import KeyFrames, Occasion, Renewal, Template
from tracknoise.trackers.patch_samples import correlation, offsets, sampled
from tracknoise.trackers.preprocessing import Preprocessing
from tracknoise.trackers.rejection import Inliers, Rejection
from tracknoise.trackers.search_start import Guess, Start, at_last, guess_from
from tracknoise.trackers.tracker import Frame, SequenceContext

_EIGENVALUE_UNIT = np.float32(1024)  # OpenCV's derivatives are 32 times too large, its structure tensor 2^20 too small

LARGEST_WINDOW_PX, MOST_LEVELS = 999, 16
"""Beyond them OpenCV takes all memory; no image is as large."""

Positions = NDArray[np.float32]


class BackwardStart(StrEnum):
    """Where the search back starts: at the position to which it should lead, or at the one that was found."""

    previous = "previous"
    present = "present"


@dataclass(frozen=True, slots=True)
class LucasKanade(FollowingSettings):
    """Settings of the Lucas-Kanade tracker. The defaults are those of XIVO's, which the paper used.

    The other parameters are those of `tracknoise.trackers.following.FollowingSettings`.

    Parameters
    ----------
    window_px
        Side of the patch, px.
    extra_levels
        Levels of the image pyramid above the full resolution.
    iterations, epsilon
        Convergence: at most this many iterations, or until the update is smaller than `epsilon` px.
    start_at
        Where the search for a feature starts: see `tracknoise.trackers.search_start.Start`.
    template
        Which patch is aligned: see `tracknoise.trackers.key_frames.Template`.
    min_ncc
        A feature whose window has a lower normalised cross-correlation with that of its first frame is dropped. None:
        any stays. It does not allow for a turn or a change of size.
    backward_px
        Each feature is followed back, and dropped if that ends farther than this from where it began, px. None: it is
        not followed back.
    backward_levels, backward_start
        Of the search back: levels of the pyramid above the full resolution (None: `extra_levels`), and where it starts.
    covariance
        Whether the covariance that least squares promise is reported, which every report then judges.
    """

    kind: ClassVar[str] = "lucas-kanade"
    description: ClassVar[str] = "corners tracked by pyramidal Lucas-Kanade, with outlier rejection"
    needs_frames_only: ClassVar[bool] = True

    detection: Detection = field(default_factory=Detection)
    rejection: Rejection = field(default_factory=Rejection)
    window_px: Annotated[int, Ge(3), Le(LARGEST_WINDOW_PX)] = 15
    extra_levels: Annotated[int, Ge(0), Le(MOST_LEVELS)] = 4
    iterations: Annotated[int, Ge(1)] = 30
    epsilon: Positive = 0.01
    max_displacement_px: Positive = 64.0
    min_features: Annotated[int, Ge(1)] = 1000
    max_features: Annotated[int, Ge(1), Le(MOST_FEATURES)] = 1200
    preprocessing: Preprocessing = field(default_factory=Preprocessing)
    order: Order = Order.spacing_first
    start_at: Start = Start.last
    template: Template = Template.previous
    keyframe_share: Between0And1 = 0.5
    keyframe_every: Annotated[int, Ge(1)] | None = None
    min_ncc: Between0And1 | None = None
    backward_px: Positive | None = None
    backward_levels: Annotated[int, Ge(0), Le(MOST_LEVELS)] | None = None
    backward_start: BackwardStart = BackwardStart.present
    detect_at: Occasion = Occasion.every_frame
    reject_at: Occasion = Occasion.every_frame
    max_age: Annotated[int, Ge(1)] | None = None
    covariance: bool = False

    def __post_init__(self) -> None:
        settle_members(self, start_at=Start, template=Template, backward_start=BackwardStart)
        FollowingSettings.__post_init__(self)

    def start(self, context: SequenceContext) -> "LucasKanadeTracker":
        """Start the tracker on one sequence at one speed."""
        return LucasKanadeTracker(self, self.inliers_of(context), guess_from(self.start_at, context))


class LucasKanadeTracker(FollowingTracker):
    """The Lucas-Kanade tracker on one sequence: see `tracknoise.trackers.following.FollowingTracker` for its tests.

    The quality of an observation is the mean absolute difference between the feature's patch and that around it in the
    current image (``lk_residual``, gray values), and the smallest eigenvalue of the mean structure tensor of its patch,
    from Scharr derivatives (``lk_min_eigenvalue``, (gray values / px)^2). The patch is that of the template. Both are
    OpenCV's; the eigenvalue is scaled so that a derivative has its unit. After an equalisation, gray values are those
    of the equalised image. With `covariance`, it is also ``lk_cov_uu``, ``lk_cov_uv`` and ``lk_cov_vv``, px^2
    (`tracknoise.trackers.gradient.shift_covariance`).
    """

    def __init__(self, settings: LucasKanade, inliers: Inliers, guess: Guess = at_last) -> None:
        key_frames = settings.key_frames()
        super().__init__(settings, PatchFollower(settings, guess, key_frames), inliers, key_frames)


_COVARIANCE = ("lk_cov_uu", "lk_cov_uv", "lk_cov_vv")


class PatchFollower:
    """Alignment of the patches of features, each from where a guess says."""

    def __init__(self, settings: LucasKanade, guess: Guess, key_frames: KeyFrames | None = None) -> None:
        self._settings = settings
        self._guess = guess
        self._renewal = Renewal(settings.template, key_frames)
        self._images: dict[int, NDArray[np.uint8]] = {}
        self._index, self._uv = np.empty(0, dtype=np.int64), np.empty((0, 2))  # of the templates
        self._agreement = None if settings.min_ncc is None else _Agreement(settings.window_px, settings.min_ncc)

    @property
    def quality_names(self) -> tuple[str, ...]:
        """See `LucasKanadeTracker`."""
        return ("lk_residual", "lk_min_eigenvalue", *(_COVARIANCE if self._settings.covariance else ()))

    def follow(self, before: Frame, after: Frame, features: Features) -> Flow:
        """Where features of one image are in the next."""
        n, settings = len(features), self._settings
        uv, is_found = np.empty((n, 2)), np.zeros(n, dtype=np.bool_)
        quality = {name: np.empty(n, dtype=np.float32) for name in self.quality_names}
        with np.errstate(over="ignore"):  # of a position that another front end reports, which is then not refined
            guess = self._guess(before, after, features).astype(np.float32)
        for image, patch, rows in self._templates(before, features):
            target, reached, quality["lk_residual"][rows] = aligned(
                settings, image, after.image, patch, guess[rows], settings.extra_levels
            )
            uv[rows] = target
            if settings.backward_px is not None:
                reached &= self._gap_px(image, after.image, patch, target) <= settings.backward_px
            is_found[rows] = reached
            quality["lk_min_eigenvalue"][rows] = self._min_eigenvalue(image, patch)
        is_found &= np.isfinite(uv).all(axis=1)
        if settings.covariance:
            entries = shift_covariance(after, uv, quality["lk_residual"], window_px=settings.window_px)
            quality |= dict(zip(_COVARIANCE, entries.T, strict=True))
        if self._agreement is not None:
            is_found &= self._agreement.holds(before, after, features, np.where(is_found[:, None], uv, 0.0))
        return Flow(uv, is_found, quality)

    def _templates(
        self, before: Frame, features: Features
    ) -> Iterator[tuple[NDArray[np.uint8], Positions, NDArray[np.intp]]]:
        """Images with patches, the positions of these (m, 2), and the rows of their features."""
        row = self._renewal.rows(features.ids, before.index)
        self._index = np.where(row < 0, before.index, np.append(self._index, before.index)[row])
        self._uv = np.where(row[:, None] < 0, features.uv, np.append(self._uv, [[0.0, 0.0]], axis=0)[row])
        self._images[before.index] = before.image
        self._images = {index: self._images[index] for index in np.unique(self._index).tolist()}
        for index, image in self._images.items():
            rows = np.flatnonzero(self._index == index)
            yield image, self._uv[rows].astype(np.float32), rows

    def _gap_px(
        self, image: NDArray[np.uint8], after: NDArray[np.uint8], patch: Positions, target: Positions
    ) -> NDArray[np.float64]:
        """How far from where it should the way back from positions (n, 2) ends; infinite if it is lost: (n,)."""
        settings = self._settings
        levels = settings.extra_levels if settings.backward_levels is None else settings.backward_levels
        guess = patch if settings.backward_start is BackwardStart.previous else target
        back, is_found, _ = aligned(settings, after, image, target, guess, levels)
        return np.where(is_found, displacement_px(patch.astype(np.float64), back.astype(np.float64)), np.inf)

    def _min_eigenvalue(self, image: NDArray[np.uint8], patch: Positions) -> NDArray[np.float32]:
        """Smallest eigenvalue of patches at positions (n, 2): a call without iterations, which takes little time.

        OpenCV reports either the residual or the eigenvalue, never both.
        """
        _, _, eigenvalue = cv2.calcOpticalFlowPyrLK(
            image,
            image,
            patch,
            patch.copy(),
            winSize=(self._settings.window_px, self._settings.window_px),
            maxLevel=0,
            criteria=(cv2.TERM_CRITERIA_COUNT, 0, 0.0),
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW | cv2.OPTFLOW_LK_GET_MIN_EIGENVALS,
        )
        return np.asarray(eigenvalue[:, 0], dtype=np.float32) * _EIGENVALUE_UNIT


class Alignment(Protocol):
    """Settings of an alignment: see `LucasKanade`."""

    @property
    def window_px(self) -> int:
        """Side of the patch, px."""
        ...

    @property
    def iterations(self) -> int:
        """At most so many."""
        ...

    @property
    def epsilon(self) -> float:
        """A smaller update ends it, px."""
        ...


def aligned(
    settings: Alignment,
    image: NDArray[np.uint8],
    after: NDArray[np.uint8],
    patch: Positions,
    guess: Positions,
    levels: int,
) -> tuple[Positions, NDArray[np.bool_], NDArray[np.float32]]:
    """Positions (n, 2) of patches in another image, whether they were found, and their residuals (n,)."""
    uv, status, residual = cv2.calcOpticalFlowPyrLK(
        image,
        after,
        patch,
        guess.copy(),
        winSize=(settings.window_px, settings.window_px),
        maxLevel=levels,
        criteria=(cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, settings.iterations, settings.epsilon),
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(uv, dtype=np.float32), status[:, 0] == 1, np.asarray(residual[:, 0], dtype=np.float32)


class _Agreement:
    """Whether features still look as they did in their first frame."""

    def __init__(self, window_px: int, min_ncc: float) -> None:
        self._offsets = offsets(window_px)
        self._least = min_ncc
        self._renewal = Renewal(Template.first)
        self._first = np.empty((0, len(self._offsets)), dtype=np.float32)

    def holds(self, before: Frame, after: Frame, features: Features, uv: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which features (n,) agree with their first window at (n, 2) positions in the next image."""
        row = self._renewal.rows(features.ids, before.index)
        first = np.empty((len(row), len(self._offsets)), dtype=np.float32)
        first[row >= 0] = self._first[row[row >= 0]]
        first[row < 0] = self._windows(before, features.uv[row < 0])
        self._first = first
        return np.asarray(correlation(first, self._windows(after, uv)) >= self._least, dtype=np.bool_)

    def _windows(self, frame: Frame, uv: NDArray[np.float64]) -> NDArray[np.float32]:
        image = frame.memo("float32", lambda image: image.astype(np.float32))
        return sampled(image, uv.astype(np.float32)[:, None] + self._offsets)
