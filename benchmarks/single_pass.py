"""What is saved by reading a sequence once for every condition instead of once for each.

Two trackers at five speeds over one sequence on disk, in one pass and in ten; images are decoded, corners detected and
described once a frame instead of once for each condition that sees it. Their tables must be the same.
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import polars as pl

from benchmarks.harness import Row, elapsed_ms, write_scene
from tracknoise.experiments.measure import Measurement, measure
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.tables.schema import ORIGIN
from tracknoise.trackers.correspondence import Correspondence
from tracknoise.trackers.lucas_kanade import LucasKanade

SPEEDS = (1, 2, 4, 8, 12)
TABLES = ("observations", "tracks", "frames", "moments", "trims")


def rows() -> list[Row]:
    """Of 24 frames of 320x240."""
    return _rows(24, 320, 240)


def full_rows() -> list[Row]:
    """Of 120 frames of 640x480."""
    return _rows(120, 640, 480)


def _rows(frames: int, width: int, height: int) -> list[Row]:
    trackers = {"lucas-kanade": LucasKanade(), "correspondence": Correspondence()}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "scene"
        write_scene(folder, frames=frames, width=width, height=height)
        sequence = open_sequence("folder", folder)
        together: list[Measurement] = []
        alone: list[Measurement] = []

        def each() -> Iterator[Measurement]:
            for tracker, settings in trackers.items():
                for speed in SPEEDS:
                    yield measure(sequence, {tracker: settings}, speeds=[speed])

        once_s = elapsed_ms(lambda: together.append(measure(sequence, trackers, speeds=SPEEDS))) / 1e3
        apart_s = elapsed_ms(lambda: alone.extend(each())) / 1e3
    same = all(_same([getattr(one, name) for one in alone], getattr(together[0], name)) for name in TABLES)
    size = f"{frames} frames of {width}x{height}"
    return [
        Row("sweep: 2 trackers at 5 speeds in one pass", once_s, "s", size),
        Row("sweep: in ten passes", apart_s, "s", size),
        Row("sweep: one pass relative to ten", once_s / apart_s, "x", f"identical tables: {same}"),
    ]


def _same(parts: list[pl.DataFrame], whole: pl.DataFrame) -> bool:
    return pl.concat(parts).sort(*ORIGIN, maintain_order=True).equals(whole.sort(*ORIGIN, maintain_order=True))
