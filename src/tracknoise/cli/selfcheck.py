"""``tracknoise selfcheck``: a self-test with errors of known size."""

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tracknoise.cli.options import DebugOption, QuietOption, WorkersOption

if TYPE_CHECKING:
    import polars as pl

    from tracknoise.cli.terminal import Terminal
    from tracknoise.experiments.validation.selfcheck import SelfTestResult
    from tracknoise.tables.store import RunFolder

_HEADINGS = ("setting", "speed", "statistic", "at", "expected", "measured", "95 % interval", "")
_TEXT_COLUMNS = (0, 2)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("selfcheck")(selfcheck)


def selfcheck(
    context: typer.Context,
    scenes: Annotated[int, typer.Option("--scenes", min=1, help="Number of simulated scenes.")] = 12,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Random seed of the scenes and the errors.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Keep the run in this folder; an earlier self-test is replaced (default: not kept)."
        ),
    ] = None,
    workers: WorkersOption = None,
    quiet: QuietOption = False,
    debug: DebugOption = False,
) -> int:
    """Self-test: measure errors of known size, and compare expected with measured values.

    Noise, bias, drift, outliers and track losses of known size are added to true positions, and the complete
    measurement is run on them. Exit status 0 if the self-test passes, 2 if it fails.

    Example: `tracknoise selfcheck`
    """
    from tracknoise.experiments.validation.selfcheck import compare, judge

    with _folder(out) as path:
        run = _measure(context.obj, path, scenes=scenes, seed=seed, workers=workers)
        if run is None:
            context.obj.error("self-test incomplete: some scenes could not be measured")
            return 2
        comparison = compare(run)
    verdict = judge(comparison)
    context.obj.result(comparison_text(comparison))
    context.obj.result(verdict_text(verdict))
    return 0 if verdict.passes else 2


def comparison_text(comparison: "pl.DataFrame") -> str:
    """The comparison as a plain text table: one row per number."""
    from tracknoise.cli.text_table import aligned

    rows = [_HEADINGS, *(_cells(row) for row in comparison.iter_rows(named=True))]
    lines = aligned(rows, numeric=[place not in _TEXT_COLUMNS for place in range(len(_HEADINGS))])
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])


def verdict_text(verdict: "SelfTestResult") -> str:
    """The result of the self-test, in three lines."""
    from tracknoise.experiments.validation.selfcheck import furthest
    from tracknoise.tables.defaults import LEVEL

    limit = f"more than {furthest(verdict.n_numbers):.1f} standard errors from the expected value"
    missing = f" {verdict.n_missing} more are missing." if verdict.n_missing else ""
    return "\n".join(
        [
            f"{verdict.n_off} of {verdict.n_numbers} numbers are off ({limit}).{missing}",
            f"{verdict.n_within} of {verdict.n_intervals} intervals ({100 * LEVEL:.0f} %) contain the expected value. "
            f"The self-test requires {verdict.n_least}; about {LEVEL * verdict.n_intervals:.0f} are likely.",
            "Self-test passed." if verdict.passes else "Self-test FAILED.",
        ]
    )


@contextmanager
def _folder(out: Path | None) -> Iterator[Path]:
    """The requested folder, or a temporary one."""
    if out is not None:
        yield out
        return
    with TemporaryDirectory(prefix="tracknoise-selfcheck-") as temporary:
        yield Path(temporary) / "run"


def _measure(terminal: "Terminal", path: Path, *, scenes: int, seed: int, workers: int | None) -> "RunFolder | None":
    """Measure the oracles. Returns None if a scene failed."""
    from tracknoise.cli.running import measure
    from tracknoise.exceptions import StoreError
    from tracknoise.experiments.validation.selfcheck import selfcheck_experiment
    from tracknoise.tables.store import RunFolder

    experiment, run = selfcheck_experiment(scenes=scenes, seed=seed), RunFolder(path)
    if run.exists and tomllib.loads(run.experiment_toml()).get("name") != experiment.name:
        raise StoreError(f"{path}: holds the run of another experiment, expected a new folder or an earlier selfcheck")
    outcome = measure(terminal, experiment, path, workers, fresh=True)
    return None if outcome.failures else run


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    """A row of the comparison as text."""
    number = " ".join(str(part) for part in (row["statistic"], row["coordinate"]) if part is not None)
    unit = "" if row["unit"] is None else f", {row['unit']}"
    interval = "-" if row["low"] is None else f"{row['low']:.4f} to {row['high']:.4f}"
    at = "-" if row["at"] is None else str(row["at"])
    values = ("-" if row[name] is None else f"{row[name]:.4f}" for name in ("expected", "measured"))
    return (row["setting"], str(row["speed"]), number + unit, at, *values, interval, "off" if row["off"] else "ok")
