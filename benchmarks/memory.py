"""Peak memory of one scene against its length: what grows must be the recorded observations alone.

A process for each length measures Lucas-Kanade over a simulated scene, and says how large it was at its peak while
the images passed, and how large the recorded observations are.
"""

import json
import subprocess
import sys
from pathlib import Path

from benchmarks.harness import Row

LENGTHS = (100, 1000)


def rows() -> list[Row]:
    """Peak resident size and size of the recordings for each length, MiB."""
    measured = {length: _in_new_process(length) for length in LENGTHS}
    table = [
        Row(f"memory: {name}, {length} frames", value, "MiB")
        for length, values in measured.items()
        for name, value in values.items()
    ]
    short, long = (measured[length] for length in LENGTHS)
    growth = long["peak"] - short["peak"]
    recorded = long["recorded observations"] - short["recorded observations"]
    return [*table, Row("memory: growth beyond the recorded observations", growth - recorded, "MiB")]


def _in_new_process(length: int) -> dict[str, float]:
    command = [sys.executable, "-m", "benchmarks.memory", str(length)]
    finished = subprocess.run(command, check=True, capture_output=True, text=True)
    measured: dict[str, float] = json.loads(finished.stdout)
    return measured


def _sweep(length: int) -> dict[str, float]:
    from tracknoise import LucasKanade, open_sequence
    from tracknoise.measurement.sweep import Condition, sweep
    from tracknoise.truth.truth import make_truth

    sequence = open_sequence("simulated", motions=["arvr"], frames=length, width=320, height=240, supersampling=1)
    conditions = [Condition("lucas-kanade", LucasKanade(), 1)]
    swept = sweep([sequence], conditions, [make_truth(sequence, None)], n_frames=length, seed=0)
    recording = swept.recordings[0]
    size = sum(getattr(recording, name).nbytes for name in recording.__slots__)
    return {"peak": _peak_kib() / 2**10, "recorded observations": size / 2**20}


def _peak_kib() -> int:
    """Largest resident size since this program began; unlike `resource.getrusage`, without its parent's (Linux)."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0])


if __name__ == "__main__":
    json.dump(_sweep(int(sys.argv[1])), sys.stdout)
