"""Bars of histograms open their tracks: what the script of the page says of them."""

import json
import shutil
import subprocess
from importlib.resources import files
from typing import Any

import altair as alt
import polars as pl
import pytest

from tracknoise.report.figures import distributions
from tracknoise.statistics.histograms import HISTOGRAM_BINS

SCRIPT = files("tracknoise.report") / "template" / "bars.js"
STUBS = """
const MOST_OF_A_KIND = 8;
const explored = { start: { speed: 1 } };
const element = (name, kind, text = "") => ({ name, text, append() {} });
const card = (one) => one;
let said = [];
const replaceChildren = (...parts) => { said = parts.map((part) => part.text); };
const place = { dataset: {}, replaceChildren, scrollIntoView() {} };
const document = { getElementById: () => place };
"""


def said(bar: dict[str, Any], largest: list[float | None]) -> list[str]:
    """Heading, note and what stands for missing pictures, of a bar of tracks of two frames with these errors."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node to run the script of the page")
    tracks = [{"track": place, "lifetime": 2, "largest": one} for place, one in enumerate(largest)]
    groups = json.dumps([{"tracker": "lk", "scene": "one", "tracks": tracks}])
    script = f"{STUBS}\nconst looked = {{groups: {groups}}};\n{SCRIPT.read_text()}"
    shown = f"lookAtBar({json.dumps(bar)}); console.log(JSON.stringify(said));"
    done = subprocess.run([node, "-e", f"{script}\n{shown}"], capture_output=True, text=True, check=True)
    return list(json.loads(done.stdout))


def test_the_note_counts_pictures_that_are_not_shown() -> None:
    bar = {"tracker": "lk", "speed": "1", "n": 70, "lifetime": 2}
    assert said(bar, [1.0] * 40) == [
        "lk, lifetime 2",
        "Tracks in this bar: 70. With pictures: 40; 24 of these are shown.",
        "",
    ]
    assert said(bar, [1.0])[1] == "Tracks in this bar: 70. With pictures: 1."
    assert said({**bar, "speed": "2"}, [1.0])[1:] == [
        "Tracks in this bar: 70. With pictures: 0.",
        "Pictures are of speed 1.",
    ]


def test_the_last_bar_of_errors_has_no_upper_end() -> None:
    bar = {"tracker": "lk", "speed": "1", "n": 3, "of": 1000, "to": None}
    assert said(bar, [900.0, 1000.0, 5000.0, None])[:2] == [
        "lk, largest error from 1000 px on",
        "Tracks in this bar: 3. With pictures: 2.",
    ]


def test_errors_beyond_the_last_bound_are_drawn() -> None:
    """Whatever the other errors are: the upper end of their bin is no number."""
    for places in ([31, 61], [61]):
        counted = pl.col("bin").is_in(places).cast(pl.Int64)
        bins = HISTOGRAM_BINS.with_columns(tracker=pl.lit("lk"), speed=pl.lit("1"), n=counted)
        drawn = pl.read_csv(distributions._histogram(bins, alt.Color("speed:N")).data.values.encode())
        assert drawn.filter(pl.col("n") > 0)["of"].max() == 1000.0
