"""Matches between the keypoints of two images, and those that are mutual nearest neighbours by descriptor."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

DISTANCE, RATIO = "descriptor_distance", "descriptor_ratio"
"""Names of the quality of matches by descriptor: see `mutual_nearest`."""


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Pairs of keypoints of two images, by ascending query row.

    Attributes
    ----------
    query_rows, train_rows : (k,) intp
        The pairs.
    quality : (k,) float32 each
        Of each pair, by the names that a step reports.
    """

    query_rows: NDArray[np.intp]
    train_rows: NDArray[np.intp]
    quality: Mapping[str, NDArray[np.float32]]

    def chosen(self, rows: NDArray[np.bool_]) -> "Matches":
        """Some of the pairs, by a mask (k,)."""
        quality = {name: values[rows] for name, values in self.quality.items()}
        return Matches(self.query_rows[rows], self.train_rows[rows], quality)


def mutual_nearest(query: NDArray[np.float32], train: NDArray[np.float32]) -> Matches:
    """Pairs of descriptors that are each other's nearest neighbour in Euclidean distance.

    The matches are those of ``cv2.BFMatcher(cv2.NORM_L2, crossCheck=True)``: among equally near ones the first
    counts. The squared distance |q|^2 + |t|^2 - 2 q.t is one product of the descriptors with their squared lengths
    appended. All terms are whole numbers below 2^24, which float32 represents exactly, so that neither the order of
    summation nor the number of threads can change a match.

    Parameters
    ----------
    query, train
        (m, d) and (n, d) float32: descriptors of both images.

    Returns
    -------
    Matches
        With the Euclidean distance of each pair (``descriptor_distance``), and that distance over the distance of the
        query to its second nearest in train (``descriptor_ratio``): from 0, unambiguous, to 1, ambiguous. NaN if there
        is no second one.
    """
    if not (len(query) and len(train)):
        no_rows, nothing = np.empty(0, dtype=np.intp), np.empty(0, dtype=np.float32)
        return Matches(no_rows, no_rows, {DISTANCE: nothing, RATIO: nothing})
    left = np.column_stack([query, _squared_length(query), np.ones_like(query[:, 0])])
    right = np.column_stack([-2.0 * train, np.ones_like(train[:, 0]), _squared_length(train)])
    squared = left @ right.T
    nearest_train = squared.argmin(axis=1)
    # Searching rows is much faster than searching columns, and only the rows of some query's nearest are needed.
    nearest_query = (right[nearest_train] @ left.T).argmin(axis=1)
    mutual = np.flatnonzero(nearest_query == np.arange(len(query)))
    distance, ratio = _distances(squared, mutual, nearest_train[mutual])
    return Matches(mutual, nearest_train[mutual], {DISTANCE: distance, RATIO: ratio})


def _distances(
    squared: NDArray[np.float32], rows: NDArray[np.intp], columns: NDArray[np.intp]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Distances (k,) and ratios (k,) of the least elements of some rows, which are overwritten."""
    first = squared[rows, columns]
    squared[rows, columns] = np.inf
    second = squared.min(axis=1)[rows]
    ratio = np.full(len(rows), np.nan, dtype=np.float32)
    ratio[np.isfinite(second)] = 1.0  # equally near, also where both distances are 0
    np.divide(first, second, out=ratio, where=np.isfinite(second) & (second > 0))
    return np.sqrt(np.maximum(first, 0)), np.sqrt(np.maximum(ratio, 0))  # rounding of descriptors of networks


def _squared_length(descriptors: NDArray[np.float32]) -> NDArray[np.float32]:
    squares: NDArray[np.float32] = np.einsum("ij,ij->i", descriptors, descriptors)
    return squares
