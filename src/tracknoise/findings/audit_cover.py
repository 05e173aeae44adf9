"""Whether faults of the truth that an audit found explain an error: what is left of it where they are corrected.

`AUDIT_CURVES` has errors by age as measured, and with all faults corrected, in units that took no part in the fit. A
mean error, or the growth of a second moment, is covered by the audit if the corrections take off at least half of it:
the claim that it is the tracker's then rests on what is stated wrongly. (audit.cover)
"""

from dataclasses import dataclass
from math import hypot, sqrt
from typing import Any

import polars as pl

from tracknoise.tables.audit_schema import EVERYTHING, MEASURED

_MOST_LEFT = 0.5
_LEAST_ERRORS = 30


@dataclass(frozen=True, slots=True)
class AuditCover:
    """An error, and what corrections of the truth leave of it.

    Attributes
    ----------
    age
        Largest audited age up to that in question.
    error_px, left_px
        Size of the error as measured and corrected, px; of a growth its root.
    is_covered
        Whether at most half of the mean, or of the growth of the second moment, is left.
    """

    age: int
    error_px: float
    left_px: float
    is_covered: bool


def audited_mean(curves: pl.DataFrame, tracker: str, at: int) -> AuditCover | None:
    """Length of the mean error of a tracker at an age, with and without corrections: (audit.cover).

    Parameters
    ----------
    curves
        Table `AUDIT_CURVES`.
    tracker
        Its name.
    at
        Age, or distance from the key frame, frames.

    Returns
    -------
    AuditCover or None
        None where no fault was found, or the tracker took no part in the audit.
    """
    rows = _both(curves, tracker, at)
    if not rows:
        return None
    error_px, left_px = (hypot(rows[-1][f"mean_u_px{end}"], rows[-1][f"mean_v_px{end}"]) for end in ("", "_left"))
    return AuditCover(rows[-1]["age"], error_px, left_px, is_covered=left_px <= _MOST_LEFT * error_px)


def audited_growth(curves: pl.DataFrame, tracker: str, coordinate: str, at: int) -> AuditCover | None:
    """Root of the growth of a second moment from the first audited age to another: see `audited_mean`.

    Parameters
    ----------
    curves, tracker, at
        As for `audited_mean`.
    coordinate
        u or v.
    """
    rows, column = _both(curves, tracker, at), f"second_{coordinate}{coordinate}"
    if len(rows) < 2:
        return None
    grown, left = (rows[-1][f"{column}{end}"] - rows[0][f"{column}{end}"] for end in ("", "_left"))
    error_px, left_px = (sqrt(max(value, 0.0)) for value in (grown, left))
    return AuditCover(rows[-1]["age"], error_px, left_px, is_covered=grown > 0.0 and left <= _MOST_LEFT * grown)


def _both(curves: pl.DataFrame, tracker: str, at: int) -> list[dict[str, Any]]:
    """Rows of the errors as measured, beside those with all faults corrected, by age."""
    enough = curves.filter(pl.col("age") <= at, pl.col("n") >= _LEAST_ERRORS, tracker=tracker)
    measured, left = (enough.filter(correction=name) for name in (MEASURED, EVERYTHING))
    return measured.join(left, on=["dataset", "age"], suffix="_left").sort("age").to_dicts()
