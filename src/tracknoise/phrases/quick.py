"""What a quick run does not know."""

from tracknoise.tables.store import RunFolder
from tracknoise.text import counted


def quick_limits(run: RunFolder) -> str:
    """What a quick run was measured on, and what the whole run adds."""
    entries = list(run.manifest().sequences.values())
    measured = sum(sum(stop - start for start, stop in entry.parts) or entry.n_frames for entry in entries)
    total = sum(entry.n_frames for entry in entries)
    longest = max(max((stop - start for start, stop in entry.parts), default=entry.n_frames) for entry in entries)
    return (
        f"Quick: {measured} of {counted(total, 'frame')} of {counted(len(entries), 'sequence')}. Tracks end after "
        f"{longest} frames, and intervals are wide. Without --quick: all frames and speeds, and the report."
    )
