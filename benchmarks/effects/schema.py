"""Tables of a study of effects."""

from enum import StrEnum

import polars as pl

from tracknoise.tables.schema import Schema


class Size(StrEnum):
    """Sizes of an effect."""

    low = "low"
    usual = "usual"
    bad = "bad"


class EffectStatistic(StrEnum):
    """What effects are measured by. Errors are visible ones of one age, of tracks that trimming kept."""

    mean_u = "mean_u"
    mean_v = "mean_v"
    second_moment = "second_moment"
    core = "core"
    lifetime = "lifetime"
    outlier_ratio = "outlier_ratio"


EFFECT_UNITS = {
    EffectStatistic.mean_u: "px",
    EffectStatistic.mean_v: "px",
    EffectStatistic.second_moment: "px^2",
    EffectStatistic.core: "px",
    EffectStatistic.lifetime: "frames",
    EffectStatistic.outlier_ratio: "1",
}
"""Unit of each statistic."""

CLEAN = "none"
"""Name of the effect of sequences without any."""

SIZE = pl.Enum(Size)
EFFECT_STATISTIC = pl.Enum(EffectStatistic)

EFFECT_VALUES: Schema = {
    "scene": pl.String,
    "effect": pl.String,
    "size": SIZE,
    "tracker": pl.String,
    "age": pl.UInt32,
    "statistic": EFFECT_STATISTIC,
    "value": pl.Float64,
}
"""One row per scene, effect, size, tracker and statistic.

The effect `CLEAN` has the same values at each size. Lifetime and outlier ratio do not depend on the age. The second
moment is about zero, the sum of u and v; the core is the geometric mean of u and v; the lifetime is the median, null
where more than half of the tracks outlive the sequence.
"""

EFFECT_CHANGES: Schema = {
    "effect": pl.String,
    "kind": pl.String,
    "size": SIZE,
    "shown": pl.String,
    "tracker": pl.String,
    "age": pl.UInt32,
    "statistic": EFFECT_STATISTIC,
    "unit": pl.String,
    **dict.fromkeys(("clean", "changed", "change", "change_low", "change_high"), pl.Float64),
    "n_scenes": pl.Int32,
}
"""One row per effect, size, tracker, age and statistic: means over scenes, and of the change within scenes.

clean and changed are means over the n_scenes scenes that have both. The interval is Student's, of the differences
within scenes; it is null with one scene.
"""
