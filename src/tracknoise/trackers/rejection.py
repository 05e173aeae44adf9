"""Outlier rejection: the matches of a step that do not agree with a common motion of the image.

The motion is a homography, a fundamental matrix, or an essential matrix of cameras whose rotation may be known.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from tracknoise.checks import Between0And1, Positive, require, require_bounds, settle_members
from tracknoise.exceptions import SettingsError
from tracknoise.geometry.cameras import CameraModel
from tracknoise.trackers.consensus import Geometry, best_hypothesis, marginal_support
from tracknoise.trackers.minimal_solvers import through_five, through_seven
from tracknoise.trackers.tracker import SequenceContext

Floats = NDArray[np.float64]

_FLAT = 1e-7  # doubled area of a triangle relative to its squared size, below which its corners count as collinear
_MAX_REFINEMENTS = 10
_CONVERGED = 1e-12


class Homography:
    """The map x' ~ H x that a plane or a pure rotation induces; its error is |x' - pi(H x)|, in the second image."""

    sample_size = 4

    def hypotheses(self, source: Floats, target: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """The homographies through four matches each.

        A sample is degenerate if three of its points are collinear in either image, or if some of its four
        triangles keep their orientation and others do not: a plane seen from one side never does that. Shapes: source,
        target (b, 4, 2); returns models (b, 3, 3), usable (b,). `models`: arbitrary for degenerate samples.
        """
        from_areas, from_lines, from_flat = _triangles(source)
        to_areas, _, to_flat = _triangles(target)
        turned = np.count_nonzero(from_areas * to_areas < 0, axis=1)
        usable = ~(from_flat | to_flat) & ((turned == 0) | (turned == 4))
        return _through_four(target, from_areas, to_areas, from_lines), usable

    def agrees(self, models: Floats, source: Floats, target: Floats, threshold: float) -> NDArray[np.bool_]:
        """Which matches each model explains to within `threshold`.

        Shapes: models (b, 3, 3), source, target (n, 2); returns (b, n).
        """
        x, y, w = _map(models, source)
        x -= target[:, 0] * w  # the error times w, so that nothing is divided by zero
        y -= target[:, 1] * w
        w *= threshold
        within: NDArray[np.bool_] = x * x + y * y <= w * w
        return within

    def squared_errors(self, models: Floats, source: Floats, target: Floats) -> Floats:
        """Squared errors; shapes as in `agrees`."""
        x, y, w = _map(models, source)
        w = np.where(np.abs(w) > np.finfo(np.float64).eps, w, np.nan)
        return np.nan_to_num((x / w - target[:, 0]) ** 2 + (y / w - target[:, 1]) ** 2, nan=np.inf)

    def refine(self, model: Floats, source: Floats, target: Floats) -> Floats:
        """The homography with the least sum of squared errors, by Levenberg-Marquardt from `model`.

        Shapes: model (3, 3), source, target (n, 2); returns (3, 3).
        """
        best: Floats = model / model[2, 2]
        x, y, inverse = _divided(best, source)
        residual, jacobian = _residual(x, y, target), _jacobian(x, y, inverse, source)
        cost, damping = float(np.sum(residual * residual)), 1e-3
        for _ in range(_MAX_REFINEMENTS):
            candidate = best + _step(residual, jacobian, damping)
            x, y, inverse = _divided(candidate, source)
            new_residual = _residual(x, y, target)
            new_cost = float(np.sum(new_residual * new_residual))
            if not new_cost < cost:
                damping *= 10
                continue
            gain = cost - new_cost
            best, cost, damping, residual = candidate, new_cost, damping / 10, new_residual
            if gain <= _CONVERGED * cost:
                break
            jacobian = _jacobian(x, y, inverse, source)
        return best


def _triangles(points: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Doubled areas of the four triangles of four points, sides of the first, and whether any is flat.

    Returns areas (b, 4), lines (b, 3, 3), flat (b,). `areas`: signed: of the triangles (3, 1, 2), (0, 3, 2), (0, 1, 3)
    and (0, 1, 2).
    """
    x, y = points[..., 0], points[..., 1]
    start, stop = (1, 2, 0), (2, 0, 1)
    lines = np.stack(
        [y[:, start] - y[:, stop], x[:, stop] - x[:, start], x[:, start] * y[:, stop] - x[:, stop] * y[:, start]],
        axis=-1,
    )
    fourth = lines[..., 0] * x[:, 3:] + lines[..., 1] * y[:, 3:] + lines[..., 2]
    areas = np.concatenate([fourth, fourth.sum(axis=1, keepdims=True)], axis=1)
    reach = np.ptp(x, axis=1) + np.ptp(y, axis=1)
    flat = np.any(np.abs(areas) <= _FLAT * reach[:, None] ** 2, axis=1)
    return areas, lines, flat


def _through_four(target: Floats, from_areas: Floats, to_areas: Floats, from_lines: Floats) -> Floats:
    """H = sum_i (b_i / a_i) q_i l_i^T over the first three points.

    l_i, the line opposite point i, picks out point i among the three; the ratio of areas b_i / a_i, seen from
    the fourth point, carries that point over, too. Multiplied by the a_i, so that nothing is divided by zero.
    """
    a, b = from_areas[:, :3], to_areas[:, :3]
    weight = b * a[:, (1, 2, 0)] * a[:, (2, 0, 1)]
    scaled = weight[..., None] * from_lines
    q = target[:, :3]
    rows = [(q[..., 0, None] * scaled).sum(axis=1), (q[..., 1, None] * scaled).sum(axis=1), scaled.sum(axis=1)]
    return np.stack(rows, axis=1)


def _map(models: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
    """Homogeneous coordinates (b, n) of what each model makes of points; explicit sums, as BLAS may round otherwise."""
    u, v = points[:, 0], points[:, 1]
    x, y, w = (row[:, 0:1] * u + row[:, 1:2] * v + row[:, 2:3] for row in models.transpose(1, 0, 2))
    return x, y, w


def _divided(model: Floats, points: Floats) -> tuple[Floats, Floats, Floats]:
    """pi(H x) of points (n, 2), and one over the third homogeneous coordinate, (n,) each; 0 where that is 0."""
    (x,), (y,), (w,) = _map(model[None], points)
    inverse = 1.0 / np.where(np.abs(w) > np.finfo(np.float64).eps, w, np.inf)
    return x * inverse, y * inverse, inverse


def _residual(x: Floats, y: Floats, target: Floats) -> Floats:
    """pi(H x) - x', first in x, then in y: (2n,)."""
    return np.concatenate([x - target[:, 0], y - target[:, 1]])


def _jacobian(x: Floats, y: Floats, inverse: Floats, source: Floats) -> Floats:
    """Derivatives (2n, 8) of the residuals by the entries of H but the last."""
    jacobian = np.zeros((2, len(source), 8))
    by_x, by_y = jacobian
    scaled = source * inverse[:, None]
    by_x[:, :2] = by_y[:, 3:5] = scaled
    by_x[:, 2] = by_y[:, 5] = inverse
    by_x[:, 6:] = -x[:, None] * scaled
    by_y[:, 6:] = -y[:, None] * scaled
    return jacobian.reshape(-1, 8)


def _step(residual: Floats, jacobian: Floats, damping: float) -> Floats:
    """Change (3, 3) of H; its last entry is fixed."""
    normal = np.einsum("ni,nj->ij", jacobian, jacobian)
    gradient = np.einsum("ni,n->i", jacobian, residual)
    normal.ravel()[::9] *= 1.0 + damping  # the diagonal
    change = np.zeros(9)
    change[:8] = -np.linalg.solve(normal, gradient)
    return change.reshape(3, 3)


_RANK_DEFICIENT = 1e-10


class Fundamental:
    """The relation x'^T F x = 0 of two views of a rigid scene; its error is Sampson's distance.

    Sampson's distance is to first order how far a match must move, in both images together, to fulfil the relation.
    """

    sample_size = 8

    def hypotheses(self, source: Floats, target: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """The fundamental matrices through eight matches each, by the eight-point algorithm.

        Shapes: source, target (b, 8, 2); returns models (b, 3, 3), usable (b,). `models`: of rank 2; arbitrary for
        degenerate samples.
        """
        _, singular, transposed = np.linalg.svd(_equations(source, target))
        usable = singular[:, -1] > _RANK_DEFICIENT * singular[:, 0]
        return _rank_two(transposed[:, -1].reshape(-1, 3, 3)), usable

    def agrees(self, models: Floats, source: Floats, target: Floats, threshold: float) -> NDArray[np.bool_]:
        """Which matches each model explains to within `threshold`.

        Shapes: models (b, 3, 3), source, target (n, 2); returns (b, n).
        """
        algebraic, slope = _sampson(models, source, target)
        return algebraic * algebraic <= threshold * threshold * slope

    def squared_errors(self, models: Floats, source: Floats, target: Floats) -> Floats:
        """Squared errors; shapes as in `agrees`."""
        algebraic, slope = _sampson(models, source, target)
        return algebraic**2 / np.maximum(slope, np.finfo(np.float64).tiny)

    def refine(self, model: Floats, source: Floats, target: Floats) -> Floats:
        """The eight-point solution on all matches; `model` is only needed where these leave it open.

        Shapes: model (3, 3), source, target (n, 2); returns (3, 3).
        """
        equations = _equations(source, target)
        values, vectors = np.linalg.eigh(np.einsum("ni,nj->ij", equations, equations))
        if values[1] <= _RANK_DEFICIENT * values[-1]:
            return model
        closest: Floats = _rank_two(vectors[:, 0].reshape(1, 3, 3))[0]
        return closest


def _sampson(models: Floats, source: Floats, target: Floats) -> tuple[Floats, Floats]:
    """What x'^T F x is for each model and match, and the squared length of its gradient: (b, n) each."""
    a, b, c = _map(models, source)  # epipolar lines
    a_back, b_back, _ = _map(np.swapaxes(models, 1, 2), target)
    algebraic = a * target[:, 0] + b * target[:, 1] + c
    return algebraic, a * a + b * b + a_back * a_back + b_back * b_back


def _equations(source: Floats, target: Floats) -> Floats:
    """Rows (..., n, 9) whose product with the entries of F is x'^T F x."""
    ones = np.ones_like(source[..., :1])
    x = np.concatenate([source, ones], axis=-1)
    rows: Floats = np.concatenate([target[..., :1] * x, target[..., 1:] * x, x], axis=-1)
    return rows


def _rank_two(models: Floats) -> Floats:
    left, singular, right = np.linalg.svd(models)
    singular[:, 2] = 0.0
    return np.asarray((left * singular[:, None, :]) @ right, dtype=np.float64)


class Essential(Fundamental):
    """The relation x'^T E x = 0 of two views of a rigid scene by rays of depth 1; its error is Sampson's distance.

    E is the fundamental matrix that is closest to what eight matches determine, with two equal singular values and none
    other.
    """

    def hypotheses(self, source: Floats, target: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """The essential matrices through eight matches each; shapes as in `Fundamental.hypotheses`."""
        models, usable = super().hypotheses(source, target)
        return _equal_two(models), usable

    def refine(self, model: Floats, source: Floats, target: Floats) -> Floats:
        """The eight-point solution on all matches; shapes as in `Fundamental.refine`."""
        refined: Floats = _equal_two(super().refine(model, source, target)[None])[0]
        return refined


def _equal_two(models: Floats) -> Floats:
    left, _, right = np.linalg.svd(models)
    return np.asarray(left[:, :, :2] @ right[:, :2], dtype=np.float64)


class SevenPoint(Fundamental):
    """As `Fundamental`, with samples of seven matches."""

    sample_size = 7

    def hypotheses(self, source: Floats, target: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """The fundamental matrices through seven matches each: see `through_seven`."""
        models, exists = through_seven(_equations(source, target))
        return models.reshape(-1, 3, 3), exists.ravel()


class FivePoint(Essential):
    """As `Essential`, with samples of five matches, which determine it on a plane too."""

    sample_size = 5

    def hypotheses(self, source: Floats, target: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """The essential matrices through five matches each: see `through_five`."""
        models, exists = through_five(_equations(source, target))
        return models.reshape(-1, 3, 3), exists.ravel()

    def refine(self, model: Floats, source: Floats, target: Floats) -> Floats:
        """The eight-point solution, where it fits better than the model: on a plane it does not."""
        refined = super().refine(model, source, target)
        return min(
            (refined, model), key=lambda candidate: float(self.squared_errors(candidate[None], source, target).sum())
        )


class KnownRotation(Fundamental):
    """The relation x'^T [t] x = 0 of two views of a rigid scene that differ by a translation t, along rays of depth 1.

    With a known rotation, two views are those once the rays of the first are turned.
    """

    sample_size = 2

    def hypotheses(self, source: Floats, target: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """Translations through two matches each: each match has one in the plane of its two rays."""
        planes = _ray_planes(source, target)
        direction = np.cross(planes[:, 0], planes[:, 1])
        size = np.linalg.norm(direction, axis=1)
        usable = size > _RANK_DEFICIENT * np.linalg.norm(planes, axis=2).prod(axis=1)
        return _crossing(direction / np.where(size > 0, size, 1)[:, None]), usable

    def refine(self, model: Floats, source: Floats, target: Floats) -> Floats:
        """The translation that is nearest to the planes of all matches."""
        planes = _ray_planes(source, target)
        _, vectors = np.linalg.eigh(np.einsum("ni,nj->ij", planes, planes))
        closest: Floats = _crossing(vectors[None, :, 0])[0]
        return closest


def _ray_planes(source: Floats, target: Floats) -> Floats:
    """Normals (..., 3) of the planes that both rays of matches (..., 2) span."""
    ahead = np.ones_like(source[..., :1])
    return np.cross(np.concatenate([source, ahead], axis=-1), np.concatenate([target, ahead], axis=-1))


def _crossing(vectors: Floats) -> Floats:
    """Matrices (b, 3, 3) that take the cross product of vectors (b, 3) with others."""
    return np.cross(vectors[:, None], np.eye(3)).swapaxes(1, 2)


Inliers = Callable[[Floats, Floats, int], NDArray[np.bool_]]
"""Decides which matches stay: source (n, 2) px, target (n, 2) px and the frame's index, to (n,) bool."""


class Model(StrEnum):
    """What relates the two images.

    homography: 4 matches determine it. fundamental, essential: matrices, through samples of 8 matches. seven-point:
    fundamental matrix through 7. five-point: essential matrix through 5, on a plane too. two-point: translation through
    2, with the rotation of the sequence's poses, which stands for that of a gyroscope. none: nothing is rejected.
    """

    homography = "homography"
    fundamental = "fundamental"
    essential = "essential"
    seven_point = "seven-point"
    five_point = "five-point"
    two_point = "two-point"
    none = "none"


class Coordinates(StrEnum):
    """Where outliers are looked for.

    image: in the image as it is. rays: in an image without distortion, with the rays of the stated camera, and the
    focal length `Rejection.focal_px`.
    """

    image = "image"
    rays = "rays"


class Consensus(StrEnum):
    """Which model is the best, and whether it is refined on its inliers. Its inliers stay.

    hypothesis: as in the paper's software. Which of many similar hypotheses wins depends on the random seed. refined:
    every hypothesis that is better than all before is fitted to its inliers again, and so is the best (LO-RANSAC). The
    result depends far less on the seed. magsac: as refined, but models are compared by the support of all matches,
    which falls with their errors, not by how many lie within the threshold: see
    `tracknoise.trackers.consensus.marginal_support`.
    """

    hypothesis = "hypothesis"
    refined = "refined"
    magsac = "magsac"


class ReferencePosition(StrEnum):
    """Start of a match.

    previous: the track's previous position. first: its first one. keyframe: that in the last key frame, as Kimera-VIO
    has it, of trackers that follow features; tracks that began since then are no outliers.
    """

    previous = "previous"
    first = "first"
    keyframe = "keyframe"


_MAX_REFITS = 10
"""Largest number of refits of one hypothesis; few are needed until its inliers no longer grow."""
_GEOMETRIES: dict[Model, Geometry] = {
    Model.homography: Homography(),
    Model.fundamental: Fundamental(),
    Model.essential: Essential(),
    Model.seven_point: SevenPoint(),
    Model.five_point: FivePoint(),
    Model.two_point: KnownRotation(),
}
_OF_RAYS = (Model.essential, Model.five_point, Model.two_point)
"""Models that relate rays, not positions in images."""


@dataclass(frozen=True, slots=True)
class Rejection:
    """How outliers are distinguished from inliers, by our own random sample consensus.

    Outlier ratio and lifetimes are results, so their definition must not change with a library. Up to OpenCV 4.11 the
    mask of ``findHomography`` was that of the best minimal hypothesis; since 4.12 it is that of the refined model.
    `consensus` selects. The paper's software used the former, and so do the presets of the paper. With
    `refined`, local optimisation finds nearly the same model with any seed. A step has no outliers if it has fewer
    matches than determine a model, or if all samples are degenerate.

    Parameters
    ----------
    model
        What relates the images: see `tracknoise.trackers.rejection.Model`. Errors are those of the reprojection into
        the second image for a homography, and Sampson's for all others.
    consensus
        The inliers of the best hypothesis, or of the locally optimised and refined model.
    reference
        Which position of each track is matched with its present one: see
        `tracknoise.trackers.rejection.ReferencePosition`.
    threshold_px
        Largest error of an inlier.
    confidence
        Probability of drawing at least one sample without outliers.
    max_hypotheses
        Largest number of samples, not counting degenerate ones.
    seed
        Random seed of the samples, combined with the index of the frame.
    coordinates
        Where outliers are looked for: in the image, or along rays of the stated camera. An essential matrix and a
        translation are always those of rays. Matches without a ray are outliers.
    focal_px
        Focal length of the image without distortion, in whose pixels `threshold_px` is. None: the larger one of the
        camera.

    References
    ----------
    Local optimisation: O. Chum, J. Matas, J. Kittler, Locally Optimized RANSAC, DAGM 2003.
    """

    model: Model = Model.homography
    consensus: Consensus = Consensus.refined
    reference: ReferencePosition = ReferencePosition.previous
    threshold_px: Positive = 3.0
    confidence: Between0And1 = 0.995
    max_hypotheses: Annotated[int, Ge(1)] = 2000
    seed: Annotated[int, Ge(0)] = 0
    coordinates: Coordinates = Coordinates.image
    focal_px: Positive | None = None

    def __post_init__(self) -> None:
        settle_members(self, model=Model, consensus=Consensus, reference=ReferencePosition, coordinates=Coordinates)
        require_bounds(self)
        previous = self.model is not Model.two_point or self.reference is ReferencePosition.previous
        require(previous, "reference", str(self.reference), "previous, whose rotation is known, for two-point")

    def repeated(self, repeat: int) -> "Rejection":
        """The same rejection with another random seed, for each repetition of a measurement; 0 changes nothing."""
        return replace(self, seed=self.seed + repeat)

    def inliers_of(self, context: SequenceContext) -> Inliers:
        """Return `inliers` for positions in the images of a sequence.

        Raises
        ------
        SettingsError
            If the camera or poses are needed and unknown, or no focal length is known.
        """
        if self.model is Model.none or (self.coordinates is Coordinates.image and self.model not in _OF_RAYS):
            return self.inliers
        if context.camera_at is None:
            raise SettingsError(f"rejection along rays in {context.sequence}: no camera, expected intrinsics")
        focal_px, turn_to = self.focal_px or _focal_px(context.camera_at(0)), None
        if self.model is Model.two_point:
            if context.rotation_at is None:
                raise SettingsError(f"two-point rejection in {context.sequence}: no poses, expected their rotations")
            turn_to = _Turns(context.rotation_at, context.speed)
        return _AlongRays(self, context.camera_at, focal_px, turn_to)

    def inliers(self, source: Floats, target: Floats, frame: int) -> NDArray[np.bool_]:
        """Which matches stay.

        Parameters
        ----------
        source, target
            (n, 2) float64, px: where the features were, and are. With a model of rays, relative to the principal point,
            in an image without distortion whose focal length is `focal_px`; with two-point, of the same rotation.
        frame
            Index of the present frame.

        Returns
        -------
        (n,) bool
        """
        all_matches = np.ones(len(source), dtype=np.bool_)
        if self.model is Model.none:
            return all_matches
        geometry = _GEOMETRIES[self.model]
        if len(source) <= geometry.sample_size:
            return all_matches
        if self.model in _OF_RAYS:
            scale = 1.0 / (self.focal_px or 1.0)
            source, target = source * scale, target * scale
        else:
            source, target, scale = _conditioned(source, target)
        threshold = self.threshold_px * scale
        best = best_hypothesis(
            geometry,
            source,
            target,
            threshold=threshold,
            confidence=self.confidence,
            max_hypotheses=self.max_hypotheses,
            rng=np.random.default_rng([self.seed, frame]),
            max_refits=0 if self.consensus is Consensus.hypothesis else _MAX_REFITS,
            support=marginal_support if self.consensus is Consensus.magsac else None,
        )
        if best is None:
            return all_matches
        if self.consensus is Consensus.hypothesis:
            return best.inliers
        refined = geometry.refine(best.model, source[best.inliers], target[best.inliers])
        within: NDArray[np.bool_] = geometry.agrees(refined[None], source, target, threshold)[0]
        return within


def _conditioned(source: Floats, target: Floats) -> tuple[Floats, Floats, float]:
    """Both point sets relative to their centroids, in units of one length, so that the algebra is well conditioned."""
    source, target = source - source.mean(axis=0), target - target.mean(axis=0)
    spread = max(float(np.abs(source).mean()), float(np.abs(target).mean()))
    scale = 1.0 / spread if spread > 0 else 1.0
    return source * scale, target * scale, scale


@dataclass(frozen=True, slots=True)
class _Turns:
    """Rotations of the camera from the frame that a tracker saw before."""

    rotation_at: Callable[[int], Floats]
    speed: int

    def __call__(self, frame: int) -> Floats:
        """(3, 3) camera_from_camera, from the frame before to this one; NaN where a pose is unknown."""
        return self.rotation_at(frame).T @ self.rotation_at(frame - self.speed)


@dataclass(frozen=True, slots=True)
class _AlongRays:
    """Decides which matches stay, in an image without distortion of one focal length."""

    rejection: Rejection
    camera_at: Callable[[int], CameraModel]
    focal_px: float
    turn_to: _Turns | None

    def __call__(self, source: Floats, target: Floats, frame: int) -> NDArray[np.bool_]:
        """Which matches (n, 2) stay; both positions are seen by the camera of the present frame."""
        camera = self.camera_at(frame)
        before, after = camera.bearings(source), camera.bearings(target)
        if self.turn_to is not None and len(source):
            turn = self.turn_to(frame)
            if not np.isfinite(turn).all():
                return np.ones(len(source), dtype=np.bool_)
            before = before @ turn.T
            before = before / np.where(before[:, 2:] > 0, before[:, 2:], np.nan)
        ideal = [self.focal_px * rays[:, :2] for rays in (before, after)]
        inlier = np.asarray(np.isfinite(np.hstack(ideal)).all(axis=1), dtype=np.bool_)
        rejection = replace(self.rejection, focal_px=self.focal_px)
        inlier[inlier] = rejection.inliers(ideal[0][inlier], ideal[1][inlier], frame)
        return inlier


def _focal_px(camera: CameraModel) -> float:
    focal = [float(getattr(camera, name)) for name in ("fx", "fy") if hasattr(camera, name)]
    if not focal:
        raise SettingsError(f"rejection along rays: {type(camera).__name__} has no fx and fy, expected focal_px")
    return max(focal)
