"""Tables of moments of du, dv by age or frame: measured from the observations of a scene, and pooled over scenes.

Everything else in this layer that concerns errors is computed from these tables, so that scenes can be pooled,
resampled and added later without a second look at the observations.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
import polars as pl

from tracknoise.statistics.grouping import Groups, group_rows
from tracknoise.statistics.joint import FOURTH, VARIANCES, JointMoments, measure_moments, pool_moments
from tracknoise.statistics.populations import VISIBLE, measured
from tracknoise.tables.schema import AXIS, MOMENTS, OBSERVATIONS, ORIGIN, POPULATION, TRIMMING, check

KEYS = [*ORIGIN, "population", "trimming", "axis", "at"]
_N, _MEAN_U, _MEAN_V = pl.col("n"), pl.col("mean_u").fill_null(0.0), pl.col("mean_v").fill_null(0.0)
ABOUT_ZERO: Mapping[str, pl.Expr] = MappingProxyType(
    {
        "u": _N * _MEAN_U,
        "v": _N * _MEAN_V,
        "uu": pl.col("m_uu") + _N * _MEAN_U**2,
        "uv": pl.col("m_uv") + _N * _MEAN_U * _MEAN_V,
        "vv": pl.col("m_vv") + _N * _MEAN_V**2,
    }
)
"""Sums about zero, which add up, from n, means and central sums."""
_MEANS = ["mean_u", "mean_v"]
_SUMS = ["m_" + "u" * p + "v" * q for p, q in FOURTH]
_ABS_MEANS = ["mean_abs_u", "mean_abs_v"]
_ABS_SUMS = ["m_abs_" + "u" * p + "v" * q for p, q in VARIANCES]
_VALUES = {column: kind for column, kind in MOMENTS.items() if column not in KEYS}


def scene_moments(observations: pl.DataFrame, *, axis: str = "age") -> pl.DataFrame:
    """Moments of the errors of every scene and condition, by population, trimming, and age or frame.

    Parameters
    ----------
    observations
        An observations table of any number of scenes, trimmed (`tracknoise.statistics.trimming.trim`).
    axis
        ``age`` where the error of a feature is zero when it is first seen; ``frame`` where it is zero in the key frame
        of a scan, so that time counts, not age.

    Returns
    -------
    polars.DataFrame
        Schema `MOMENTS`, sorted by the columns of `KEYS`: a row for each combination that has an observation.
        `untrimmed` counts every observation, `trimmed` those of tracks that were kept.

    Raises
    ------
    SchemaError
        If the table has other columns, or an error is missing where the true position is known.
    """
    known = measured(check(observations, OBSERVATIONS, "observations"), population="projected")
    cells = measure_cells(
        known.with_columns(pl.col(axis).alias("at"), pl.col("truth").is_in(VISIBLE).alias("visible")),
        by=[*ORIGIN, "at", "visible", "kept"],
    )
    selections = {
        ("visible", "untrimmed"): pl.col("visible"),
        ("visible", "trimmed"): pl.col("visible") & pl.col("kept"),
        ("projected", "untrimmed"): pl.lit(value=True),
        ("projected", "trimmed"): pl.col("kept"),
    }
    return check(unite_cells(cells, selections, axis=axis).select(*MOMENTS).sort(KEYS), MOMENTS, "moments")


def measure_cells(errors: pl.DataFrame, *, by: Sequence[str]) -> pl.DataFrame:
    """Moments of the errors in the rows that agree in `by`: disjoint cells, of which selections are unions.

    Parameters
    ----------
    errors
        With the columns `by`, `du_px` and `dv_px`, px, none of them missing.
    by
        Key columns, at least one.

    Returns
    -------
    polars.DataFrame
        Columns `by`, then `n` and the moments as in `MOMENTS`; sorted by `by`.
    """
    groups = group_rows(errors, by)
    pairs = errors.select("du_px", "dv_px").to_numpy()
    signed = measure_moments(pairs, groups.index, groups.count)
    absolute = measure_moments(np.abs(pairs), groups.index, groups.count, orders=VARIANCES)
    return _table(groups, signed, absolute)


def unite_cells(
    cells: pl.DataFrame,
    selections: Mapping[tuple[str, str], pl.Expr],
    *,
    axis: str,
    by: Sequence[str] = (*ORIGIN, "at"),
) -> pl.DataFrame:
    """Moments of selections of cells, one selection after another.

    Parameters
    ----------
    cells
        What `measure_cells` made, by the columns `by` and whatever the selections look at.
    selections
        Which cells make up each population and trimming.
    axis
        What ``at`` is: ``age`` or ``frame``.
    by
        Key columns to keep.

    Returns
    -------
    polars.DataFrame
        What `merge` makes, and columns population, trimming and axis.
    """
    parts = [
        merge(cells.filter(selected), by=by).with_columns(
            population=pl.lit(population, dtype=POPULATION),
            trimming=pl.lit(trimming, dtype=TRIMMING),
            axis=pl.lit(axis, dtype=AXIS),
        )
        for (population, trimming), selected in selections.items()
    ]
    return pl.concat(parts)


def merge(moments: pl.DataFrame, *, by: Sequence[str]) -> pl.DataFrame:
    """Pool the rows that agree in `by`, as if the moments had been measured on all their observations at once.

    Parameters
    ----------
    moments
        A moments table, or what `merge` made of one. A row may stand in it several times, as bootstrap needs.
    by
        Key columns to keep, at least one.

    Returns
    -------
    polars.DataFrame
        Columns `by`, then `n` and the moments as in `MOMENTS`; sorted by `by`. Means are null where n is 0.

    Raises
    ------
    SchemaError
        If a column of moments is missing or of another type.
    """
    check(moments.select(column for column in _VALUES if column in moments.columns), _VALUES, "moments")
    ordered = moments.sort([column for column in moments.columns if column not in _VALUES], maintain_order=True)
    groups = group_rows(ordered, by)
    signed = pool_moments(_joint(ordered, FOURTH, _MEANS, _SUMS), groups.index, groups.count)
    absolute = pool_moments(_joint(ordered, VARIANCES, _ABS_MEANS, _ABS_SUMS), groups.index, groups.count)
    return _table(groups, signed, absolute)


def _joint(table: pl.DataFrame, orders: Sequence[tuple[int, int]], means: list[str], sums: list[str]) -> JointMoments:
    return JointMoments(
        tuple(orders),
        table["n"].to_numpy(),
        table.select(pl.col(means).fill_null(0.0)).to_numpy(),
        table.select(sums).to_numpy(),
    )


def _table(groups: Groups, signed: JointMoments, absolute: JointMoments) -> pl.DataFrame:
    columns = {
        "n": signed.n,
        **dict(zip(_MEANS, signed.mean.T, strict=True)),
        **dict(zip(_SUMS, signed.central.T, strict=True)),
        **dict(zip(_ABS_MEANS, absolute.mean.T, strict=True)),
        **dict(zip(_ABS_SUMS, absolute.central.T, strict=True)),
    }
    values = pl.DataFrame(columns, schema=_VALUES)
    known = pl.when(pl.col("n") > 0).then(pl.col(*_MEANS, *_ABS_MEANS))
    return groups.keys.hstack(values.with_columns(known))
