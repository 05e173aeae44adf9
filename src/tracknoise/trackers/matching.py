"""Matches between the keypoints of two images: mutual nearest neighbours by descriptor, and their support nearby."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

DISTANCE, RATIO = "descriptor_distance", "descriptor_ratio"
"""Names of the quality of matches by descriptor: see `mutual_nearest`."""
_ROWS_AT_ONCE = 128  # so that their squared distances stay in the processor's cache


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Pairs of keypoints of two images, by ascending query row."""

    # query_rows, train_rows: (k,): the pairs
    query_rows: NDArray[np.intp]
    train_rows: NDArray[np.intp]
    quality: Mapping[str, NDArray[np.float32]]  # (k,): of each pair, by the names that a step reports

    def chosen(self, rows: NDArray[np.bool_]) -> "Matches":
        """Some of the pairs, by a mask (k,)."""
        quality = {name: values[rows] for name, values in self.quality.items()}
        return Matches(self.query_rows[rows], self.train_rows[rows], quality)


def mutual_nearest(
    query: NDArray[np.float32], train: NDArray[np.float32], allowed: NDArray[np.bool_] | None = None
) -> Matches:
    """Pairs of descriptors that are each other's nearest neighbour in Euclidean distance.

    The matches are those of ``cv2.BFMatcher(cv2.NORM_L2, crossCheck=True)``: among equally near ones the first
    counts. The squared distance |q|^2 + |t|^2 - 2 q.t is one product of the descriptors with their squared lengths
    appended. All terms are whole numbers below 2^24, which float32 represents exactly, so that neither the order of
    summation nor the number of threads can change a match.

    `query`, `train`: (m, d) and (n, d) float32: descriptors of both images; `allowed`: (m, n), which of them may be
    pairs and are compared, None: all. Returns pairs with their Euclidean distance (``descriptor_distance``), and that
    distance over the distance of the query to its second nearest in train (``descriptor_ratio``): from 0, unambiguous,
    to 1, ambiguous. NaN if there is no second one.
    """
    if not (len(query) and len(train)):
        no_rows, nothing = np.empty(0, dtype=np.intp), np.empty(0, dtype=np.float32)
        return Matches(no_rows, no_rows, {DISTANCE: nothing, RATIO: nothing})
    left = np.column_stack([query, _squared_length(query), np.ones_like(query[:, 0])])
    right = np.column_stack([-2.0 * train, np.ones_like(train[:, 0]), _squared_length(train)]).T
    nearest_train = np.empty(len(query), dtype=np.intp)
    first, second = np.empty((2, len(query)), dtype=np.float32)
    nearest_query, least = np.zeros(len(train), dtype=np.intp), np.full(len(train), np.inf, dtype=np.float32)
    for start in range(0, len(query), _ROWS_AT_ONCE):
        rows = slice(start, start + _ROWS_AT_ONCE)
        squared = left[rows] @ right
        if allowed is not None:
            squared[~allowed[rows]] = np.inf
        row = squared.argmin(axis=0)
        value = squared[row, np.arange(len(train))]
        closer = value < least
        nearest_query[closer], least[closer] = start + row[closer], value[closer]
        column = squared.argmin(axis=1)
        nearest_train[rows], first[rows] = column, squared[np.arange(len(column)), column]
        squared[np.arange(len(column)), column] = np.inf
        second[rows] = squared.min(axis=1)
    mutual = np.flatnonzero((nearest_query[nearest_train] == np.arange(len(query))) & np.isfinite(first))
    distance, ratio = _distances(first[mutual], second[mutual])
    return Matches(mutual, nearest_train[mutual], {DISTANCE: distance, RATIO: ratio})


def _distances(
    first: NDArray[np.float32], second: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Distances (k,) and ratios (k,) from squared distances to the nearest and to the second nearest."""
    ratio = np.full(len(first), np.nan, dtype=np.float32)
    ratio[np.isfinite(second)] = 1.0  # equally near, also where both distances are 0
    np.divide(first, second, out=ratio, where=np.isfinite(second) & (second > 0))
    return np.sqrt(np.maximum(first, 0)), np.sqrt(np.maximum(ratio, 0))  # rounding of descriptors of networks


def _squared_length(descriptors: NDArray[np.float32]) -> NDArray[np.float32]:
    squares: NDArray[np.float32] = np.einsum("ij,ij->i", descriptors, descriptors)
    return squares


_CELLS = 20
"""Cells along each side of an image."""
_FACTOR = 6.0
"""A pair of cells needs more support than this many standard deviations of what chance gives."""
_NEAR = np.array([(column, row) for column in (-1, 0, 1) for row in (-1, 0, 1)])


def supported(source: NDArray[np.float64], target: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Which matches have the support of those around them: grid-based motion statistics (GMS).

    Both images have 20 x 20 cells. A cell leads to the cell of the other image in which most of its matches end; the
    pair is right if the 3 x 3 cells around both have more matches with each other than 6 sqrt(n), where n is the mean
    number of matches in those cells of the first image. Matches of such pairs stay. That is done with the grid of the
    first image shifted by half a cell in u, in v and in both too; one of the four is enough. Neither a turn beyond
    about 20 degrees nor a large change of size is allowed for. A few hundred matches are needed.

    `source`, `target`: (n, 2) float64, px: positions in the first and in the second image; `size`: (width, height) of
    both, px. Returns (n,) bool.

    J. Bian, W.-Y. Lin, Y. Matsushita, S.-K. Yeung, T.-D. Nguyen, M.-M. Cheng, GMS: Grid-based Motion Statistics for
    Fast, Ultra-robust Feature Correspondence, CVPR 2017.
    """
    scale = _CELLS / np.array(size, dtype=np.float64)
    target_cells = np.clip(np.floor(target * scale), 0, _CELLS - 1).astype(np.intp)
    kept = np.zeros(len(source), dtype=np.bool_)
    for shift in ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)):
        kept |= _by_cells(np.clip(np.floor(source * scale + shift), 0, _CELLS).astype(np.intp), target_cells)
    return kept


def _by_cells(source_cells: NDArray[np.intp], target_cells: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Which matches (n,) belong to right pairs of cells, given as columns and rows (n, 2) of both images."""
    side = _CELLS + 3  # with a border of empty cells, so that each has neighbours
    first, second = ((cells + 1) @ [1, side] for cells in (source_cells, target_cells))
    counts = np.bincount(first * side**2 + second, minlength=side**4).reshape(side**2, side**2)
    used = np.unique(first)
    best = counts[used].argmax(axis=1)
    around = _NEAR @ [1, side]
    support = counts[used[:, None] + around, best[:, None] + around].sum(axis=1)
    expected = counts.sum(axis=1)[used[:, None] + around].mean(axis=1)
    leads_to = np.full(side**2, -1)
    leads_to[used] = np.where(support > _FACTOR * np.sqrt(expected), best, -1)
    return np.asarray(leads_to[first] == second, dtype=np.bool_)
