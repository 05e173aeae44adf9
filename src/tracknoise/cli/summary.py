"""The summary of a run as a plain text table."""

from tracknoise.tables.store import RunFolder

_COLUMNS = (
    ("tracker", "tracker", "{}"),
    ("speed", "speed", "{}"),
    ("lighting", "lighting", "{}"),
    ("tracks", "n_tracks", "{:,}"),
    ("lifetime\nmean", "mean_lifetime", "{:.1f}"),
    ("outlier\nratio", "outlier_ratio", "{:.3f}"),
    ("at\nage", "age", "{}"),
    ("mean u\npx", "trimmed_nu_u_px", "{:+.3f}"),
    ("mean v\npx", "trimmed_nu_v_px", "{:+.3f}"),
    ("|err| u\npx", "trimmed_eta_u_px", "{:.3f}"),
    ("|err| v\npx", "trimmed_eta_v_px", "{:.3f}"),
    ("rms u\npx", "trimmed_rms_u_px", "{:.3f}"),
    ("rms v\npx", "trimmed_rms_v_px", "{:.3f}"),
    ("rms u\nuntrimmed", "untrimmed_rms_u_px", "{:.3f}"),
    ("rms v\nuntrimmed", "untrimmed_rms_v_px", "{:.3f}"),
)


def summary_text(run: RunFolder) -> str:
    """One line a condition: lifetimes, outlier ratio, and the trimmed errors (observed minus true) at one age.

    Raises
    ------
    StoreError, SchemaError
        If the run has no usable statistics.
    """
    table = run.statistics("summary")
    shown = [column for column in _COLUMNS if column[1] != "lighting" or table["lighting"].n_unique() > 1]
    headings = [heading.split("\n") for heading, _, _ in shown]
    rows = [[parts[0] if len(parts) > 1 else "" for parts in headings], [parts[-1] for parts in headings]]
    rows += [[_cell(row[name], form) for _, name, form in shown] for row in table.iter_rows(named=True)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join(_aligned(cell, width, i) for i, (cell, width) in enumerate(zip(row, widths, strict=True)))
        for row in rows
    ]
    return "\n".join([*lines[:2], "-" * len(lines[1]), *lines[2:]])


def _cell(value: object, form: str) -> str:
    return "-" if value is None else form.format(value)


def _aligned(cell: str, width: int, position: int) -> str:
    return cell.ljust(width) if position == 0 else cell.rjust(width)
