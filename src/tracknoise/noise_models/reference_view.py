"""The view of a run that noise is of."""

from typing import Any

import polars as pl


def reference_view(table: pl.DataFrame) -> dict[str, Any]:
    """The least turned images, played forward if there are such.

    Errors of turned images have other axes, and a drift changes its sign where frames are played backward: they cannot
    be added to others.

    Parameters
    ----------
    table
        Of any sequences, with rows and the columns rotation and direction.

    Returns
    -------
    dict
        Values of these columns, for `polars.DataFrame.filter`.
    """
    rotation = table["rotation"].min()
    return {"rotation": rotation, "direction": table.filter(rotation=rotation)["direction"].max()}
