"""Homographies between two images: through four matches in closed form, and refined on many."""

import numpy as np
from numpy.typing import NDArray

_FLAT = 1e-7  # doubled area of a triangle relative to its squared size, below which its corners count as collinear
_MAX_REFINEMENTS = 10
_CONVERGED = 1e-12

Floats = NDArray[np.float64]


class Homography:
    """The map x' ~ H x that a plane or a pure rotation induces; its error is |x' - pi(H x)|, in the second image."""

    sample_size = 4

    def hypotheses(self, source: Floats, target: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """The homographies through four matches each.

        A sample is degenerate if three of its points are collinear in either image, or if some of its four
        triangles keep their orientation and others do not: a plane seen from one side never does that.

        Parameters
        ----------
        source, target
            (b, 4, 2) float64.

        Returns
        -------
        models : (b, 3, 3) float64
            Arbitrary for degenerate samples.
        usable : (b,) bool
        """
        from_areas, from_lines, from_flat = _triangles(source)
        to_areas, _, to_flat = _triangles(target)
        turned = np.count_nonzero(from_areas * to_areas < 0, axis=1)
        usable = ~(from_flat | to_flat) & ((turned == 0) | (turned == 4))
        return _through_four(target, from_areas, to_areas, from_lines), usable

    def agrees(self, models: Floats, source: Floats, target: Floats, threshold: float) -> NDArray[np.bool_]:
        """Which matches each model explains to within `threshold`.

        Parameters
        ----------
        models
            (b, 3, 3) float64.
        source, target
            (n, 2) float64.
        threshold
            Largest error, in the unit of the points.

        Returns
        -------
        (b, n) bool
        """
        x, y, w = _map(models, source)
        x -= target[:, 0] * w  # the error times w, so that nothing is divided by zero
        y -= target[:, 1] * w
        w *= threshold
        within: NDArray[np.bool_] = x * x + y * y <= w * w
        return within

    def refine(self, model: Floats, source: Floats, target: Floats) -> Floats:
        """The homography with the least sum of squared errors, by Levenberg-Marquardt from `model`.

        Parameters
        ----------
        model
            (3, 3) float64.
        source, target
            (n, 2) float64, n >= 4; `model` fits all of them roughly.

        Returns
        -------
        (3, 3) float64
        """
        best: Floats = model / model[2, 2]
        residual, jacobian = _linearise(best, source, target)
        cost, damping = float(np.sum(residual * residual)), 1e-3
        for _ in range(_MAX_REFINEMENTS):
            candidate = best + _step(residual, jacobian, damping)
            linear = _linearise(candidate, source, target)
            new_cost = float(np.sum(linear[0] * linear[0]))
            if not new_cost < cost:
                damping *= 10
                continue
            gain = cost - new_cost
            best, cost, damping, (residual, jacobian) = candidate, new_cost, damping / 10, linear
            if gain <= _CONVERGED * cost:
                break
        return best


def _triangles(points: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Doubled areas of the four triangles of four points, sides of the first, and whether any is flat.

    Returns
    -------
    areas : (b, 4) float64
        Signed: of the triangles (3, 1, 2), (0, 3, 2), (0, 1, 3) and (0, 1, 2).
    lines : (b, 3, 3) float64
        The lines through points (1, 2), (2, 0) and (0, 1): ``lines @ (u, v, 1)`` is a triangle's doubled area.
    flat : (b,) bool
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
    """Homogeneous coordinates (b, n) of points under each model; explicit sums, as BLAS may round differently."""
    u, v = points[:, 0], points[:, 1]
    x, y, w = (row[:, 0:1] * u + row[:, 1:2] * v + row[:, 2:3] for row in np.moveaxis(models, 1, 0))
    return x, y, w


def _linearise(model: Floats, source: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Residuals (2n,) of pi(H x) - x' and their derivatives (2n, 8) by the entries of H but the last."""
    (x,), (y,), (w,) = _map(model[None], source)
    inverse = 1.0 / np.where(np.abs(w) > np.finfo(np.float64).eps, w, np.inf)
    x, y = x * inverse, y * inverse
    scaled = np.column_stack([source, np.ones(len(source))]) * inverse[:, None]
    nothing = np.zeros_like(scaled)
    by_x = np.hstack([scaled, nothing, -x[:, None] * scaled[:, :2]])
    by_y = np.hstack([nothing, scaled, -y[:, None] * scaled[:, :2]])
    return np.concatenate([x - target[:, 0], y - target[:, 1]]), np.concatenate([by_x, by_y])


def _step(residual: Floats, jacobian: Floats, damping: float) -> Floats:
    """Change (3, 3) of H; its last entry is fixed."""
    normal = np.einsum("ni,nj->ij", jacobian, jacobian)
    gradient = np.einsum("ni,n->i", jacobian, residual)
    normal[np.diag_indices(8)] *= 1.0 + damping
    return -np.append(np.linalg.solve(normal, gradient), 0.0).reshape(3, 3)
