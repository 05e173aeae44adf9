"""``tracknoise audit``: what is wrong with the stated truth of a run, as sentences and tables, or as JSON."""

import json
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.shared_options import (
    UNUSABLE,
    DebugOption,
    JsonFileOption,
    JsonOption,
    QuietOption,
    write_json,
)
from tracknoise.cli.terminal import WIDTH, Terminal
from tracknoise.tables.findings_schema import AUDIT, AUDIT_CURVES, TRUST
from tracknoise.truth_faults.pose_accuracy import POSE_LAW, RIGID_SHARE

if TYPE_CHECKING:
    import polars as pl


def audit(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    as_json: JsonOption = False,
    json_file: JsonFileOption = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Say whether the truth of a run can be trusted, and what is wrong with its camera, poses, depths or times.

    Prints the verdict, what to add to the experiment file (corrections, and the accuracy of the poses), and the numbers
    behind it. Exit status 0 if the truth is trusted or limited, 4 if it is not trusted or this is unknown.

    Example: `tracknoise audit runs/7scenes`
    """
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.exceptions import StoreError
    from tracknoise.tables.store import RunFolder
    from tracknoise.tables.trust import TruthVerdict
    from tracknoise.truth_faults.audit_summary import corrections_toml, recorded_step
    from tracknoise.truth_faults.pose_accuracy import accuracy_toml

    require_outputs([("--json-file", json_file)], inputs=[run])
    folder = RunFolder(run)
    found, curves = folder.statistics(AUDIT), folder.statistics(AUDIT_CURVES)
    trust = folder.statistics(TRUST)
    verdict = TruthVerdict.of(trust)
    if found.is_empty() and not verdict.are_tracks_wrong:
        raise StoreError(f"{run}: holds no audit, expected that of a finished run; `tracknoise run` makes it")
    settings = folder.settings()
    corrections = corrections_toml(found, settings)
    accuracy = accuracy_toml(folder.statistics(POSE_LAW), folder.statistics(RIGID_SHARE), recorded_step(settings))
    document = _json(trust, found, curves, corrections, accuracy)
    write_json(context.obj, document, as_json=as_json, file=json_file)
    if not as_json:
        texts = filter(None, [verdict.sentence, verdict.stated])
        context.obj.result("\n".join([*(textwrap.fill(text, WIDTH) for text in texts), ""]))
        _print(context.obj, trust, found, curves, corrections, accuracy)
    return 0 if verdict.is_usable else UNUSABLE


def _json(
    trust: "pl.DataFrame", found: "pl.DataFrame", curves: "pl.DataFrame", corrections: str | None, accuracy: str | None
) -> str:
    from tracknoise.truth_faults.audit_summary import audit_sentences

    document = {
        "format": 2,
        "truth": trust.to_dicts(),
        "sentences": audit_sentences(found),
        "corrections": corrections,
        "accuracy": accuracy,
        "audit": found.to_dicts(),
        "audit_curves": curves.to_dicts(),
    }
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)


def _print(
    terminal: Terminal,
    trust: "pl.DataFrame",
    found: "pl.DataFrame",
    curves: "pl.DataFrame",
    corrections: str | None,
    accuracy: str | None,
) -> None:
    from tracknoise.cli.text_table import show
    from tracknoise.report.truth_section import cause_cells, curve_cells, parameter_cells
    from tracknoise.truth_faults.audit_summary import audit_sentences

    for sentence in audit_sentences(found, every=True):
        terminal.result(textwrap.fill(sentence, WIDTH))
    if corrections:
        how = "put this block into the experiment file, in place of one that it has, and run it again"
        terminal.result(f"\nTo correct this, {how}:\n\n{corrections}")
    if accuracy:
        terminal.result(
            f"\nThe trackers agree on errors of the poses. To include them in the truth floor, add:\n\n{accuracy}"
        )
    for cells in (cause_cells(trust), parameter_cells(found), curve_cells(curves)):
        if cells.rows:
            terminal.result("")
            show(terminal.result, cells)
