"""Mutual nearest neighbours among descriptors, by one matrix product."""

import numpy as np
from numpy.typing import NDArray


def mutual_nearest(query: NDArray[np.float32], train: NDArray[np.float32]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs of descriptors each of which is the other's nearest, in Euclidean distance.

    The matches are those of ``cv2.BFMatcher(cv2.NORM_L2, crossCheck=True)``: of several nearest ones the first
    counts. The squared distance |q|^2 + |t|^2 - 2 q.t is one product of the descriptors with their squared lengths
    appended. All terms are whole numbers below 2^24, which float32 holds exactly, so that neither the order of
    summation nor the count of threads can change a match.

    Parameters
    ----------
    query
        (m, d) float32, whole numbers, of squared length below 2^22. (SIFT's is about 2^18.)
    train
        (n, d) float32, likewise.

    Returns
    -------
    query_rows, train_rows : (k,) intp
        The pairs, by ascending query row.
    """
    if not (len(query) and len(train)):
        nothing = np.empty(0, dtype=np.intp)
        return nothing, nothing
    left = np.column_stack([query, _squared_length(query), np.ones_like(query[:, 0])])
    right = np.column_stack([-2.0 * train, np.ones_like(train[:, 0]), _squared_length(train)])
    nearest_train = (left @ right.T).argmin(axis=1)
    # Rows are searched much faster than columns, and only those that are some query's nearest need to be.
    nearest_query = (right[nearest_train] @ left.T).argmin(axis=1)
    mutual = np.flatnonzero(nearest_query == np.arange(len(query)))
    return mutual, nearest_train[mutual]


def _squared_length(descriptors: NDArray[np.float32]) -> NDArray[np.float32]:
    squares: NDArray[np.float32] = np.einsum("ij,ij->i", descriptors, descriptors)
    return squares
