"""Changes by effects of cameras and faults of the truth: one panel per statistic, one line per effect."""

from collections.abc import Mapping, Sequence

import altair as alt
import polars as pl

from tracknoise.findings.wording import listing
from tracknoise.report import style
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Figure
from tracknoise.report.figures.layout import Panel, layered
from tracknoise.report.figures.layout import arranged as arrange
from tracknoise.tables.effects_schema import EFFECT_UNITS, EffectStatistic, Size

_WIDTH, _LINE = 230, 34
_DIAMETERS = {Size.low: 14, Size.usual: 34, Size.bad: 70}
_TITLES = {
    EffectStatistic.mean_u: "mean error in u",
    EffectStatistic.mean_v: "mean error in v",
    EffectStatistic.second_moment: "second moment",
    EffectStatistic.core: "core",
    EffectStatistic.lifetime: "median lifetime",
    EffectStatistic.outlier_ratio: "outlier ratio",
}
_LINEAR_PART = {
    EffectStatistic.mean_u: 0.05,
    EffectStatistic.mean_v: 0.05,
    EffectStatistic.second_moment: 0.05,
    EffectStatistic.core: 0.05,
    EffectStatistic.lifetime: 1.0,
    EffectStatistic.outlier_ratio: 0.005,
}
"""Changes up to about this size are drawn to a linear scale, larger ones to a logarithmic one."""


def effect_sizes(changes: pl.DataFrame) -> Figure:
    """The figure of `tracknoise effects`.

    Parameters
    ----------
    changes
        Schema `EFFECT_CHANGES`, of one age.
    """
    trackers = changes["tracker"].unique(maintain_order=True).to_list()
    colours = dict(zip(trackers, style.colours(trackers), strict=True))
    effects = changes["effect"].unique(maintain_order=True).to_list()
    shown = (marks.shown("tracker", colours),)
    panels = [
        Panel(_panel(changes.filter(statistic=name), name, effects, colours), shown, layer=2)
        for name in EffectStatistic
    ]
    return Figure(
        id="effects",
        title="Effects of cameras and faults of the truth",
        shows=f"Change of each statistic by each effect alone, for {listing(trackers)}. Points are means over scenes; "
        "their area stands for the size: low, usual, bad. Lines are intervals. Scales are linear near 0 and "
        "logarithmic beyond.",
        look_for="Effects whose intervals exclude 0 change what is measured.",
        spec=arrange(panels, columns=3),
    )


def _panel(
    table: pl.DataFrame, name: EffectStatistic, effects: Sequence[str], colours: Mapping[str, str]
) -> alt.LayerChart:
    slots = [f"{size} {tracker}" for size in Size for tracker in colours]
    columns = ["effect", "size", "shown", "tracker", "change", "change_low", "change_high"]
    known = table.select(columns).drop_nulls("change")
    drawn = known.with_columns(slot=pl.format("{} {}", "size", "tracker"))
    base = alt.Chart(marks.rows(drawn)).encode(
        y=alt.Y("effect:N", sort=list(effects), title=None, scale=alt.Scale(domain=list(effects))),
        yOffset=alt.YOffset("slot:N", sort=slots, scale=alt.Scale(domain=slots)),
        color=marks.colour("tracker", colours, "tracker"),
        opacity=marks.opacity("tracker"),
        tooltip=[alt.Tooltip(f"{column}:N" if column in columns[:4] else f"{column}:Q") for column in columns],
    )
    scale = alt.Scale(type="symlog", constant=_LINEAR_PART[name])
    unit = "" if EFFECT_UNITS[name] == "1" else f" ({EFFECT_UNITS[name]})"
    axis = alt.Axis(format=".2~r", tickCount=5)
    x = alt.X("change:Q", title=f"change of {_TITLES[name]}{unit}", scale=scale, axis=axis)
    areas = alt.Scale(domain=[str(size) for size in Size], range=list(_DIAMETERS.values()))
    zero = alt.Chart(alt.InlineData(values=[{"change": 0}])).mark_rule(color=style.QUIET, strokeWidth=0.8).encode(x=x)
    bars = base.mark_rule().encode(x=alt.X("change_low:Q", scale=scale), x2=alt.X2("change_high:Q"))
    points = base.mark_point(filled=True).encode(
        x=x, size=alt.Size("size:N", scale=areas, sort=None, legend=alt.Legend(title="size"))
    )
    return layered(zero, bars, points).properties(width=_WIDTH, height=_LINE * len(effects))
