"""``tracknoise effects``: what effects of cameras and faults of the truth do to the results."""

from pathlib import Path
from typing import Annotated

import typer

from tracknoise.cli.shared_options import DebugOption, FreshOption, QuietOption, WorkersOption, parse_names, processes


def effects(
    context: typer.Context,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the results.")] = Path("runs/effects"),
    scenes: Annotated[int, typer.Option("--scenes", min=1, help="Number of scenes; each has its own world.")] = 6,
    frames: Annotated[int, typer.Option("--frames", min=2, help="Number of frames per scene.")] = 40,
    age: Annotated[int, typer.Option("--age", min=1, help="Age at which errors are compared, frames.")] = 10,
    motion: Annotated[str, typer.Option(help="Camera motion, the same in all scenes; see docs/simulation.md")] = "arvr",
    only: Annotated[str | None, typer.Option("--only", help="Effects by name, separated by commas.")] = None,
    workers: WorkersOption = None,
    fresh: FreshOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Measure what each effect of a camera, and each fault of the truth, changes in the results.

    Each effect is simulated alone, at a low, a usual and a bad size. Mean error, second moment, core, median lifetime
    and outlier ratio are compared with those of the same scenes without effects. Sizes are in docs/simulation.md. An
    interrupted study resumes.

    Examples: `tracknoise effects --scenes 4 --frames 30`, `tracknoise effects --only "rolling shutter,clock offset"`
    """
    from tracknoise.cli.text_table import show
    from tracknoise.experiments.effects_study import Study, base_options, chosen_effects, merged, run_study
    from tracknoise.inference.conventions import LEVEL
    from tracknoise.report.effect_files import effect_cells, write_effects

    context.obj.resumes(fresh=fresh)
    options = merged(base_options(), {"motions": [motion], "worlds": scenes, "frames": frames})
    study = Study(options, chosen_effects(None if only is None else parse_names(only)), ages=(age,))
    changes = run_study(
        study,
        out,
        workers=processes(workers),
        fresh=fresh,
        done=lambda part, count, total: context.obj.say(f"measured {count} of {total}: {part[0]}, {part[1]} sizes"),
    )
    for cells in effect_cells(changes, level=LEVEL):
        show(context.obj.result, cells)
    for path in write_effects(out, changes, level=LEVEL):
        context.obj.result(f"written: {path.resolve()}")
    return 0
