"""What a run produced, as text: its answer or its tables, the path of its report, and the sequences that failed."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import polars as pl

from tracknoise.cli.run_answer import answer_lines, sentences_to_set
from tracknoise.cli.terminal import Terminal, wrapped
from tracknoise.cli.text_table import aligned, show
from tracknoise.report.answer import accuracy, noise_to_set
from tracknoise.report.leaderboard import leaderboard
from tracknoise.report.measured import mixed_kernels
from tracknoise.report.report_data import ReportData
from tracknoise.statistics.definitions import POOLED
from tracknoise.tables.enumerations import FittedMeasure, Trimming
from tracknoise.tables.identity import readable
from tracknoise.tables.store import RunFolder
from tracknoise.text import counted
from tracknoise.topics.bias_topic import mean_errors
from tracknoise.topics.headline import MOST_TRACKERS
from tracknoise.topics.headlines import findings_of
from tracknoise.topics.sentences import by_statement, together
from tracknoise.topics.truth_topic import at_most
from tracknoise.words import rms_of_tracks

if TYPE_CHECKING:
    from tracknoise.experiments.execute import Outcome

MOST_LINES = 12
"""Of all that is printed about a run, without its tables and its progress."""
_NAMED = 3
"""Maximum number of causes of failure for which the final message names the sequences."""
_TRACKS = (
    ("tracks", "n_tracks", "{:,}"),
    ("median\nlifetime", "median_lifetime", "{}"),
    ("outlier\nratio", "outlier_ratio", "{:.3f}"),
)
_FITTED_TOPICS = ("truth", "noise")
_AT = ("at\n{axis}", "at", "{}")
_ERRORS = (
    ("mean {axis}\npx", "mean", "{:+.3f}"),
    ("core {axis}\npx", "core", "{:.3f}"),
    ("rms {axis}\n{tracks}", "rms", "{:.3f}"),
)
"""Headings, the statistic in the names of columns, and how numbers are written."""
_TRACKS_OF = {Trimming.untrimmed: "all px", Trimming.trimmed: "kept px"}
"""Which tracks an RMS is over."""
_FLOOR = tuple((f"floor {axis}\npx", f"floor_{axis}_px", "{:.3f}") for axis in "uv")
"""Beside errors, where anything is known of the errors of the truth."""
_NOISE = (
    ("noise by\nfitted points px", FittedMeasure.triangulated, "{:.3f}"),
    ("noise by\nepipolar lines px", FittedMeasure.epipolar, "{:.3f}"),
)
"""In place of errors, where true positions are fitted to the tracks."""


def print_outcome(
    terminal: Terminal,
    out: Path,
    outcome: "Outcome",
    *,
    report: bool,
    table: bool = False,
    quick: bool = False,
    ranked: bool = False,
) -> int:
    """Print the answer of a run that has ended, its failures and its report.

    Parameters
    ----------
    terminal, out, outcome
        Where to print, the folder of the run, and what was measured.
    report
        Whether to write the report.
    table
        Whether tables are printed in place of the answer.
    quick
        Whether it is a quick run, whose limits are printed too.
    ranked
        Whether the table of ranks, where there is one, says what to set.

    Returns
    -------
    int
        Exit status: 0 if every sequence was measured, 2 if some were, 1 if none was.
    """
    if not outcome.measured:
        return 1 if outcome.failures else 0
    run = RunFolder(out)
    failed = _failed(outcome) if outcome.failures else []
    limits = wrapped(_quick_limits(run)) if quick else []
    print_results(terminal, run, report=report, table=table, ranked=ranked, failed=failed, limits=limits)
    return 2 if outcome.failures else 0


def print_results(
    terminal: Terminal,
    run: RunFolder,
    *,
    report: bool,
    figures: bool = False,
    table: bool = False,
    ranked: bool = False,
    failed: Sequence[str] = (),
    limits: Sequence[str] = (),
) -> None:
    """Print the answer of a run, or its tables. With `report`, also write its report, with `figures` or not.

    `failed`, `limits`: further lines, on stderr and on stdout.
    """
    if table:
        terminal.result(summary_text(run))
    else:
        hint = f"The numbers of every tracker and speed: tracknoise report {run.path} --all"
        others = [*failed, *limits, *(["report"] if report else []), hint]
        data = ReportData.of(run)
        board = leaderboard(data) if ranked else None
        if board is not None:
            terminal.result("\n".join(wrapped(board.leader_with(noise_to_set(data)))))
            show(terminal.result, board.cells())
        terminal.result("\n".join(answer_lines(data, MOST_LINES - len(others), is_ranked=board is not None)))
        if not data.truth.are_tracks_wrong:
            terminal.say(hint)
    for line in failed:
        terminal.say(line)
    if limits:
        terminal.result("\n".join(limits))
    if report:
        from tracknoise.report.figure_files import FORMATS
        from tracknoise.report.page import write_report

        terminal.say("writing the report")
        terminal.result(f"report: {write_report(run, figure_formats=FORMATS if figures else ()).resolve()}")


def _quick_limits(run: RunFolder) -> str:
    """What a quick run was measured on, and what the whole run adds."""
    entries = list(run.manifest().sequences.values())
    measured = sum(sum(stop - start for start, stop in entry.parts) or entry.n_frames for entry in entries)
    total = sum(entry.n_frames for entry in entries)
    of_all = f"{counted(total, 'frame')} of {counted(len(entries), 'sequence')}"
    if measured == total:
        return f"Quick: all {of_all}. Without --quick: all speeds, and the report."
    longest = max(max((stop - start for start, stop in entry.parts), default=entry.n_frames) for entry in entries)
    return (
        f"Quick: {measured} of {of_all}. Tracks end after {longest} frames, and intervals are wide. "
        "Without --quick: all frames and speeds, and the report."
    )


def summary_text(run: RunFolder) -> str:
    """Summary table with one row per condition: lifetime, outlier ratio, and errors (observed minus true) at one age.

    If there are too many conditions, only those that the report's figures show have a row.
    """
    data = ReportData.of(run)
    if data.truth.are_tracks_wrong:
        return "\n".join(_truth(data)).rstrip()
    table = data.in_order(data.listed(_with_noise(data) if data.truth_is_fitted else _with_means(data)))
    shown = [*((name, name, "{}") for name in data.condition_columns), *_TRACKS, *_errors(data)]
    headings = [heading.format(axis=data.axis.name).split("\n") for heading, _, _ in shown]
    rows = [[parts[0] if len(parts) > 1 else "" for parts in headings], [parts[-1] for parts in headings]]
    rows += [[_cell(row[name], form) for _, name, form in shown] for row in table.iter_rows(named=True)]
    lines = aligned(rows, numeric=[place > 0 for place in range(len(shown))])
    texts = [
        *_others(data),
        *_sizes(data),
        *("\n".join(wrapped(sentence)) for sentence in _sentences(data)),
    ]
    return "\n".join([*_truth(data), *lines[:2], "-" * len(lines[1]), *lines[2:], *texts])


def _errors(data: ReportData) -> list[tuple[str, str, str]]:
    """Columns of the errors that verdicts are about, where tracks were dropped the RMS of the others, and the floor.

    Where true positions are fitted to the tracks, their noise, because errors about fitted points are smaller.
    """
    if data.truth_is_fitted:
        bound = f"noise {at_most(data.truth)}by"
        return [(heading.replace("noise by", bound), name, form) for heading, name, form in _NOISE]
    shown = [
        (
            heading.replace("{axis}", axis).replace("{tracks}", _TRACKS_OF[data.trimming]),
            f"{data.trimming}_{statistic}_{axis}_px",
            form,
        )
        for heading, statistic, form in _ERRORS
        for axis in "uv"
    ]
    others = [] if data.percentile is None else [other for other in Trimming if other != data.trimming]
    return [
        _AT,
        *shown,
        *(
            (f"rms {axis}\n{_TRACKS_OF[other]}", f"{other}_rms_{axis}_px", "{:.3f}")
            for other in others
            for axis in "uv"
        ),
        *(_FLOOR if (data["summary"]["floor_u_px"] > 0).any() else ()),
    ]


def _with_means(data: ReportData) -> pl.DataFrame:
    """The summary with the mean errors of the finding on bias, in which scenes weigh equally, px."""
    means = mean_errors(data).rename({f"mean_{axis}_px": f"{data.trimming}_mean_{axis}_px" for axis in "uv"})
    return data["summary"].join(means, on=[*POOLED, "at"], how="left", nulls_equal=True, maintain_order="left")


def _with_noise(data: ReportData) -> pl.DataFrame:
    """The summary with columns of `_NOISE`: noise of one coordinate of tracks of any length, px."""
    rows = data["triangulated_noise"].filter(pl.col("length_low").is_null(), coordinate="both", trimming=data.trimming)
    table = data["summary"]
    for _, measure, _ in _NOISE:
        noise = rows.filter(measure=measure).select(*POOLED, pl.col("sigma_px").alias(measure))
        table = table.join(noise, on=POOLED, how="left", nulls_equal=True, maintain_order="left")
    return table


def _truth(data: ReportData) -> list[str]:
    """The verdict on the truth, what it changed in that of a check, and which scenes are copies, before any number."""
    copies = findings_of(data.tables, "copies")["text"]
    texts = filter(None, [data.truth.sentence, data.truth.stated, data.truth_change, *copies])
    return ["\n".join([*wrapped(text), ""]) for text in texts]


def _sizes(data: ReportData) -> list[str]:
    """What the columns of errors are."""
    if data.truth_is_fitted:
        return []
    kept = "" if data.percentile is None else f", or {rms_of_tracks(Trimming.trimmed)}"
    return [f"mean: over scenes. core: of a typical scene. rms: {rms_of_tracks(Trimming.untrimmed)}{kept}."]


def _sentences(data: ReportData) -> Iterator[str]:
    """Which tracker is more accurate, what to set, what fitted points hide, where trimming matters, and on what it ran.

    The finding that says what to set names the first trackers; sentences of the others follow.
    """
    fitted = findings_of(data.tables, *_FITTED_TOPICS)["text"].to_list() if data.truth_is_fitted else []
    to_set = [*findings_of(data.tables, "estimator")["text"], *sentences_to_set(data)[MOST_TRACKERS:]]
    trimming = findings_of(data.tables, "trimming")["text"]
    return filter(None, [accuracy(data), *to_set, *fitted, *trimming, mixed_kernels(data)])


def _others(data: ReportData) -> list[str]:
    n = data["summary"].height - data.listed(data["summary"]).height
    if not n:
        return []
    others = "1 other condition is" if n == 1 else f"{n} other conditions are"
    return [f"({data.where.strip()}; {others} in the report's tables/summary.csv)"]


def _cell(value: object, form: str) -> str:
    return "-" if value is None else form.format(value)


def _failed(outcome: "Outcome") -> list[str]:
    """Lines that name the sequences that failed, grouped by cause: the errors themselves may have scrolled away."""
    failures = outcome.failures
    named = list(by_statement(sorted(failures.items())).values())[:_NAMED]
    rest = len(failures) - sum(map(len, named))
    names = "; ".join([*(together([*map(readable, keys)]) for keys in named), *([f"{rest} more"] if rest else [])])
    of_all = f"{len(failures)} of {counted(len(failures) + len(outcome.measured), 'sequence')} failed"
    return wrapped(f"{of_all}: {names}; see failures.jsonl. Run the same command again to retry them.")
