"""Ids of imported tracks that are slots of an array: each has one feature after another, and the position jumps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tracknoise.text import counted, counted_of

_LEAST_PX = 10.0
_OVER_TYPICAL = 10.0
"""A jump differs by more than so many px from other steps, and by more than so many times what is typical."""
_TYPICAL = 0.3
"""Quantile of what is typical: half of the steps may be jumps."""
_ALL, _LEAST_STEPS = 0.5, 8
"""From this share of so many tracks on that jump in one frame, all features were detected again there."""
_SHARE, _LEAST_TRACKS = 0.2, 5
"""Jumps are noted from this share of tracks on, and from so many."""
_LEAST_ROWS = 4
"""Tracks of fewer rows do not show whether a position jumps and stays."""
_ALONE = 0.5
"""Of a jump that stays, the steps before and after differ by less than this share of it."""
_FITTED = 0.5
"""An affine motion of the image explains steps if it leaves less than this share of their median distance."""


def jumps_note(track: NDArray[np.int64], frame: NDArray[np.int64], uv: NDArray[np.float64]) -> str | None:
    """A sentence if ids may be slots. Shapes: (n,), (n,), (n, 2), sorted by frame and track."""
    steps = _Steps.of(track, frame, uv)
    all_new = steps.frames_of_all()
    jumped = np.unique(steps.track[steps.stays])
    long = int(np.count_nonzero(np.unique(track, return_counts=True)[1] >= _LEAST_ROWS))
    if not len(all_new) and (len(jumped) < _LEAST_TRACKS or len(jumped) < _SHARE * long):
        return None
    where = ""
    if len(all_new):
        shown = ", ".join(map(str, all_new[:3])) + (", ..." if len(all_new) > 3 else "")
        where = f", most of them in {'frame' if len(all_new) == 1 else 'frames'} {shown}"
        jumped = np.unique(np.concatenate([jumped, steps.track[np.isin(steps.frame, all_new)]]))
    jump = counted_of(len(jumped), len(np.unique(track)), "imported track", "jumps", "jump")
    return (
        f'{jump} by more than {steps.limit_px:.0f} px{where}: if ids are slots that are used again, set ids = "slots"'
    )


def split_at_births(
    track: NDArray[np.int64], frame: NDArray[np.int64], uv: NDArray[np.float64]
) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    """The number of the track (n,) of each observation where ids are slots, and how many births there are in them.

    A new track begins where the position jumps, unless it returns in the next frame. Where most positions jump in one
    frame, all tracks of it are new. Shapes: as `jumps_note`.
    """
    steps = _Steps.of(track, frame, uv)
    births = (steps.jumps & ~steps.returns) | np.isin(steps.frame, steps.frames_of_all())
    begins = np.zeros(len(track), dtype=np.bool_)
    begins[steps.row[births]] = True
    order = np.lexsort([frame, track])
    first = np.append(True, np.diff(track[order]) != 0)[: len(order)]
    number = np.empty(len(track), dtype=np.int64)
    number[order] = np.cumsum(first | begins[order]) - 1
    note = (
        f"{counted(int(begins.sum()), 'birth')} within imported tracks, at jumps of more than {steps.limit_px:.0f} px"
    )
    return number, (note,)


@dataclass(frozen=True, slots=True, eq=False)
class _Steps:
    """Steps of tracks from one frame with rows to the next, sorted by track and frame."""

    row: NDArray[np.intp]  # (m,): the observation to which each leads
    track: NDArray[np.int64]  # (m,)
    frame: NDArray[np.int64]  # (m,): the frame to which each leads
    by: NDArray[np.float64]  # (m, 2): px
    common: NDArray[np.float64]  # (m, 2): what the steps of all tracks to the same frame have in common, px
    follows: NDArray[np.bool_]  # (m - 1,): whether each step but the first begins where the one before ends
    limit_px: float  # how far from what is expected a step is that is a jump

    @classmethod
    def of(cls, track: NDArray[np.int64], frame: NDArray[np.int64], uv: NDArray[np.float64]) -> "_Steps":
        """All steps of tracks (n,) in frames (n,) at positions (n, 2)."""
        order = np.lexsort([frame, track])
        place = np.searchsorted(np.unique(frame), frame[order])
        last = np.flatnonzero((np.diff(track[order]) == 0) & (np.diff(place) == 1)) + 1
        row, before = order[last], order[last - 1]
        by, common = uv[row] - uv[before], np.zeros((len(row), 2))
        follows = before[1:] == row[:-1]
        by_frame = np.argsort(frame[row], kind="stable")
        parts = np.split(by_frame, np.flatnonzero(np.diff(frame[row][by_frame])) + 1) if len(row) else []
        for part in parts:
            common[part] = np.median(by[part], axis=0)
        off = _apart(by, common, follows)
        limit = max(_LEAST_PX, _OVER_TYPICAL * float(np.quantile(off, _TYPICAL))) if len(row) else _LEAST_PX
        for part in parts:
            if np.mean(off[part] > limit) >= _SHARE:
                common[part] = _motion_of_camera(uv[before[part]], by[part], common[part])
        return cls(row, track[row], frame[row], by, common, follows, limit)

    @property
    def jumps(self) -> NDArray[np.bool_]:
        """Which steps are by far unlike others to the same frame, and unlike those before and after."""
        return np.asarray(_apart(self.by, self.common, self.follows) > self.limit_px)

    @property
    def returns(self) -> NDArray[np.bool_]:
        """Which steps are one of two that lead away and back: one position is wrong, and the track is the same."""
        two = self.by[1:] + self.by[:-1]
        back = np.hypot(*(two - self.common[1:] - self.common[:-1]).T) <= self.limit_px
        back[1:] |= self.follows[:-1] & (np.hypot(*(two[1:] - 2.0 * self.by[:-2]).T) <= self.limit_px)
        returning = np.zeros(len(self.row), dtype=np.bool_)
        returning[1:] |= self.follows & back
        returning[:-1] |= self.follows & back
        return returning & self.jumps

    @property
    def stays(self) -> NDArray[np.bool_]:
        """Which steps are jumps between steps that are alike."""
        staying = np.zeros(len(self.row), dtype=np.bool_)
        if len(self.row) > 2:
            before, now, after = self.by[:-2], self.by[1:-1], self.by[2:]
            alone = np.hypot(*(after - before).T) <= _ALONE * np.hypot(*(now - 0.5 * (before + after)).T)
            staying[1:-1] = self.follows[:-1] & self.follows[1:] & alone & self.jumps[1:-1]
        return staying

    def frames_of_all(self) -> NDArray[np.int64]:
        """Frames in which most tracks jump, each in its own direction."""
        jumps = self.jumps
        frames = []
        for frame in np.unique(self.frame[jumps]):
            mine = self.frame == frame
            if np.count_nonzero(mine) >= _LEAST_STEPS and jumps[mine].mean() >= _ALL:
                frames.append(frame)
        return np.array(frames, dtype=np.int64)


def _apart(by: NDArray[np.float64], common: NDArray[np.float64], follows: NDArray[np.bool_]) -> NDArray[np.float64]:
    """How far steps (m, 2) are from what may be expected: the common step, and those before and after, (m,) px."""
    apart: NDArray[np.float64] = np.hypot(*(by - common).T)
    changed = np.where(follows, np.hypot(*np.diff(by, axis=0).T), np.inf)
    apart[1:] = np.minimum(apart[1:], changed)
    apart[:-1] = np.minimum(apart[:-1], changed)
    return apart


def _motion_of_camera(
    start: NDArray[np.float64], by: NDArray[np.float64], median: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Steps (n, 2) of an affine motion of the image, where it explains those from (n, 2) positions; else the median."""
    design = np.column_stack([start, np.ones(len(start))])
    motion = design @ np.linalg.lstsq(design, by, rcond=None)[0]
    left, before = (np.median(np.hypot(*(by - prediction).T)) for prediction in (motion, median))
    return np.asarray(motion if len(by) >= _LEAST_STEPS and left < _FITTED * before else median)
