"""What curves run along (ages, or frames around the key frame of a scan), and the bands of their intervals."""

from collections.abc import Sequence
from dataclasses import dataclass

import polars as pl

from tracknoise import words
from tracknoise.statistics.definitions import NAMES, POOLED, upright
from tracknoise.statistics.truth_errors import FLOOR_COLUMNS
from tracknoise.tables.findings_schema import RESAMPLED
from tracknoise.tables.schema import Schema
from tracknoise.words import interval_text, listing


@dataclass(frozen=True, slots=True)
class Axis:
    """What curves run along, and how the report speaks of it.

    Attributes
    ----------
    name
        As in the tables: age or frame.
    title
        Of the horizontal axis of a figure.
    zero
        Where errors are zero by construction.
    distance
        What the distance from there is called.
    """

    name: str
    title: str
    zero: str
    distance: str

    @property
    def roles(self) -> dict[str, str]:
        """Role of each statistic, by its name in the tables."""
        return {name: role for role, name in NAMES[self.name].items()}

    def place(self, since: int) -> str:
        """Write a place by its distance from where errors are zero: ``at age 10``, ``8 frames after the key frame``.

        Parameters
        ----------
        since
            Frames of the sequence; negative before the key frame.
        """
        return words.place(self.name, since)

    def opening_place(self, since: int) -> str:
        """Write a place as `place` does, as the start of a sentence.

        Parameters
        ----------
        since
            As in `place`.
        """
        return words.opening_place(self.name, since)


AGE = Axis("age", "age (frames of the sequence)", "age 0", "age")
FRAME = Axis("frame", "frame", "the key frame", "distance from the key frame")
BOUNDS = ("u_low", "u_high", "v_low", "v_high")
KIND: Schema = {"level": pl.Float64, "resampled": RESAMPLED, "n_resampled": pl.Int32}
"""Level of an interval, what was resampled, and in how many scenes."""
_CURVE = ["population", "trimming", "weighting", "statistic", "axis", "at"]


def with_bounds(curves: pl.DataFrame, intervals: pl.DataFrame) -> pl.DataFrame:
    """Curves with the bounds of their values in u and v.

    Returns: the same rows with columns `BOUNDS`, in the unit of the curve, and `KIND`. Null where there is no interval.
    `curves`: columns of `CURVES`, or of `ASPECT_CURVES`. `intervals`: columns of `INTERVALS`.
    """
    aspect = ["aspect", "at_least"] if "aspect" in curves.columns else []
    keys = [*aspect, *POOLED, *_CURVE]
    chosen = intervals if aspect else intervals.filter(aspect="all")
    chosen = chosen.filter(pl.col("axis").is_in(["age", "frame"])).with_columns(pl.col("axis", "at").cast(pl.String))
    table = curves.with_columns(axis_=pl.col("axis").cast(pl.String), at_=pl.col("at").cast(pl.String))
    left_keys = [*aspect, *POOLED, *_CURVE[:-2], "axis_", "at_"]
    bounds = side_by_side(chosen, keys)
    return table.join(
        bounds, left_on=left_keys, right_on=keys, how="left", maintain_order="left", nulls_equal=True
    ).drop("axis_", "at_")


def side_by_side(intervals: pl.DataFrame, keys: Sequence[str]) -> pl.DataFrame:
    """Bounds in u and v in one row: the keys, `BOUNDS` and `KIND`. `keys`: columns that identify a value."""
    u, v = (
        intervals.filter(coordinate=axis).select(*keys, pl.col("low", "high").name.prefix(f"{axis}_")) for axis in "uv"
    )
    kinds = intervals.filter(coordinate="u").drop_nulls(["low", "high"])
    kinds = kinds.select(*keys, "level", "resampled", n_resampled="n_scenes")
    return u.join(v, on=keys, how="left", nulls_equal=True).join(kinds, on=keys, how="left", nulls_equal=True)


def of_scalar(table: pl.DataFrame, intervals: pl.DataFrame, statistic: str) -> pl.DataFrame:
    """A table of conditions with columns low and high, the bounds of one number per condition, and `KIND`.

    Where `table` has a column lifetime, the number is the one at that lifetime.
    """
    along = ["lifetime"] if "lifetime" in table.columns else []
    bounds = intervals.filter(aspect="all", statistic=statistic).drop_nulls(["low", "high"])
    kinds = {"low": "low", "high": "high", "level": "level", "resampled": "resampled", "n_resampled": "n_scenes"}
    bounds = bounds.select(*POOLED, *(pl.col("at").cast(pl.UInt32).alias(name) for name in along), **kinds)
    return table.join(bounds, on=[*POOLED, *along], how="left", maintain_order="left")


def upright_bounds(points: pl.DataFrame, *, signed: pl.Expr) -> pl.DataFrame:
    """As `tracknoise.statistics.definitions.upright`, for points with `BOUNDS` and `FLOOR_COLUMNS`, rotated too."""
    values = upright(points, signed=signed)
    low, high = (
        upright(points.with_columns(u=f"u_{end}", v=f"v_{end}"), signed=signed).select("u", "v")
        for end in ("low", "high")
    )
    ends = {
        f"{axis}_{end}": choose(low[axis].alias("low"), high[axis].alias("high"))
        for axis in "uv"
        for end, choose in (("low", pl.min_horizontal), ("high", pl.max_horizontal))
    }
    floor = upright(points.with_columns(u=FLOOR_COLUMNS[0], v=FLOOR_COLUMNS[1]), signed=pl.lit(False))
    return values.with_columns(**ends, **{name: floor[axis] for name, axis in zip(FLOOR_COLUMNS, "uv", strict=True)})


def interval_texts(rows: pl.DataFrame, n_scenes: str) -> list[str]:
    """How intervals were made, each kind once. `rows`: columns level, resampled and the one named `n_scenes`."""
    bounded = rows.drop_nulls(["level", "resampled", n_scenes])
    kinds = bounded.group_by("level", "resampled").agg(pl.col(n_scenes).unique()).sort("level", "resampled")
    return [interval_text(*row) for row in kinds.iter_rows()]


def describe_bounds(rows: pl.DataFrame, *, of: str, marks: str = "Bands around") -> str:
    """As `describe_intervals`, for the rows of a table that have bounds: columns low, high and n_scenes."""
    return describe_intervals(rows.drop_nulls(["low", "high"]), of=of, marks=marks, n_scenes="n_scenes")


def describe_intervals(
    points: pl.DataFrame, *, of: str, marks: str = "Bands around", n_scenes: str = "n_resampled"
) -> str:
    """Describe the bands, or other `marks`, that show intervals, or say that there are none.

    `points`: columns `KIND`; the count of scenes may have another name.
    """
    bounded = points.drop_nulls(["level", "resampled", n_scenes])
    kinds = listing(interval_texts(bounded, n_scenes))
    if not kinds:
        return f"No intervals were computed for {of}."
    subject = "Those from blocks" if bounded["resampled"].n_unique() > 1 else "They"
    only = f" {subject} hold only for the scenes of this run." if "blocks" in bounded["resampled"] else ""
    within = " Those within groups hold only for these groups of scenes." if "within" in bounded["resampled"] else ""
    return f"{marks} {of}: {kinds}.{only}{within}"
