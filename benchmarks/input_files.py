"""What it costs to notice data that change: checksums while a sequence is measured, and comparing before a run resumes.

Both trackers at speed 1 on sequences of files. Recorded ones are those of the folder of samples, if it is there.
"""

import os
import tempfile
from pathlib import Path

from benchmarks.harness import Row, elapsed_ms, write_scene
from tracknoise.experiments.inputs import InputCheck
from tracknoise.experiments.plan import plan
from tracknoise.experiments.settings import parse_experiment
from tracknoise.experiments.task import attempt
from tracknoise.opened_files import noting, read_noted
from tracknoise.tables.store import RunFolder

SAMPLES = Path(os.environ.get("TRACKNOISE_DATA", "../shared/data"))
RECORDED = {"sevenscenes": "sevenscenes", "tartanair": "tartanair_v1", "tum": "tum_rgbd"}
TRACKERS = '[[trackers]]\nkind = "lucas-kanade"\n[[trackers]]\nkind = "correspondence"\n'


def rows() -> list[Row]:
    """A simulated scene of 40 frames of 640x480, and the samples."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "data" / "scene"
        write_scene(folder, frames=40, width=640, height=480)
        found = _rows("folder", folder.parent)
        for reader, sample in RECORDED.items():
            if (SAMPLES / sample).is_dir():
                found += _rows(reader, SAMPLES / sample)
    return found


def _rows(reader: str, root: Path) -> list[Row]:
    text = f'name = "x"\n[dataset]\nreader = "{reader}"\nroot = "{root.resolve()}"\n{TRACKERS}'
    task = plan(parse_experiment(text, place="x"))[0]
    with tempfile.TemporaryDirectory() as name:
        run = RunFolder(Path(name))
        entries = []
        measuring_ms = elapsed_ms(lambda: entries.extend(attempt([task], run, debug=True)))
        table = run.inputs(task.key)
        assert table is not None
        files = [root.resolve() / os.fsdecode(path) for path in table.filter(kind="file", in_data=True)["path"]]
        reading_once_ms = elapsed_ms(lambda: [path.read_bytes() for path in files])
        with noting(lambda path: True):
            noting_ms = elapsed_ms(lambda: [read_noted(path) for path in files])
        comparing_ms = elapsed_ms(lambda: InputCheck(run).change(task, entries[0]))
        reading_ms = elapsed_ms(lambda: InputCheck(run, verify=True).change(task, entries[0]))
    checksums_ms = noting_ms - reading_once_ms
    size = f"{len(files)} files, {table['size'].sum() / 1e6:.0f} MB, measured in {measuring_ms / 1e3:.1f} s"
    return [
        Row(
            f"inputs: checksums while measuring, {reader}",
            100 * checksums_ms / measuring_ms,
            "% of measuring",
            size,
        ),
        Row(f"inputs: comparing before a resume, {reader}", 100 * comparing_ms / measuring_ms, "% of measuring"),
        Row(f"inputs: the same with verify = true, {reader}", 100 * reading_ms / measuring_ms, "% of measuring"),
    ]
