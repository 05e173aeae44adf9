"""What trackers of image features keep: the live features, and the report of a step."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.tables.schema import TrackEnd
from tracknoise.trackers.tracker import Step

ALIVE = -1
"""In place of a `TrackEnd`: the feature is still alive."""


@dataclass(frozen=True, slots=True)
class Features:
    """The live features of a tracker, oldest first."""

    ids: NDArray[np.int64]  # (n,): ascending
    uv: NDArray[np.float64]  # (n, 2): latest position of each, px
    first_uv: NDArray[np.float64]  # (n, 2): first position of each, px
    before_uv: NDArray[np.float64]  # (n, 2): position of each before the latest, px; the latest if there is only one
    born: NDArray[np.int64]  # (n,): the frame in which each began

    @classmethod
    def begin(cls, first_id: int, uv: NDArray[np.float64], frame: int = 0) -> "Features":
        """New features at (n, 2) positions in a frame, with ids counting up from `first_id`."""
        ids = np.arange(first_id, first_id + len(uv), dtype=np.int64)
        return cls(ids, uv, uv, uv, np.full(len(uv), frame, dtype=np.int64))

    def __len__(self) -> int:
        return len(self.ids)

    def chosen(self, rows: NDArray[np.intp] | NDArray[np.bool_], uv: NDArray[np.float64]) -> "Features":
        """Some of the features, by index or mask, now at (m, 2) `uv`."""
        return Features(self.ids[rows], uv, self.first_uv[rows], self.uv[rows], self.born[rows])

    def joined(self, later: "Features") -> "Features":
        """These and then the others."""
        return Features(
            np.concatenate([self.ids, later.ids]),
            np.concatenate([self.uv, later.uv]),
            np.concatenate([self.first_uv, later.first_uv]),
            np.concatenate([self.before_uv, later.before_uv]),
            np.concatenate([self.born, later.born]),
        )


_ROUNDING = 1e-3


def are_symmetric(matrices: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Whether matrices (n, 2, 2) are symmetric, but for rounding: 0.1 % of the largest entry. Those with NaN are."""
    with np.errstate(invalid="ignore"):  # of infinite entries
        apart = np.abs(matrices[:, 0, 1] - matrices[:, 1, 0])
    lopsided: NDArray[np.bool_] = apart > _ROUNDING * np.abs(matrices).max(axis=(1, 2))
    return ~lopsided


def displacement_px(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance between (n, 2) positions, (n,) px; infinite where float64 cannot hold it."""
    with np.errstate(over="ignore"):
        return np.hypot(after[:, 0] - before[:, 0], after[:, 1] - before[:, 1])


def report(
    *,
    offered: NDArray[np.int64],
    end: NDArray[np.int8],
    matched: int,
    found: Features,
    new: Features,
    response: NDArray[np.float32],
    missed: int = 0,
    quality: Mapping[str, NDArray[np.float32]] | None = None,
) -> Step:
    """The report of a step: features found, then new ones."""
    over = end != ALIVE
    shown = found.joined(new)
    born = np.zeros(len(shown), dtype=np.bool_)
    born[len(found) :] = True
    return Step(
        ids=shown.ids,
        uv=shown.uv,
        born=born,
        response=np.concatenate([np.full(len(found), np.nan, dtype=np.float32), response]),
        ended_ids=offered[over],
        ended=end[over],
        offered=len(offered),
        matched=matched,
        outliers=int(np.count_nonzero(end == TrackEnd.outlier)),
        alive=len(shown) + missed,
        quality={name: _padded(values, len(shown)) for name, values in (quality or {}).items()},
    )


def _padded(values: NDArray[np.float32], count: int) -> NDArray[np.float32]:
    """The values, followed by NaN up to a count."""
    return np.concatenate([values, np.full(count - len(values), np.nan, dtype=np.float32)])
