"""What each effect of a camera, and each fault of the truth, changes in the results.

    python -m benchmarks.effects [--out FOLDER] [--scenes N] [--frames N] [--age N] [--only NAMES]

Each effect is simulated alone, at a low, a usual and a bad size. Mean error, second moment, core, median lifetime and
outlier ratio are compared with those of the same scenes without effects. Effects, their sizes and sources are in
``effects.toml``. An interrupted study resumes.
"""

import argparse
import sys
from pathlib import Path

from benchmarks.effects.files import effect_cells, write_effects
from benchmarks.effects.study import Study, base_options, chosen_effects, merged, run_study
from benchmarks.program import ended, print_tables
from tracknoise.inference.conventions import LEVEL
from tracknoise.processes import usable_cores


def main(arguments: list[str]) -> int:
    """Measure a study and print its tables. Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.effects", description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("runs/effects"), help="folder for the results")
    parser.add_argument("--scenes", type=int, default=6, help="each has its own world")
    parser.add_argument("--frames", type=int, default=40, help="of each scene")
    parser.add_argument("--age", type=int, default=10, help="at which errors are compared, frames")
    parser.add_argument("--motion", default="arvr", help="of the camera, the same in all scenes")
    parser.add_argument("--only", type=lambda text: text.split(","), help="effects by name, separated by commas")
    parser.add_argument("--workers", type=int, default=usable_cores())
    parser.add_argument("--fresh", action="store_true", help="delete what the folder holds of another study")
    options = parser.parse_args(arguments)
    return ended(lambda: _measured(options))


def _measured(options: argparse.Namespace) -> int:
    changes = {"motions": [options.motion], "worlds": options.scenes, "frames": options.frames}
    study = Study(merged(base_options(), changes), chosen_effects(options.only), ages=(options.age,))
    found = run_study(
        study,
        options.out,
        workers=options.workers,
        fresh=options.fresh,
        done=lambda part, count, total: print(
            f"measured {count} of {total}: {part[0]}, {part[1]} sizes", file=sys.stderr
        ),
    )
    print_tables(effect_cells(found, level=LEVEL))
    for path in write_effects(options.out, found, level=LEVEL):
        print(f"written: {path.resolve()}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
