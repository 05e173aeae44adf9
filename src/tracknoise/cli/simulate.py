"""``tracknoise simulate``: render simulated sequences to files, in the layout of a data set."""

from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tracknoise.cli.terminal import DebugOption, QuietOption, Terminal
from tracknoise.exceptions import SettingsError

if TYPE_CHECKING:
    from collections.abc import Callable

    from tracknoise.sequences.sequence import Reader
    from tracknoise.tables.identity import SequenceId

    Progress = Callable[[int, int], None]


class Layout(StrEnum):
    """On-disk layouts that can be written; each is a reader's name."""

    folder = "folder"
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
    Layout.kitti: {**_MOVING, "motion": "forward", "width": 1242, "height": 375, "hfov": 81.5},
    Layout.dtu: {**_ANY, "width": 1600, "height": 1200, "supersampling": 1, "image_format": "png"},
}
"""The options that a layout has, with their defaults."""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("simulate", no_args_is_help=True)(simulate)


def simulate(
    context: typer.Context,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder to write; must be new or empty.")],
    layout: Annotated[Layout, typer.Option(help="Which data set's: see docs/.")] = Layout.folder,
    scenes: Annotated[int, typer.Option(min=1, help="Count of scenes, each with a world of its own.")] = 1,
    motion: Annotated[str | None, typer.Option(help="sideways, forward, ...; not of dtu, where it is an arc.")] = None,
    frames: Annotated[int | None, typer.Option(min=1, help="Count of frames; 60. Not of dtu, where it is 49.")] = None,
    width: Annotated[int | None, typer.Option(min=16, help="Of the images, px; as the data set has it.")] = None,
    height: Annotated[int | None, typer.Option(min=16, help="Of the images, px; as the data set has it.")] = None,
    hfov: Annotated[float | None, typer.Option(help="Horizontal field of view, degrees; not of dtu.")] = None,
    supersampling: Annotated[int | None, typer.Option(min=1, help="Samples a pixel, along each side.")] = None,
    noise: Annotated[float | None, typer.Option(min=0, help="Sigma of the sensor noise, grey levels; 2.")] = None,
    shadows: Annotated[bool | None, typer.Option("--shadows", help="Let surfaces block the light; slower.")] = None,
    lighting: Annotated[str | None, typer.Option(help="Name of a lighting; not of dtu, which has its own.")] = None,
    world: Annotated[str | None, typer.Option(help="Kind of world: see docs/worlds.md; not of dtu.")] = None,
    models: Annotated[Path | None, typer.Option(help="Folder of Gazebo models to use; not of dtu.")] = None,
    world_file: Annotated[Path | None, typer.Option(help="Gazebo world to move through; not of dtu.")] = None,
    image_format: Annotated[str | None, typer.Option(help="png, or bmp, which is larger and faster; of dtu.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Of the worlds, the paths and the noise.")] = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Render simulated sequences in the layout of a data set, which the reader of the same name reads.

    `folder`: images, exact depth, poses and camera. `dtu`: a light stage with 19 LEDs and a scan. `kitti`: a drive with
    a lidar. See docs/folder-layout.md, docs/dtu.md and docs/kitti.md.

    Examples: `tracknoise simulate --motion forward --frames 100 --out data/forward`,
    `tracknoise simulate --layout dtu --scenes 2 --out data/dtu`
    """
    options = _options(layout, context.params)
    if layout is Layout.dtu:
        written = _write_stages(context.obj, out, scenes, options)
    else:
        written = _write_sequences(context.obj, layout, out, scenes, options)
    context.obj.result(f"wrote {written} to {out}")
    return 0


def _options(layout: Layout, given: dict[str, Any]) -> dict[str, Any]:
    """The layout's options, with those that were given in place of their defaults."""
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
    """Write scenes on the light stage, and say how many."""
    from tracknoise.cli.progress import frame_progress
    from tracknoise.sequences.dtu.writer import IMAGE_FORMATS, write_dtu
    from tracknoise.simulation.light_stage.stage import LightStage

    image_format = options.pop("image_format")
    if image_format not in IMAGE_FORMATS:
        raise SettingsError(f"--image-format: found {image_format!r}, expected one of {', '.join(IMAGE_FORMATS)}")
    if options["width"] % 2 or options["height"] % 2:
        raise SettingsError(
            "--width, --height: found an odd number, expected even ones, since readers halve the images"
        )
    stage = partial(LightStage, noise_sigma=options.pop("noise"), **options)
    with frame_progress(terminal, "photographing the stage") as progress:
        write_dtu(out, scenes=scenes, stage=stage, image_format=image_format, progress=progress)
    return _count(scenes, "scene")


def _write_sequences(terminal: Terminal, layout: Layout, out: Path, scenes: int, options: dict[str, Any]) -> str:
    """Write sequences of a moving camera, and say of how many frames."""
    from tracknoise.cli.progress import frame_progress
    from tracknoise.sequences.registry import make_reader

    motion, lighting = options.pop("motion"), options.pop("lighting")
    options |= {"motions": [motion], "worlds": scenes}
    options |= {"noise_sigma": options.pop("noise"), "hfov_deg": options.pop("hfov")}
    if lighting is not None:
        options["lightings"] = [lighting]
    reader = make_reader("simulated", None, {name: value for name, value in options.items() if value is not None})
    names = reader.sequences()
    with frame_progress(terminal, f"rendering {motion}") as progress:
        if layout is Layout.kitti:
            from tracknoise.sequences.kitti.writer import write_kitti

            write_kitti(map(reader.open, names), out, seed=options["seed"], progress=progress)
        else:
            _write_folders(reader, names, out, progress)
    return _count(options["frames"] * len(names), "frame")


def _write_folders(reader: "Reader", names: "list[SequenceId]", out: Path, progress: "Progress") -> None:
    """One sequence into the folder itself, several into folders within."""
    from tracknoise.sequences.folder import write_folder
    from tracknoise.sequences.new_folder import new_folder

    if len(names) == 1:
        write_folder(reader.open(names[0]), out, progress=progress)
        return
    with new_folder(out) as unfinished:
        for name in names:
            write_folder(reader.open(name), unfinished / name.scene, progress=progress)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' if number != 1 else ''}"
