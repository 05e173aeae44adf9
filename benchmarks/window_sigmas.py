"""The noise of windows of a run, as a table and as the figure of docs/estimators.md.

    tracknoise run demo --out runs/demo
    python -m benchmarks.window_sigmas runs/demo [--svg docs/images/window-noise.svg] [--trimming untrimmed]

Printed are the quantities of windows at the lowest speed. The figure shows, by length of window, the sigma that makes
depths as certain as they are, and that which residuals look like, with their intervals.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import polars as pl
import vl_convert

import tracknoise as tn
from tracknoise.report.style import PALETTE, config

COLUMNS = (
    "residual_sigma", "residual_core", "consistent_sigma", "z_root_mean_square", "overconfidence",
    "core_overconfidence", "gate_95", "coverage_95", "depth_share",
)  # fmt: skip
SHOWN = {"consistent_sigma": "makes depths as certain as they are", "residual_core": "what residuals look like"}


def print_table(windows: pl.DataFrame) -> None:
    """Print one row per tracker and length of window."""
    known = [name for name in COLUMNS if name in windows["quantity"]]
    print(f"{'tracker':<16}{'window':>7}{'windows':>9}" + "".join(f"{name:>20}" for name in known))
    for (tracker, window), rows in windows.sort("tracker", "window").group_by("tracker", "window", maintain_order=True):
        values = dict(rows.select("quantity", "value").iter_rows())
        cells = "".join(f"{values[name]:>20.3f}" if name in values else f"{'-':>20}" for name in known)
        print(f"{tracker:<16}{window:>7}{rows['n'].max():>9}{cells}")


def figure(windows: pl.DataFrame) -> dict[str, Any]:
    """Vega-Lite specification: a panel per tracker."""
    shown = windows.filter(pl.col("quantity").is_in(list(SHOWN))).with_columns(
        sigma=pl.col("quantity").replace_strict(SHOWN)
    )
    window = {"field": "window", "type": "quantitative", "title": "length of the window, frames"}
    colour = {
        "field": "sigma", "type": "nominal", "title": None, "legend": {"labelLimit": 400},
        "scale": {"domain": list(SHOWN.values()), "range": [PALETTE[1], PALETTE[0]]},
    }  # fmt: skip
    scale = {"type": "log", "nice": False}
    band = {"low": {"field": "low", "type": "quantitative", "scale": scale}, "high": {"field": "high"}}
    layers = [
        {
            "mark": {"type": "area", "opacity": 0.2},
            "encoding": {"y": band["low"] | {"title": "sigma, px"}, "y2": band["high"]},
        },
        {
            "mark": {"type": "line", "point": True},
            "encoding": {"y": {"field": "value", "type": "quantitative", "scale": scale}},
        },
    ]
    return {
        "$schema": "https://vega.github.io/schema/vega-lite/v5.json",
        "config": config(),
        "data": {"values": shown.select("tracker", "window", "sigma", "value", "low", "high").to_dicts()},
        "facet": {"column": {"field": "tracker", "type": "nominal", "title": None}},
        "spec": {"width": 330, "height": 240, "encoding": {"x": window, "color": colour}, "layer": layers},
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, and draw the figure if it is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("--svg", type=Path)
    parser.add_argument("--trimming", default="untrimmed")
    chosen = parser.parse_args(arguments)
    windows = tn.open_run(chosen.run).table("window_sigmas", trimming=chosen.trimming)
    windows = windows.filter(pl.col("speed") == windows["speed"].min())
    print_table(windows)
    if chosen.svg is not None:
        chosen.svg.write_text(vl_convert.vegalite_to_svg(figure(windows)), encoding="utf-8")


if __name__ == "__main__":
    main()
