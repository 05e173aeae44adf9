"""Aligned patches: the patch around each feature is found again shifted, turned and stretched."""

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from tracknoise.checks import Between0And1, Positive, settle_members
from tracknoise.trackers.alignment import Aligned, Alignment, Brightness, Templates, Warp, pyramid_of
from tracknoise.trackers.detection import MOST_FEATURES, Detection
from tracknoise.trackers.features import Features, displacement_px
from tracknoise.trackers.following import Flow, FollowingSettings, FollowingTracker, Order
from tracknoise.trackers.key_frames import KeyFrames, Occasion, Renewal, Template
from tracknoise.trackers.patch_samples import Shape, offsets
from tracknoise.trackers.preprocessing import Preprocessing
from tracknoise.trackers.rejection import Rejection
from tracknoise.trackers.search_start import Guess, Start, guess_from
from tracknoise.trackers.tracker import Frame, SequenceContext


@dataclass(frozen=True, slots=True)
class AlignedPatches(FollowingSettings):
    """Settings of the tracker of aligned patches.

    The other parameters are those of `tracknoise.trackers.following.FollowingSettings`.

    Parameters
    ----------
    window_px, shape
        Side of the patch, px, and which of its pixels count: see `tracknoise.trackers.patch_samples.Shape`.
    warp
        What may happen to the patch besides a shift: see `tracknoise.trackers.alignment.Warp`.
    brightness
        How its gray values may change: see `tracknoise.trackers.alignment.Brightness`.
    template
        Which patch is aligned: see `tracknoise.trackers.key_frames.Template`.
    extra_levels
        Levels of the image pyramid above the full resolution.
    iterations, epsilon
        Convergence at each level: at most this many iterations, or until the update is smaller than `epsilon` px.
    start_at
        Where the search for a feature starts: see `tracknoise.trackers.search_start.Start`. Turn and stretch start from
        those of the step before.
    backward_px
        The patch at the position found is followed back to the previous image, and the feature dropped if that ends
        farther than this from where it was, px. None: it is not followed back.
    min_ncc
        A feature whose warped patch has a lower normalised cross-correlation with its template is dropped. None: any
        stays.
    """

    kind: ClassVar[str] = "patch"
    description: ClassVar[str] = "patches aligned by a shift, a turn (SE(2)) or an affine map, with outlier rejection"
    needs_frames_only: ClassVar[bool] = True

    detection: Detection = field(default_factory=Detection)
    rejection: Rejection = field(default_factory=Rejection)
    window_px: Annotated[int, Ge(3), Le(99)] = 15
    shape: Shape = Shape.square
    warp: Warp = Warp.se2
    brightness: Brightness = Brightness.both
    template: Template = Template.first
    keyframe_share: Between0And1 = 0.5
    keyframe_every: Annotated[int, Ge(1)] | None = None
    extra_levels: Annotated[int, Ge(0), Le(16)] = 3
    iterations: Annotated[int, Ge(1)] = 20
    epsilon: Positive = 0.01
    start_at: Start = Start.last
    backward_px: Positive | None = None
    min_ncc: Between0And1 | None = None
    max_displacement_px: Positive = 64.0
    min_features: Annotated[int, Ge(1)] = 400
    max_features: Annotated[int, Ge(1), Le(MOST_FEATURES)] = 500
    preprocessing: Preprocessing = field(default_factory=Preprocessing)
    order: Order = Order.spacing_first
    detect_at: Occasion = Occasion.every_frame
    reject_at: Occasion = Occasion.every_frame
    max_age: Annotated[int, Ge(1)] | None = None

    def __post_init__(self) -> None:
        settle_members(self, shape=Shape, warp=Warp, brightness=Brightness, template=Template, start_at=Start)
        FollowingSettings.__post_init__(self)

    def start(self, context: SequenceContext) -> FollowingTracker:
        """Start the tracker on one sequence at one speed.

        The quality of an observation is the mean absolute difference between the template and the warped patch, gray
        values after the change of brightness (``patch_residual``), and their normalised cross-correlation
        (``patch_ncc``).
        """
        key_frames = self.key_frames()
        follower = _Warped(self, guess_from(self.start_at, context), key_frames)
        return FollowingTracker(self, follower, self.inliers_of(context), key_frames)


class _Warped:
    """Features whose patches are aligned."""

    quality_names = ("patch_residual", "patch_ncc")

    def __init__(self, settings: AlignedPatches, guess: Guess, key_frames: KeyFrames) -> None:
        self._settings = settings
        self._guess = guess
        self._alignment = Alignment(
            offsets(settings.window_px, settings.shape),
            settings.warp,
            settings.brightness,
            settings.iterations,
            settings.epsilon,
        )
        self._renewal = Renewal(settings.template, key_frames)
        self._templates: list[Templates] = []
        self._matrix = np.empty((0, 2, 2))  # of the features in the latest image

    def follow(self, before: Frame, after: Frame, features: Features) -> Flow:
        """Where features of one image are in the next."""
        settings = self._settings
        self._renew(before, features)
        guess = self._guess(before, after, features)
        seen = self._alignment.align(self._templates, self._levels(after), guess, self._matrix)
        self._matrix = seen.matrix
        is_found = seen.found & self._in_image(seen, after)
        if settings.min_ncc is not None:
            is_found &= seen.ncc >= settings.min_ncc
        if settings.backward_px is not None:
            is_found &= self._gap_px(before, after, features, seen) <= settings.backward_px
        return Flow(seen.uv, is_found, {"patch_residual": seen.residual, "patch_ncc": seen.ncc})

    def _levels(self, frame: Frame) -> list[NDArray[np.float32]]:
        return pyramid_of(frame, self._settings.extra_levels, self._settings.window_px)

    def _renew(self, before: Frame, features: Features) -> None:
        """Cut new templates in the present image, and forget those of features that ended."""
        row = self._renewal.rows(features.ids, before.index)
        new = self._alignment.templates(self._levels(before), features.uv[row < 0])
        present = self._templates or [Templates.empty(len(self._alignment.offsets), self._alignment.warp)] * len(new)
        self._templates = [old.renewed(row, fresh) for old, fresh in zip(present, new, strict=True)]
        self._matrix = np.concatenate([self._matrix, np.eye(2)[None]])[row]

    def _in_image(self, seen: Aligned, frame: Frame) -> NDArray[np.bool_]:
        within = (seen.uv >= 0) & (seen.uv <= np.array(frame.size) - 1)
        return np.asarray(within.all(axis=1), dtype=np.bool_)

    def _gap_px(self, before: Frame, after: Frame, features: Features, seen: Aligned) -> NDArray[np.float64]:
        """How far from where it should the way back ends; infinite if it is lost: (n,)."""
        back = self._alignment.follow(self._levels(after), self._levels(before), seen.uv, seen.uv)
        return np.where(back.found, displacement_px(features.uv, back.uv), np.inf)
