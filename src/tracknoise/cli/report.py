"""``tracknoise report``: the report of a run, as a page or as text."""

from pathlib import Path
from typing import Annotated

import typer

from tracknoise.cli.shared_options import DebugOption, JsonOption, QuietOption, flag, text


def report(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.")],
    as_text: Annotated[bool, flag("--text", help="Print at most ten sentences, and write no page.")] = False,
    every: Annotated[
        bool, flag("--all", help="Print all findings, the numbers of every tracker and speed, and verdicts.")
    ] = False,
    as_json: JsonOption = False,
    figures: Annotated[bool, flag("--figures", help="Also write all figures as SVG and PNG.")] = False,
    rerun: Annotated[
        str | None,
        text("--rerun", metavar="SCENE", help="Also write rerun/SCENE.rrd, for the viewer Rerun (extra: rerun)."),
    ] = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Write the report of a run: an HTML page, and tables as CSV; or print its findings.

    The sentences say what to set, which tracker is better, and what was shown. The page saves each figure on demand. A
    recording for Rerun shows images, tracks coloured by error, true points and the path of the camera. It requires the
    data of the run.

    Examples: `tracknoise report runs/7scenes`, `tracknoise report runs/7scenes --text`,
    `tracknoise report runs/demo --rerun forward-00`
    """
    from tracknoise.cli.run_sentences import print_findings
    from tracknoise.cli.run_summary import print_results
    from tracknoise.exceptions import SettingsError
    from tracknoise.tables.store import RunFolder

    if as_text or every or as_json:
        if figures or rerun is not None:
            option = "--figures" if figures else "--rerun"
            raise SettingsError(f"{option}: found a report that is printed, expected the option with the page alone")
        print_findings(context.obj, run, every=every, as_json=as_json)
        return 0
    folder = RunFolder(run)
    if rerun is not None:
        from tracknoise.experiments.view3d import write_recording
        from tracknoise.tables.files import require_no_links

        require_no_links(folder.path)
        file = folder.path / "rerun" / f"{rerun.replace('/', '-')}.rrd"
        write_recording(folder, file, scene=rerun)
        context.obj.result(f"written: {file.resolve()}")
    print_results(context.obj, folder, report=True, figures=figures)
    return 0
