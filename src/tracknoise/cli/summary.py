"""The summary of a run as a plain text table."""

from tracknoise.cli.text_table import aligned
from tracknoise.report.report_data import ReportData
from tracknoise.tables.store import RunFolder

_NUMBERS = (
    ("tracks", "n_tracks", "{:,}"),
    ("lifetime\nmean", "mean_lifetime", "{:.1f}"),
    ("outlier\nratio", "outlier_ratio", "{:.3f}"),
    ("at\n{axis}", "at", "{}"),
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
    """One line a condition: lifetimes, outlier ratio, and the trimmed errors (observed minus true) at one place.

    Where there are too many conditions, only those that the report's figures are about have a line.

    Raises
    ------
    StoreError, SchemaError
        If the run has no usable statistics.
    """
    data = ReportData.of(run)
    table = data.in_order(data.listed(data.summary))
    shown = [*((name, name, "{}") for name in data.condition_columns), *_NUMBERS]
    headings = [heading.format(axis=data.axis.name).split("\n") for heading, _, _ in shown]
    rows = [[parts[0] if len(parts) > 1 else "" for parts in headings], [parts[-1] for parts in headings]]
    rows += [[_cell(row[name], form) for _, name, form in shown] for row in table.iter_rows(named=True)]
    lines = aligned(rows, numeric=[place > 0 for place in range(len(shown))])
    return "\n".join([*lines[:2], "-" * len(lines[1]), *lines[2:], *_others(data)])


def _others(data: ReportData) -> list[str]:
    if not data.is_large:
        return []
    n = data.summary.height - data.listed(data.summary).height
    return [f"({data.where.strip()}; {n} other conditions are in the report's tables/summary.csv)"]


def _cell(value: object, form: str) -> str:
    return "-" if value is None else form.format(value)
