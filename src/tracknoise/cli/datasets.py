"""``tracknoise datasets``: the dataset formats, the options of a reader, and what a recording holds."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from tracknoise.cli.recording_arguments import OptionOption, Recording
from tracknoise.cli.shared_options import DebugOption, QuietOption
from tracknoise.cli.terminal import Terminal, listing
from tracknoise.text import significant

_HEADINGS = ("sequence", "frames", "with pose", "size", "rate", "depth")


def datasets(
    context: typer.Context,
    recording: Annotated[
        list[str] | None,
        typer.Argument(metavar="[READER] [PATH]", help="A reader whose options to show, a recording to show, or both."),
    ] = None,
    option: OptionOption = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """List the dataset formats, the options of a reader with their defaults, or what a recording holds.

    Of a recording: frames, poses, size, rate and depth of each sequence, and the options of its reader.

    Examples: `tracknoise datasets kitti`, `tracknoise datasets /data/my-recording`,
    `tracknoise datasets sevenscenes /data/7scenes`
    """
    from tracknoise.sequences.reader_registry import READERS

    words = recording or []
    if not words:
        context.obj.result(listing(READERS.descriptions()))
        return 0
    if len(words) > 1 or _is_path(words[0]):
        return _show_recording(context.obj, words, option)
    _show_reader(context.obj, words[0])
    return 0


def _is_path(word: str) -> bool:
    """Whether a word names a file or folder. Names of readers come first."""
    from tracknoise.sequences.reader_registry import READERS

    return word not in READERS and (Path(word).exists() or len(Path(word).parts) > 1)


def _show_reader(terminal: Terminal, reader: str) -> None:
    """The options of a reader, and its sequences where it needs no data."""
    from tracknoise.sequences.reader_registry import READERS, make_reader

    terminal.result(_options(reader))
    if READERS.load(reader).needs_root:
        return
    terminal.result("")
    for item in make_reader(reader).sequences():
        rotation = f"  rotated {item.rotation}" if item.rotation else ""
        terminal.result(f"{item.scene}  {item.lighting}{rotation}")


def _show_recording(terminal: Terminal, words: list[str], option: list[str] | None) -> int:
    """A table of the sequences of a recording, and the options of its reader. Status 1 if one cannot be read."""
    from tracknoise.cli.recording_arguments import open_recording
    from tracknoise.cli.text_table import aligned

    opened = open_recording(words, option)
    failures: list[str] = []
    rows = [_HEADINGS, *_rows(opened, failures)]
    lines = aligned(rows, numeric=(False, True, True, True, True, True))
    terminal.result("\n".join([f"reader: {opened.reader.name}", "", *lines, "", _options(opened.reader.name)]))
    for failure in failures:
        terminal.error(failure)
    return 1 if failures else 0


def _rows(recording: Recording, failures: list[str]) -> Iterator[tuple[str, ...]]:
    """Cells of each sequence; those of a sequence that cannot be read are empty, and its error is a failure."""
    from tracknoise.exceptions import DataError
    from tracknoise.tables.identity import readable
    from tracknoise.truth_faults.check_recording import overview

    for item in recording.reader.sequences():
        try:
            shown = overview(recording.view(recording.reader.open(item)))
        except DataError as error:
            failures.append(str(error))
            yield (readable(item.key), *("-" for _ in _HEADINGS[1:]))
            continue
        yield (
            readable(item.key),
            str(shown.n_frames),
            str(shown.n_poses),
            f"{shown.width_px}x{shown.height_px}",
            "-" if shown.rate_hz is None else f"{significant(shown.rate_hz, 4)} Hz",
            "none" if shown.depth_share is None else f"{shown.depth_share:.0%} of pixels",
        )


def _options(reader: str) -> str:
    from tracknoise.sequences.reader_registry import reader_defaults

    return reader_defaults(reader) or f"# the reader {reader} has no options"
