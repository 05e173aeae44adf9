"""How much CPU time the findings of a run take: from the stored tables of its sequences to the sentences, on one core.

The full size is that of the paper's DTU experiment: 60 scenes, 19 lightings, two trackers at five speeds, 49 frames. A
few scenes are made up, and stand in for all of them under other names.
"""

import json
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import polars as pl

from benchmarks.harness import Row, in_new_process, peak_mib, stay_on_one_core
from benchmarks.made_up import EXPERIMENT, SPEEDS, TRACKERS, made_up, renamed, seen_by_a_still_camera
from tracknoise.experiments.measure import complete
from tracknoise.experiments.resume import new_manifest
from tracknoise.experiments.run_findings import compute_findings
from tracknoise.experiments.run_statistics import compute_statistics
from tracknoise.experiments.settings import parse_experiment
from tracknoise.experiments.task import tables_to_keep
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import RunFolder

FRAMES, OBSERVATIONS, DIFFERENT = 49, 40_000, 6


def rows() -> list[Row]:
    """Of 8 scenes under 2 lightings."""
    return _rows(8, 2)


def full_rows() -> list[Row]:
    """Of 60 scenes under 19 lightings."""
    return _rows(60, 19)


def _rows(scenes: int, lightings: int) -> list[Row]:
    measured = in_new_process("benchmarks.findings", scenes, lightings)
    size = f"{scenes} scenes, {lightings * len(TRACKERS) * len(SPEEDS)} conditions, {FRAMES} frames"
    return [
        Row("findings: pooling", measured["pooling"], "s of CPU time", size),
        Row("findings: all of them, reading included", measured["finding"], "s of CPU time", size),
        Row("findings: peak memory", measured["peak"], "MiB", size),
    ]


def _measure(scenes: int, lightings: int) -> dict[str, float]:
    stay_on_one_core()
    experiment = parse_experiment(f'{EXPERIMENT}lightings = ["light-00"]', place="benchmark")
    made = [_tables(experiment, seed) for seed in range(DIFFERENT)]
    with tempfile.TemporaryDirectory() as folder:
        run = RunFolder(Path(folder) / "run")
        manifest = new_manifest(experiment)
        run.create(experiment.to_toml(), manifest)
        for scene in range(scenes):
            for light in range(lightings):
                names = {"scene": f"scene-{scene:02d}", "lighting": f"light-{light:02d}"}
                entry = SequenceEntry(SequenceId("made up", **names), n_frames=FRAMES, width=800,
                                      height=600, truth="birth", snapshot_frame=0, seconds=0.0)  # fmt: skip
                tables = renamed(made[(scene + light) % DIFFERENT], names)
                hashes = run.write_sequence(entry.key, tables, b"")
                manifest.sequences[entry.key] = replace(entry, sha256=hashes)
        run.write_manifest(manifest)
        start = time.process_time()
        statistics = compute_statistics(run, experiment)
        pooled = time.process_time()
        compute_findings(run, experiment, statistics)
        return {"pooling": pooled - start, "finding": time.process_time() - pooled, "peak": peak_mib()}


def _tables(experiment, seed: int) -> dict[str, pl.DataFrame]:
    scene = made_up("scene", seed=seed, frames=FRAMES, observations=OBSERVATIONS)
    sequence = seen_by_a_still_camera(SequenceId("made up", "scene"), FRAMES)
    return tables_to_keep(experiment, sequence, complete(sequence, scene))


if __name__ == "__main__":
    json.dump(_measure(int(sys.argv[1]), int(sys.argv[2])), sys.stdout)
