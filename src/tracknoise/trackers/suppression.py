"""Where features may be: outside the margin, and outside the squares of those that came before."""

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.trackers.detection import Detection


class Mask:
    """The pixels of one image that are still free of features.

    A feature belongs to the pixel whose centre is nearest to it (halves round up). It is free if that pixel lies
    outside the border margin and outside the square around the pixel of every feature that claimed its place
    before.

    Parameters
    ----------
    size
        (width, height) of the image, px.
    detection
        The width of the margin and the side of the squares.
    """

    __slots__ = ("_blocked", "_detection", "_size", "_unpainted")

    def __init__(self, size: tuple[int, int], detection: Detection) -> None:
        self._size = size
        self._detection = detection
        self._blocked: NDArray[np.uint8] | None = None
        self._unpainted: list[tuple[NDArray[np.int32], NDArray[np.int32]]] = []

    def claim(self, uv: NDArray[np.float64], *, limit: int | None = None) -> NDArray[np.intp]:
        """Let features claim their places in the given order: each that is free takes its square from the others.

        Parameters
        ----------
        uv
            (n, 2) float64, px; NaN and positions outside the image are never free.
        limit
            How many may claim a place at most.

        Returns
        -------
        (m,) intp
            Indices of those that did, ascending.
        """
        free, column, row = self._free(uv)
        kept = _first_come(column, row, self._detection.square_px // 2)[:limit]
        self._unpainted.append((column[kept], row[kept]))
        return free[kept]

    def _free(self, uv: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.int32], NDArray[np.int32]]:
        """Those outside the margin and all squares: indices, columns and rows of their pixels."""
        margin = self._detection.margin_px
        low, high = margin - 0.5, np.array(self._size) - margin - 0.5
        free = np.flatnonzero(((uv >= low) & (uv < high)).all(axis=1))
        column, row = np.floor(uv[free] + 0.5).astype(np.int32).T
        if self._unpainted:
            open_ = self._painted()[row, column] == 0
            free, column, row = free[open_], column[open_], row[open_]
        return free, column, row

    def _painted(self) -> NDArray[np.uint8]:
        width, height = self._size
        centres = np.zeros((height, width), dtype=np.uint8)
        for column, row in self._unpainted:
            centres[row, column] = 1
        side = self._detection.square_px
        squares = np.asarray(cv2.dilate(centres, np.ones((side, side), dtype=np.uint8)), dtype=np.uint8)
        return squares


def _first_come(column: NDArray[np.int32], row: NDArray[np.int32], reach: int) -> NDArray[np.intp]:
    """Go through pixels in order, keeping those farther than `reach` (Chebyshev) from all that were kept before.

    Only those with another nearby need the sequential loop.
    """
    crowded = _crowded(column, row, reach)
    kept = ~crowded
    loop = np.flatnonzero(crowded)
    if len(loop):
        kept[loop[_sequentially(column[loop], row[loop], reach)]] = True
    return np.flatnonzero(kept)


def _sequentially(column: NDArray[np.int32], row: NDArray[np.int32], reach: int) -> list[int]:
    left, top = column - column.min(), row - row.min()
    stride = int(left.max()) + 2 * reach + 1
    blocked = bytearray((int(top.max()) + 2 * reach + 1) * stride)  # padded: no square needs clipping
    squares = np.frombuffer(blocked, dtype=np.uint8).reshape(-1, stride)
    centres = ((top + reach) * stride + left + reach).tolist()
    side = 2 * reach + 1
    kept = []
    for index, (centre, x, y) in enumerate(zip(centres, left.tolist(), top.tolist(), strict=True)):
        if not blocked[centre]:
            squares[y : y + side, x : x + side] = 1
            kept.append(index)
    return kept


def _crowded(column: NDArray[np.int32], row: NDArray[np.int32], reach: int) -> NDArray[np.bool_]:
    """Which pixels may have another within `reach`: never False for one that has.

    Each pixel goes into a cell of side reach + 1, so that all within reach lie in the 3x3 cells around it. A cell
    holds one pixel; where several fall into it, the pixels of all cells around are called crowded.
    """
    if not len(column):
        return np.zeros(0, dtype=np.bool_)
    side = reach + 1
    stride = int(column.max()) // side + 3
    cell = (row // side + 1) * stride + column // side + 1
    index = np.arange(len(cell))
    holder = np.full(int(cell.max()) + stride + 2, -1)
    holder[cell] = index
    shared = np.zeros(holder.shape, dtype=np.bool_)
    shared[cell[holder[cell] != index]] = True
    around = cell[:, None] + (np.arange(-1, 2)[:, None] * stride + np.arange(-1, 2)).ravel()
    other = holder[around]
    near = (np.abs(column[other] - column[:, None]) <= reach) & (np.abs(row[other] - row[:, None]) <= reach)
    crowded: NDArray[np.bool_] = np.any(shared[around] | (near & (other >= 0) & (other != index[:, None])), axis=1)
    return crowded
