"""What is wrong with the stated truth of a run, as sentences and tables, or as JSON."""

import json
import textwrap
from dataclasses import dataclass
from pathlib import Path

from tracknoise.cli.terminal import WIDTH, Terminal
from tracknoise.cli.text_table import show
from tracknoise.exceptions import StoreError
from tracknoise.report.truth_section import cause_cells, curve_cells, parameter_cells
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import AssessedTruth
from tracknoise.tables.truth_audit import AuditTables
from tracknoise.truth_faults.audit_summary import audit_sentences, corrections_toml, recorded_step
from tracknoise.truth_faults.pose_accuracy import POSE_LAW, RIGID_SHARE, accuracy_toml


@dataclass(frozen=True, slots=True, eq=False)
class Audit:
    """What a run found out about its truth.

    Attributes
    ----------
    truth
        Whether it can be trusted, and why.
    tables
        What the audit says.
    corrections, accuracy
        What to add to the experiment file; None for nothing.
    """

    truth: AssessedTruth
    tables: AuditTables
    corrections: str | None
    accuracy: str | None


def read_audit(run: Path) -> Audit:
    """The audit of a finished run.

    Raises
    ------
    StoreError
        If there is none, or a table is damaged.
    """
    folder = RunFolder(run)
    tables, truth = AuditTables.of_run(folder), AssessedTruth.of_run(folder)
    if tables.audit.is_empty() and not truth.verdict.are_tracks_wrong:
        raise StoreError(f"{run}: holds no audit, expected that of a finished run; `tracknoise run` makes it")
    settings = folder.settings()
    corrections = corrections_toml(tables.audit, settings)
    accuracy = accuracy_toml(folder.statistics(POSE_LAW), folder.statistics(RIGID_SHARE), recorded_step(settings))
    return Audit(truth, tables, corrections, accuracy)


def audit_json(audit: Audit) -> str:
    """The whole audit as one JSON document."""
    document = {
        "format": 2,
        "truth": audit.truth.rows.to_dicts(),
        "sentences": audit_sentences(audit.tables.audit),
        "corrections": audit.corrections,
        "accuracy": audit.accuracy,
        **{name: table.to_dicts() for name, table in audit.tables._asdict().items()},
    }
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False)


def print_audit(terminal: Terminal, audit: Audit) -> None:
    """Print the verdict, what to add to the experiment file, and the numbers behind it."""
    texts = filter(None, [audit.truth.verdict.sentence, audit.truth.verdict.stated])
    terminal.result("\n".join([*(textwrap.fill(text, WIDTH) for text in texts), ""]))
    for sentence in audit_sentences(audit.tables.audit, every=True):
        terminal.result(textwrap.fill(sentence, WIDTH))
    if audit.corrections:
        how = "put this block into the experiment file, in place of an earlier one, and run it again"
        terminal.result(f"\nTo correct the truth, {how}:\n\n{audit.corrections}")
    if audit.accuracy:
        agreed = "The trackers agree on errors of the poses. To include them in the truth floor, add:"
        terminal.result(f"\n{agreed}\n\n{audit.accuracy}")
    parameters, curves = audit.tables
    for cells in (cause_cells(audit.truth), parameter_cells(parameters), curve_cells(curves)):
        if cells.rows:
            terminal.result("")
            show(terminal.result, cells)
