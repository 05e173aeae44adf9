"""Time from the measured observations and tracks of a sequence to all of its tables.

    python -m benchmarks statistics                # of a made-up sequence
    python -m benchmarks.statistics RUN [NUMBER]   # of the first sequence of a run folder that keeps its observations

Both print CPU seconds per million observations, which other programs on the machine hardly change, and wall time. The
second form uses as many threads as the environment allows.
"""

import json
import sys
import time
import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

import polars as pl

from benchmarks.harness import Row, median_ms
from benchmarks.made_up import made_up
from tracknoise.statistics.curves import curves
from tracknoise.statistics.moments import KEYS, merge, scene_moments
from tracknoise.statistics.prepared import prepare_observations
from tracknoise.statistics.summarise import summarise_sequence

OBSERVATIONS, FRAMES = 1_000_000, 600
SCENES = 100
REPEATS = 5


def rows() -> list[Row]:
    """Time the statistics of a made-up sequence, and the pooling of its moments over scenes."""
    scene = made_up("scene", seed=0, frames=FRAMES, observations=OBSERVATIONS)
    work = partial(summarise_sequence, scene.observations, scene.tracks, scene.frames, trim_percentile=90.0, slowest=1)
    moments = scene_moments(prepare_observations(scene.observations))
    scenes = pl.concat([moments.with_columns(scene=pl.lit(f"scene {index}")) for index in range(SCENES)])
    by = [column for column in KEYS if column != "scene"]
    merge_ms = median_ms(lambda: merge(scenes, by=by), repeats=REPEATS)
    pooled = f"{scenes.height} rows of {SCENES} scenes"
    return [
        *_timed(work, scene.observations.height),
        Row("merge", scenes.height / merge_ms / 1e3, "million moments rows/s", pooled),
        Row("curves", median_ms(lambda: curves(scenes), repeats=REPEATS), "ms", pooled),
    ]


def _of_run(path: Path, number: int) -> list[Row]:
    """Time the statistics of one sequence of a run folder."""
    settings = tomllib.loads((path / "experiment.toml").read_text())
    key, entry = list(json.loads((path / "manifest.json").read_text())["sequences"].items())[number]
    tables = [pl.read_parquet(path / name / f"{key}.parquet") for name in ("observations", "tracks", "frames")]
    work = partial(
        summarise_sequence,
        *tables,
        key_frame=entry["key_frame"],
        population=settings["truth"]["population"],
        trim_percentile=settings["statistics"]["trim_percentile"],
        trim_among=settings["statistics"]["trim_among"],
        slowest=min(settings["speeds"]),
    )
    return _timed(work, tables[0].height)


def _timed(work: Callable[[], object], observations: int) -> list[Row]:
    """CPU and wall time of a call, median after one warm-up call."""
    work()
    times = [_seconds(work) for _ in range(REPEATS)]
    size, columns = f"{observations} observations", zip(("CPU", "wall"), zip(*times, strict=True), strict=True)
    return [
        Row(f"summarise_sequence: {name} time", median(each) / observations * 1e6, "s/million", size)
        for name, each in columns
    ]


def _seconds(work: Callable[[], object]) -> tuple[float, float]:
    cpu, wall = time.process_time(), time.perf_counter()
    work()
    return time.process_time() - cpu, time.perf_counter() - wall


if __name__ == "__main__":
    for row in _of_run(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0):
        print(f"{row.value:8.2f} {row.unit} {row.name} ({row.note})")
