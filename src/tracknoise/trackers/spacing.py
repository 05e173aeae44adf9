"""Where features may be: outside the margin, and apart from other features, by squares, circles or cells.

Squares are in the way of XIVO, circles of VINS-Mono, cells of a fine grid of OpenVINS.
"""

from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.trackers.detection import (
    SMALLEST_SIDE_PX,
    Detection,
    Detector,
    Keypoints,
    Spacing,
    cell_keypoints,
    keypoints,
    refined,
)
from tracknoise.trackers.tracker import Frame

Floats = NDArray[np.float64]
Births = tuple[Floats, NDArray[np.float32]]
"""Positions (n, 2) of new features, px, and their responses (n,)."""


class Places(Protocol):
    """The places in one image that are free for features."""

    def inside(self, uv: Floats) -> NDArray[np.bool_]:
        """Which positions (n, 2), px, lie in the image and outside the margin: (n,)."""
        ...

    def claim(self, uv: Floats) -> NDArray[np.intp]:
        """Accept live features (n, 2), px, in the given order where their place is free, and return their rows (m,)."""
        ...

    def births(self, frame: Frame, limit: int) -> Births:
        """New features of the image in free places, at most `limit`. Called once, after all claims."""
        ...


def places_in(size: tuple[int, int], detection: Detection) -> Places:
    """All places of an image (width, height), as far apart as the settings say."""
    if detection.spacing is Spacing.squares:
        return Mask(size, detection)
    return CellMask(size, detection) if detection.spacing is Spacing.cells else CircleMask(size, detection)


def _candidates(frame: Frame, detection: Detection, live: Floats) -> Births:
    """Keypoints that may become features; with a grid, those of cells with few enough live features (m, 2)."""
    if detection.grid is None:
        points = keypoints(frame, detection)
        return points.uv, points.response
    points = cell_keypoints(frame, detection, detection.grid)
    counts = np.bincount(_cell(live, frame.size, detection.grid), minlength=detection.grid[0] * detection.grid[1])
    wanted = counts[_cell(points.uv, frame.size, detection.grid)] < detection.refill_below
    return points.uv[wanted], points.response[wanted]


def _cell(uv: Floats, size: tuple[int, int], grid: tuple[int, int]) -> NDArray[np.intp]:
    """Numbers of the cells of a grid over the whole image in which positions (n, 2) are."""
    column, row = np.clip(np.floor(uv * np.array(grid) / np.array(size)), 0, np.array(grid) - 1).astype(np.intp).T
    return np.asarray(column * grid[1] + row, dtype=np.intp)


class Mask:
    """The positions in one image that are still free for features.

    A feature at (u, v) lies on pixel (floor u, floor v). That pixel must be outside the border margin and
    outside the squares of all features that were accepted before. The feature's own square is centred on the
    pixel nearest to it (halves round up). For keypoints, which lie on pixel centres, the two are the same.

    This is XIVO's convention, and it affects results: with the nearest pixel instead, the mean lifetime on the
    7-Scenes sample would be 9.5 frames instead of 8.8 (Lucas-Kanade, OpenCV 4.11's rejection). Shapes: size
    (width, height).
    """

    __slots__ = ("_blocked", "_detection", "_live", "_reach", "_size", "_squares")

    def __init__(self, size: tuple[int, int], detection: Detection) -> None:
        width, height = size
        self._size = size
        self._detection = detection
        self._live: list[Floats] = [np.empty((0, 2))]
        self._reach = detection.square_px // 2
        padding = 2 * self._reach + 1  # no square needs clipping, even one centred beyond the image by rounding
        self._blocked = bytearray((height + padding) * (width + padding))
        self._squares = np.frombuffer(self._blocked, dtype=np.uint8).reshape(height + padding, width + padding)

    def inside(self, uv: Floats) -> NDArray[np.bool_]:
        """Which positions (n, 2) lie on a pixel outside the margin; NaN and those outside the image do not."""
        return _inside(uv, self._size, self._detection.margin_px)

    def births(self, frame: Frame, limit: int) -> Births:
        """The strongest keypoints in free places."""
        uv, response = _candidates(frame, self._detection, np.concatenate(self._live))
        uv = refined(frame, uv, self._detection)  # before the claims: several keypoints may move to one corner
        rows = self.claim(uv, limit=limit)
        return uv[rows], response[rows]

    def claim(self, uv: Floats, *, limit: int | None = None) -> NDArray[np.intp]:
        """Accept features in the given order if their pixel is free; each accepted feature blocks its square.

        Shapes: uv (n, 2) px; returns (m,). Indices of the accepted features, ascending. `uv`: NaN and positions outside
        the image are never free.
        """
        rows = np.flatnonzero(self.inside(uv))
        column, row = np.floor(uv[rows]).astype(np.intp).T + self._reach
        place = row * self._squares.shape[1] + column
        free = np.flatnonzero(self._squares.ravel()[place] == 0)
        rows, place = rows[free], place[free]
        left, top = np.floor(uv[rows] + 0.5).astype(np.intp).T.tolist()
        rows = rows[self._first_come(place.tolist(), left, top, len(rows) if limit is None else limit)]
        self._live.append(uv[rows])
        return rows

    def _first_come(self, places: list[int], left: list[int], top: list[int], limit: int) -> list[int]:
        """The sequential loop. Reading a byte string is much faster than reading an array, and both share memory."""
        blocked, squares, side = self._blocked, self._squares, 2 * self._reach + 1
        kept: list[int] = []
        for index, place in enumerate(places):
            if len(kept) >= limit:
                break
            if not blocked[place]:
                x, y = left[index], top[index]
                squares[y : y + side, x : x + side] = 1
                kept.append(index)
        return kept


def _inside(pixel: Floats, size: tuple[int, int], margin_px: int) -> NDArray[np.bool_]:
    """Which positions (n, 2) lie outside the margin of an image; NaN do not."""
    inside = (pixel >= margin_px) & (pixel < np.array(size) - margin_px)
    return np.asarray(inside[:, 0] & inside[:, 1], dtype=np.bool_)


class CircleMask:
    """The positions in one image that are outside the circles of all accepted features, in the way of VINS-Mono.

    A feature lies on the pixel nearest to it, halves to the even one. That pixel must be outside the border margin and
    outside the circles of the features that were accepted before. Its own circle is the disc that OpenCV draws around
    it. New corners of `gftt` without a grid are detected outside the circles only, so that `quality` is a share of the
    strongest free one, and are at least `distance_px` apart from each other. With `Spacing.anms`, new features have the
    largest `suppression_radii`.
    """

    __slots__ = ("_detection", "_free", "_live", "_size")

    def __init__(self, size: tuple[int, int], detection: Detection) -> None:
        self._size = size
        self._detection = detection
        self._free = np.full(size[::-1], 255, dtype=np.uint8)
        self._live: list[Floats] = [np.empty((0, 2))]

    def inside(self, uv: Floats) -> NDArray[np.bool_]:
        """Which positions (n, 2) lie on a pixel outside the margin; NaN and those outside the image do not."""
        return _inside(np.rint(uv), self._size, self._detection.margin_px)

    def claim(self, uv: Floats, *, limit: int | None = None) -> NDArray[np.intp]:
        """Accept features in the given order if their pixel is free; each accepted feature blocks its circle."""
        rows = np.flatnonzero(self.inside(uv))
        kept: list[int] = []
        most = len(rows) if limit is None else limit
        for row, (x, y) in zip(rows.tolist(), np.rint(uv[rows]).astype(int).tolist(), strict=True):
            if len(kept) >= most:
                break
            if self._free[y, x]:
                cv2.circle(self._free, (x, y), self._detection.distance_px, 0, -1)
                kept.append(row)
        accepted = np.array(kept, dtype=np.intp)
        self._live.append(uv[accepted])
        return accepted

    def births(self, frame: Frame, limit: int) -> Births:
        """The strongest keypoints in free places."""
        detection = self._detection
        adaptive = detection.spacing is Spacing.anms
        if (
            detection.detector is Detector.gftt
            and detection.grid is None
            and detection.network is None
            and not adaptive
        ):
            uv, response = self._strongest_free(frame, limit)
            return refined(frame, uv, detection), response
        live = np.concatenate(self._live)
        uv, response = _candidates(frame, detection, live)
        uv = refined(frame, uv, detection)
        if adaptive:
            order = np.argsort(-suppression_radii(uv, response, live), kind="stable")
            uv, response = uv[order], response[order]
        rows = self.claim(uv, limit=limit)
        return uv[rows], response[rows]

    def _strongest_free(self, frame: Frame, limit: int) -> Births:
        detection, border = self._detection, self._detection.margin_px - 1  # it finds none on the outermost pixels
        if border > 0:
            self._free[:border], self._free[-border:], self._free[:, :border], self._free[:, -border:] = 0, 0, 0, 0
        if limit < 1 or min(frame.size) < SMALLEST_SIDE_PX:
            return np.empty((0, 2)), np.empty(0, dtype=np.float32)
        detected: tuple[Any, Any] = cv2.goodFeaturesToTrackWithQuality(
            frame.image, limit, detection.quality, detection.distance_px, self._free, blockSize=detection.block_px
        )
        corners, response = detected
        if corners is None:
            return np.empty((0, 2)), np.empty(0, dtype=np.float32)
        return np.asarray(corners, dtype=np.float64)[:, 0], np.asarray(response, dtype=np.float32)[:, 0]


_BLOCK = 256
_ROBUSTNESS = 0.9
"""A keypoint suppresses those whose response is smaller than this share of its own."""
_MOST_SUPPRESSED = 3000
"""Of more keypoints, only the strongest have a radius: time grows with the square."""


def suppression_radii(uv: Floats, response: NDArray[np.float32], live: Floats) -> Floats:
    """How far keypoints are from what suppresses them: live features and clearly stronger keypoints.

    The keypoints with the largest radii are as many as wanted that are spread over the image. A response is clearly
    smaller below 0.9 of another.

    `uv`, `response`: (n, 2) float64, px, and (n,): keypoints; `live`: (m, 2) float64, px: features that suppress all
    keypoints. Returns (n,) float64: px; infinite for the strongest without live features, 0 beyond the 3000 strongest.

    M. Brown, R. Szeliski, S. Winder, Multi-Image Matching using Multi-Scale Oriented Patches, CVPR 2005.
    """
    radii = np.zeros(len(uv))
    strongest = np.argsort(-response, kind="stable")[:_MOST_SUPPRESSED]
    positions, strength = uv[strongest], response[strongest]
    stronger = np.searchsorted(-strength, -strength / _ROBUSTNESS)  # how many are clearly stronger than each
    for start in range(0, len(positions), _BLOCK):
        rows = slice(start, start + _BLOCK)
        suppressors = np.concatenate([positions[: stronger[rows].max()], live])
        if not len(suppressors):
            radii[strongest[rows]] = np.inf
            continue
        squared = (positions[rows, :1] - suppressors[:, 0]) ** 2 + (positions[rows, 1:] - suppressors[:, 1]) ** 2
        weaker = np.arange(len(suppressors)) >= stronger[rows, None]
        weaker[:, len(suppressors) - len(live) :] = False
        squared[weaker] = np.inf
        radii[strongest[rows]] = np.sqrt(squared.min(axis=1))
    return radii


class CellMask:
    """The positions in one image whose cell of a fine grid is free, in the way of OpenVINS.

    A feature lies on pixel (floor u, floor v). A live feature is accepted if that pixel is outside the border margin
    and no feature before it is in the same cell of `distance_px`. A keypoint may become a feature if its pixel is more
    than `distance_px` from those of all live features in u or in v, and if its cell is free after its refinement; a
    margin does not apply to it. The square around a live feature that is nearer to the border than that blocks nothing.
    Cells that do not fit into the image on the right and below hold no feature.
    """

    __slots__ = ("_blocked", "_detection", "_live", "_size", "_taken")

    def __init__(self, size: tuple[int, int], detection: Detection) -> None:
        side = detection.distance_px
        self._size = size
        self._detection = detection
        self._taken = np.zeros((size[0] // side, size[1] // side), dtype=np.bool_)
        self._blocked = np.zeros(size[::-1], dtype=np.bool_)
        self._live: list[Floats] = [np.empty((0, 2))]

    def inside(self, uv: Floats) -> NDArray[np.bool_]:
        """Which positions (n, 2) lie on a pixel outside the margin; NaN and those outside the image do not."""
        return _inside(np.floor(uv), self._size, self._detection.margin_px)

    def claim(self, uv: Floats) -> NDArray[np.intp]:
        """Accept live features in the given order if their cell is free; each blocks its cell and its square."""
        rows = np.flatnonzero(self.inside(uv))
        accepted = rows[self._first_come(uv[rows], len(rows))]
        reach = self._detection.distance_px
        for x, y in np.floor(uv[accepted]).astype(int).tolist():
            if reach <= x < self._size[0] - reach and reach <= y < self._size[1] - reach:
                self._blocked[y - reach : y + reach + 1, x - reach : x + reach + 1] = True
        self._live.append(uv[accepted])
        return accepted

    def births(self, frame: Frame, limit: int) -> Births:
        """The strongest keypoints in free places."""
        uv, response = _candidates(frame, self._detection, np.concatenate(self._live))
        column, row = np.floor(uv).astype(np.intp).T
        away = ~self._blocked[row, column]
        uv, response = refined(frame, uv[away], self._detection), response[away]
        rows = self._first_come(uv, limit)
        return uv[rows], response[rows]

    def _first_come(self, uv: Floats, limit: int) -> list[int]:
        """Rows of positions whose cells are free, in the given order; each takes its cell."""
        kept: list[int] = []
        for index, (x, y) in enumerate(np.floor(uv / self._detection.distance_px).astype(int).tolist()):
            if len(kept) >= limit:
                break
            if 0 <= x < self._taken.shape[0] and 0 <= y < self._taken.shape[1] and not self._taken[x, y]:
                self._taken[x, y] = True
                kept.append(index)
        return kept


def spread_keypoints(frame: Frame, detection: Detection) -> Keypoints:
    """Keypoints of the whole image to be matched: of the cells of a grid, kept apart, and refined, by the settings.

    Squares do not keep them apart, and their margin does not apply: circles, or the cells of `Spacing.cells`, do. With
    `Spacing.anms` circles do as well: all keypoints are matched, so that none is farthest.
    """
    points = keypoints(frame, detection) if detection.grid is None else cell_keypoints(frame, detection, detection.grid)
    if detection.spacing is not Spacing.squares:
        rows = places_in(frame.size, detection).claim(points.uv)
        points = Keypoints(points.raw, points.order[rows], points.uv[rows], points.response[rows])
    if not detection.subpixel_px:
        return points
    uv = refined(frame, points.uv, detection)
    raw = [_at(points.raw[index], u, v) for index, (u, v) in zip(points.order.tolist(), uv.tolist(), strict=True)]
    return Keypoints(raw, np.arange(len(raw)), uv, points.response)


def _at(point: cv2.KeyPoint, u: float, v: float) -> cv2.KeyPoint:
    return cv2.KeyPoint(u, v, point.size, point.angle, point.response, point.octave, point.class_id)
