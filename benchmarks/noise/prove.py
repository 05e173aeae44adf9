"""What an estimator gains from a noise model, on scenes that the model was not fitted to.

    python -m benchmarks.noise.prove RUN MODEL [--window N] [--per-sequence N] [--tracks N] [--seed N] [--out FILE]

Adjusts windows of a run that keeps its observations under each noise assumption, and compares poses with the true ones.
Prints the answer, whichever it is, and two tables, and writes them as JSON. Refuses a run or a model whose truth is not
trusted, or of which this is unknown, unless ``--allow untrusted`` is given.
"""

import argparse
import json
import sys
import textwrap
from pathlib import Path

import polars as pl

from benchmarks.noise.arms import REFERENCE
from benchmarks.noise.proof import Proof, prove
from benchmarks.program import ended, print_tables
from tracknoise.cli.output_files import require_outputs
from tracknoise.cli.shared_options import require_truth
from tracknoise.cli.terminal import WIDTH
from tracknoise.estimators.noise_model import NoiseModel
from tracknoise.inference.estimates import Estimate
from tracknoise.report.cells import Cells
from tracknoise.tables.files import write_atomically
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import TruthVerdict
from tracknoise.words import format_estimate


def main(arguments: list[str]) -> int:
    """Prove a model on a run. Returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.noise.prove", description=__doc__.partition("\n")[0])
    parser.add_argument("run", type=Path, help="run folder that keeps its observations")
    parser.add_argument("model", type=Path, help="noise model, as `tracknoise export --model` keeps it")
    parser.add_argument("--window", type=int, default=11, help="length of the windows, processed frames")
    parser.add_argument("--per-sequence", type=int, default=8, help="most windows of a sequence")
    parser.add_argument("--tracks", type=int, default=80, help="most tracks of a window")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="JSON file (default: MODEL with the ending .proof.json)")
    parser.add_argument("--allow", choices=["untrusted"], help="numbers from a truth that is not trusted, or unknown")
    options = parser.parse_args(arguments)
    return ended(lambda: _proved(options))


def _proved(options: argparse.Namespace) -> int:
    require_outputs([("--out", options.out)], inputs=[options.run, options.model])
    model, run = NoiseModel.read(options.model), RunFolder(options.run)
    truth = TruthVerdict.of_run(run)
    for verdict, whose in ((truth, options.run), (model.truth, options.model)):
        require_truth(verdict, str(whose), accepted=options.allow is not None)
        if not verdict.is_usable:
            print(f"warning: {whose}: {verdict.caveat}", file=sys.stderr)
    found = prove(
        run,
        model,
        length=options.window,
        per_sequence=options.per_sequence,
        most_tracks=options.tracks,
        seed=options.seed,
    )
    for sentence in found.sentences:
        print(textwrap.fill(sentence, WIDTH))
    print_tables(_tables(found))
    written = options.model.with_suffix(".proof.json") if options.out is None else options.out
    write_atomically(written, _json(found, model, truth).encode())
    print(f"\nwritten: {written.resolve()}")
    return 0


def _json(found: Proof, model: NoiseModel, truth: TruthVerdict) -> str:
    document = {
        "format": "tracknoise.proof/1",
        "model_sha256": model.sha256,
        "tracker": model.training.tracker,
        "speed": model.training.speed,
        "truth": {"of_run": truth.caveat, "of_model": model.truth.caveat},
        "sentences": found.sentences,
        "training_scenes": found.training,
        "tested_scenes": found.tested,
        "poses": found.poses.to_dicts(),
        "distances": found.distances.to_dicts(),
    }
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _tables(found: Proof) -> list[Cells]:
    compared = f"arm {REFERENCE}"
    intervals = "" if found.poses["low"].is_null().all() else " In brackets: 95 % intervals."
    poses = f"Errors of the newest pose relative to {compared}, and NEES: 1 if as certain as claimed.{intervals}"
    distances = "Errors of triangulated distances relative to 1 px, and share inside their 95 % intervals."
    shown = ("position_ratio", "rotation_ratio", "nees_newest", "nees_all", "coverage_95")
    return [
        _cells(poses, found.poses, ["arm", "title"], shown),
        _cells(distances, found.distances, ["covariance"], ("error_ratio", "z_square", "coverage_95")),
    ]


def _cells(caption: str, table: pl.DataFrame, labels: list[str], quantities: tuple[str, ...]) -> Cells:
    rows = []
    for key, part in table.group_by(labels, maintain_order=True):
        by_name = {row["quantity"]: row for row in part.iter_rows(named=True)}
        found = (Estimate.of_row(by_name[name], "value", "low", "high") for name in quantities)
        rows.append([*map(str, key), *map(format_estimate, found)])
    headings = [*labels, *(name.replace("_", " ") for name in quantities)]
    return Cells(caption, headings, rows, [False] * len(labels) + [True] * len(quantities))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
