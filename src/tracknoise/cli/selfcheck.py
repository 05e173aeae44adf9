"""``tracknoise selfcheck``: whether the instrument gives back what went in, on this machine."""

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tracknoise.cli.run import WorkersOption, processes
from tracknoise.cli.terminal import DebugOption, QuietOption, Terminal

if TYPE_CHECKING:
    import polars as pl

    from tracknoise.experiments.validation.selfcheck import Verdict
    from tracknoise.tables.store import RunFolder

_HEADINGS = ("setting", "speed", "number", "at", "went in", "came back", "95 % interval", "")
_TEXT_COLUMNS = (0, 2)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("selfcheck")(selfcheck)


def selfcheck(
    context: typer.Context,
    scenes: Annotated[int, typer.Option("--scenes", min=1, help="Count of simulated scenes.")] = 12,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the scenes and the errors.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Keep the run in this folder, replaced; by default it is removed."),
    ] = None,
    workers: WorkersOption = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Measure errors of known size, and compare what comes back with what went in.

    True positions plus noise, bias, drift, outliers and losses of known size go through the whole measurement. Exit
    status 0 if everything comes back as it must, 2 if not.

    Example: `tracknoise selfcheck`
    """
    from tracknoise.experiments.validation.selfcheck import compare, judge

    with _folder(out) as path:
        run = _measure(context.obj, path, scenes=scenes, seed=seed, workers=workers)
        if run is None:
            context.obj.error("not every scene could be measured, so that nothing is known of the instrument")
            return 2
        comparison = compare(run)
    verdict = judge(comparison)
    context.obj.result(comparison_text(comparison))
    context.obj.result(verdict_text(verdict))
    return 0 if verdict.is_right else 2


def comparison_text(comparison: "pl.DataFrame") -> str:
    """The comparison as a plain text table, a line a number."""
    from tracknoise.cli.text_table import aligned

    rows = [_HEADINGS, *(_cells(row) for row in comparison.iter_rows(named=True))]
    lines = aligned(rows, numeric=[place not in _TEXT_COLUMNS for place in range(len(_HEADINGS))])
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])


def verdict_text(verdict: "Verdict") -> str:
    """What the comparison comes to, in a few lines."""
    from tracknoise.experiments.validation.selfcheck import furthest
    from tracknoise.tables.defaults import LEVEL

    limit = f"more than {furthest(verdict.n_numbers):.1f} standard errors from what went in"
    missing = f" {verdict.n_missing} more are missing." if verdict.n_missing else ""
    right = "The instrument gives back what went in." if verdict.is_right else "The instrument is NOT right."
    return "\n".join(
        [
            f"{verdict.n_off} of {verdict.n_numbers} numbers are off: {limit}.{missing}",
            f"{verdict.n_within} of {verdict.n_intervals} are within their {LEVEL:.0%} interval (expected about "
            f"{LEVEL * verdict.n_intervals:.0f}, at least {verdict.n_least}).",
            right,
        ]
    )


@contextmanager
def _folder(out: Path | None) -> Iterator[Path]:
    """The folder that was asked for, or one that is removed in the end."""
    if out is not None:
        yield out
        return
    with TemporaryDirectory(prefix="tracknoise-selfcheck-") as temporary:
        yield Path(temporary) / "run"


def _measure(terminal: Terminal, path: Path, *, scenes: int, seed: int, workers: int | None) -> "RunFolder | None":
    """Measure the oracles; None if a scene failed."""
    from tracknoise.cli.progress import RunProgress
    from tracknoise.exceptions import StoreError
    from tracknoise.experiments.running.execute import execute
    from tracknoise.experiments.validation.selfcheck import selfcheck_experiment
    from tracknoise.tables.store import RunFolder

    experiment, run = selfcheck_experiment(scenes=scenes, seed=seed), RunFolder(path)
    if run.exists and tomllib.loads(run.experiment_toml()).get("name") != experiment.name:
        raise StoreError(f"{path}: holds the run of another experiment, expected a new folder or an earlier selfcheck")
    with RunProgress(terminal) as progress:
        outcome = execute(
            experiment, run, listener=progress, workers=processes(workers), fresh=True, debug=terminal.debug
        )
    return None if outcome.failures else run


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    """A row of the comparison as text."""
    number = " ".join(str(part) for part in (row["statistic"], row["coordinate"]) if part is not None)
    unit = "" if row["unit"] is None else f", {row['unit']}"
    interval = "-" if row["low"] is None else f"{row['low']:.4f} to {row['high']:.4f}"
    at = "-" if row["at"] is None else str(row["at"])
    values = ("-" if row[name] is None else f"{row[name]:.4f}" for name in ("went_in", "came_back"))
    return (row["setting"], str(row["speed"]), number + unit, at, *values, interval, "off" if row["off"] else "ok")
