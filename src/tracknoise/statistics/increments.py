"""How an error changes from one frame that the tracker saw to the next, and whether changes depend on those before.

With d_k = e_k - e_(k - s) the change of a track's error that ends at age k, at speed s, over the pairs of changes of
one track that lie l steps apart:

- autocorrelation(l) = sum(d_k d_(k - l s)) / sum((d_k^2 + d_(k - l s)^2) / 2) (autocorrelation)

about zero, not about the mean, so that a steady drift shows as positive correlation; between -1 and 1 whatever the
data. Errors that are independent from frame to frame give about -1/2 at lag 1 and 0 beyond (a little less than -1/2
where the first position is exact and tracks are short), those of a random walk 0 at every lag, of a steady drift 1.
"""

from collections.abc import Iterator, Mapping

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.blocks import with_blocks
from tracknoise.statistics.grouping import group_rows
from tracknoise.statistics.joint import measure_moments
from tracknoise.statistics.populations import measured
from tracknoise.tables.schema import INCREMENTS, OBSERVATIONS, ORIGIN, TRIMMING, Schema, check

CHANGE = "change"
"""Aspect of the changes of the errors of every track, in image axes, along the age at which they end."""
LAGS = 5
"""Largest lag, in steps of the tracker."""

_ORDERS = {"m_uu": (2, 0), "m_uv": (1, 1), "m_vv": (0, 2)}
_KEYS = ["block", "trimming", "lag", "age"]
_READ = [*ORIGIN, "track", "frame", "age", "du_px", "dv_px", "kept"]


def increments(observations: pl.DataFrame, tracks: pl.DataFrame) -> pl.DataFrame:
    """Moments of the changes of errors by age, and what (autocorrelation) is made of.

    Parameters
    ----------
    observations
        An observations table of any number of scenes, trimmed (`tracknoise.statistics.trimming.trim`). Only visible
        ones count; where one is missing in between, there is no change across the gap.
    tracks
        The tracks of the same scenes and conditions, all of them.

    Returns
    -------
    polars.DataFrame
        Schema `INCREMENTS`, sorted by its columns before `n`: lags 0 to `LAGS`, as far as there are such pairs.

    Raises
    ------
    SchemaError
        If a table has other columns, or an observation belongs to no track.
    """
    seen = measured(check(observations, OBSERVATIONS, "observations"), population="visible")
    conditions = group_rows(seen, list(ORIGIN))
    blocked = with_blocks(seen.select(_READ), tracks)
    changes = changes_of(blocked.with_columns(condition=pl.Series(conditions.index)))
    selections = {"untrimmed": changes, "trimmed": changes.filter("kept")}
    parts = [
        table.with_columns(trimming=pl.lit(trimming, dtype=TRIMMING))
        for trimming, chosen in selections.items()
        for table in (_by_age(chosen), *_products(chosen))
    ]
    table = pl.concat(parts, how="diagonal").sort("condition", *_KEYS)
    table = table.hstack(conditions.keys[table["condition"]])
    return check(table.select(pl.col(name).cast(kind) for name, kind in INCREMENTS.items()), INCREMENTS, "increments")


def changes_of(seen: pl.DataFrame) -> pl.DataFrame:
    """The rows that follow on another, track by track in the order of frames, with changes in place of errors.

    Parameters
    ----------
    seen
        Visible observations; column `condition`, a number, tells those of different sequences and conditions apart.
    """
    ordered = seen.sort("condition", "track", "frame")
    return ordered.with_columns(pl.col("du_px", "dv_px").diff())[_followers(ordered, 1)]


def _followers(ordered: pl.DataFrame, steps: int) -> NDArray[np.intp]:
    """Rows of which the row so many places above is of the same track, as many frames that the tracker saw before."""
    names = ("condition", "track", "frame", "speed")
    condition, track, frame, speed = (ordered[name].to_numpy().astype(np.int64) for name in names)
    late, early = slice(steps, None), slice(None, max(len(frame) - steps, 0))
    same = (condition[late] == condition[early]) & (track[late] == track[early])
    return np.flatnonzero(same & (frame[late] - frame[early] == steps * speed[late])) + steps


def _by_age(changes: pl.DataFrame) -> pl.DataFrame:
    """Rows of lag 0."""
    groups = group_rows(changes, ["condition", "age"])
    pairs = changes.select("du_px", "dv_px").to_numpy()
    moments = measure_moments(pairs, groups.index, groups.count, orders=tuple(_ORDERS.values()))
    columns = {"n": moments.n, **dict(zip(("mean_u", "mean_v"), moments.mean.T, strict=True))}
    columns |= dict(zip(_ORDERS, moments.central.T, strict=True))
    return groups.keys.hstack(_typed(columns)).with_columns(lag=pl.lit(0, dtype=pl.UInt32))


def _products(changes: pl.DataFrame) -> Iterator[pl.DataFrame]:
    """Rows of each lag from 1 on."""
    groups = group_rows(changes, ["condition", "block"])
    for lag in range(1, LAGS + 1):
        late = _followers(changes, lag)
        group = groups.index[late]
        columns = {"n": np.bincount(group, minlength=groups.count)}
        for axis in "uv":
            values = changes[f"d{axis}_px"].to_numpy()
            now, before = values[late], values[late - lag]
            terms = {f"lagged_{axis}{axis}": now * before, f"squares_{axis}{axis}": (now**2 + before**2) / 2}
            columns |= {name: np.bincount(group, term, groups.count) for name, term in terms.items()}
        rows = groups.keys.hstack(_typed(columns)).filter(pl.col("n") > 0)
        yield rows.with_columns(lag=pl.lit(lag, dtype=pl.UInt32))


def _typed(columns: Mapping[str, NDArray[np.int64] | NDArray[np.float64]]) -> pl.DataFrame:
    kinds: Schema = {name: INCREMENTS[name] for name in columns}
    return pl.DataFrame(columns, schema=dict(kinds))
