"""All relations between two images that a minimal number of matches allows.

Fundamental matrices through seven matches are the roots of a cubic, essential matrices through five matches those of
ten cubics in three unknowns.
"""

from itertools import combinations_with_replacement, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_DEFICIENT = 1e-10
"""A singular value smaller than this share of the largest one counts as zero."""
_REAL = 1e-8
"""A root with a smaller imaginary part, in units of its absolute value, counts as real."""


def through_seven(equations: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """The fundamental matrices through seven matches: up to three.

    Those whose determinant is zero, of all that are combinations of the two that fulfil the equations.

    `equations`: (b, 7, 9) float64: rows whose product with the entries of F is x'^T F x. Returns `models` (b, 3, 3, 3)
    float64: three for each sample, arbitrary where there are fewer; `exists` (b, 3) bool.

    R. Hartley, A. Zisserman, Multiple View Geometry in Computer Vision, 2nd edition, 11.1.2.
    """
    basis, usable = _kernel(equations, 2)
    first, second = basis[:, 0], basis[:, 1]
    cubic, constant = np.linalg.det(first), np.linalg.det(second)
    more, less = np.linalg.det(first + second), np.linalg.det(second - first)
    square, linear = (more + less) / 2 - constant, (more - less) / 2 - cubic
    scale = np.where(cubic == 0, np.inf, cubic)
    companion = np.zeros((len(equations), 3, 3))
    companion[:, 1, 0] = companion[:, 2, 1] = 1
    companion[:, :, 2] = -np.stack([constant, linear, square], axis=1) / scale[:, None]
    roots = np.linalg.eigvals(companion)
    models = roots.real[:, :, None, None] * first[:, None] + second[:, None]
    return models, usable[:, None] & (cubic != 0)[:, None] & _is_real(roots)


def through_five(equations: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """The essential matrices through five matches: up to ten.

    Of all combinations x X + y Y + z Z + W that fulfil the equations, those with det E = 0 and
    2 E E^T E = trace(E E^T) E: ten cubics, which are solved by the eigenvectors of the multiplication by x.

    `equations`: (b, 5, 9) float64: rows whose product with the entries of E is x'^T E x, of rays with depth 1. Returns
    `models` (b, 10, 3, 3) float64: ten for each sample, arbitrary where there are fewer; `exists` (b, 10) bool.

    D. Nister, An Efficient Solution to the Five-Point Relative Pose Problem, PAMI 26, 2004. H. Stewenius, C. Engels, D.
    Nister, Recent Developments on Direct Relative Orientation, ISPRS Journal 60, 2006.
    """
    basis, usable = _kernel(equations, 4)
    cubics = _cubics(basis)
    leading = cubics[:, :, :10]
    regular = usable & (np.linalg.slogdet(leading)[0] != 0)
    leading = np.where(regular[:, None, None], leading, np.eye(10))
    reduced = -np.linalg.solve(leading, cubics[:, :, 10:])  # cubic monomials by the others
    regular &= np.isfinite(reduced).all(axis=(1, 2))
    by_x = np.zeros((len(equations), 10, 10))
    for row, monomial in enumerate(_MONOMIALS[10:]):
        column = _MONOMIALS.index(tuple(sorted((0, *monomial))[:3]))  # x times it, of which a 1 is left out
        if column < 10:
            by_x[:, row] = np.where(regular[:, None], reduced[:, column], 0)
        else:
            by_x[:, row, column - 10] = 1
    roots, vectors = np.linalg.eig(by_x)
    last = vectors[:, 9]
    weights = vectors[:, 6:].real / np.where(np.abs(last) > 0, last.real, 1)[:, None]
    models = np.einsum("bks,bkij->bsij", weights, basis)
    return models, regular[:, None] & _is_real(roots) & (np.abs(last.real) > 0)


def _is_real(roots: NDArray[Any]) -> NDArray[np.bool_]:
    return np.asarray(np.abs(np.imag(roots)) <= _REAL * np.abs(roots), dtype=np.bool_)


def _kernel(equations: Floats, dimensions: int) -> tuple[Floats, NDArray[np.bool_]]:
    """Matrices (b, dimensions, 3, 3) that fulfil equations (b, n, 9), and whether there are no more: (b,)."""
    _, singular, transposed = np.linalg.svd(equations)
    usable = singular[:, -1] > _DEFICIENT * singular[:, 0]
    return transposed[:, -dimensions:].reshape(-1, dimensions, 3, 3), np.asarray(usable, dtype=np.bool_)


_MONOMIALS: list[tuple[int, ...]] = sorted(
    combinations_with_replacement(range(4), 3), key=lambda monomial: monomial.count(3)
)
"""Of degree 3 in x, y, z and 1, as factors 0 to 3: those of degree 3 in x, y and z, then the others down to 1."""
_PLACES = np.array([_MONOMIALS.index(tuple(sorted(factors))) for factors in product(range(4), repeat=3)])
_TURN = np.zeros((3, 3, 3))
_TURN[[0, 1, 2], [1, 2, 0], [2, 0, 1]], _TURN[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = 1, -1


def _cubics(basis: Floats) -> Floats:
    """Coefficients (b, 10, 20) of the ten cubics in `_MONOMIALS`, for E = x X + y Y + z Z + W of bases (b, 4, 3, 3)."""
    squares = np.einsum("bipq,bjrq->bijpr", basis, basis)
    traces = np.trace(squares, axis1=3, axis2=4)
    products = 2 * np.einsum("bijpr,bkrs->bijkps", squares, basis) - np.einsum("bij,bkps->bijkps", traces, basis)
    pairs = np.einsum("bjq,bkr,pqr->bjkp", basis[:, :, 1], basis[:, :, 2], _TURN)
    determinants = np.einsum("bip,bjkp->bijk", basis[:, :, 0], pairs)
    terms = np.concatenate([products.reshape(-1, 64, 9), determinants.reshape(-1, 64, 1)], axis=2)
    cubics = np.zeros((len(basis), 20, 10))
    for place, term in zip(_PLACES.tolist(), np.moveaxis(terms, 1, 0), strict=True):
        cubics[:, place] += term
    return np.swapaxes(cubics, 1, 2)
