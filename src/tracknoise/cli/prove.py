"""``tracknoise prove``: what an estimator gains from a noise model, as sentences and tables, and as JSON."""

import json
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.shared_options import AcceptTruthOption, DebugOption, QuietOption, require_truth
from tracknoise.cli.terminal import WIDTH

if TYPE_CHECKING:
    import polars as pl

    from tracknoise.estimators.noise_model import NoiseModel
    from tracknoise.estimators.proof import Proof
    from tracknoise.report.cells import Cells
    from tracknoise.tables.trust import TruthVerdict


def prove(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(help="Run folder that keeps its observations.")],
    model: Annotated[Path, typer.Argument(help="Noise model, as `tracknoise noise fit` writes it.")],
    window: Annotated[int, typer.Option("--window", min=3, help="Length of the windows, processed frames.")] = 11,
    per_sequence: Annotated[int, typer.Option("--per-sequence", min=1, help="Most windows of a sequence.")] = 8,
    tracks: Annotated[int, typer.Option("--tracks", min=20, help="Most tracks of a window.")] = 80,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Random seed.")] = 0,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="JSON file (default: MODEL with the ending .proof.json).")
    ] = None,
    accept_truth: AcceptTruthOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Say what an estimator gains from a noise model, on scenes that the model was not fitted to.

    Adjusts windows of the run under each noise assumption, and compares poses with the true ones. Prints the answer,
    whichever it is, and two tables. Refuses a run or a model whose truth is not trusted, or of which this is unknown.

    Example: `tracknoise prove runs/7scenes lk.noise.json`
    """
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.cli.text_table import show
    from tracknoise.estimators.noise_model import NoiseModel
    from tracknoise.estimators.proof import prove as proof_of
    from tracknoise.tables.files import write_atomically
    from tracknoise.tables.store import RunFolder
    from tracknoise.tables.trust import TruthVerdict

    require_outputs([("--out", out)], inputs=[run, model])
    read = NoiseModel.read(model)
    truth = TruthVerdict.of_run(RunFolder(run))
    for verdict, whose in ((truth, run), (read.truth, model)):
        require_truth(verdict, str(whose), accepted=accept_truth)
        if not verdict.is_usable:
            context.obj.warn(f"{whose}: {verdict.caveat}")
    found = proof_of(RunFolder(run), read, length=window, per_sequence=per_sequence, most_tracks=tracks, seed=seed)
    for sentence in found.sentences:
        context.obj.result(textwrap.fill(sentence, WIDTH))
    for cells in _tables(found):
        context.obj.result("")
        show(context.obj.result, cells)
    written = model.with_suffix(".proof.json") if out is None else out
    write_atomically(written, _json(found, read, truth).encode())
    context.obj.result(f"\nwritten: {written.resolve()}")
    return 0


def _json(found: "Proof", model: "NoiseModel", truth: "TruthVerdict") -> str:
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


def _tables(found: "Proof") -> "list[Cells]":
    from tracknoise.estimators.trial import REFERENCE

    compared = f"arm {REFERENCE}"
    intervals = "" if found.poses["low"].is_null().all() else " In brackets: 95 % intervals."
    poses = f"Errors of the newest pose relative to {compared}, and NEES: 1 if as certain as claimed.{intervals}"
    distances = "Errors of triangulated distances relative to 1 px, and share inside their 95 % intervals."
    shown = ("position_ratio", "rotation_ratio", "nees_newest", "nees_all", "coverage_95")
    return [
        _cells(poses, found.poses, ["arm", "title"], shown),
        _cells(distances, found.distances, ["covariance"], ("error_ratio", "z_square", "coverage_95")),
    ]


def _cells(caption: str, table: "pl.DataFrame", labels: list[str], quantities: tuple[str, ...]) -> "Cells":
    from tracknoise.inference.estimates import Estimate
    from tracknoise.report.cells import Cells
    from tracknoise.words import format_estimate

    rows = []
    for key, part in table.group_by(labels, maintain_order=True):
        by_name = {row["quantity"]: row for row in part.iter_rows(named=True)}
        found = (Estimate.of_row(by_name[name], "value", "low", "high") for name in quantities)
        rows.append([*map(str, key), *map(format_estimate, found)])
    headings = [*labels, *(name.replace("_", " ") for name in quantities)]
    return Cells(caption, headings, rows, [False] * len(labels) + [True] * len(quantities))
