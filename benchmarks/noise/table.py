"""Covariance and bias by tracker, speed and motion, and what the table gains on scenes that were left out.

    python -m benchmarks.noise.table RUN [--tracker NAME ...] [--speed N ...] [--window N] [--out FOLDER]

The motion of a scene is its group: see `groups` in the section `dataset` of an experiment.
"""

import argparse
import sys
from pathlib import Path

from benchmarks.noise.cells import gain_cells, noise_table_cells, noise_table_sentences
from benchmarks.noise.noise_table import WINDOW, noise_table, noise_table_csv, noise_table_json
from benchmarks.program import ended, print_tables
from tracknoise.cli.output_files import require_outputs
from tracknoise.cli.terminal import wrapped
from tracknoise.tables.files import write_atomically
from tracknoise.tables.store import RunFolder


def main(arguments: list[str]) -> int:
    """Print the table of a run, and write it. Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.noise.table", description=__doc__.partition("\n")[0])
    parser.add_argument("run", type=Path, help="folder of a finished run")
    parser.add_argument("--tracker", action="append", help="only this tracker; may be repeated")
    parser.add_argument("--speed", type=int, action="append", help="only this speed; may be repeated")
    parser.add_argument("--window", type=int, default=WINDOW, help="length of windows, frames")
    parser.add_argument("--out", type=Path, help="folder for noise-table.csv and noise-table.json")
    options = parser.parse_args(arguments)
    return ended(lambda: _made(options))


def _made(options: argparse.Namespace) -> int:
    out = options.out
    files = {out / "noise-table.csv": noise_table_csv, out / "noise-table.json": noise_table_json} if out else {}
    require_outputs([("--out", path) for path in files], inputs=[options.run])
    found = noise_table(RunFolder(options.run), trackers=options.tracker, speeds=options.speed, window=options.window)
    print("\n".join(line for sentence in noise_table_sentences(found) for line in wrapped(sentence)))
    print_tables((noise_table_cells(found), gain_cells(found)))
    for path, content in files.items():
        write_atomically(path, content(found).encode())
        print(f"written: {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
