"""What the table of trims says about a run."""

import polars as pl


def dropped_above(trims: pl.DataFrame) -> float | None:
    """Percentile of the tracks' largest errors above which a run's tracks were dropped; None where none was.

    Parameters
    ----------
    trims
        Schema `TRIMS`, of one run.
    """
    found: list[float] = trims["percentile"].drop_nulls().unique().to_list()
    return found[0] if found and found[0] < 100 else None
