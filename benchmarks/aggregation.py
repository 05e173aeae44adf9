"""How fast, and in how much memory, the observations of a large run become its statistics.

Sequences are made up one after another, each of 100,000 observations of two trackers at five speeds, and go through the
very functions that a run puts a measured sequence through, into a run folder that keeps statistics alone; then the run
is pooled, and its findings are made. A process of its own does it all and says how large it was at its peak.
"""

import json
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from benchmarks.harness import Row, in_new_process, peak_mib
from benchmarks.made_up import EXPERIMENT, made_up, seen_by_a_still_camera
from tracknoise.experiments.measure import complete
from tracknoise.experiments.resume import new_manifest
from tracknoise.experiments.run_findings import compute_findings
from tracknoise.experiments.run_statistics import compute_statistics
from tracknoise.experiments.settings import parse_experiment
from tracknoise.experiments.task import tables_to_keep
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import RunFolder

FEW, MANY = 20, 1000
OBSERVATIONS = 100_000
FRAMES = 600


def rows() -> list[Row]:
    """Of two million observations."""
    return _rows(FEW)


def full_rows() -> list[Row]:
    """Of a hundred million observations."""
    return _rows(MANY)


def _rows(sequences: int) -> list[Row]:
    measured = in_new_process("benchmarks.aggregation", sequences)
    size = f"{measured['observations'] / 1e6:.0f} million observations of {sequences} sequences"
    rate = measured["observations"] / measured["reducing"] / 1e6
    return [
        Row("aggregation: peak memory up to the tables of the run", measured["peak"], "MiB", size),
        Row("aggregation: peak memory with its findings", measured["peak with findings"], "MiB", size),
        Row("aggregation: observations to tables of a sequence", rate, "million/s", size),
        Row("aggregation: writing these", measured["writing"], "s", f"{measured['kept'] / 2**20:.0f} MiB"),
        Row("aggregation: tables of sequences to those of the run", measured["pooling"], "s", size),
        Row("aggregation: findings of the run", measured["finding"], "s", size),
        Row("aggregation: in all, but for making them up", sum(measured[name] for name in _TIMED), "s", size),
    ]


_TIMED = ("reducing", "writing", "pooling", "finding")


def _measure(sequences: int) -> dict[str, float]:
    experiment = parse_experiment(EXPERIMENT, place="benchmark")
    clock, observations = dict.fromkeys(_TIMED, 0.0), 0
    with tempfile.TemporaryDirectory() as folder:
        run = RunFolder(Path(folder) / "run")
        manifest = new_manifest(experiment)
        run.create(experiment.to_toml(), manifest)
        for number in range(sequences):
            scene = made_up(str(number).zfill(5), seed=number, frames=FRAMES, observations=OBSERVATIONS)
            observations += scene.observations.height
            name = SequenceId("made up", f"{number:05d}")
            sequence = seen_by_a_still_camera(name, FRAMES)
            with _timed(clock, "reducing"):
                tables = tables_to_keep(experiment, sequence, complete(sequence, scene))
            entry = _entry(name)
            with _timed(clock, "writing"):
                hashes = run.write_sequence(entry.key, tables, b"")
            manifest.sequences[entry.key] = replace(entry, sha256=hashes)
        run.write_manifest(manifest)
        with _timed(clock, "pooling"):
            statistics = compute_statistics(run, experiment)
        peak = peak_mib()
        with _timed(clock, "finding"):
            compute_findings(run, experiment, statistics)
        kept = sum(path.stat().st_size for path in run.path.rglob("*.parquet"))
    return {"peak": peak, "peak with findings": peak_mib(), "observations": observations, "kept": kept, **clock}


@contextmanager
def _timed(clock: dict[str, float], name: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    clock[name] += time.perf_counter() - start


def _entry(name: SequenceId) -> SequenceEntry:
    return SequenceEntry(
        name, FRAMES, 800, 600, "birth", 0, 0.0
    )  # fmt: skip


if __name__ == "__main__":
    json.dump(_measure(int(sys.argv[1])), sys.stdout)
