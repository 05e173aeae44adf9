"""Self-test: measure worlds whose true positions and errors are known, and compare what the package finds.

What is expected does not come from the package: positions have a closed form, errors are drawn here, statistics are
computed from their definitions. There are three parts. Those after one in which something is wrong are left out,
because they use what it tests.

- exact: every position, status, age and statistic of scripted tracks. Values agree up to rounding, so that chance plays
  no part.
- pool: intervals and verdicts for scenes that differ, which have known answers.
- factors: verdicts on factors that do matter, do not, or cannot be decided.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path

import polars as pl

from benchmarks.selfcheck.comparison import CHECKS, SUSPECTS, Area, failed
from benchmarks.selfcheck.exact_worlds import FOLDERS as EXACT_FOLDERS
from benchmarks.selfcheck.exact_worlds import exact_checks
from benchmarks.selfcheck.scene_pools import factor_checks, measure_factors, measure_pool, pool_checks
from tracknoise.exceptions import StoreError
from tracknoise.experiments.local_workers import ENVIRONMENT
from tracknoise.experiments.run_findings import compute_findings
from tracknoise.experiments.run_statistics import compute_statistics
from tracknoise.experiments.settings import Experiment
from tracknoise.processes import process_pool, raise_if_interruption
from tracknoise.tables.schema import check
from tracknoise.tables.store import RunFolder

FOLDERS = (*EXACT_FOLDERS, "pool", "factors")
"""What `self_test` writes."""

LEAST_SCENES = 12
"""With fewer scenes a right verdict may be `undecided`: with 6, two of two self-tests had one."""


@dataclass(frozen=True, slots=True)
class SelfTestResult:
    """Result of a self-test."""

    # n_values, n_wrong: count of values that were compared, and of those that are wrong
    n_values: int
    n_wrong: int
    areas: tuple[Area, ...]  # areas with wrong values, in the order of `Area`

    @property
    def passes(self) -> bool:
        """Whether nothing is wrong."""
        return not self.areas

    @property
    def suspect(self) -> str | None:
        """What to look at first: the part of the package that is responsible for the first area; None if it passes."""
        return SUSPECTS[self.areas[0]] if self.areas else None


def self_test(
    folder: Path,
    *,
    scenes: int,
    seed: int = 0,
    workers: int = 1,
    debug: bool = False,
    progress: Callable[[str], None] | None = None,
) -> pl.DataFrame:
    """Measure all worlds and compare.

    Parameters
    ----------
    folder
        New folder, for recordings and runs.
    scenes
        Number of scenes of the pools. With fewer than `LEAST_SCENES` only the part `exact` is tested.
    seed
        Random seed of tracks and errors.
    workers
        Processes that share the three parts.
    debug
        Raise the first error. By default an error is a check that failed: the worlds are valid.
    progress
        Called with the name of each part when its results are expected next.

    Returns
    -------
    polars.DataFrame
        Schema `CHECKS`, sorted by area; in the order of measurement within one. Parts are left out after the first in
        which something is wrong.

    Raises
    ------
    StoreError
        If the folder cannot be written.
    """
    parts = list(_PARTS) if scenes >= LEAST_SCENES else ["exact"]
    jobs = [parts, repeat(folder), repeat(scenes), repeat(seed), repeat(debug)]
    if workers == 1:
        return _collected(map(_run, *jobs), parts, progress)
    with process_pool(workers, ENVIRONMENT) as pool:
        return _collected(pool.map(_run, *jobs), parts, progress)


def _collected(
    results: Iterator[pl.DataFrame], parts: list[str], progress: Callable[[str], None] | None
) -> pl.DataFrame:
    """Checks of the parts, up to the first in which something is wrong."""
    tables = []
    for part in parts:
        if progress is not None:
            progress(part)
        tables.append(next(results))
        if not judge(tables[-1]).passes:
            break
    return check(pl.concat(tables).sort("area", maintain_order=True), CHECKS, "checks")


def judge(checks: pl.DataFrame) -> SelfTestResult:
    """The result of a self-test, from what `self_test` returned."""
    wrong = checks.filter(pl.col("n_wrong") > 0)["area"].unique().sort().to_list()
    n_values, n_wrong = (int(checks[name].sum()) for name in ("n", "n_wrong"))
    return SelfTestResult(n_values, n_wrong, tuple(Area(name) for name in wrong))


def _exact(folder: Path, scenes: int, seed: int) -> pl.DataFrame:
    return pl.concat(exact_checks(folder, seed=seed))


def _pool(folder: Path, scenes: int, seed: int) -> pl.DataFrame:
    run = _analysed(folder / "pool", measure_pool, scenes=scenes, seed=seed)
    return pl.concat(pool_checks(run, scenes=scenes))


def _factors(folder: Path, scenes: int, seed: int) -> pl.DataFrame:
    return pl.concat(factor_checks(_analysed(folder / "factors", measure_factors, scenes=scenes, seed=seed)))


def _analysed(folder: Path, measure: Callable[..., Experiment], *, scenes: int, seed: int) -> RunFolder:
    """A run with its statistics and findings."""
    run = RunFolder(folder)
    experiment = measure(run, scenes=scenes, seed=seed)
    compute_findings(run, experiment, compute_statistics(run, experiment))
    return run


_PARTS: Mapping[str, Callable[[Path, int, int], pl.DataFrame]] = {"exact": _exact, "pool": _pool, "factors": _factors}

_FIRST: Mapping[str, Area] = {"exact": Area.geometry, "pool": Area.intervals, "factors": Area.factors}
"""First area that a part tests."""


def _run(part: str, folder: Path, scenes: int, seed: int, debug: bool) -> pl.DataFrame:
    """Checks of a part, or the check that it can be measured, if that ended in an error."""
    try:
        return _PARTS[part](folder, scenes, seed)
    except StoreError:
        raise
    except (Exception, pl.exceptions.PanicException) as error:
        raise_if_interruption(error)
        if debug:
            raise
        return failed(_FIRST[part], part, error)
