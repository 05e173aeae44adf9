"""Panels put side by side into one Vega-Lite specification."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import altair as alt

Spec: TypeAlias = dict[str, Any]
"""A Vega-Lite specification."""
Chart: TypeAlias = alt.Chart | alt.LayerChart | alt.FacetChart
Selection: TypeAlias = Mapping[str, Any]
"""A Vega-Lite selection parameter, without the views that it lives in."""


@dataclass(frozen=True, slots=True)
class Panel:
    """A chart, and the selections that can be made in it.

    Attributes
    ----------
    chart
        The chart, without parameters.
    selections
        Those of one name in several panels of a figure are one selection: what is muted in one is muted in all.
    layer
        Which layer of the chart the selections live in, if it has several: it must have the scales and the legend.
    """

    chart: Chart
    selections: tuple[Selection, ...] = ()
    layer: int = 0


def arranged(panels: Sequence[Panel], *, columns: int, independent: Sequence[str] = ()) -> Spec:
    """Put panels into rows of `columns`; the scales of the channels in `independent` are each panel's own.

    Altair can do the same, but copies every chart at every level, which took half of the time of a report. Nor is every
    specification checked against Vega-Lite's schema, which took half of the rest: the tests do that.
    """
    parameters: dict[str, Spec] = {}
    datasets: Spec = {}
    specs = []
    for place, panel in enumerate(panels):
        spec = panel.chart.to_dict(validate=False)
        datasets |= spec.pop("datasets", {})
        view = f"panel_{place}"
        _unit(spec, panel.layer)["name"] = view
        specs.append({key: value for key, value in spec.items() if key not in ("$schema", "config")})
        for selection in panel.selections:
            parameters.setdefault(selection["name"], {**selection, "views": []})["views"].append(view)
    return {
        "$schema": alt.SCHEMA_URL,
        "columns": columns,
        "concat": specs,
        "datasets": datasets,
        "params": list(parameters.values()),
        "resolve": {"scale": dict.fromkeys(independent, "independent")},
    }


def _unit(spec: Spec, layer: int) -> Spec:
    """The view that selections of a chart live in."""
    unit: Spec = spec["layer"][layer] if "layer" in spec else spec
    return unit
