"""``tracknoise check``: whether the truth of a recording can be trusted, and what is wrong with it."""

import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.recording_arguments import (
    OptionOption,
    RecordingArgument,
    TrajectoryOfOption,
    TrajectoryOption,
)
from tracknoise.cli.shared_options import (
    UNUSABLE,
    DebugOption,
    JsonFileOption,
    JsonOption,
    QuietOption,
    write_json,
)
from tracknoise.cli.terminal import WIDTH, Terminal

if TYPE_CHECKING:
    from tracknoise.truth_faults.check_report import CheckReport, Item


def check(
    context: typer.Context,
    recording: RecordingArgument,
    option: OptionOption = None,
    trajectory: TrajectoryOption = None,
    trajectory_of: TrajectoryOfOption = "camera",
    scenes: Annotated[int, typer.Option("--scenes", min=1, help="Read the images of this many sequences.")] = 3,
    html: Annotated[Path | None, typer.Option("--html", help="Write a page with pictures to this file.")] = None,
    as_json: JsonOption = False,
    json_file: JsonFileOption = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Check whether the truth of a recording can be trusted: poses, clock, depth and intrinsics against its images.

    Names the usual mistakes: inverted poses, quaternion order, axes, units, intrinsics of another resolution, poses off
    by frames. Exit status 0 if the truth is trusted or limited, 4 if it is not trusted or this is unknown.

    Examples: `tracknoise check /data/my-recording`, `tracknoise check tum /data/fr1 --html check.html`,
    `tracknoise check /data/euroc --option depth=stereo`
    """
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.cli.recording_arguments import open_recording
    from tracknoise.tables.files import write_atomically
    from tracknoise.truth_faults.check_recording import Pictures, check_reader

    opened = open_recording(recording, option, trajectory=trajectory, trajectory_of=trajectory_of)
    require_outputs([("--html", html), ("--json-file", json_file)], inputs=[opened.path])
    context.obj.say(f"reader: {opened.reader.name}")
    pictures = Pictures()
    source = str(opened.path or opened.reader.name)
    seen = pictures.take if html else None
    report = check_reader(opened.reader, source, most=scenes, seen=seen, change=opened.view)
    write_json(context.obj, report.to_json(), as_json=as_json, file=json_file)
    if html is not None:
        write_atomically(html, pictures.page(report).encode())
    if not as_json:
        _print(context.obj, report)
        context.obj.say("a first answer in about a minute: tracknoise init RECORDING, then tracknoise run FILE --quick")
    return 0 if report.truth.is_usable else UNUSABLE


_COLOURS: Mapping[str, str] = {
    "ok": "green", "unknown": "yellow", "caveat": "yellow", "fatal": "red",
    "trusted": "green", "limited": "yellow", "not trusted": "red",
}  # fmt: skip
"""Of items by their severity, and of verdicts on the truth."""


def _print(terminal: Terminal, report: "CheckReport") -> None:
    """The verdict on the truth, then all items; of several sequences, the verdict on each before its items."""
    _say(terminal, report.truth.sentence, "", report.truth.verdict)
    terminal.result("")
    for sequence in report.sequences:
        own = f" {sequence.truth.caveat}" if len(report.sequences) > 1 else ""
        _say(terminal, f"{sequence.sequence}:{own}", "  ", sequence.truth.verdict)
        for item in sequence.items:
            _say_item(terminal, item)
    for item in report.items:
        _say_item(terminal, item)


def _say_item(terminal: Terminal, item: "Item") -> None:
    _say(terminal, f"  {item.severity:<7}  {item.topic}: {item.text}", " " * 11, item.severity)


def _say(terminal: Terminal, text: str, indent: str, status: str) -> None:
    """Print a text whose first `status` has its colour."""
    lines = textwrap.fill(text, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    terminal.result(lines, coloured=status, colour=_COLOURS[status])
