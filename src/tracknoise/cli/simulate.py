"""``tracknoise simulate``: render simulated sequences to files, in the layout of a dataset."""

from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tracknoise.cli.shared_options import DebugOption, QuietOption
from tracknoise.cli.terminal import Terminal
from tracknoise.exceptions import SettingsError
from tracknoise.text import counted

if TYPE_CHECKING:
    from collections.abc import Callable

    from tracknoise.sequences.sequence import Reader
    from tracknoise.tables.identity import SequenceId

    Progress = Callable[[int, int], None]


class Layout(StrEnum):
    """File layouts that can be written. Each has the name of the reader that reads it."""

    folder = "folder"
    euroc = "euroc"
    dtu = "dtu"
    kitti = "kitti"


_ANY: dict[str, Any] = {"noise": 2.0, "shadows": False, "seed": 0}
_MOVING = {
    **_ANY,
    "frames": 60,
    "supersampling": 2,
    "world": None,
    "models": None,
    "world_file": None,
    "lighting": None,
}
_DEFAULTS: dict[Layout, dict[str, Any]] = {
    Layout.folder: {**_MOVING, "motion": "sideways", "width": 800, "height": 600, "hfov": 60.0},
    Layout.euroc: {**_MOVING, "motion": "arvr", "width": 752, "height": 480, "hfov": 78.8},
    Layout.kitti: {**_MOVING, "motion": "forward", "width": 1242, "height": 375, "hfov": 81.5},
    Layout.dtu: {**_ANY, "width": 1600, "height": 1200, "supersampling": 1, "image_format": "png"},
}
"""Options of each layout, with their defaults."""

_EUROC_RATE_HZ = 20.0
"""Frames per second of EuRoC's cameras."""


def simulate(
    context: typer.Context,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder; must be new or empty.")],
    layout: Annotated[Layout, typer.Option(help="Layout of the files; see docs/.")] = Layout.folder,
    scenes: Annotated[int, typer.Option(min=1, help="Number of scenes; each has its own world.")] = 1,
    motion: Annotated[str | None, typer.Option(help="Camera motion: sideways, forward, ... Not for dtu.")] = None,
    frames: Annotated[int | None, typer.Option(min=1, help="Number of frames (default: 60). Not for dtu (49).")] = None,
    width: Annotated[int | None, typer.Option(min=16, help="Image width, px (default: as in the dataset).")] = None,
    height: Annotated[int | None, typer.Option(min=16, help="Image height, px (default: as in the dataset).")] = None,
    hfov: Annotated[float | None, typer.Option(help="Horizontal field of view, degrees. Not for dtu.")] = None,
    supersampling: Annotated[int | None, typer.Option(min=1, help="Samples per pixel along each axis.")] = None,
    noise: Annotated[
        float | None, typer.Option(min=0, max=10_000, help="Sigma of the sensor noise, grey levels (default: 2).")
    ] = None,
    shadows: Annotated[bool | None, typer.Option("--shadows", help="Render shadows (slower).")] = None,
    lighting: Annotated[str | None, typer.Option(help="Name of a lighting. Not for dtu, which has its own.")] = None,
    world: Annotated[str | None, typer.Option(help="Kind of world, see docs/simulation.md. Not for dtu.")] = None,
    models: Annotated[Path | None, typer.Option(help="Folder of Gazebo models to use. Not for dtu.")] = None,
    world_file: Annotated[Path | None, typer.Option(help="Gazebo world file to use. Not for dtu.")] = None,
    image_format: Annotated[str | None, typer.Option(help="png or bmp (larger files, faster). Only for dtu.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Random seed of worlds, paths and noise.")] = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Render simulated sequences in the layout of a dataset. The reader of the same name reads them.

    `folder`: images, exact depth, poses and camera. `euroc`: images at 20 Hz, inertial readings at 200 Hz with EuRoC's
    noise, poses, velocities and biases, for filters. `dtu`: a light stage with 19 LEDs and a scan. `kitti`: a drive
    with a lidar. See docs/data.md, docs/formats.md and docs/paper.md.

    Examples: `tracknoise simulate --motion forward --frames 100 --out data/forward`,
    `tracknoise simulate --layout euroc --world objects --motion linear --frames 300 --out data/flight`
    """
    options = _options(layout, context.params)
    if layout is Layout.dtu:
        written = _write_stages(context.obj, out, scenes, options)
    else:
        written = _write_sequences(context.obj, layout, out, scenes, options)
    context.obj.result(f"wrote {written} to {out}")
    return 0


def _options(layout: Layout, given: dict[str, Any]) -> dict[str, Any]:
    """Options of a layout: as given by the user, otherwise the default."""
    options = dict(_DEFAULTS[layout])
    of_any = set().union(*_DEFAULTS.values())
    for name, value in given.items():
        if name in of_any and value is not None:
            if name not in options:
                raise SettingsError(f"layout {layout} has no {_flag(name)}; it has {', '.join(map(_flag, options))}")
            options[name] = value
    return options


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _write_stages(terminal: Terminal, out: Path, scenes: int, options: dict[str, Any]) -> str:
    """Write scenes on the light stage. Returns their number as text."""
    from tracknoise.cli.progress import frame_progress
    from tracknoise.paper.dtu_writer import IMAGE_FORMATS, write_dtu
    from tracknoise.paper.light_stage import LightStage

    image_format = options.pop("image_format")
    if image_format not in IMAGE_FORMATS:
        raise SettingsError(f"--image-format: found {image_format!r}, expected one of {', '.join(IMAGE_FORMATS)}")
    if options["width"] % 2 or options["height"] % 2:
        raise SettingsError(
            "--width, --height: found an odd number, expected even numbers, because readers halve the image size"
        )
    stage = partial(LightStage, noise_sigma=options.pop("noise"), **options)
    with frame_progress(terminal, "rendering the light stage") as progress:
        write_dtu(out, scenes=scenes, stage=stage, image_format=image_format, progress=progress)
    return counted(scenes, "scene")


def _write_sequences(terminal: Terminal, layout: Layout, out: Path, scenes: int, options: dict[str, Any]) -> str:
    """Write sequences of a moving camera. Returns the number of frames as text."""
    from tracknoise.cli.progress import frame_progress
    from tracknoise.sequences.reader_registry import make_reader

    motion, lighting = options.pop("motion"), options.pop("lighting")
    options |= {"motions": [motion], "worlds": scenes}
    options |= {"noise_sigma": options.pop("noise"), "hfov_deg": options.pop("hfov")}
    if layout is Layout.euroc:
        options["imaging"] = {"rate_hz": _EUROC_RATE_HZ}
    if lighting is not None:
        options["lightings"] = [lighting]
    reader = make_reader("simulated", None, {name: value for name, value in options.items() if value is not None})
    names = reader.sequences()
    with frame_progress(terminal, f"rendering {motion}") as progress:
        if layout is Layout.kitti:
            from tracknoise.sequences.kitti_writer import write_kitti

            write_kitti(map(reader.open, names), out, seed=options["seed"], progress=progress)
        elif layout is Layout.euroc:
            from tracknoise.sequences.euroc_writer import write_euroc

            _write_folders(partial(write_euroc, seed=options["seed"]), reader, names, out, progress)
        else:
            from tracknoise.sequences.folder import write_folder

            _write_folders(write_folder, reader, names, out, progress)
    return counted(options["frames"] * len(names), "frame")


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
