"""Grid-based motion statistics (GMS): a match is right where many near it lead to the same place."""

import numpy as np
from numpy.typing import NDArray

_CELLS = 20
"""Cells along each side of an image."""
_FACTOR = 6.0
"""A pair of cells needs more support than this many standard deviations of what chance gives."""
_NEAR = np.array([(column, row) for column in (-1, 0, 1) for row in (-1, 0, 1)])

Floats = NDArray[np.float64]


def supported(source: Floats, target: Floats, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Which matches have the support of those around them.

    Both images have 20 x 20 cells. A cell leads to the cell of the other image in which most of its matches end; the
    pair is right if the 3 x 3 cells around both have more matches with each other than 6 sqrt(n), where n is the mean
    number of matches in those cells of the first image. Matches of such pairs stay. That is done with the grid of the
    first image shifted by half a cell in u, in v and in both too; one of the four is enough. Neither a turn beyond
    about 20 degrees nor a large change of size is allowed for. A few hundred matches are needed.

    Parameters
    ----------
    source, target
        (n, 2) float64, px: positions in the first and in the second image.
    size
        (width, height) of both, px.

    Returns
    -------
    (n,) bool

    References
    ----------
    J. Bian, W.-Y. Lin, Y. Matsushita, S.-K. Yeung, T.-D. Nguyen, M.-M. Cheng, GMS: Grid-based Motion Statistics for
    Fast, Ultra-robust Feature Correspondence, CVPR 2017.
    """
    scale = _CELLS / np.array(size, dtype=np.float64)
    there = np.clip(np.floor(target * scale), 0, _CELLS - 1).astype(np.intp)
    kept = np.zeros(len(source), dtype=np.bool_)
    for shift in ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)):
        kept |= _by_cells(np.clip(np.floor(source * scale + shift), 0, _CELLS).astype(np.intp), there)
    return kept


def _by_cells(here: NDArray[np.intp], there: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Which matches (n,) belong to right pairs of cells, given as columns and rows (n, 2) of both images."""
    side = _CELLS + 3  # with a border of empty cells, so that each has neighbours
    first, second = ((cells + 1) @ [1, side] for cells in (here, there))
    counts = np.bincount(first * side**2 + second, minlength=side**4).reshape(side**2, side**2)
    used = np.unique(first)
    best = counts[used].argmax(axis=1)
    around = _NEAR @ [1, side]
    support = counts[used[:, None] + around, best[:, None] + around].sum(axis=1)
    expected = counts.sum(axis=1)[used[:, None] + around].mean(axis=1)
    leads_to = np.full(side**2, -1)
    leads_to[used] = np.where(support > _FACTOR * np.sqrt(expected), best, -1)
    return np.asarray(leads_to[first] == second, dtype=np.bool_)
