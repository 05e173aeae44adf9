"""Inverse-compositional alignment: how a patch of one image is shifted, turned and stretched in another.

Many patches are aligned at once, from coarse to fine.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.trackers.patch_samples import correlation, sampled
from tracknoise.trackers.tracker import Frame

Floats = NDArray[np.float32]

_LEAST_EIGENVALUE = 0.1
"""A patch with less texture cannot be found: (gray values / px)^2, OpenCV's default for Lucas-Kanade."""
_RIDGE = 1e-6
"""Added to normal equations, as a share of their trace, so that they can always be solved."""
_LEAST_SHARE = 0.5
"""A patch with a smaller share of its samples in the image cannot be found."""
_LEAST_AREA = 0.01
"""A step that shrinks the area of a patch more than to this share makes it a point, which is then not found."""


class Warp(StrEnum):
    """What may happen to a patch.

    shift: nothing else. se2: a shift and a turn. affine: an affine map, which small or plain patches hardly determine.
    """

    shift = "shift"
    se2 = "se2"
    affine = "affine"


class Brightness(StrEnum):
    """How gray values of a patch may differ from those of its template.

    same: not at all. offset: by one number. gain: by one factor, so that each patch is divided by its mean. both: by a
    factor and a number.
    """

    same = "same"
    offset = "offset"
    gain = "gain"
    both = "both"


def pyramid(image: NDArray[np.uint8], levels: int, smallest_px: int) -> list[Floats]:
    """The image and smaller ones, each half as large, as float32; at most `levels` more, of no less than `smallest_px`.

    The pixel (2u, 2v) of a level lies at (u, v) in the next.
    """
    shown = [image.astype(np.float32)]
    while len(shown) <= levels and min(shown[-1].shape) >= 2 * smallest_px:
        shown.append(np.asarray(cv2.pyrDown(shown[-1]), dtype=np.float32))
    return shown


def pyramid_of(frame: Frame, levels: int, smallest_px: int) -> list[Floats]:
    """The `pyramid` of a frame, which trackers share."""
    return frame.memo(("pyramid", levels, smallest_px), lambda image: pyramid(image, levels, smallest_px))


@dataclass(frozen=True, slots=True)
class Templates:
    """Patches at one level of a pyramid."""

    values: Floats  # (n, p): gray values; NaN where a sample is not in the image
    # (n, k, p): their derivatives by the k parameters of the warp, without what a change of brightness explains; 0
    # where a sample is missing
    steepest: Floats
    inverse: NDArray[np.float64]  # (n, k, k): inverses of the products of the derivatives, summed over the patch

    @classmethod
    def cut(cls, image: Floats, uv: Floats, offsets: Floats, warp: Warp, brightness: Brightness) -> "Templates":
        """Patches around positions in a level of a pyramid.

        Shapes: image (height, width), uv (n, 2) px of the level, offsets (p, 2) px. Derivatives are central
        differences, smoothed across by Scharr's weights.
        """
        places = uv[:, None] + offsets
        values = sampled(image, places)
        along = [cv2.Scharr(image, cv2.CV_32F, *axis, scale=1 / 32) for axis in ((1, 0), (0, 1))]
        du, dv = (sampled(np.asarray(derivative, dtype=np.float32), places) for derivative in along)
        steepest = np.stack(_by_parameter(du, dv, offsets, warp), axis=1)
        steepest[np.broadcast_to(~np.isfinite(values)[:, None], steepest.shape)] = 0
        steepest = _unexplained(steepest, values, brightness)
        return cls(values, steepest, _inverse(steepest))

    @classmethod
    def empty(cls, samples: int, warp: Warp) -> "Templates":
        """No patches."""
        k = _PARAMETERS[warp]
        return cls(np.empty((0, samples), np.float32), np.empty((0, k, samples), np.float32), np.empty((0, k, k)))

    def renewed(self, row: NDArray[np.intp], new: "Templates") -> "Templates":
        """These in another order: `row` (m,) is which, or -1 for the next of `new`."""
        source = np.where(row < 0, len(self.values) + np.cumsum(row < 0) - 1, row)
        values, steepest, inverse = (
            np.concatenate([getattr(self, name), getattr(new, name)])[source] for name in self.__slots__
        )
        return Templates(values, steepest, inverse)


_PARAMETERS = {Warp.shift: 2, Warp.se2: 3, Warp.affine: 6}


def _by_parameter(du: Floats, dv: Floats, offsets: Floats, warp: Warp) -> list[Floats]:
    """Derivatives (n, p) of gray values by u and v, and by an angle or the four entries of a matrix."""
    x, y = offsets.T
    if warp is Warp.shift:
        return [du, dv]
    return [du, dv, dv * x - du * y] if warp is Warp.se2 else [du, dv, du * x, du * y, dv * x, dv * y]


def _unexplained(steepest: Floats, values: Floats, brightness: Brightness) -> Floats:
    """Derivatives (n, k, p) without their part along changes of brightness, with which no warp can be confused."""
    inside = np.isfinite(values)
    plain = np.where(inside, values, 0)
    ones = inside.astype(np.float32)
    basis = {Brightness.same: [], Brightness.offset: [ones], Brightness.gain: [plain], Brightness.both: [ones, plain]}
    done: list[Floats] = []
    for vector in basis[brightness]:
        for earlier in done:
            vector = vector - earlier * _total(vector * earlier)
        size = np.sqrt(_total(vector * vector))
        done.append(np.asarray(vector / np.where(size > 0, size, 1), dtype=np.float32))
    for vector in done:
        steepest = steepest - vector[:, None] * np.einsum("np,nkp->nk", vector, steepest)[:, :, None]
    return steepest


def _total(values: Floats | NDArray[np.bool_]) -> Floats:
    """Sums (n, 1) over patches (n, p)."""
    return np.asarray(values.sum(axis=1, keepdims=True), dtype=np.float32)


def _inverse(steepest: Floats) -> NDArray[np.float64]:
    """See `Templates.inverse`."""
    normal = np.einsum("nip,njp->nij", steepest, steepest).astype(np.float64)
    trace = np.trace(normal, axis1=1, axis2=2)[:, None]
    diagonal = np.arange(normal.shape[1])
    normal[:, diagonal, diagonal] += _RIDGE * trace + (trace == 0)
    return np.asarray(np.linalg.inv(normal), dtype=np.float64)


def _as_bright(seen: Floats, template: Floats, brightness: Brightness) -> Floats:
    """Gray values (n, p) of the present image, as bright as the template (n, p): what both have decides."""
    if brightness is Brightness.same:
        return seen
    shared = np.isfinite(seen) & np.isfinite(template)
    count = np.maximum(_total(shared), 1)
    mean, wanted_mean = (_total(np.where(shared, values, 0)) / count for values in (seen, template))
    gain = np.ones_like(mean)
    if brightness is Brightness.gain:
        np.divide(wanted_mean, mean, out=gain, where=mean > 0)
    elif brightness is Brightness.both:
        spread, wanted = (
            np.sqrt(_total(np.where(shared, values - middle, 0) ** 2))
            for values, middle in ((seen, mean), (template, wanted_mean))
        )
        np.divide(wanted, spread, out=gain, where=spread > 0)
    return np.asarray((seen - mean) * gain + wanted_mean, dtype=np.float32)


@dataclass(frozen=True, slots=True)
class Aligned:
    """Where n patches are in an image."""

    uv: NDArray[np.float64]  # (n, 2): their centres, px
    matrix: NDArray[np.float64]  # (n, 2, 2): what the warp does to offsets from the centre
    # (n,): they have texture, have not shrunk to a point, and enough of each lies in the image
    found: NDArray[np.bool_]
    # (n,): mean absolute difference of gray values, after that of brightness; NaN if nothing is in the image
    residual: Floats
    ncc: Floats  # (n,): normalised cross-correlation with the template; NaN without texture


@dataclass(frozen=True, slots=True)
class Alignment:
    """Inverse-compositional Gauss-Newton from coarse to fine: the derivatives are those of the templates.

    Parameters
    ----------
    offsets : (p, 2) float32
        Samples of a patch relative to its centre, px of each level.
    warp, brightness
        What may change.
    iterations, epsilon
        At each level at most this many iterations, or until the shift is smaller than `epsilon` px of the level.

    References
    ----------
    S. Baker, I. Matthews, Lucas-Kanade 20 Years On: A Unifying Framework, IJCV 56, 2004.
    """

    offsets: Floats
    warp: Warp
    brightness: Brightness
    iterations: int
    epsilon: float

    def templates(self, levels: Sequence[Floats], uv: NDArray[np.float64]) -> list[Templates]:
        """Patches around positions (n, 2), px, at each level of a pyramid."""
        places = [(uv / 2**level).astype(np.float32) for level in range(len(levels))]
        return [
            Templates.cut(image, place, self.offsets, self.warp, self.brightness)
            for image, place in zip(levels, places, strict=True)
        ]

    def align(
        self,
        templates: Sequence[Templates],
        levels: Sequence[Floats],
        uv: NDArray[np.float64],
        matrix: NDArray[np.float64],
    ) -> Aligned:
        """Find templates in an image.

        Shapes: templates of n patches and the image at each level; uv (n, 2), px, and matrix (n, 2, 2): where to start.
        """
        uv, matrix = uv.astype(np.float64), matrix.astype(np.float64)
        uv[~np.isfinite(uv)] = -1e6  # outside any image
        for level in reversed(range(min(len(levels), len(templates)))):
            uv, matrix = self._at_level(templates[level], levels[level], uv / 2**level, matrix)
            uv *= 2**level
        finest = templates[0]
        seen = self._seen(levels[0], uv, matrix)
        difference = np.abs(_as_bright(seen, finest.values, self.brightness) - finest.values)
        inside = np.isfinite(difference)
        count = inside.sum(axis=1)
        residual = np.full(len(uv), np.nan)
        np.divide(np.where(inside, difference, 0).sum(axis=1, dtype=np.float64), count, out=residual, where=count > 0)
        area = matrix[:, 0, 0] * matrix[:, 1, 1] - matrix[:, 0, 1] * matrix[:, 1, 0]
        is_found = (count >= _LEAST_SHARE * len(self.offsets)) & _textured(finest) & (area > _LEAST_AREA)
        ncc = correlation(finest.values, seen)
        return Aligned(uv, matrix, is_found, residual.astype(np.float32), ncc)

    def follow(
        self, before: Sequence[Floats], after: Sequence[Floats], uv: NDArray[np.float64], start: NDArray[np.float64]
    ) -> Aligned:
        """Find the patches around positions (n, 2) of one image in another, straight and from positions (n, 2), px.

        `before`, `after`: pyramids of the images.
        """
        straight = np.broadcast_to(np.eye(2), (len(uv), 2, 2))
        return self.align(self.templates(before, uv), after, start, straight)

    def _seen(self, image: Floats, uv: NDArray[np.float64], matrix: NDArray[np.float64]) -> Floats:
        """Gray values (n, p) at the samples of warped patches."""
        (a, b), (c, d) = np.moveaxis(matrix.astype(np.float32), 0, 2)[..., None]
        u, v = uv.astype(np.float32).T[..., None]
        x, y = self.offsets.T
        return sampled(image, np.stack([u + a * x + b * y, v + c * x + d * y], axis=2))

    def _at_level(
        self, templates: Templates, image: Floats, uv: NDArray[np.float64], matrix: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions and matrices after the iterations at one level, in its pixels."""
        rows = np.arange(len(uv))
        for _ in range(self.iterations):
            seen = self._seen(image, uv[rows], matrix[rows])
            error = _as_bright(seen, templates.values[rows], self.brightness) - templates.values[rows]
            inside = np.isfinite(error)
            rows_in = inside.sum(axis=1) >= _LEAST_SHARE * len(self.offsets)
            rows, error = rows[rows_in], np.where(inside, error, 0)[rows_in]
            gradient = np.einsum("nkp,np->nk", templates.steepest[rows], error).astype(np.float64)
            change = np.einsum("nij,nj->ni", templates.inverse[rows], gradient)
            back = _inverse_matrix(change, self.warp)
            matrix[rows] = matrix[rows] @ back
            shift = np.einsum("nij,nj->ni", matrix[rows], change[:, :2])
            uv[rows] -= shift
            rows = rows[np.hypot(*shift.T) >= self.epsilon]
            if not len(rows):
                break
        return uv, matrix


def _inverse_matrix(change: NDArray[np.float64], warp: Warp) -> NDArray[np.float64]:
    """Inverses (n, 2, 2) of the matrices of warps with these parameters (n, k)."""
    if warp is Warp.affine:
        a, b, c, d = (change[:, 2:] + [1, 0, 0, 1]).T
        determinant = a * d - b * c
        inverse = np.stack([d, -b, -c, a], axis=1) / np.where(determinant > _LEAST_AREA, determinant, np.inf)[:, None]
        return inverse.reshape(-1, 2, 2)
    angle = change[:, 2] if warp is Warp.se2 else np.zeros(len(change))
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos, sin, -sin, cos], axis=1).reshape(-1, 2, 2)


def _textured(templates: Templates) -> NDArray[np.bool_]:
    """Which patches (n,) have texture in all directions."""
    du, dv = np.moveaxis(templates.steepest[:, :2].astype(np.float64), 1, 0)
    uu, uv, vv = ((a * b).mean(axis=1) for a, b in ((du, du), (du, dv), (dv, dv)))
    return np.asarray((uu + vv - np.hypot(uu - vv, 2 * uv)) / 2 > _LEAST_EIGENVALUE, dtype=np.bool_)
