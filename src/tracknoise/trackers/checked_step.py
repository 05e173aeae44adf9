"""Checks of what a tracker reports about one frame."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import TrackerError
from tracknoise.printable import counted
from tracknoise.tables.schema import TrackEnd

if TYPE_CHECKING:
    from tracknoise.trackers.tracker import Step

_KINDS = {"ids": "iu", "uv": "fiu", "born": "b", "response": "f", "ended_ids": "iu", "ended": "iu"}
"""Kinds of elements that the arrays of a step may have, as NumPy abbreviates them."""
_NAMES = {"b": "bool", "f": "float", "fiu": "numbers", "iu": "whole numbers"}
_CAUSES = tuple(end for end in TrackEnd if end is not TrackEnd.sequence_end)
"""Why a track can end before the last frame."""


def check_step(step: "Step", live_ids: NDArray[np.int64]) -> None:
    """Check a step by itself, and against the features that were alive before it.

    Parameters
    ----------
    step
        What the tracker reported. Its quality is not looked at.
    live_ids
        (k,) int64: features that began in earlier steps and have not ended in one.

    Raises
    ------
    TrackerError
        If arrays have other shapes or types than promised, positions are not finite, a feature is reported or ends
        twice, began before, is unknown, is gone without having ended, or ends for no known reason, or if counts do not
        fit to each other or to the features that were alive.
    """
    found = next(_mistakes(step, live_ids), None)
    if found is not None:
        raise TrackerError(f"a tracker reported {found}")


def _mistakes(step: "Step", live_ids: NDArray[np.int64]) -> Iterator[str]:
    for name, kinds in _KINDS.items():
        values = getattr(step, name)
        if not isinstance(values, np.ndarray) or values.dtype.kind not in kinds:
            found = values.dtype if isinstance(values, np.ndarray) else type(values).__name__
            yield f"{name} of type {found}, expected an array of {_NAMES[kinds]}"
    n = len(step.ids)
    for name, shape in {"uv": (n, 2), "born": (n,), "response": (n,), "ended": (len(step.ended_ids),)}.items():
        if getattr(step, name).shape != shape:
            yield f"{name} of shape {getattr(step, name).shape}, expected {shape}"
    for feature in step.ids[~np.isfinite(step.uv).all(axis=1)][:1]:
        yield f"feature {feature} at a position that is not finite"
    for ids, place in ((step.ids, "in one frame"), (step.ended_ids, "as ended")):
        for feature in _repeated(ids)[:1]:
            yield f"feature {feature} twice {place}"
    for place in np.flatnonzero(~np.isin(step.ended, _CAUSES))[:1]:
        expected = ", ".join(f"{cause.value} ({cause.name})" for cause in _CAUSES)
        yield f"reason {step.ended[place]} why feature {step.ended_ids[place]} ended, expected one of {expected}"
    yield from _contradictions(step, live_ids)
    yield from _miscounted(step, len(live_ids))


def _contradictions(step: "Step", live_ids: NDArray[np.int64]) -> Iterator[str]:
    """What does not fit to earlier steps."""
    left = live_ids[~np.isin(live_ids, step.ended_ids)]
    begun, followed = step.ids[step.born], step.ids[~step.born]
    for feature in (*step.ended_ids[~np.isin(step.ended_ids, live_ids)][:1], *followed[~np.isin(followed, left)][:1]):
        yield f"feature {feature}, which never began or has ended"
    for feature in begun[np.isin(begun, left)][:1]:
        yield f"feature {feature} as new, which began before and has not ended"
    alive = len(left) + len(begun)
    if step.alive != alive:
        yield f"{counted(step.alive, 'feature')} alive, expected {alive}: all that began and are not among ended_ids"


def _miscounted(step: "Step", live: int) -> Iterator[str]:
    """Counts that no step can have: outlier ratios are made of them."""
    if step.offered != live:
        yield f"{counted(step.offered, 'feature')} offered, expected {live}: all that were alive before"
    if not 0 <= step.outliers <= step.matched <= step.offered:
        found = f"{counted(step.outliers, 'outlier')} and {step.matched} matched of {counted(step.offered, 'feature')}"
        yield f"{found}, expected no more outliers than matched, and no more of these than were offered"


def _repeated(ids: NDArray[np.int64]) -> NDArray[np.int64]:
    ordered = np.sort(ids)
    repeated: NDArray[np.int64] = ordered[1:][ordered[1:] == ordered[:-1]]
    return repeated
