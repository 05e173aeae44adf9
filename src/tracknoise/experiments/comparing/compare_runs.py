"""Compare runs with the first of them, paired by scene."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from tracknoise.exceptions import SettingsError
from tracknoise.experiments.comparing.comparable import OpenedRun, differing
from tracknoise.experiments.comparing.questions import questions
from tracknoise.findings.comparison.gate import Gate, judge
from tracknoise.findings.comparison.result import Comparison, RunSide
from tracknoise.findings.comparison.verdicts import verdicts
from tracknoise.tables.defaults import LEVEL, MARGIN
from tracknoise.tables.enumerations import ComparedAges
from tracknoise.tables.store import RunFolder

_LEVELS = (0.5, 0.99)


def compare(
    first: str | Path,
    *others: str | Path,
    trackers: tuple[str, str] | None = None,
    gate: Gate | None = None,
    margin: float = MARGIN,
    level: float = LEVEL,
    ages: ComparedAges | str = ComparedAges.every,
) -> Comparison:
    """Compare runs on the same scenes with the first of them, paired by scene.

    Parameters
    ----------
    first, others
        Folders of finished runs.
    trackers
        Name of a tracker in the first run, and of the one in the others that it is compared with. Default: trackers of
        the same name.
    gate
        Tolerances for changes for the worse.
    margin
        Largest relative change that counts as no difference: 0.1 for ratios of 1.1, for mean errors 10 % of the core,
        and for shares 0.02.
    level
        Probability that an interval contains the true change; any false claim has a probability of at most 1 - level.
    ages
        Whether verdicts are about every single age and their mean (``every``), or about the mean alone (``mean``).

    Returns
    -------
    Comparison
        One row per statistic and condition, with a verdict.

    Raises
    ------
    SettingsError
        If runs cannot be compared: other data, other truth or other libraries. Also if an argument is wrong.
    UnknownNameError
        If a tracker is not in its run.
    StoreError, SchemaError
        If there is no finished run, or one is damaged.
    """
    _require(others, margin, level, ages)
    known, *compared = _opened([Path(first), *map(Path, others)])
    found = [questions(known, run, trackers) for run in compared]
    asked = [one for part in found for one in part.asked]
    sides = tuple(
        RunSide(run.name, str(run.folder.path), differing(known, run), part.notes)
        for run, part in zip(compared, found, strict=True)
    )
    rows = verdicts(asked, margin=margin, level=level, ages=ComparedAges(ages))
    missing = [sentence for part in found for sentence in part.missing]
    result = None if gate is None else judge(gate, asked, missing)
    side = RunSide(known.name, str(known.folder.path))
    return Comparison(side, sides, tuple(rows), margin, level, ComparedAges(ages), result)


def _require(others: Sequence[object], margin: float, level: float, ages: str) -> None:
    if not others:
        raise SettingsError("found one run to compare, expected at least two")
    if not 0 < margin < float("inf"):
        raise SettingsError(f"margin is {margin}, expected a number above 0")
    if not _LEVELS[0] <= level <= _LEVELS[1]:
        raise SettingsError(f"level is {level}, expected a number from {_LEVELS[0]} to {_LEVELS[1]}")
    if ages not in list(ComparedAges):
        raise SettingsError(f"ages is {ages!r}, expected one of {', '.join(ComparedAges)}")


def _opened(paths: Sequence[Path]) -> list[OpenedRun]:
    """The runs, with names that differ: those of their folders, else their paths, else numbered."""
    names = [path.resolve().name for path in paths]
    if len(set(names)) < len(names):
        names = [str(path) for path in paths]
    seen: Counter[str] = Counter()
    runs = []
    for path, name in zip(paths, names, strict=True):
        seen[name] += 1
        runs.append(OpenedRun.of(RunFolder(path), name if seen[name] == 1 else f"{name} ({seen[name]})"))
    return runs
