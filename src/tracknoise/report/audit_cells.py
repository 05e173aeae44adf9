"""The audit of the truth as tables of text."""

import polars as pl

from tracknoise.findings.wording import DASH, SPACE, number, percent, pixels
from tracknoise.report.cells import Cells

_FAMILIES = {
    "alone": "alone",
    "beside_bias": "beside biases of the trackers",
    "optics": "optics",
    "timing": "timing",
    "depth": "depth",
    "mounting": "mounting",
    "optics_and_timing": "optics and timing",
    "all": "all",
    "named": "all faults found",
}
_CAPTION = (
    "Corrections of the stated truth, fitted to the errors of all trackers. Explained: share of the second moment that "
    "a correction removes from data that took no part in its fit."
)


def parameter_cells(audit: pl.DataFrame) -> Cells:
    """One row per number of every fit."""
    headings = ["fitted", "parameter", "stated", "value", "low", "high", "unit", "explained", "condition", "verdict"]
    rows = [
        [
            _FAMILIES[row["family"]],
            f"{row['parameter'].replace('_', ' ')} {row['component']}".strip(),
            *(number(row[name], digits=4) for name in ("stated", "value", "low", "high")),
            row["unit"],
            percent(row["gain"]),
            number(row["condition"], digits=2),
            (row["verdict"] or DASH).replace("_", " "),
        ]
        for row in audit.filter(pl.col("family").is_not_null()).iter_rows(named=True)
    ]
    numeric = [False, False, True, True, True, True, False, True, True, False]
    return Cells(_CAPTION + _resampled(audit), headings, rows, numeric)


def curve_cells(curves: pl.DataFrame) -> Cells:
    """Mean error and second moment by age, before and after each correction."""
    headings = ["tracker", "age", "corrected", "n", "mean u (px)", "mean v (px)", "second u (px²)", "second v (px²)"]
    names = ("mean_u_px", "mean_v_px", "second_uu", "second_vv")
    rows = [
        [
            row["tracker"],
            number(row["age"]),
            "nothing" if row["correction"] == "measured" else row["correction"].replace("_", " "),
            number(row["n"]),
            *(pixels(row[name]) for name in names),
        ]
        for row in curves.iter_rows(named=True)
    ]
    caption = "Errors before and after corrections, each together with those above it."
    return Cells(caption, headings, rows, [False, True, False, *[True] * 5])


def _resampled(audit: pl.DataFrame) -> str:
    """How intervals were made."""
    units = audit["resampled"].drop_nulls()
    if units.is_empty():
        return ""
    kind = {"blocks": "blocks of tracks", "within": "scenes within their groups"}.get(units[0], units[0])
    level = f"{100 * audit['level'].drop_nulls()[0]:g}{SPACE}%"
    return f" {level} intervals from {audit['n_units'].drop_nulls()[0]} {kind}."
