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
from tracknoise.cli.terminal import WIDTH, Terminal, wrapped

if TYPE_CHECKING:
    from tracknoise.cli.recording_arguments import Recording
    from tracknoise.tables.identity import SequenceId
    from tracknoise.truth_faults.check_report import CheckReport, Item


def check(
    context: typer.Context,
    recording: RecordingArgument,
    option: OptionOption = None,
    trajectory: TrajectoryOption = None,
    trajectory_of: TrajectoryOfOption = "camera",
    scenes: Annotated[int, typer.Option("--scenes", min=1, help="Read the images of this many sequences.")] = 3,
    html: Annotated[Path | None, typer.Option("--html", help="Write a page with pictures to this file.")] = None,
    write_trajectory: Annotated[
        str | None,
        typer.Option(
            "--write-trajectory",
            metavar="FILE",
            help="Write the refined poses of all frames in the format of TUM; {scene} in the name for several scenes.",
        ),
    ] = None,
    as_json: JsonOption = False,
    json_file: JsonFileOption = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Check whether the truth of a recording can be trusted: poses, clock, depth and intrinsics against its images.

    Names the usual mistakes: inverted poses, quaternion order, axes, units, intrinsics of another resolution, poses off
    by frames. Exit status 0 if the truth is trusted or limited, 4 if it is not trusted or this is unknown.

    Examples: `tracknoise check /data/my-recording`, `tracknoise check tum /data/fr1 --html check.html`,
    `tracknoise check /data/euroc --option depth=stereo`, `tracknoise check /data/mine --write-trajectory refined.txt`
    """
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.cli.recording_arguments import open_recording
    from tracknoise.tables.files import write_atomically
    from tracknoise.truth_faults.check_recording import Pictures, check_reader

    opened = open_recording(recording, option, trajectory=trajectory, trajectory_of=trajectory_of)
    trajectories = {} if write_trajectory is None else _trajectories(opened, write_trajectory, most=scenes)
    outputs = [("--html", html), ("--json-file", json_file), *(("--write-trajectory", one) for one in trajectories)]
    require_outputs(outputs, inputs=[opened.path])
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
    for path, name in trajectories.items():
        _write_trajectory(context.obj, opened, name, path)
    return 0 if report.truth.is_usable else UNUSABLE


def _trajectories(opened: "Recording", template: str, *, most: int) -> dict[Path, "SequenceId"]:
    """The file of each sequence that is checked."""
    from tracknoise.exceptions import SettingsError

    names = opened.reader.sequences()[:most]
    try:
        files = {name.expand(template, speed=1): name for name in names}
    except ValueError as error:
        raise SettingsError(f"--write-trajectory {template}: {error}") from error
    if len(files) < len(names):
        found = f"one file for {len(names)} sequences"
        raise SettingsError(f"--write-trajectory {template}: {found}, expected {{scene}} or {{lighting}} in its name")
    return files


def _write_trajectory(terminal: Terminal, opened: "Recording", name: "SequenceId", path: Path) -> None:
    """Write the refined poses of all frames of a sequence."""
    from tracknoise.sequences.other_poses import trajectory_text
    from tracknoise.tables.files import write_atomically
    from tracknoise.tables.identity import readable
    from tracknoise.truth_faults.check_poses import refined_trajectory

    terminal.say(f"{readable(name.key)}: refining the poses of all frames")
    found, notes = refined_trajectory(opened.view(opened.reader.open(name)))
    for note in notes:
        terminal.warn(f"{readable(name.key)}: {note}")
    write_atomically(path, trajectory_text(found, f"refined poses of {readable(name.key)}").encode())
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


def _say(terminal: Terminal, text: str, indent: str, status: str) -> None:
    """Print a text whose first `status` has its colour."""
    lines = textwrap.fill(text, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    terminal.result(lines, coloured=status, colour=_COLOURS[status])
