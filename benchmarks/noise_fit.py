"""How long noise models of a run of sixty scenes take: python -m benchmarks noise_fit.

A few simulated scenes are measured by the whole program. Their tables are then written again under other names until
there are sixty scenes, and models of all trackers and speeds are fitted.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import polars as pl

from benchmarks.harness import Row, elapsed_ms, program
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.estimators.training import conditions
from tracknoise.tables.manifest import Manifest, SequenceEntry
from tracknoise.tables.store import RunFolder

SCENES = 60
EXPERIMENT = """
name = "noise fit"
speeds = [1, 2]
[dataset]
reader = "simulated"
[dataset.options]
motions = ["sideways", "forward"]
worlds = 1
frames = {frames}
width = {width}
height = {height}
[[trackers]]
kind = "lucas-kanade"
[[trackers]]
kind = "correspondence"
"""


def rows() -> list[Row]:
    """Of scenes of 12 frames of 240x180."""
    return _rows(12, 240, 180)


def full_rows() -> list[Row]:
    """Of scenes of 60 frames of 640x480."""
    return _rows(60, 640, 480)


def _rows(frames: int, width: int, height: int) -> list[Row]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "x.toml").write_text(EXPERIMENT.format(frames=frames, width=width, height=height))
        program("run", folder / "x.toml", "--out", folder / "few", "--no-report", "--quiet")
        replicate_scenes(RunFolder(folder / "few"), RunFolder(folder / "many"), SCENES)
        wanted = conditions(RunFolder(folder / "many"))
        fit = (
            elapsed_ms(lambda: [NoiseModel.fit(folder / "many", tracker=one, speed=speed) for one, speed in wanted])
            / 1e3
        )
        models = len(wanted)
    size = f"{SCENES} scenes of {frames} frames of {width}x{height}"
    return [Row("noise fit: one model", fit / models, "s", size), Row(f"noise fit: {models} models", fit, "s", size)]


def replicate_scenes(few: RunFolder, many: RunFolder, n_scenes: int) -> None:
    """Write a run whose scenes are those of another one, again and again under other names."""
    read = few.manifest()
    entries = [read.sequences[key] for key in sorted(read.sequences)]
    manifest = replace(read, sequences={})
    many.create(few.experiment_toml(), manifest)
    for place in range(n_scenes):
        _copy(few, many, entries[place % len(entries)], place, manifest)
    many.write_manifest(manifest)


def _copy(few: RunFolder, many: RunFolder, entry: SequenceEntry, place: int, manifest: Manifest) -> None:
    sequence = replace(entry.sequence, scene=f"{entry.sequence.scene}-{place:02}")
    tables = {name: few.sequence_table(name, entry.key) for name in few.names_of_tables(entry.key)}
    scene = pl.lit(sequence.scene).alias("scene")
    named = {name: table.with_columns(scene) if "scene" in table.columns else table for name, table in tables.items()}
    sha256 = many.write_sequence(sequence.key, named, few.snapshot(entry.key))
    manifest.sequences[sequence.key] = replace(entry, sequence=sequence, sha256=sha256, group=f"{place}")


if __name__ == "__main__":
    replicate_scenes(RunFolder(Path(sys.argv[1])), RunFolder(Path(sys.argv[2])), int(sys.argv[3]))
