"""Errors seen in other ways: along and across the motion or the gradient, and of tracks that live long.

With e = (du, dv) and a unit vector d in the image,

- along = d . e, across = (-d_v, d_u) . e: to the right of d, since v points down

`motion`: d is the direction in which the true position moved since the previous frame that the tracker saw. Where
motion turns, an error that follows it averages out in u and v, and does not along d. `gradient`: d is the dominant
gradient where the feature was first seen. It is an axis without sign, so that absolute errors and second moments along
it mean something and mean errors nothing.

`lives K`: errors in image axes of the tracks that were seen at age K or later. Where they err less than all tracks do
at the same age, part of what curves over all tracks show is that bad tracks leave.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.statistics.curves import NAMES, curves
from tracknoise.statistics.grouping import group_rows
from tracknoise.statistics.moments import KEYS, measure_cells, unite_cells
from tracknoise.statistics.populations import measured
from tracknoise.tables.defaults import MIN_FEATURES
from tracknoise.tables.schema import ASPECT_CURVES, ASPECTS, CURVES, MOMENTS, OBSERVATIONS, ORIGIN, TRACKS, check

MOTION, GRADIENT = "motion", "gradient"
LIVES = (5, 10, 20, 50, 100)
"""Ages that long-lived tracks are told by, frames of the nominal sequence."""
LEAST_MOTION_PX = 0.1
"""A true position that moved less than this has no direction to speak of."""
SELECTIONS = {("visible", "untrimmed"): pl.lit(value=True), ("visible", "trimmed"): pl.col("kept")}
"""Which of the visible errors make up each population and trimming of aspects."""
_TRACK = [*ORIGIN, "track"]
_POSITION = ["u_true_px", "v_true_px"]
_NEEDED = [*_TRACK, "frame", "age", *_POSITION, "truth", "du_px", "dv_px", "kept"]
_BEFORE_DATASET = "/"
"""Comes before digits, so that names sort alike with it and without."""
_SIGNLESS = {names[role] for names in NAMES.values() for role in ("absolute", "second")}
"""Statistics that do not change with the sign of an axis."""


def lives(age: int) -> str:
    """Name of the aspect of the tracks that were seen at an age or later."""
    return f"lives {age}"


def scene_aspects(observations: pl.DataFrame, tracks: pl.DataFrame, *, axis: str = "age") -> pl.DataFrame:
    """Moments of visible errors along and across motion and gradient, and of tracks that live long.

    Parameters
    ----------
    observations, tracks
        Tables of any number of scenes, trimmed (`tracknoise.statistics.trimming.trim`).
    axis
        ``age`` or ``frame``, as in `tracknoise.statistics.moments.scene_moments`.

    Returns
    -------
    polars.DataFrame
        Schema `ASPECTS`, sorted by aspect and the keys of moments: a row for each combination that has an observation,
        with their count `n`. Left out of `motion` are those without a known true position in the previous frame that
        the tracker saw (at age 0 all), or with one less than `LEAST_MOTION_PX` away; of `gradient`, those of tracks
        that began where none dominates.

    Raises
    ------
    SchemaError
        If a table has other columns, or an error is missing where the true position is known.
    """
    seen = check(observations, OBSERVATIONS, "observations").with_columns(at=axis)
    parts = [
        unite_cells(cells, SELECTIONS, axis=axis).select(pl.lit(aspect).alias("aspect"), *MOMENTS)
        for aspect, cells in aspect_cells(seen, tracks, by=[*ORIGIN, "at", "kept"])
    ]
    return check(pl.concat(parts).sort("aspect", *KEYS), ASPECTS, "aspects")


def aspect_cells(
    observations: pl.DataFrame, tracks: pl.DataFrame, *, by: Sequence[str]
) -> Iterator[tuple[str, pl.DataFrame]]:
    """Each aspect with moments of the visible errors in rows that agree in `by`, or in that and something more.

    Parameters
    ----------
    observations
        Columns of `OBSERVATIONS`, and any others.
    tracks
        As in `scene_aspects`.
    by
        Columns of the observations.

    Yields
    ------
    str, polars.DataFrame
        The aspect, and what `tracknoise.statistics.moments.measure_cells` made of it.
    """
    seen = observations.select(list(dict.fromkeys([*_NEEDED, *by]))).with_columns(who=pl.Series(_numbers(observations)))
    visible = measured(seen, population="visible")
    gradients = check(tracks, TRACKS, "tracks").select(*_TRACK, pl.col("gradient_rad").cast(pl.Float64)).drop_nulls()
    yield MOTION, measure_cells(_along_motion(seen), by=by)
    yield GRADIENT, measure_cells(_along_gradient(visible, gradients), by=by)
    reached = np.searchsorted(LIVES, _oldest(seen)[visible["who"].to_numpy()], side="right")
    cells = measure_cells(visible.with_columns(reached=pl.Series(reached)), by=[*by, "reached"])
    for place, age in enumerate(LIVES):  # unions of the cells of tracks that live between two of these ages
        yield lives(age), cells.filter(pl.col("reached") > place)


def aspect_curves(aspects: pl.DataFrame | Iterable[pl.DataFrame], *, min_features: int = MIN_FEATURES) -> pl.DataFrame:
    """Curves of every aspect, pooled over scenes: see `tracknoise.statistics.curves.curves`.

    Parameters
    ----------
    aspects
        What `scene_aspects` made of any number of scenes; or any number of such tables, read as they are asked for.
    min_features
        `cut` is set where fewer features than this remain.

    Returns
    -------
    polars.DataFrame
        Schema `ASPECT_CURVES`, sorted by aspect and then as curves are. u is along and v across the motion or the
        gradient. Along the gradient, whose axis has no sign, there are no means and no central moments.

    Raises
    ------
    SchemaError
        If a table has other columns.
    """
    each = [aspects] if isinstance(aspects, pl.DataFrame) else aspects
    found = curves((_as_dataset(table) for table in each), min_features=min_features)
    parts = pl.col("dataset").str.splitn(_BEFORE_DATASET, 2).struct
    named = found.select(parts.field("field_0").alias("aspect"), *CURVES).with_columns(dataset=parts.field("field_1"))
    means_nothing = (pl.col("aspect") == GRADIENT) & ~pl.col("statistic").is_in(_SIGNLESS)
    return check(named.filter(~means_nothing), ASPECT_CURVES, "aspect curves")


def _as_dataset(aspects: pl.DataFrame) -> pl.DataFrame:
    """Moments, with each aspect as a dataset of its own, so that all are pooled in one reading."""
    table = check(aspects, ASPECTS, "aspects")
    return table.with_columns(dataset=pl.col("aspect") + _BEFORE_DATASET + pl.col("dataset")).drop("aspect")


def _numbers(seen: pl.DataFrame) -> NDArray[np.int64]:
    """A number for the track of each observation, different for different sequences and conditions."""
    track = seen["track"].to_numpy().astype(np.int64)
    numbers: NDArray[np.int64] = group_rows(seen, list(ORIGIN)).index * (track.max(initial=0) + 1) + track
    return numbers


def _along_motion(seen: pl.DataFrame) -> pl.DataFrame:
    """Visible errors along and across the motion of the true position, where it has a direction."""
    ordered = seen.drop_nulls(_POSITION).sort("who", "frame")
    u, v, who, frame = (pl.col(name) for name in (*_POSITION, "who", "frame"))
    moved = ordered.with_columns(
        step_u=u - u.shift(1),
        step_v=v - v.shift(1),
        follows=(who == who.shift(1)) & (frame == frame.shift(1) + pl.col("speed")),
    ).with_columns(step=(pl.col("step_u").pow(2) + pl.col("step_v").pow(2)).sqrt())
    visible = measured(moved.filter(pl.col("follows") & (pl.col("step") >= LEAST_MOTION_PX)), population="visible")
    return _turned(visible, pl.col("step_u") / pl.col("step"), pl.col("step_v") / pl.col("step"))


def _along_gradient(visible: pl.DataFrame, gradients: pl.DataFrame) -> pl.DataFrame:
    """Errors along and across the gradient, of tracks that have one."""
    angle = pl.col("gradient_rad")
    return _turned(visible.join(gradients, on=_TRACK, maintain_order="left"), angle.cos(), angle.sin())


def _turned(errors: pl.DataFrame, d_u: pl.Expr, d_v: pl.Expr) -> pl.DataFrame:
    """Errors along and across a unit vector, in the columns of those in u and v."""
    du, dv = pl.col("du_px"), pl.col("dv_px")
    return errors.with_columns(du_px=d_u * du + d_v * dv, dv_px=d_u * dv - d_v * du)


def _oldest(seen: pl.DataFrame) -> NDArray[np.uint32]:
    """Last age at which each track was seen, by its number; with or without a known true position."""
    who = seen["who"].to_numpy()
    oldest = np.zeros(who.max(initial=-1) + 1, dtype=np.uint32)
    np.maximum.at(oldest, who, seen["age"].to_numpy())
    return oldest
