"""What the audit names where a known fault is planted in simulated recordings that real trackers follow.

    python -m benchmarks.validity.audit_simulated [--worlds N] [--frames N] [--jobs N]

Each world is filmed with four motions, at 320 x 240 px and 30 Hz, and followed by Lucas-Kanade and by correspondence.
The fault is in what is stated of the recordings; their images, and so the tracks, are the same for all faults but those
of the shutter. Printed are, for each fault, the parameters that are named with their values and intervals, beside the
stated ones. Only one motion of the four changes its speed, so that errors of times show in every fourth scene. The last
line is about scenes that are audited one by one, without a fault.
"""

import argparse
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Any

import polars as pl

from benchmarks.effects.study import SharedTracker, SharedWorld, simulated_reader
from tracknoise.experiments.geometry_tables import audit_samples, cameras_table, poses_table
from tracknoise.experiments.measure import measure_together
from tracknoise.inference.units import NO_GROUPS
from tracknoise.trackers.tracker_registry import make_tracker
from tracknoise.truth_faults.audit_tables import AuditedTables, read_samples, tables_of
from tracknoise.truth_faults.fault_parameters import Family

Options = dict[str, Any]

TRACKERS = ("lucas-kanade", "correspondence")
FAULTS: Mapping[str, Options] = {
    "none": {},
    "focal length 1 % too long": {"focal": 0.01},
    "focal length 10 % too long": {"focal": 0.1},
    "focal length 5 % too short": {"focal": -0.05},
    "principal point (3, -3) px off": {"principal_point_px": [3.0, -3.0]},
    "principal point (12, 8) px off": {"principal_point_px": [12.0, 8.0]},
    "k1 of 0.01": {"k1": 0.01},
    "k1 of 0.1": {"k1": 0.1},
    "depths x 1.02": {"depth": {"scale": 1.02}},
    "depths x 0.9": {"depth": {"scale": 0.9}},
    "depths + 5 cm": {"depth": {"offset_m": 0.05}},
    "depths + 30 cm": {"depth": {"offset_m": 0.3}},
    "turned by (0.3, -0.3, 0.3) deg": {"mounting": {"rotation_deg": [0.3, -0.3, 0.3]}},
    "turned by (2, 1, -2) deg": {"mounting": {"rotation_deg": [2.0, 1.0, -2.0]}},
    "moved by (3, 2, -2) cm": {"mounting": {"position_m": [0.03, 0.02, -0.02]}},
    "moved by (10, -5, 5) cm": {"mounting": {"position_m": [0.1, -0.05, 0.05]}},
    "clock 3 ms off": {"clock_s": 0.003},
    "clock -20 ms off": {"clock_s": -0.02},
    "clock one frame off": {"clock_frames": 1.0},
}
"""What is stated wrongly, as `dataset.options.faults` of the reader ``simulated``."""
READOUTS = {"readout of 10 ms": 0.01, "readout of 26 ms": 0.026}
"""Seconds that an image takes, which is not stated."""


def variants(base: Options) -> tuple[dict[str, Options], dict[str, Options]]:
    """Options of the reader by fault: of those with the images of a global shutter, and of the others."""
    stated = {name: base | {"faults": fault} for name, fault in FAULTS.items()}
    hidden = {
        name: base | {"imaging": base["imaging"] | {"readout_s": seconds}, "faults": {"hide_shutter": True}}
        for name, seconds in READOUTS.items()
    }
    return stated, hidden


def measured(base: Options, scene: str) -> dict[str, AuditedTables]:
    """Tables of a scene by fault."""
    found: dict[str, AuditedTables] = {}
    for options in variants(base):
        found |= dict(_together(base, scene, options))
    return found


def _together(base: Options, scene: str, options: Mapping[str, Options]) -> Iterator[tuple[str, AuditedTables]]:
    """Measure a scene under several faults, with one world and one run of each tracker on equal images."""
    reader = simulated_reader(base)
    world = SharedWorld(reader.scenery_of(scene))
    name = next(one for one in reader.sequences() if one.scene == scene)
    sequences = [simulated_reader(one).open_in(world, name) for one in options.values()]
    trackers = {kind: SharedTracker(make_tracker(kind, {})) for kind in TRACKERS}
    results = measure_together(sequences, trackers, truth="birth")
    for fault, sequence, result in zip(options, sequences, results, strict=True):
        n = base["frames"]
        samples = audit_samples(sequence, result.prepared, "birth")
        yield fault, AuditedTables(samples, cameras_table(sequence, n), poses_table(sequence, n))


def report(fault: str, tables: list[AuditedTables]) -> str:
    """The lines about a fault."""
    audit = tables_of(read_samples(tables, NO_GROUPS), "simulated").audit
    named = audit.filter(pl.col("rank").is_not_null(), family=str(Family.alone)).sort("rank", maintain_order=True)
    lines = [
        f"    {row['parameter']} {row['component']}: {row['value']:.4g} ({row['low']:.4g} to {row['high']:.4g})"
        f" {row['unit']}, stated {row['stated']:.4g}"
        for row in named.iter_rows(named=True)
    ]
    return "\n".join([f"{fault}: {'' if lines else 'nothing named'}", *lines])


def one_by_one(scenes: list[AuditedTables]) -> str:
    """How often intervals of single scenes hold the truth, and how many faults are named, where there is none."""
    audits = [tables_of(read_samples([scene], NO_GROUPS), "simulated").audit for scene in scenes]
    beside = pl.concat(audits).filter(family=str(Family.beside_bias))
    held = beside.filter(pl.col("stated").is_between(pl.col("low"), pl.col("high"))).height
    named = sum(audit["rank"].drop_nulls().n_unique() for audit in audits)
    return f"{len(scenes)} single scenes, no fault: intervals hold {held} of {beside.height} numbers, {named} named"


def main() -> None:
    """Print what is named for each fault."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=2)
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    base = {
        "width": 320,
        "height": 240,
        "frames": given.frames,
        "worlds": given.worlds,
        "imaging": {"rate_hz": 30.0},
    }
    scenes = [one.scene for one in simulated_reader(base).sequences()]
    with ProcessPoolExecutor(given.jobs) as pool:
        by_scene = list(pool.map(partial(measured, base), scenes))
    for fault in by_scene[0]:
        print(report(fault, [one[fault] for one in by_scene]), flush=True)
    print(one_by_one([one["none"] for one in by_scene]))


if __name__ == "__main__":
    main()
