"""Peak memory of one process: against the length of a scene, of which only recorded observations may remain; and of a
scene of the light stage, whose lightings are measured together.

Each is measured by a process of its own, which says how large it was at its peak.
"""

import json
import sys
import tempfile
from pathlib import Path

from benchmarks.harness import Row, elapsed_ms, in_new_process, peak_mib, program

LENGTHS = (100, 1000)
STAGE_SMALL, STAGE_FULL = (240, 180), (1600, 1200)
STAGE = """
name = "memory"
speeds = [1, 2, 4, 8, 12]
[dataset]
reader = "dtu"
root = "data"
[[trackers]]
kind = "lucas-kanade"
[[trackers]]
kind = "correspondence"
[truth]
kind = "scan"
population = "projected"
"""


class Silent:
    """Listens to a run, and says nothing."""

    def __getattr__(self, name: str) -> object:
        return lambda *arguments: None


def rows() -> list[Row]:
    """Of a simulated sequence of two lengths, and of a stage of small images."""
    return [*_by_length(), *_stage(STAGE_SMALL)]


def full_rows() -> list[Row]:
    """The same with a stage of the images that DTU Point Features have."""
    return [*_by_length(), *_stage(STAGE_FULL)]


def _by_length() -> list[Row]:
    measured = {length: in_new_process("benchmarks.memory", "sweep", length) for length in LENGTHS}
    table = [
        Row(f"memory: {name}, {length} frames", value, "MiB")
        for length, values in measured.items()
        for name, value in values.items()
    ]
    short, long = (measured[length] for length in LENGTHS)
    growth = long["peak"] - short["peak"]
    recorded = long["recorded observations"] - short["recorded observations"]
    return [*table, Row("memory: growth beyond the recorded observations", growth - recorded, "MiB")]


def _stage(size: tuple[int, int]) -> list[Row]:
    width, height = size
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        options = [
            "--option",
            f"width={width}",
            "--option",
            f"height={height}",
            "--option",
            "image_format=bmp",
            "--quiet",
        ]
        program("simulate", "--layout", "dtu", "--out", folder / "data", *options)
        (folder / "x.toml").write_text(STAGE)
        measured = in_new_process("benchmarks.memory", "stage", folder)
    what = f"49 frames in {measured['sequences']} lightings at {width // 2}x{height // 2}"
    note = f"10 conditions, {measured['observations'] / 1e6:.1f} million observations"
    return [
        Row(f"memory: peak of a scene of the light stage, {what}", measured["peak"], "MiB", note),
        Row(f"a scene of the light stage, {what}", measured["seconds"], "s", note),
    ]


def _measure_sweep(length: int) -> dict[str, float]:
    from tracknoise.measurement.tracking import TrackerSetup, run_trackers
    from tracknoise.sequences.reader_registry import open_sequence
    from tracknoise.trackers.lucas_kanade import LucasKanade
    from tracknoise.truth.truth_registry import make_truth

    sequence = open_sequence("simulated", motions=["arvr"], frames=length, width=320, height=240, supersampling=1)
    conditions = [TrackerSetup("lucas-kanade", LucasKanade(), 1)]
    swept = run_trackers([sequence], conditions, [make_truth(sequence, None)], n_frames=length, seed=0)
    recording = swept[0].recordings[0]
    arrays = [getattr(recording, name) for name in recording.__slots__ if name != "quality"]
    size = sum(array.nbytes for array in [*arrays, *recording.quality.values()])
    return {"peak": peak_mib(), "recorded observations": size / 2**20}


def _measure_stage(folder: Path) -> dict[str, float]:
    from tracknoise.experiments.execute import execute
    from tracknoise.experiments.load import load_experiment
    from tracknoise.tables.store import RunFolder

    experiment, run = load_experiment(folder / "x.toml"), RunFolder(folder / "run")
    seconds = elapsed_ms(lambda: execute(experiment, run, listener=Silent(), debug=True)) / 1e3
    observations = int(run.statistics("counts").filter(kind="truth")["n"].sum())
    n_sequences = len(run.manifest().sequences)
    return {"peak": peak_mib(), "sequences": n_sequences, "observations": observations, "seconds": seconds}


if __name__ == "__main__":
    kind, argument = sys.argv[1:]
    json.dump(_measure_sweep(int(argument)) if kind == "sweep" else _measure_stage(Path(argument)), sys.stdout)
