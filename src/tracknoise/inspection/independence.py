"""The topic independence: whether scenes are pieces or copies of one recording."""

from collections.abc import Iterator
from collections.abc import Sequence as ListOf
from itertools import pairwise

import numpy as np

from tracknoise.inspection.check_report import Item, Severity, Values
from tracknoise.inspection.copies import copies
from tracknoise.inspection.jumps import steps_of
from tracknoise.sequences.sequence import Sequence, group_of

_MOST_STEPS = 3.0
"""A scene continues another if it begins within this many median steps, in place and in time, of the other's end."""
_MOST_NAMED = 5


def independence(sequences: ListOf[Sequence]) -> Item | None:
    """Scenes that continue the poses of another, or are copies of another; None for a single scene."""
    scenes = {sequence.id.scene: sequence for sequence in sequences}
    if len(scenes) < 2:
        return None
    ordered = [scenes[name] for name in sorted(scenes)]
    continued = [(a.id.scene, b.id.scene) for a, b in pairwise(ordered) if _continues(a, b)]
    copied = [(a.id.scene, b.id.scene) for a, b in copies(ordered)]
    values: Values = {"n_scenes": len(scenes), "n_continued": len(continued), "n_copies": len(copied)}
    if not continued and not copied:
        text = f"There are {len(scenes)} scenes; none continues the poses of another, and none is a copy."
        return Item("independence", Severity.ok, text, values)
    return Item("independence", Severity.caveat, " ".join(_sentences(len(scenes), continued, copied)), values)


def _sentences(n_scenes: int, continued: ListOf[tuple[str, str]], copied: ListOf[tuple[str, str]]) -> Iterator[str]:
    if continued:
        named = ", ".join(f"{b} continues {a}" for a, b in continued[:_MOST_NAMED])
        yield (
            f"{len(continued) + 1} of {n_scenes} scenes are pieces of one recording ({named}). They are not "
            "independent: declare them as a group with dataset.groups."
        )
    if copied:
        named = ", ".join(f"{a} those of {b}" for a, b in copied[:_MOST_NAMED])
        are = "is a copy" if len(copied) == 1 else "are copies"
        yield (
            f"{len(copied)} of {n_scenes} scenes {are}, with the images of another ({named}). Copies are not "
            "independent: leave them out with dataset.scenes."
        )


def _continues(first: Sequence, second: Sequence) -> bool:
    """Whether one begins where and when the other ends. Scenes that their reader groups are known already."""
    known = group_of(first) is not None and group_of(first) == group_of(second)
    end, begin = first.world_from_camera[-1], second.world_from_camera[0]
    if known or min(len(first), len(second)) < 3 or _apart_in_time(first, second):
        return False
    if not (np.isfinite(end).all() and np.isfinite(begin).all()) or np.allclose(begin, np.eye(4), atol=1e-9):
        return False  # a recording that begins at the origin of its own world continues no other
    moved, turned = steps_of(np.stack([end, begin]))
    steps = [np.stack(steps_of(one.world_from_camera)) for one in (first, second)]
    typical = [every[:, np.isfinite(every).all(axis=0)] for every in steps]
    if not all(every.size for every in typical):
        return False  # of a scene without two poses in a row, a typical step is not known
    most_m, most_deg = np.max([np.median(every, axis=1) for every in typical], axis=0)
    return bool(moved[0] <= _MOST_STEPS * most_m and turned[0] <= _MOST_STEPS * max(most_deg, 0.01))


def _apart_in_time(first: Sequence, second: Sequence) -> bool:
    """Whether both have timestamps of one clock, and the second does not follow the first within a few frames.

    Times may have any origin. Where both scenes begin at the same time, it is that of the first frame of each, and says
    nothing.
    """
    before, after = first.timestamps_s, second.timestamps_s
    if before is None or after is None or before[0] == after[0]:
        return False
    return not 0.0 < after[0] - before[-1] <= _MOST_STEPS * float(np.median(np.diff(before)))
