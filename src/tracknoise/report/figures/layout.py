"""Panels arranged in one Vega-Lite specification."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self, TypeAlias

import altair as alt

Spec: TypeAlias = dict[str, Any]
"""A Vega-Lite specification."""
Chart: TypeAlias = alt.Chart | alt.LayerChart | alt.FacetChart


@dataclass(frozen=True, slots=True)
class Panel:
    """A chart and its selections.

    Attributes
    ----------
    chart
        The chart, without parameters.
    selections
        Vega-Lite parameters without their views. Panels share a selection of the same name: what is muted in one is
        muted in all.
    layer
        The layer that has the selections, if the chart has several. It must have the scales and the legend.
    """

    chart: Chart
    selections: tuple[Mapping[str, Any], ...] = ()
    layer: int = 0


def arranged(panels: Sequence[Panel], *, columns: int, independent: Sequence[str] = ()) -> Spec:
    """Arrange panels in rows of `columns`. Each panel has its own scales for the channels in `independent`.

    Altair can do the same, but copies every chart at every level, which took half of the time of a report. Nor are
    specifications checked against the schema of Vega-Lite here, which took half of the rest. The tests check them.
    """
    parameters: dict[str, Spec] = {}
    datasets: Spec = {}
    specs = []
    for place, panel in enumerate(panels):
        spec = panel.chart.to_dict(validate=False)
        datasets |= spec.pop("datasets", {})
        _limit_title(spec)
        view = f"panel_{place}"
        _unit(spec, panel.layer)["name"] = view
        specs.append({key: value for key, value in spec.items() if key not in ("$schema", "config")})
        for selection in panel.selections:
            _join(parameters.setdefault(selection["name"], {**selection, "views": []}), selection, view)
    return {
        "$schema": alt.SCHEMA_URL,
        "columns": columns,
        "concat": specs,
        "datasets": datasets,
        "params": list(parameters.values()),
        "resolve": {"scale": dict.fromkeys(independent, "independent")},
    }


def _join(parameter: Spec, selection: Mapping[str, Any], view: str) -> None:
    """Add a view to a parameter, and what is selected there from the start: a legend may have other names there."""
    parameter["views"].append(view)
    if "value" in parameter:
        start = parameter["value"]
        parameter["value"] = [*start, *(one for one in selection["value"] if one not in start)]


def _limit_title(spec: Spec) -> None:
    """Cut the title of a panel that is longer than the panel is wide: it would widen the figure."""
    title, width = spec.get("title"), spec.get("width")
    if title and isinstance(width, int | float):
        spec["title"] = {"limit": width, **(title if isinstance(title, dict) else {"text": title})}


class _Layers(alt.LayerChart):
    """Layers whose shallow copies share the charts. Altair copies every chart whenever a property is set."""

    def copy(self, deep: bool | Iterable[Any] = True, ignore: list[str] | None = None) -> Self:
        if deep:
            return super().copy(deep, ignore)
        whole = type(self)()
        for name, value in self._kwds.items():
            whole[name] = value
        return whole


def layered(*charts: alt.Chart) -> alt.LayerChart:
    """Draw charts above each other, the last on top. If all are of the same data, these belong to the whole.

    `altair.layer` gives the same, but copies every chart and its data four times.
    """
    whole = _Layers()
    if all(chart.data is charts[0].data for chart in charts):
        whole.data = charts[0].data
        charts = tuple(chart.copy(deep=False) for chart in charts)
        for chart in charts:
            chart.data = alt.Undefined
    whole.layer = list(charts)
    return whole


def _unit(spec: Spec, layer: int) -> Spec:
    """The view of a chart that has its selections."""
    unit: Spec = spec["layer"][layer] if "layer" in spec else spec
    return unit
