"""Sums from which effects are computed: tables with one row per scene, condition and place.

All have columns scene, POOLED, at, n and sums. A row whose `at` is null says only that the scene was measured.
"""

from collections.abc import Mapping

import polars as pl

from tracknoise.findings.sampling.units import additive
from tracknoise.statistics.conditions import TablesByCondition
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.differences import comparable
from tracknoise.statistics.grouping import reduce_each
from tracknoise.statistics.upright import upright
from tracknoise.tables.enumerations import Trimming, Weighting
from tracknoise.tables.schema import CURVES, ENDS, FRAME_COUNTS, MOMENTS, Schema, check, empty

CURVE_SUMS = ["u", "v", "abs_u", "abs_v", "uu", "vv"]
"""Sums of du, dv, |du|, |dv|, du^2 and dv^2."""
_CURVE = [*POOLED, "axis"]


def curve_sums(
    moments: TablesByCondition, curves: pl.DataFrame, *, population: str, key_frames: Mapping[str, int]
) -> pl.DataFrame:
    """Sums of trimmed errors at the points of curves that may be compared, in the axes of the upright image.

    Parameters
    ----------
    moments, curves
        Moments of all scenes, and the curves made of them, which say where they are cut.
    population
        Which observations the errors are of.
    key_frames
        As in `tracknoise.statistics.differences.comparable`, which says what `at` is.

    Returns
    -------
    polars.DataFrame
        Also with column axis; sums are `CURVE_SUMS`.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    chosen = {"population": population, "trimming": Trimming.trimmed}
    known = (
        check(curves, CURVES, "curves")
        .filter(**chosen, weighting=Weighting.features)
        .select(*_CURVE, "at", "cut")
        .unique()
    )
    cuts = known.partition_by(POOLED, as_dict=True, include_key=False)
    columns = [*_CURVE, "scene", "at", "n", *CURVE_SUMS]
    parts = []
    for key, table in {(): empty(MOMENTS), **moments}.items():  # one part at least, which has the columns
        all_ages = table.filter(**chosen)
        there = additive(all_ages).join(cuts.get(key, known.select("axis", "at", "cut").clear()), on=["axis", "at"])
        parts += [comparable(there, key_frames).select(columns), all_ages.select(*_CURVE, "scene").unique()]
    return _upright(pl.concat(parts, how="diagonal")).sort(*_CURVE, "scene", "at")


def lifetime_sums(ends: TablesByCondition) -> pl.DataFrame:
    """Number of tracks that ended, and how often tracks were looked for (`total`, frames); `at` is 0.

    Their ratio is `frames_per_end` of `tracknoise.statistics.lifetimes.mean_lifetime`.
    """
    ended, censored = pl.col("n_ended"), pl.col("n_censored")
    looked_for = (ended + censored) * pl.col("lifetime") - censored
    return _totals(ends, ENDS, "ends", ended, looked_for)


def outlier_sums(frames: TablesByCondition) -> pl.DataFrame:
    """Sums of F(t-1), and of f1(t) (`total`); `at` is 0."""
    return _totals(frames, FRAME_COUNTS, "frames", pl.col("offered"), pl.col("outliers"))


def _totals(tables: TablesByCondition, schema: Schema, name: str, n: pl.Expr, total: pl.Expr) -> pl.DataFrame:
    kinds = {"n": n.cast(pl.Int64).sum(), "total": total.cast(pl.Int64).sum()}
    summed = reduce_each(tables.values(), schema, name, lambda table: table.group_by(*POOLED, "scene").agg(**kinds))
    return summed.sort(*POOLED, "scene").with_columns(at=pl.lit(0, dtype=pl.Int64))


def _upright(points: pl.DataFrame) -> pl.DataFrame:
    for (u, v), signed in ((("u", "v"), True), (("abs_u", "abs_v"), False), (("uu", "vv"), False)):
        turned = upright(points.select("rotation", u=u, v=v), signed=pl.lit(signed))
        points = points.with_columns(turned["u"].alias(u), turned["v"].alias(v))
    return points
