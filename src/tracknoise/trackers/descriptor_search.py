"""Features of one camera, searched by their descriptors among the keypoints of the image of a second one beside it.

In rectified images, both have about the same row. A match may be refined along the row: the patch around the feature is
laid on each pixel near the keypoint, and the smallest sum of absolute differences, between pixels by a parabola,
decides. Features of coarser levels of an image pyramid are refined at that level.
"""

from dataclasses import dataclass, field
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import NDArray

from tracknoise.checks import Positive, require, require_bounds, settle_members
from tracknoise.geometry.stereo_pair import StereoPair
from tracknoise.trackers.correspondence import Described, Descriptor, describe, describe_at
from tracknoise.trackers.detection import Detection
from tracknoise.trackers.matching import DISTANCE, mutual_nearest
from tracknoise.trackers.rectified_rows import Array, Images, RectifiedRows, require_depths, vertex
from tracknoise.trackers.tracker import Frame

_LEVEL_SCALE = 1.2
"""Of two successive levels of ORB's pyramid."""


@dataclass(frozen=True, slots=True)
class DescriptorSearch:
    """Settings of the search.

    Parameters
    ----------
    detection
        How keypoints of the second camera are detected; margin and squares do not apply. Where they are described with
        their own size and direction (see `tracknoise.trackers.correspondence.describe`), features must be keypoints of
        the same detection, or are not found.
    descriptor
        What features are recognised by: see `tracknoise.trackers.correspondence.Descriptor`, but not network.
    max_distance
        Largest distance of descriptors; of bits, the root of how many differ. None: any.
    rows_px
        A keypoint farther than this from the row of a feature is not compared with it, px of the level of the keypoint.
    nearest_m, farthest_m
        Depths of points, metres; with others they are not found.
    refined_px
        Of the refinement: half of the side of the patch, without its central pixel, and largest shift, px of the level.
        0: positions are those of keypoints.
    difference_ratio
        A match whose sum of absolute differences is above this times the median in the image is dropped. None: none is.
    """

    detection: Detection = field(default_factory=Detection)
    descriptor: Descriptor = Descriptor.orb
    max_distance: Positive | None = None
    rows_px: Positive = 2.0
    nearest_m: Positive = 0.5
    farthest_m: Positive = 1000.0
    refined_px: Annotated[int, Ge(0), Le(10)] = 5
    difference_ratio: Annotated[float, Gt(1)] | None = None

    def __post_init__(self) -> None:
        settle_members(self, descriptor=Descriptor)
        require_bounds(self)
        known = self.descriptor is not Descriptor.network
        require(known, "descriptors.descriptor", str(self.descriptor), "one that has descriptors at any position")
        require_depths("descriptors", self)

    def of(self, pair: StereoPair) -> "KeypointSearch":
        """The search in the images of two cameras.

        Raises
        ------
        DataError
            If the second camera is not beside the first.
        """
        return KeypointSearch(self, RectifiedRows.of(pair))


@dataclass(frozen=True, slots=True, eq=False)
class KeypointSearch:
    """The search among the keypoints of a second camera."""

    settings: DescriptorSearch
    rows: RectifiedRows

    def found(self, images: tuple[Frame, Frame], first_uv: Array) -> Array:
        """(n, 2): positions in the second image of features (n, 2) of the first; NaN where they are not found."""
        given, found = self.settings, np.full(first_uv.shape, np.nan)
        described, which = describe_at(images[0], first_uv, given.detection, given.descriptor)
        features = np.flatnonzero(which >= 0)
        keypoints, which = describe(images[1], given.detection, given.descriptor), which[features]
        uv, other = self.rows.from_first(first_uv[features]), self.rows.from_second(keypoints.uv)
        level = described.level[which]
        allowed = self._allowed(uv, level, other, keypoints)
        matches = mutual_nearest(described.descriptors[which], keypoints.descriptors, allowed)
        if given.max_distance is not None:
            matches = matches.chosen(matches.quality[DISTANCE] <= given.max_distance)
        rows, columns = matches.query_rows, matches.train_rows
        if not given.refined_px:
            found[features[rows]] = keypoints.uv[columns]
            return found
        both = self.rows.images((images[0].image, images[1].image))
        found[features[rows]] = self.rows.to_second(self._refined(both, uv[rows], other[columns], level[rows]))
        return found

    def _allowed(self, uv: Array, level: NDArray[np.intp], other: Array, keypoints: Described) -> NDArray[np.bool_]:
        """(n, m): which keypoints are near the rows of features, at a depth and a level that they may have."""
        near = np.abs(other[:, 1] - uv[:, 1, None]) <= self.settings.rows_px * _LEVEL_SCALE**keypoints.level
        near &= np.abs(keypoints.level - level[:, None]) <= 1
        return near & self.rows.in_range(uv[:, :1] - other[:, 0], self.settings)

    def _refined(self, images: Images, uv: Array, other: Array, level: NDArray[np.intp]) -> Array:
        """(n, 2): rectified positions of matches, on the rows of their features; NaN of those that are dropped."""
        given, u, difference = self.settings, np.full(len(uv), np.nan), np.full(len(uv), np.nan)
        for step in np.unique(level).tolist():
            rows = np.flatnonzero(level == step)
            u[rows], difference[rows] = _on_rows(images, uv[rows], other[rows], _LEVEL_SCALE**step, given.refined_px)
        good = self.rows.in_range(uv[:, 0] - u, given)
        if given.difference_ratio is not None and good.any():
            good &= difference <= given.difference_ratio * np.median(difference[good])
        return np.where(good[:, None], np.column_stack([u, uv[:, 1]]), np.nan)


def _on_rows(images: Images, uv: Array, other: Array, scale: float, half: int) -> tuple[Array, Array]:
    """(n,) each: where patches are along their rows, from near other positions, and their differences; NaN if nowhere.

    Positions (n, 2) are those of images `scale` times as large as those in which patches have a side of 2 half + 1 px.
    """
    size = tuple(max(1, round(side / scale)) for side in images[0].shape[::-1])
    first, second = (np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.int32) for image in images)
    shrunk = np.array(images[0].shape[::-1]) / size
    (u, v), (start, _) = (np.rint((places + 0.5) / shrunk - 0.5).T for places in (uv, other))
    inside = (np.minimum(u, v) >= half) & (u < size[0] - half) & (v < size[1] - half)
    inside &= (start >= 2 * half) & (start < size[0] - 2 * half)
    found, difference = np.full(len(uv), np.nan), np.full(len(uv), np.nan)
    around, along = np.arange(-half, half + 1), np.arange(-2 * half, 2 * half + 1)
    for row in np.flatnonzero(inside).tolist():
        lines = (int(v[row]) + around)[:, None]
        patch = first[lines, int(u[row]) + around]
        places = np.lib.stride_tricks.sliding_window_view(second[lines, int(start[row]) + along], len(around), axis=1)
        differences = np.abs(places - patch[:, None]).sum(axis=(0, 2))
        best = int(np.argmin(differences))
        if 0 < best < len(differences) - 1:
            moved = start[row] + best - half + vertex(differences, best) - u[row]
            found[row], difference[row] = uv[row, 0] + shrunk[0] * moved, differences[best]
    return found, difference
