"""``tracknoise check``: whether the truth of a recording or a run can be trusted, and what is wrong with it."""

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.recording_arguments import OptionOption, TrajectoryOption
from tracknoise.cli.shared_options import (
    UNUSABLE,
    DebugOption,
    JsonOption,
    QuietOption,
    files_by_ending,
    print_json,
    text,
    whole,
    write_files,
)
from tracknoise.cli.terminal import WIDTH, Terminal, wrapped

if TYPE_CHECKING:
    from tracknoise.cli.recording_arguments import Recording
    from tracknoise.tables.identity import SequenceId
    from tracknoise.truth_faults.check_report import CheckReport, Item

_PAGE, _DOCUMENT, _POSES = ".html", ".json", ".txt"
_MOST_SEQUENCES = 3


def check(
    context: typer.Context,
    recording: Annotated[
        list[str],
        typer.Argument(
            metavar="[READER] PATH",
            help="Recording, whose format may come first, experiment file, or folder of a run.",
        ),
    ],
    option: OptionOption = None,
    trajectory: TrajectoryOption = None,
    scenes: Annotated[
        int | None, whole("--scenes", help=f"Read the images of this many sequences (default: {_MOST_SEQUENCES}).")
    ] = None,
    out: Annotated[
        list[Path] | None,
        text("--out", "-o", metavar="FILE", help="Page (.html), JSON (.json) or refined poses (.txt); repeatable."),
    ] = None,
    as_json: JsonOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Check whether the truth of a recording can be trusted: poses, clock, depth and intrinsics against its images.

    Names the usual mistakes: inverted poses, quaternion order, axes, units, intrinsics of another resolution, poses off
    by frames. Of an experiment file: the same, of its recordings as it corrects them. Of a run: what is wrong with its
    truth, what to add to the experiment file, and the numbers behind it.
    Exit status 0 if the truth is trusted or limited, 4 if it is not trusted or this is unknown.

    Examples: `tracknoise check /data/my-recording`, `tracknoise check tum /data/fr1 -o check.html`,
    `tracknoise check /data/euroc --option depth=stereo`, `tracknoise check /data/mine -o refined.txt`,
    `tracknoise check mine.toml`, `tracknoise check runs/7scenes`
    """
    from tracknoise.cli.output_files import is_run

    if len(recording) == 1 and is_run(Path(recording[0])):
        given = {"--option": option, "--trajectory": trajectory, "--scenes": scenes}
        return _of_run(context.obj, Path(recording[0]), out, [name for name in given if given[name]], as_json=as_json)
    return _of_recording(
        context.obj, recording, option, trajectory, out, most=scenes or _MOST_SEQUENCES, as_json=as_json
    )


def _of_run(terminal: Terminal, run: Path, out: list[Path] | None, others: list[str], *, as_json: bool) -> int:
    """Print what is wrong with the truth of a run. `others`: options that a recording alone has."""
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.cli.run_audit import audit_json, print_audit, read_audit
    from tracknoise.exceptions import SettingsError

    if others:
        raise SettingsError(f"{run}: found a run with {others[0]}, expected the option with a recording alone")
    files = files_by_ending(out, [_DOCUMENT])
    require_outputs([("--out", path) for path in files.values()], inputs=[run], are_reports=True)
    audit = read_audit(run)
    if as_json:
        print_json(terminal, audit_json(audit))
    write_files({path: lambda: audit_json(audit) for path in files.values()}, terminal.say)
    if not as_json:
        print_audit(terminal, audit)
    return 0 if audit.truth.verdict.is_usable else UNUSABLE


def _of_recording(
    terminal: Terminal,
    recording: list[str],
    option: list[str] | None,
    trajectory: str | None,
    out: list[Path] | None,
    *,
    most: int,
    as_json: bool,
) -> int:
    from tracknoise.cli.output_files import is_experiment, require_outputs
    from tracknoise.cli.recording_arguments import open_experiment, open_recording
    from tracknoise.exceptions import SettingsError
    from tracknoise.truth_faults.check_recording import Pictures, check_reader

    files = files_by_ending(out, [_PAGE, _DOCUMENT, _POSES])
    experiment = Path(recording[0]) if len(recording) == 1 and is_experiment(Path(recording[0])) else None
    if experiment is not None and trajectory is not None:
        raise SettingsError(f"{experiment}: found an experiment file with --trajectory, expected it in the file")
    opened = (
        open_recording(recording, option, trajectory=trajectory)
        if experiment is None
        else open_experiment(experiment, option)
    )
    trajectories = _trajectories(opened, files.pop(_POSES), most=most) if _POSES in files else {}
    outputs = [("--out", path) for path in (*files.values(), *trajectories)]
    require_outputs(outputs, inputs=[opened.path, experiment], are_reports=True)
    terminal.say(f"reader: {opened.reader.name}")
    pictures = Pictures()
    source = str(opened.path or opened.reader.name)
    seen = pictures.take if _PAGE in files else None
    report = check_reader(opened.reader, source, most=most, seen=seen, change=opened.view)
    if as_json:
        print_json(terminal, report.to_json())
    makers = {_PAGE: lambda: pictures.page(report), _DOCUMENT: report.to_json}
    write_files({path: makers[ending] for ending, path in files.items()}, terminal.say)
    if not as_json:
        _print(terminal, report)
        ahead = "tracknoise init RECORDING, then tracknoise run FILE"
        command = ahead if experiment is None else f"tracknoise run {experiment}"
        terminal.say(f"a first answer in about a minute: {command} --quick")
    for path, name in trajectories.items():
        _write_trajectory(terminal, opened, name, path)
    return 0 if report.truth.is_usable else UNUSABLE


def _trajectories(opened: "Recording", template: Path, *, most: int) -> dict[Path, "SequenceId"]:
    """The file of each sequence that is checked."""
    from tracknoise.exceptions import SettingsError

    names = opened.reader.sequences()[:most]
    try:
        files = {name.expand(str(template), speed=1): name for name in names}
    except ValueError as error:
        raise SettingsError(f"--out {template}: {error}") from error
    if len(files) < len(names):
        given = f"one file for {len(names)} sequences"
        raise SettingsError(f"--out {template}: {given}, expected {{scene}} or {{lighting}} in its name")
    return files


def _write_trajectory(terminal: Terminal, opened: "Recording", name: "SequenceId", path: Path) -> None:
    """Write the refined poses of all frames of a sequence."""
    from tracknoise.sequences.other_poses import trajectory_text
    from tracknoise.tables.files import write_atomically
    from tracknoise.tables.identity import readable
    from tracknoise.truth_faults.check_poses import refined_trajectory

    terminal.say(f"{readable(name.key)}: refining the poses of all frames")
    trajectory, notes = refined_trajectory(opened.view(opened.reader.open(name)))
    for note in notes:
        terminal.warn(f"{readable(name.key)}: {note}")
    about = ": ".join([f"refined poses of {readable(name.key)}", *filter(None, [" ".join(notes)])])
    write_atomically(path, trajectory_text(trajectory, about).encode())
    terminal.say(f"written: {path.resolve()}")


_COLOURS: Mapping[str, str] = {
    "ok": "green", "unknown": "yellow", "caveat": "yellow", "fatal": "red",
    "trusted": "green", "limited": "yellow", "not trusted": "red",
}  # fmt: skip
"""Of items by their severity, and of verdicts on the truth."""


def _print(terminal: Terminal, report: "CheckReport") -> None:
    """The verdict on the truth, then all items; of several sequences, the verdict on each before its items."""
    _say(terminal, report.truth.sentence, "", report.truth.verdict)
    if report.truth.stated:
        terminal.result("\n".join(wrapped(report.truth.stated)))
    terminal.result("")
    for sequence in report.sequences:
        own = f" {sequence.truth.caveat} {sequence.truth.stated}".rstrip() if len(report.sequences) > 1 else ""
        _say(terminal, f"{sequence.sequence}:{own}", "  ", sequence.truth.verdict)
        for item in sequence.items:
            _say_item(terminal, item)
    for item in report.items:
        _say_item(terminal, item)


def _say_item(terminal: Terminal, item: "Item") -> None:
    _say(terminal, f"  {item.severity:<7}  {item.topic}: {item.text}", " " * 11, item.severity)


def _say(terminal: Terminal, said: str, indent: str, status: str) -> None:
    """Print a text whose first `status` has its colour."""
    lines = textwrap.fill(said, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    terminal.result(lines, coloured=status, colour=_COLOURS[status])
