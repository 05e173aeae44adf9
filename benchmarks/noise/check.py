"""Whether predicted covariances describe the errors of a run: coverage, NEES, likelihood, ENCE.

    python -m benchmarks.noise.check MODEL --on RUN [--scene NAME ...] [--figure FILE]
    python -m benchmarks.noise.check --own NAME --tracker NAME --on RUN

Checks a noise model, or with ``--own`` the covariances that a front end reports itself, in the columns
``quality_NAME_uu``, ``_uv`` and ``_vv``.
"""

import argparse
import sys
from pathlib import Path

from benchmarks.noise.calibration import Calibration, check_model, check_own
from benchmarks.noise.cells import calibration_cells, calibration_sentences, reliability_cells
from benchmarks.noise.reliability import reliability
from benchmarks.program import ended, print_tables
from tracknoise.cli.output_files import require_outputs
from tracknoise.cli.terminal import wrapped
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.exceptions import SettingsError
from tracknoise.report.figure_files import FORMATS, render, specification
from tracknoise.tables.files import write_atomically
from tracknoise.tables.store import RunFolder


def main(arguments: list[str]) -> int:
    """Check covariances on a run. Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.noise.check", description=__doc__.partition("\n")[0])
    parser.add_argument("model", type=Path, nargs="?", help="noise model, as `tracknoise export --model` keeps it")
    parser.add_argument("--on", type=Path, required=True, help="folder of a finished run of other scenes")
    parser.add_argument("--scene", action="append", help="only this scene of the run; may be repeated")
    parser.add_argument("--own", help="check columns of this name, not a model")
    parser.add_argument("--tracker", help="tracker of the run, with --own")
    parser.add_argument("--speed", type=int, help="speed of the run, with --own (default: 1)")
    parser.add_argument("--figure", type=Path, help="write the reliability plot to this file: .svg or .png")
    options = parser.parse_args(arguments)
    return ended(lambda: _checked(options))


def _checked(options: argparse.Namespace) -> int:
    kind = None if options.figure is None else _kind(options.figure)
    require_outputs([("--figure", options.figure)], inputs=[options.model, options.on])
    found = _found(options)
    print("\n".join(line for sentence in calibration_sentences(found) for line in wrapped(sentence)))
    print_tables((calibration_cells(found), reliability_cells(found)))
    if kind is not None:
        figure = reliability(found, title=f"Reliability of {options.model or options.own}")
        write_atomically(options.figure, render(specification(figure), (kind,))[kind])
        print(f"\nwritten: {options.figure}")
    return 0


def _kind(path: Path) -> str:
    """Format of a figure, by the name of its file."""
    kind = path.suffix.lower().removeprefix(".")
    if kind not in FORMATS:
        raise SettingsError(f"--figure {path}: found a name that ends in {path.suffix!r}, expected .svg or .png")
    return kind


def _found(options: argparse.Namespace) -> Calibration:
    run = RunFolder(options.on)
    if options.own is not None:
        if options.tracker is None or options.model is not None:
            raise SettingsError("--own NAME: found no --tracker or a model as well, expected --tracker alone")
        speed = options.speed or 1
        return check_own(run, tracker=options.tracker, speed=speed, name=options.own, scenes=options.scene)
    if options.model is None:
        raise SettingsError("no MODEL, expected a noise model, or --own NAME")
    if options.tracker is not None or options.speed is not None:
        option = "--speed" if options.tracker is None else "--tracker"
        raise SettingsError(f"{option}: found a noise model, which has its own, expected the option with --own alone")
    return check_model(NoiseModel.read(options.model), run, scenes=options.scene)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
