"""Faults of the truth that are usual mistakes: distances along the ray as depths, and poses of other frames."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.audit.parameters import Family, Parameter

_MOST_HALF, _ROUNDING = 0.25, 0.1
"""A clock offset is one of whole frames if its interval is this narrow, and holds a whole number or is this near."""


def whole_frames(offset: float, half: float) -> int:
    """Number of frames that poses are off by; 0 where a clock offset is not surely a whole number of frames.

    Parameters
    ----------
    offset
        The pose this many frame intervals after a frame fits its image.
    half
        Half of its interval, frame intervals.
    """
    whole = round(offset)
    return whole if half <= _MOST_HALF and abs(offset - whole) <= max(half, _ROUNDING) else 0


def shifted_text(frames: int) -> str:
    """``Poses are off by 1 frame: pose i +1 belongs to frame i``."""
    plural = "s" if abs(frames) > 1 else ""
    return f"Poses are off by {abs(frames)} frame{plural}: pose i {frames:+d} belongs to frame i"


def usual_mistakes(audit: pl.DataFrame) -> list[str]:
    """Sentences about named faults that are usual mistakes, in the order of the faults.

    Parameters
    ----------
    audit
        Table `tracknoise.tables.audit_schema.AUDIT`; may be empty.
    """
    together = audit.filter(family=str(Family.named))
    found = [row["parameter"] for row in together.iter_rows(named=True) if _is_usual(row)]
    alone = audit.filter(family=str(Family.alone)).filter(pl.col("parameter").is_in(found))
    return alone.drop_nulls("rank").sort("rank")["text"].to_list()


def _is_usual(row: Mapping[str, Any]) -> bool:
    """Whether a row of a named fault is of a usual mistake."""
    if row["parameter"] != Parameter.clock_offset:
        return bool(row["parameter"] == Parameter.ray_depth)
    frame = row["value"] / row["in_frames"] if row["in_frames"] else 1.0
    return whole_frames(row["in_frames"], 0.5 * (row["high"] - row["low"]) / frame) != 0
