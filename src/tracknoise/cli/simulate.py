"""``tracknoise simulate``: render simulated sequences to files, in the layout of a dataset."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tracknoise.cli.recording_arguments import options_of
from tracknoise.cli.shared_options import DebugOption, QuietOption, text, whole
from tracknoise.cli.terminal import Terminal
from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.text import counted

if TYPE_CHECKING:
    from tracknoise.sequences.sequence import Reader
    from tracknoise.tables.identity import SequenceId

    Progress = Callable[[int, int], None]


class Layout(StrEnum):
    """File layouts that can be written. Each has the name of the reader that reads it."""

    folder = "folder"
    euroc = "euroc"
    dtu = "dtu"
    kitti = "kitti"


_MOVING: Mapping[Layout, Mapping[str, Any]] = {
    Layout.folder: {"motions": ["sideways"]},
    Layout.euroc: {"motions": ["arvr"], "width": 752, "height": 480, "hfov_deg": 78.8, "imaging": {"rate_hz": 20.0}},
    Layout.kitti: {"motions": ["forward"], "width": 1242, "height": 375, "hfov_deg": 81.5},
}
"""Options of the reader ``simulated`` that are not its defaults, for the layouts of a moving camera."""
_STAGE: Mapping[str, Any] = {
    "worlds": 1,
    "noise_sigma": 2.0,
    "shadows": False,
    "seed": 0,
    "width": 1600,
    "height": 1200,
    "supersampling": 1,
    "image_format": "png",
}
"""Options of the layout of the light stage, with their defaults."""


def simulate(
    context: typer.Context,
    out: Annotated[Path, text("--out", "-o", metavar="FOLDER", help="Output folder; must be new or empty.")],
    layout: Annotated[
        Layout, text("--layout", metavar="|".join(Layout), help="Layout of the files; see docs/formats.md.")
    ] = Layout.folder,
    motion: Annotated[
        str | None, text("--motion", metavar="NAME", help="Camera motion: sideways, forward, ... Not for dtu.")
    ] = None,
    frames: Annotated[int | None, whole("--frames", help="Number of frames (default: 60). Not for dtu (49).")] = None,
    option: Annotated[
        list[str] | None,
        text("--option", metavar="NAME=VALUE", help="Option of the reader simulated, such as width=640; repeatable."),
    ] = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Render simulated sequences in the layout of a dataset. The reader of the same name reads them.

    `folder`: images, exact depth, poses and camera. `euroc`: images at 20 Hz, inertial readings at 200 Hz with EuRoC's
    noise, poses, velocities and biases, for filters. `dtu`: a light stage with 19 LEDs and a scan. `kitti`: a drive
    with a lidar. See docs/data.md, docs/formats.md and docs/paper.md.

    Options are those of `tracknoise datasets simulated`, such as worlds: scenes, each with its own world. Layout dtu
    has worlds, noise_sigma, shadows, seed, width, height, supersampling and image_format (png or bmp).

    Examples: `tracknoise simulate --motion forward --frames 100 --out data/forward`,
    `tracknoise simulate --layout euroc --option world=objects --motion linear --frames 300 --out data/flight`
    """
    options = options_of(option)
    if layout is Layout.dtu:
        for name, given in {"--motion": motion, "--frames": frames}.items():
            if given is not None:
                raise SettingsError(f"layout {layout} has no {name}; it has {', '.join(_STAGE)}")
        written = _write_stages(context.obj, out, options)
    else:
        named = {"motions": None if motion is None else [motion], "frames": frames}
        options = {**_MOVING[layout], **options, **{name: value for name, value in named.items() if value is not None}}
        written = _write_sequences(context.obj, layout, out, options)
    context.obj.result(f"wrote {written} to {out}")
    return 0


def _write_stages(terminal: Terminal, out: Path, given: Mapping[str, object]) -> str:
    """Write scenes on the light stage. Returns their number as text."""
    from tracknoise.cli.progress import frame_progress
    from tracknoise.paper.dtu_writer import IMAGE_FORMATS, write_dtu
    from tracknoise.paper.light_stage import LightStage

    options = dict(_STAGE)
    for name, value in given.items():
        if name not in _STAGE:
            raise UnknownNameError(f"option of layout {Layout.dtu}", name, _STAGE)
        if type(value) is not type(_STAGE[name]) and not (type(value) is int and type(_STAGE[name]) is float):
            raise SettingsError(f"--option {name}: found {value!r}, expected a value such as {_STAGE[name]!r}")
        options[name] = value
    image_format, scenes = options.pop("image_format"), options.pop("worlds")
    if scenes < 1:
        raise SettingsError(f"--option worlds: found {scenes}, expected at least 1")
    if image_format not in IMAGE_FORMATS:
        raise SettingsError(f"--option image_format: found {image_format!r}, expected {' or '.join(IMAGE_FORMATS)}")
    if options["width"] % 2 or options["height"] % 2:
        raise SettingsError(
            "--option width, height: found an odd number, expected even numbers, because readers halve the image size"
        )
    with frame_progress(terminal, "rendering the light stage") as progress:
        write_dtu(
            out, scenes=scenes, stage=partial(LightStage, **options), image_format=image_format, progress=progress
        )
    return counted(scenes, "scene")


def _write_sequences(terminal: Terminal, layout: Layout, out: Path, options: Mapping[str, object]) -> str:
    """Write sequences of a moving camera. Returns the number of frames as text."""
    from tracknoise.cli.progress import frame_progress
    from tracknoise.sequences.reader_registry import make_reader
    from tracknoise.sequences.simulated import Simulated

    reader = make_reader("simulated", None, options)
    assert isinstance(reader, Simulated), "the reader of this name"
    if reader.baseline_m and layout is not Layout.euroc:
        found = f"found {reader.baseline_m:g}, expected none: only the layout euroc has images of a second camera"
        raise SettingsError(f"--option baseline_m: {found}")
    names = reader.sequences()
    with frame_progress(terminal, f"rendering {', '.join(reader.motions)}") as progress:
        if layout is Layout.kitti:
            from tracknoise.sequences.kitti_writer import write_kitti

            write_kitti(map(reader.open, names), out, seed=reader.seed, progress=progress)
        elif layout is Layout.euroc:
            from tracknoise.sequences.euroc_writer import write_euroc

            _write_folders(partial(write_euroc, seed=reader.seed), reader, names, out, progress)
        else:
            from tracknoise.sequences.folder import write_folder

            _write_folders(write_folder, reader, names, out, progress)
    return counted(reader.frames * len(names), "frame")


def _write_folders(
    write: "Callable[..., None]", reader: "Reader", names: "list[SequenceId]", out: Path, progress: "Progress"
) -> None:
    """Write a single sequence into the folder itself, several sequences into subfolders."""
    from tracknoise.sequences.writing import new_folder

    if len(names) == 1:
        write(reader.open(names[0]), out, progress=progress)
        return
    with new_folder(out) as unfinished:
        for name in names:
            write(reader.open(name), unfinished / name.scene, progress=progress)
