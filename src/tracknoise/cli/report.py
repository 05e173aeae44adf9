"""``tracknoise report``: write the report of a run."""

from pathlib import Path
from typing import Annotated

import typer

from tracknoise.cli.shared_options import DebugOption, QuietOption, TableOption


def report(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    rerun: Annotated[
        Path | None,
        typer.Option("--rerun", help="Also write a recording of one scene for the viewer Rerun (extra: rerun)."),
    ] = None,
    scene: Annotated[str | None, typer.Option("--scene", help="Scene of this recording. Default: the first.")] = None,
    figures: Annotated[bool, typer.Option("--figures", help="Also write all figures as SVG and PNG.")] = False,
    table: TableOption = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Write the report of a run: an HTML page, and tables as CSV.

    With `--figures`, also all figures as SVG and PNG. The page saves each figure on demand.

    A recording for Rerun shows images, tracks coloured by error, true points and the path of the camera. It requires
    the data of the run.

    Examples: `tracknoise report runs/7scenes`, `tracknoise report runs/demo --rerun demo.rrd --scene forward-00`
    """
    from tracknoise.cli.run_summary import print_results
    from tracknoise.tables.store import RunFolder

    if rerun is not None:
        from tracknoise.cli.output_files import require_outputs
        from tracknoise.experiments.view3d import write_recording

        require_outputs([("--rerun", rerun)], inputs=[run])
        write_recording(RunFolder(run), rerun, scene=scene)
        context.obj.result(f"written: {rerun.resolve()}")
    print_results(context.obj, RunFolder(run), report=True, figures=figures, table=table)
    return 0
