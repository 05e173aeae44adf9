"""Layers, as Altair puts them together."""

import altair as alt
import pytest

from tracknoise.report.figures import marks
from tracknoise.report.figures.panels import Panel, arranged, layered


def chart(value: int) -> alt.Chart:
    return alt.Chart(alt.InlineData(values=[{"x": value}])).encode(x=alt.X("x:Q"))


ONE, OTHER = chart(1), chart(2)


@pytest.mark.parametrize(
    "layers",
    [
        [ONE.mark_line()],
        [ONE.mark_line(), ONE.mark_point().encode(y=alt.Y("x:Q"))],
        [ONE.mark_line(), ONE.mark_point(), OTHER.mark_point()],
    ],
    ids=["one layer", "the same data", "other data"],
)
def test_layers_are_those_of_altair_and_charts_stay_as_they_were(layers: list[alt.Chart]) -> None:
    before = [layer.to_dict() for layer in layers]
    title = alt.Title("of both")
    assert layered(*layers).properties(title=title).to_dict() == alt.layer(*layers).properties(title=title).to_dict()
    assert [layer.to_dict() for layer in layers] == before


def test_names_of_every_panel_are_shown_from_the_start() -> None:
    chart = alt.Chart(alt.InlineData(values=[{"speed": "1"}])).mark_point().encode(opacity=marks.opacity("speed"))
    panels = [Panel(chart, (marks.shown("speed", names), marks.zoom("x"))) for names in (("1", "2"), ("1", "15"))]
    shown, zoom = arranged(panels, columns=1)["params"]
    assert shown["value"] == [{"speed": "1"}, {"speed": "2"}, {"speed": "15"}]
    assert shown["views"] == zoom["views"] == ["panel_0", "panel_1"]
