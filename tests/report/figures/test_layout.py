"""Layers, as Altair puts them together."""

import altair as alt
import pytest

from tracknoise.report.figures.layout import layered


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
