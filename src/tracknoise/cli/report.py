"""``tracknoise report``: the report of a run, as a page or as text."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.shared_options import DebugOption, JsonOption, QuietOption, flag, text
from tracknoise.cli.terminal import Terminal

if TYPE_CHECKING:
    from tracknoise.tables.store import RunFolder


def report(
    context: typer.Context,
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Run folder.")],
    as_text: Annotated[bool, flag("--text", help="Print at most ten sentences, and write no page.")] = False,
    every: Annotated[
        bool, flag("--all", help="Print all findings, the numbers of every tracker and speed, and verdicts.")
    ] = False,
    as_json: JsonOption = False,
    figures: Annotated[
        bool, flag("--figures", help="Also write all figures as SVG and PNG, until the next report.")
    ] = False,
    rerun: Annotated[
        str | None,
        text("--rerun", metavar="SCENE", help="Also write rerun/SCENE.rrd, for the viewer Rerun (extra: rerun)."),
    ] = None,
    video: Annotated[
        Path | None,
        text("--video", metavar="FILE", help="Also write tracks and true positions frame by frame, as .gif or .mp4."),
    ] = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Write the report of a run: an HTML page, and tables as CSV; or print its findings.

    The sentences say what to set, which tracker is better, and what was shown. The page saves each figure on demand. A
    recording for Rerun shows images, tracks coloured by error, true points and the path of the camera. It requires the
    data of the run.

    Examples: `tracknoise report runs/7scenes`, `tracknoise report runs/7scenes --text`,
    `tracknoise report runs/demo --rerun forward-00`, `tracknoise report runs/demo --video tracks.gif`
    """
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.cli.run_sentences import print_findings
    from tracknoise.cli.run_summary import print_results
    from tracknoise.exceptions import SettingsError
    from tracknoise.tables.store import RunFolder

    if as_text or every or as_json:
        given = {"--figures": figures, "--rerun": rerun is not None, "--video": video is not None}
        for option in (name for name, is_given in given.items() if is_given):
            raise SettingsError(f"{option}: found a report that is printed, expected the option with the page alone")
        print_findings(context.obj, run, every=every, as_json=as_json)
        return 0
    folder = RunFolder(run)
    if video is not None:
        from tracknoise.sequences.animations import require_ending

        require_ending("--video", video)
        require_outputs([("--video", video)], inputs=[run])
        _write_video(context.obj, folder, video)
    if rerun is not None:
        from tracknoise.experiments.view3d import write_recording
        from tracknoise.tables.files import require_no_links

        require_no_links(folder.path)
        file = folder.path / "rerun" / f"{rerun.replace('/', '-')}.rrd"
        write_recording(folder, file, scene=rerun)
        context.obj.result(f"written: {file.resolve()}")
    print_results(context.obj, folder, report=True, figures=figures)
    return 0


def _write_video(terminal: Terminal, run: "RunFolder", file: Path) -> None:
    """Write the film of a run with its tracks, and say which trackers it shows."""
    from tracknoise.report.animation import FRAME_MS, animation
    from tracknoise.report.report_data import ReportData
    from tracknoise.sequences.animations import write_animation

    shown = animation(ReportData.of(run))
    write_animation(file, shown.pictures(), frame_ms=FRAME_MS)
    if len(shown.trackers) < shown.n_trackers:
        terminal.say(f"shown: {', '.join(shown.trackers)}, the first of {shown.n_trackers} trackers")
    terminal.result(f"written: {file.resolve()}")
