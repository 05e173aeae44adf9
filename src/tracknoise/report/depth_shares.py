"""How many claimed intervals of depths hold the true one: the rows that the page shows."""

import polars as pl

from tracknoise.findings.wording import SPACE
from tracknoise.report.report_data import ReportData

LEVELS = {f"coverage_{level}": level for level in (50, 90, 95, 99)}
"""Levels of the claimed intervals, %, by the names of their quantities."""
_LONGEST, _LEAST_WINDOWS = 15, 100


def depth_shares(data: ReportData) -> pl.DataFrame:
    """Shares at the lowest speed, of the longest window of each tracker that has enough tracks.

    Returns
    -------
    polars.DataFrame
        Columns of `tracknoise.tables.findings_schema.DEPTH_INTERVALS`, with value, low and high in %, and at (the level
        of the claimed interval, %).
    """
    wanted = pl.col("quantity").is_in([*LEVELS]) & (pl.col("window") <= _LONGEST)
    rows = data.nominal(data.depth_intervals).filter(wanted, trimming=data.trimming)
    enough = rows.filter(pl.col("n").min().over("tracker", "window") >= _LEAST_WINDOWS)
    longest = enough.filter(pl.col("window") == pl.col("window").max().over("tracker"))
    levels = pl.col("quantity").replace_strict(LEVELS, return_dtype=pl.Int64)
    return longest.with_columns(pl.col("value", "low", "high") * 100.0, at=levels)


def depth_sentence(data: ReportData, tracker: str) -> str:
    """What 95 % intervals of depths hold with the sigma of residuals and with the consistent one; empty if unknown."""
    rows = depth_shares(data).filter(tracker=tracker, at=95)
    held = {name: f"{share:.0f}{SPACE}%" for name, share in rows.select("covariance", "value").iter_rows()}
    if not {"residual sigma", "consistent sigma"} <= set(held):
        return ""
    residual, consistent = held["residual sigma"], held["consistent sigma"]
    return (
        f"{tracker}: 95{SPACE}% depth intervals hold {residual} of the true depths with the sigma of residuals, and "
        f"{consistent} with the one to set."
    )
