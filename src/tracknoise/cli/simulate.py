"""``tracknoise simulate``: render a simulated sequence to files."""

from pathlib import Path
from typing import Annotated, Any

import typer

from tracknoise.cli.terminal import DebugOption, QuietOption


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("simulate", no_args_is_help=True)(simulate)


def simulate(
    context: typer.Context,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder to write; must be new or empty.")],
    motion: Annotated[str, typer.Option(help="sideways, sideways-left, fixating, forward or arvr.")] = "sideways",
    frames: Annotated[int, typer.Option(min=1, help="Count of frames.")] = 60,
    width: Annotated[int, typer.Option(min=16, help="Of the images, px.")] = 800,
    height: Annotated[int, typer.Option(min=16, help="Of the images, px.")] = 600,
    hfov_deg: Annotated[float, typer.Option("--hfov", help="Horizontal field of view, degrees.")] = 60.0,
    supersampling: Annotated[int, typer.Option(min=1, help="Samples a pixel, along each side.")] = 2,
    noise: Annotated[float, typer.Option(min=0, help="Standard deviation of the sensor noise, grey levels.")] = 2.0,
    lighting: Annotated[str | None, typer.Option(help="Name of a lighting; by default the first.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the world, the path and the noise.")] = 0,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Render a simulated sequence in the plain layout that the `folder` reader reads.

    Images, exact depth, poses and camera: see docs/folder-layout.md.

    Example: `tracknoise simulate --motion forward --frames 100 --out data/forward`
    """
    from tracknoise.cli.progress import frame_progress
    from tracknoise.sequences.folder import write_folder
    from tracknoise.sequences.registry import open_sequence

    options: dict[str, Any] = {
        "motions": [motion],
        "frames": frames,
        "width": width,
        "height": height,
        "hfov_deg": hfov_deg,
        "supersampling": supersampling,
        "noise_sigma": noise,
        "seed": seed,
    }
    if lighting is not None:
        options["lightings"] = [lighting]
    sequence = open_sequence("simulated", **options)
    with frame_progress(context.obj, f"rendering {motion}") as progress:
        write_folder(sequence, out, progress=progress)
    context.obj.result(f"wrote {len(sequence)} frames to {out}")
    return 0
