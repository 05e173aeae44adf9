"""What a quick run does not know."""

import textwrap

from tracknoise.tables.store import RunFolder
from tracknoise.text import counted

_WIDTH = 110


def quick_limits(run: RunFolder) -> str:
    """What a quick run was measured on, and what the whole run adds."""
    entries = list(run.manifest().sequences.values())
    measured = sum(sum(stop - start for start, stop in entry.parts) or entry.n_frames for entry in entries)
    total = sum(entry.n_frames for entry in entries)
    longest = max(max((stop - start for start, stop in entry.parts), default=entry.n_frames) for entry in entries)
    text = (
        f"Quick answer: {measured} of {counted(total, 'frame')} of {counted(len(entries), 'sequence')}. Tracks end "
        f"after {longest} frames, so that errors of older tracks and long lifetimes are unknown. Intervals are wide. "
        "The same command without --quick measures all frames and speeds, and writes the report."
    )
    return textwrap.fill(text, _WIDTH, break_long_words=False, break_on_hyphens=False)
