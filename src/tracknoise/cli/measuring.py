"""Measure an experiment from the command line, with progress on stderr."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

from tracknoise import processes as signals
from tracknoise.cli.terminal import Terminal

if TYPE_CHECKING:
    from tracknoise.experiments.execute import Outcome
    from tracknoise.experiments.settings import Experiment


def processes(workers: int | None) -> int:
    """Number of worker processes: as requested, otherwise one per core."""
    return workers or os.cpu_count() or 1


def measure(
    terminal: Terminal,
    experiment: "Experiment",
    out: Path,
    workers: int | None,
    *,
    scheduler: str | None = None,
    fresh: bool,
    verify: bool = False,
) -> "Outcome":
    """Measure an experiment into a run folder. `workers`: None means one per core."""
    from tracknoise.cli.progress import RunProgress
    from tracknoise.experiments.execute import execute
    from tracknoise.tables.store import RunFolder

    signals.end_system_calls()
    with RunProgress(terminal) as progress:
        return execute(
            experiment,
            RunFolder(out),
            listener=progress,
            workers=processes(workers),
            scheduler=scheduler,
            fresh=fresh,
            verify=verify,
            debug=terminal.debug,
        )
