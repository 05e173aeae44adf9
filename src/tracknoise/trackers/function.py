"""A function of your own that follows points from one image to the next, measured as a tracker."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from tracknoise.checks import Between0And1, Positive, require
from tracknoise.exceptions import TrackerError, first_line
from tracknoise.trackers.detection import MOST_FEATURES, Detection
from tracknoise.trackers.features import Features, are_symmetric
from tracknoise.trackers.following import Flow, FollowingSettings, FollowingTracker, Order
from tracknoise.trackers.key_frames import Occasion
from tracknoise.trackers.preprocessing import Preprocessing
from tracknoise.trackers.refinement import Refinement
from tracknoise.trackers.rejection import Model, Rejection
from tracknoise.trackers.tracker import Frame, SequenceContext

Follow = Callable[[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.float64]], tuple[Any, ...]]
"""Two images (height, width) uint8 and points (n, 2) px of the first, to points (n, 2) px of the second and whether
each was found, (n,) bool; and covariances (n, 2, 2) px^2 if it predicts some."""


def _free() -> Rejection:
    return Rejection(model=Model.none)


@dataclass(frozen=True, slots=True)
class Function(FollowingSettings):
    """Settings of a tracker that follows features with a function of your own.

    The other parameters are those of `tracknoise.trackers.following.FollowingSettings`.

    Parameters
    ----------
    function
        Called as ``function(previous, image, points)`` for each image that the tracker sees, if features are alive:
        `previous` and `image` are copies, (height, width) uint8; `points` (n, 2) float64, px, n at least 1. The centre
        of the first pixel is (0, 0). It returns ``points, ok``: (n, 2) positions in `image`, px, and (n,) bool, whether
        each was found. Positions that are not finite count as not found. A third value, (n, 2, 2) px^2, is the
        covariance of each position, NaN where unknown; the first position of a track has none. What it raises is
        raised; `StopIteration`, which would end the measurement unseen, as a `TrackerError`.
    rejection
        Which features are outliers; by default none.
    refine
        Whether positions are refined by Lucas-Kanade, from which the function then goes on: see
        `tracknoise.trackers.refinement.Refinement`.
    """

    kind: ClassVar[str] = "function"
    description: ClassVar[str] = "corners followed by a function in Python"
    needs_frames_only: ClassVar[bool] = True

    function: Follow
    detection: Detection = field(default_factory=Detection)
    rejection: Rejection = field(default_factory=_free)
    max_displacement_px: Positive = 10000.0
    min_features: Annotated[int, Ge(1)] = 1000
    max_features: Annotated[int, Ge(1), Le(MOST_FEATURES)] = 1200
    preprocessing: Preprocessing = field(default_factory=Preprocessing)
    order: Order = Order.spacing_first
    keyframe_share: Between0And1 = 0.5
    keyframe_every: Annotated[int, Ge(1)] | None = None
    detect_at: Occasion = Occasion.every_frame
    reject_at: Occasion = Occasion.every_frame
    max_age: Annotated[int, Ge(1)] | None = None
    refine: Refinement = field(default_factory=Refinement)

    def __post_init__(self) -> None:
        require(callable(self.function), "function", self.function, "a function of two images and points")
        FollowingSettings.__post_init__(self)

    @property
    def name(self) -> str:
        """The name of the function."""
        return getattr(self.function, "__name__", type(self.function).__name__)

    def start(self, context: SequenceContext) -> FollowingTracker:
        """Start the tracker on one sequence at one speed."""
        follower = self.refine.refining(_Called(self.function, self.name))
        return FollowingTracker(self, follower, self.inliers_of(context))


@dataclass(frozen=True, slots=True)
class _Called:
    """Features that a function follows."""

    function: Follow
    name: str
    quality_names: tuple[str, ...] = ()

    def follow(self, before: Frame, after: Frame, features: Features) -> Flow:
        """Where features of one image are in the next."""
        try:
            returned: object = self.function(before.image.copy(), after.image.copy(), features.uv.copy())
        except StopIteration as error:
            raise TrackerError(f"{self.name} raised StopIteration, expected points and ok") from error
        if not isinstance(returned, tuple | list) or len(returned) not in (2, 3):
            raise TrackerError(f"{self.name} returned {_shown(returned)}, expected points and ok")
        n = len(features)
        uv = self._array("points", returned[0], "fiu", (n, 2))
        ok = self._array("ok", returned[1], "b", (n,))
        with np.errstate(over="ignore"):  # of a longer float, which becomes infinite
            uv = uv.astype(np.float64)
        is_found = ok & np.isfinite(uv).all(axis=1)
        return Flow(uv, is_found, self._quality(returned[2], is_found) if len(returned) == 3 else {})

    def _array(self, what: str, value: object, kinds: str, shape: tuple[int, ...]) -> NDArray[Any]:
        """A returned value as an array without masked elements."""
        expected = f"{'bool' if kinds == 'b' else 'numbers'} of shape {shape}"
        try:
            array = _array_of(value)
        except (TypeError, ValueError, RuntimeError, UserWarning) as error:
            message = f"{self.name} returned no array of {what} ({first_line(error)}), expected {expected}"
            raise TrackerError(message) from error
        if array.shape != shape or array.dtype.kind not in kinds:
            raise TrackerError(f"{self.name} returned {what} {_shown(array.data)}, expected {expected}")
        if np.ma.is_masked(array):
            raise TrackerError(f"{self.name} returned {what} with masked elements, expected {expected} without a mask")
        return np.asarray(array)

    def _quality(self, returned: object, is_found: NDArray[np.bool_]) -> dict[str, NDArray[np.float32]]:
        """Entries of the covariances by name."""
        covariance = self._array("covariances", returned, "fiu", (len(is_found), 2, 2))
        with np.errstate(over="ignore", invalid="ignore"):  # of what is refused or lost
            entries = covariance.astype(np.float32)
        beyond = covariance[is_found][np.isfinite(covariance[is_found]) & np.isinf(entries[is_found])]
        if len(beyond):
            stated = f"a covariance of {beyond[0]!s} px^2"
            raise TrackerError(f"{self.name} returned {stated}, expected numbers within the range of float32")
        if not are_symmetric(entries).all():
            raise TrackerError(f"{self.name} returned covariances that are not symmetric, expected (n, 2, 2) px^2")
        return {"cov_uu": entries[:, 0, 0], "cov_uv": entries[:, 0, 1], "cov_vv": entries[:, 1, 1]}


def _array_of(value: object) -> np.ma.MaskedArray[Any, Any]:
    """A value as an array with a mask. `np.ma.masked` in a list is an error, not a warning and NaN."""
    if isinstance(value, np.ndarray):
        return np.ma.asarray(value)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "Warning: converting a masked element")
        return np.ma.asarray(value)


def _shown(value: object) -> str:
    return (
        f"{value.dtype} of shape {value.shape}" if isinstance(value, np.ndarray) else f"of type {type(value).__name__}"
    )
