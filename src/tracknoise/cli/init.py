"""``tracknoise init``: an experiment file for a recording, to begin with."""

from pathlib import Path
from typing import Annotated

import typer

from tracknoise.cli.recording_arguments import OptionOption, RecordingArgument
from tracknoise.cli.shared_options import DebugOption, QuietOption


def init(
    context: typer.Context,
    recording: RecordingArgument,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File to write (default: NAME.toml).")] = None,
    option: OptionOption = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the file if it exists.")] = False,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Recognise the format of a recording and write an experiment file for it.

    Examples: `tracknoise init /data/my-recording`, `tracknoise init tum /data/fr1 --out fr1.toml`
    """
    from tracknoise.cli.output_files import require_outputs
    from tracknoise.cli.recording_arguments import open_recording
    from tracknoise.exceptions import SettingsError
    from tracknoise.experiments.template import experiment_template
    from tracknoise.tables.files import write_atomically

    opened = open_recording(recording, option)
    reader, path = opened.reader, opened.path
    text = experiment_template(reader, path, opened.options, stereo=opened.stereo)
    file = out or Path(f"{(path or Path(reader.name)).resolve().name}.toml")
    if file.exists() and not force:
        raise SettingsError(f"{file}: exists, expected a new file; --force replaces it")
    if file.exists() and file.suffix != ".toml":
        raise SettingsError(f"{file}: found a file of another kind, expected a new file or a .toml file to replace")
    require_outputs([("--out", file)], inputs=[path])
    write_atomically(file, text.encode())
    context.obj.result(
        f"{file}: reader {reader.name}. A first answer in about a minute: tracknoise run {file} --quick. "
        f"Measure all of it: tracknoise run {file}"
    )
    return 0
