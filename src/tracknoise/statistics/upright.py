"""Statistics of turned images in the axes of the upright image, so that the two can be compared."""

import polars as pl


def upright(points: pl.DataFrame, *, signed: pl.Expr) -> pl.DataFrame:
    """Values in turned images as values in the axes of the upright image; `rotation` stays as it is.

    An image turned by 90 degrees counter-clockwise has the upright image's pixel (u, v) at (v, width - 1 - u): an
    error (du, dv) in the turned image is (-dv, du) in the upright one. A quarter turn thus swaps the coordinates of
    any statistic, and the u of signed ones changes sign.

    Parameters
    ----------
    points
        With columns rotation (degrees counter-clockwise: 0, 90, 180 or 270), u and v.
    signed
        True in rows whose u and v have a sign, such as mean errors; false for absolute errors and second moments.
    """
    sign = pl.when(signed).then(-1.0).otherwise(1.0)
    for angle in (90, 180, 270):  # as many quarter turns back as there were
        turned = pl.col("rotation") >= angle
        u, v = pl.when(turned).then(sign * pl.col("v")).otherwise("u"), pl.when(turned).then("u").otherwise("v")
        points = points.with_columns(u=u, v=v)
    return points
