"""What leaving out features that could not be seen changes."""

from collections.abc import Sequence

import altair as alt
import polars as pl

from tracknoise.report.evidence import Evidence
from tracknoise.report.figures import marks
from tracknoise.report.figures.figure import Absence, Family, Figure
from tracknoise.report.figures.layout import Panel, arranged
from tracknoise.report.sentences import count, percent, px
from tracknoise.statistics.summary import REFERENCE_AGE

_TITLE = "Visible against all projected"
_PANELS = {
    ("eta", "u"): "η in u (px)",
    ("eta", "v"): "η in v (px)",
    ("Phi", "u"): "√Φ in u (px)",
    ("Phi", "v"): "√Φ in v (px)",
}
_KEYS = ["tracker", "speed", "statistic", "at"]


def figures(evidence: Evidence) -> Sequence[Figure | Absence]:
    """One figure: both populations, every tracker and speed."""
    if not evidence.counts.filter(pl.col("name").is_in(["occluded", "out_of_image"]))["n"].sum():
        why = "No feature was hidden from view at a known true position, so there is nothing to leave out."
        return [Absence("occlusion", _TITLE, why)]
    table = compare(evidence)
    if table.is_empty():
        return [Absence("occlusion", _TITLE, "No age has enough features in both populations to compare them.")]
    return [_figure(evidence, table)]


def compare(evidence: Evidence) -> pl.DataFrame:
    """Both populations at each condition's last shared age that is not above the reference age.

    Returns
    -------
    polars.DataFrame
        tracker, speed, statistic (eta, Phi), at, and for each population its n and its value in u and v, px.
    """
    points = evidence.reference(evidence.points).filter(
        (pl.col("trimming") == "trimmed")
        & pl.col("at").is_between(1, REFERENCE_AGE)
        & pl.col("statistic").is_in(["eta", "Phi"])
    )
    sides = [
        points.filter(population=side).select(*_KEYS, pl.col("n", "u", "v").name.suffix(f"_{side}"))
        for side in ("visible", "projected")
    ]
    both = sides[0].join(sides[1], on=_KEYS)
    last = pl.col("at") == pl.col("at").max().over("tracker", "speed")
    return both.filter(last).sort(_KEYS)


def _figure(evidence: Evidence, table: pl.DataFrame) -> Figure:
    ages = sorted(table["at"].unique())
    age = f"age {ages[0]}" if len(ages) == 1 else f"the age that each condition has, {ages[0]} to {ages[-1]}"
    return Figure(
        id="occlusion",
        title=_TITLE,
        shows=f"{evidence.errors_kept} at {age}{evidence.where}: a filled dot where only features that could be seen "
        "count, a ring where all whose true position is known do, hidden ones too.",
        look_for=_look_for(evidence, table),
        spec=arranged([_panel(evidence, table, key) for key in _PANELS], columns=4),
    )


def _look_for(evidence: Evidence, table: pl.DataFrame) -> str:
    rows = {row["tracker"]: row for row in table.filter(statistic="Phi", speed=evidence.slowest).to_dicts()}
    parts = [_sentence(name, rows[name]) for name in evidence.trackers if name in rows]
    numbers = f"At speed {evidence.slowest}: {'; '.join(parts)}. " if parts else ""
    return numbers + "Where dot and ring are far apart, features that could not be seen decide part of the error."


def _sentence(name: str, row: dict[str, float]) -> str:
    hidden = int(row["n_projected"] - row["n_visible"])
    share = percent(hidden / row["n_projected"])
    change = f"{px(row['u_projected'])} with them and {px(row['u_visible'])} without"
    return f"{name} has {count(hidden, 'hidden feature')} ({share}) at age {row['at']}, and its √Φ in u is {change}"


def _panel(evidence: Evidence, table: pl.DataFrame, key: tuple[str, str]) -> Panel:
    statistic, axis = key
    table = table.filter(statistic=statistic).with_columns(
        condition=pl.col("tracker") + ", speed " + pl.col("speed").cast(pl.String)
    )
    order = [f"{tracker}, speed {speed}" for tracker in evidence.trackers for speed in evidence.speeds]
    first = key == next(iter(_PANELS))
    y = alt.Y(
        "condition:N", sort=order, title=None, axis=alt.Axis(labels=first, ticks=False, domain=False, labelLimit=220)
    )
    tips = [alt.Tooltip("condition:N"), alt.Tooltip("at:Q", title="age")]
    tips += [alt.Tooltip(f"{axis}_{side}:Q", title=f"{side} (px)") for side in ("visible", "projected")]
    base = alt.Chart(marks.rows(table)).encode(
        y=y, color=marks.colour("tracker", evidence.colour, "tracker", legend=False), tooltip=tips
    )
    x = alt.X(f"{axis}_visible:Q", title=_PANELS[key], scale=alt.Scale(zero=True), axis=alt.Axis(tickCount=4))
    link = base.mark_rule(strokeWidth=1.5).encode(x=x, x2=f"{axis}_projected:Q")
    ring = base.mark_point(filled=False, size=60, strokeWidth=1.5).encode(x=f"{axis}_projected:Q")
    dot = base.mark_point(filled=True, size=45, opacity=1).encode(x=x)
    rows = table["condition"].n_unique()
    return Panel(alt.layer(link, ring, dot).properties(width=175, height=max(60, 26 * rows)))


FAMILY = Family(
    id="occlusion",
    title="What could not be seen",
    lead="A tracker may go on following a point that something else has come to hide: then it follows that other "
    "thing. The paper counts such features; whether they count decides part of the error.",
    figures=figures,
)
