"""Compare runs with the first of them, paired by scene.

Runs can be compared if they have the same data, truth and libraries, whatever their trackers are.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isclose
from pathlib import Path
from typing import Any

import polars as pl

from tracknoise.analysis.comparison import Comparison, RunSide
from tracknoise.analysis.condition_units import groups_of_scenes
from tracknoise.analysis.estimand import Estimand, RoleValues, TableValues
from tracknoise.analysis.gate import Gate, judge
from tracknoise.analysis.paired_tests import Unit
from tracknoise.analysis.run_changes import Asked, Compared, verdicts
from tracknoise.analysis.run_inputs import read_kind_tables
from tracknoise.analysis.scene_values import NUMBERS, RunValues, differences_of, number_differences, run_values
from tracknoise.checks import path_of, require, require_within
from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.experiments.resume import LIBRARIES
from tracknoise.experiments.settings import OF_NO_RESULT
from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.paired_differences import Differences
from tracknoise.measurement.reference_tracks import KINDS
from tracknoise.sequences.sequence import TRIANGULATED
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import Condition, TablesByCondition, by_condition
from tracknoise.tables.defaults import MARGIN
from tracknoise.tables.enumerations import Axis, ComparedAges, Trimming
from tracknoise.tables.findings_schema import CURVES, SUMMARY
from tracknoise.tables.identity import readable
from tracknoise.tables.manifest import REFINED, Manifest, joined_fit
from tracknoise.tables.store import RunFolder, schema_of
from tracknoise.tables.trust import TruthVerdict
from tracknoise.text import dotted
from tracknoise.topics.catalogue import ESTIMANDS
from tracknoise.words import pixels

_DATA, _TRUTH = "dataset.", "truth."
_FREE = (
    *("dataset.root", "dataset.groups", "dataset.scenes", "dataset.lightings", "dataset.max_scenes"),
    *("truth.accuracy.", "truth.second.", "truth.poses"),  # which poses lead is compared for each sequence
)
"""Settings that may differ: the folder of the data, which part of it is measured, and what changes no error."""
_OF_IMAGES = ("n_frames", "width", "height")
_OF_TRUTH = ("truth", "key_frame")
_SHORT = 10
_SAME_DEPTH = 0.005
"""Corrections of depths by reference tracks may differ by less, between processors and where parts are measured."""


@dataclass(frozen=True, slots=True)
class OpenedRun:
    """A run that takes part in a comparison."""

    name: str  # name of the run in the result
    folder: RunFolder  # where it is
    manifest: Manifest  # of the run
    settings: Mapping[str, Any]  # all resolved settings

    @classmethod
    def of(cls, folder: RunFolder, name: str) -> "OpenedRun":
        """Read a run."""
        folder.statistics(SUMMARY)
        return cls(name, folder, folder.manifest(), folder.settings())

    def flat(self) -> dict[str, Any]:
        """Settings by dotted name, without those of the trackers."""
        return dict(dotted({key: value for key, value in self.settings.items() if key != "trackers"}))


def _require_comparable(first: OpenedRun, second: OpenedRun) -> list[str]:
    """Keys of the sequences that both runs have measured, sorted."""
    common = sorted(set(first.manifest.sequences) & set(second.manifest.sequences))
    for what, values, expected in _obstacles(first, second, common):
        raise SettingsError(f"{first.name} and {second.name} cannot be compared: {what}: {values}, expected {expected}")
    return common


def _obstacles(first: OpenedRun, second: OpenedRun, common: Sequence[str]) -> Iterator[tuple[str, str, str]]:
    """Why runs cannot be compared: what is another one, what was found, and what is expected."""
    settings = first.flat(), second.flat()
    for name in dict.fromkeys(name for of_run in settings for name in of_run):
        a, b = (of_run.get(name) for of_run in settings)
        if a != b and name.startswith((_DATA, _TRUTH)) and not name.startswith(_FREE):
            what = "other data" if name.startswith(_DATA) else "other truth"
            yield what, f"{name} is {_shown(a)} and {_shown(b)}", "the same"
    for name in LIBRARIES:
        a, b = (run.manifest.versions.get(name) for run in (first, second))
        if a != b:
            versions = f"{name} {a or 'of unknown version'} and {b or 'of unknown version'}"
            yield "another library", versions, "the same version"
    if not common:
        names = " and ".join(_some(run.manifest.sequences) for run in (first, second))
        yield "other data", f"sequences {names}", "at least one of the same name"
    for key in common:
        yield from _unlike(first, second, key)


def _unlike(first: OpenedRun, second: OpenedRun, key: str) -> Iterator[tuple[str, str, str]]:
    """The same of a sequence whose images or true geometry differ."""
    first_entry, second_entry = (run.manifest.sequences[key] for run in (first, second))
    sequence = readable(key)
    for what, names in (("other data", _OF_IMAGES), ("other truth", _OF_TRUTH)):
        for name in names:
            a, b = getattr(first_entry, name), getattr(second_entry, name)
            if a != b:
                yield what, f"{name} of {sequence} is {a} and {b}", "the same"
    images = [entry.sha256.get("snapshots") for entry in (first_entry, second_entry)]
    if first_entry.snapshot_frame == second_entry.snapshot_frame and images[0] != images[1]:
        yield "other data", f"frame {first_entry.snapshot_frame} of {sequence} differs", "the same image"
    a, b = first_entry.first_depth_m, second_entry.first_depth_m
    if a is not None and b is not None and not isclose(a, b, rel_tol=_SAME_DEPTH):
        values = f"{a:.4g} m and {b:.4g} m"
        yield "other truth", f"median depth of the first frame of {sequence} is {values}", "the same depth maps"
    if first_entry.leading_poses != second_entry.leading_poses:
        values = f"poses of {sequence} are {first_entry.leading_poses} and {second_entry.leading_poses}"
        yield "other truth", values, 'the same, as with poses = "stated" in [truth] of both'
    for name in ("cameras",) if first_entry.leading_poses == REFINED else ("poses", "cameras"):
        if not _equal(first, second, name, key):
            yield "other truth", f"{name} of {sequence} differ", "the same"


def _equal(first: OpenedRun, second: OpenedRun, name: str, key: str) -> bool:
    """Whether two tables have the same content, even if their files differ."""
    hashes = [run.manifest.sequences[key].sha256.get(name) for run in (first, second)]
    tables = (run.folder.sequence_table(name, key) for run in (first, second))
    return hashes[0] == hashes[1] or next(tables).equals(next(tables))


def _differing(first: OpenedRun, second: OpenedRun) -> tuple[tuple[str, str, str], ...]:
    """Settings and versions that differ: name, value in the first run, value in the second."""
    first_values, second_values = (
        {**dict(dotted(run.settings)), **{f"version of {name}": of for name, of in run.manifest.versions.items()}}
        for run in (first, second)
    )
    return tuple(
        (name, _shown(first_values.get(name)), _shown(second_values.get(name)))
        for name in first_values | second_values
        if first_values.get(name) != second_values.get(name) and name not in OF_NO_RESULT
    )


def _shown(value: object) -> str:
    return "not set" if value is None else str(value)


def _some(keys: Iterable[str]) -> str:
    """A few keys."""
    ordered = sorted(keys)
    return ", ".join(ordered[:_SHORT]) + (", ..." if len(ordered) > _SHORT else "")


def _refined_apart(first: OpenedRun, second: OpenedRun, keys: Iterable[str]) -> Iterator[str]:
    """A sentence about sequences whose poses were refined twice, with results that differ."""
    first_entries, second_entries = first.manifest.sequences, second.manifest.sequences
    refined = [key for key in keys if first_entries[key].leading_poses == REFINED]
    apart = [key for key in refined if not _equal(first, second, "poses", key)]
    fit = joined_fit([run[key].pose_fit for key in apart for run in (first_entries, second_entries)])
    if fit is not None and fit.left_px is not None:
        left = f"differences may contain what is left of their errors, {pixels(fit.left_px)} px at age {fit.age}"
        yield f"Poses of {_some(apart)} were refined in other parts of frames: {left}."


def _failed_in(first: OpenedRun, second: OpenedRun) -> Iterator[str]:
    """Sentences about sequences that the first run has measured, and the second could not."""
    failed = set(first.manifest.sequences) & set(second.manifest.failures)
    if failed:
        yield f"{second.name} could not measure {_some(failed)}, which {first.name} measured."


def _left_out(run: OpenedRun, other: OpenedRun) -> Iterator[str]:
    """Sentences about sequences that a run has measured, and the other was not to."""
    asked_for = set(other.manifest.sequences) | set(other.manifest.failures)
    if only := set(run.manifest.sequences) - asked_for:
        yield f"{other.name} has no {_some(only)}, which {run.name} measured."


_FITTED = "True positions are fitted to the tracks, so that errors are not compared."


@dataclass(frozen=True, slots=True)
class RunTables:
    """What one run measured of the sequences that both runs have."""

    name: str  # of the run
    values: RunValues
    numbers: Mapping[str, TablesByCondition]  # tables of `NUMBERS`, by statistic and condition

    @property
    def trackers(self) -> set[str]:
        """Names of its trackers."""
        return {str(key[_TRACKER]) for key in self.values.frames}

    @property
    def speeds(self) -> set[int]:
        """Its speeds."""
        return {int(key[_SPEED]) for key in self.values.frames}


def _read(run: OpenedRun, keys: Sequence[str], scenes: Mapping[str, Sequence[str]]) -> RunTables:
    """Read the sequences that both runs have. `scenes`: names of their scenes, sorted, by dataset."""
    errors = {"population": run.settings["truth"]["population"], "trimming": str(Trimming.untrimmed)}
    entries = run.manifest.sequences

    def read(name: str, *chosen: pl.Expr, **columns: str) -> TablesByCondition:
        there = [key for key in keys if name in entries[key].sha256]
        tables = run.folder.stacked_tables(name, there)
        return by_condition(tables, schema_of(name), name, lambda table: table.filter(*chosen, **columns))

    every = {name: read(name, pl.col("n") > 0, **errors) for name in ("moments", "scales")}
    values = run_values(
        every["moments"],
        every["scales"],
        read("ends"),
        read("frames"),
        run.folder.statistics(CURVES),
        by_kind=read_kind_tables(run.folder, keys, every, KINDS, lambda table: table.filter(pl.col("n") > 0, **errors)),
        key_frames={str(e.sequence.direction): e.key_frame for e in entries.values() if e.key_frame is not None},
        scenes=scenes,
        **errors,
    )
    return RunTables(run.name, values, {name: _numbers(estimand.values, read) for name, estimand in ESTIMANDS.items()})


def _numbers(source: RoleValues | TableValues, read: Callable[..., TablesByCondition]) -> TablesByCondition:
    """Tables of `NUMBERS` by condition; none of what differences are known of by a role."""
    if isinstance(source, RoleValues):
        return {}
    made = {key: source.numbers(table) for key, table in read(source.table, **source.rows).items()}
    return {key: _with_places(table) for key, table in made.items() if table is not None}


def _with_places(table: pl.DataFrame) -> pl.DataFrame:
    placed = table if "at" in table.columns else table.with_columns(at=None)
    return placed.select(pl.col(name).cast(kind) for name, kind in NUMBERS.items())


_TRACKER, _SPEED = POOLED.index("tracker"), POOLED.index("speed")
_EXPECTED = "trackers of the same name, or one of each run, named by --trackers"
Pair = tuple[Condition, Condition]
"""A condition of the first run, and the one of the second that it is compared with."""


def _matched_trackers(first: RunTables, second: RunTables, asked: tuple[str, str] | None) -> dict[str, str]:
    """Name of the tracker of the second run, by that of the first. `asked`: None for those of the same name."""
    first_trackers, second_trackers = first.trackers, second.trackers
    if asked is None:
        if not first_trackers & second_trackers:
            have = " and ".join(", ".join(sorted(names)) for names in (first_trackers, second_trackers))
            pair = f"{first.name} and {second.name} cannot be compared"
            raise SettingsError(f"{pair}: trackers {have}, expected {_EXPECTED}")
        return {name: name for name in sorted(first_trackers & second_trackers)}
    for run, name in zip((first, second), asked, strict=True):
        if name not in run.trackers:
            raise UnknownNameError(f"tracker of {run.name}", name, run.trackers)
    return {asked[0]: asked[1]}


def _paired_conditions(first: RunTables, trackers: Mapping[str, str]) -> list[Pair]:
    """Conditions of a run and those that another should have, sorted. `trackers`: as of `_matched_trackers`."""
    conditions = [key for key in sorted(first.values.frames) if str(key[_TRACKER]) in trackers]
    return [(key, (*key[:_TRACKER], trackers[str(key[_TRACKER])], *key[_TRACKER + 1 :])) for key in conditions]


def _unmatched(first: RunTables, second: RunTables, trackers: Mapping[str, str] | None) -> Iterator[str]:
    """Sentences about trackers that take no part, unless None is given, and about speeds that only one run has."""
    if trackers is not None:
        for run, matched in ((first, set(trackers)), (second, set(trackers.values()))):
            for name in sorted(run.trackers - matched):
                yield f"Tracker {name} of {run.name} takes no part."
    for run, other in ((first, second), (second, first)):
        for speed in sorted(run.speeds - other.speeds):
            yield f"Speed {speed} is in {run.name} only."


@dataclass(frozen=True, slots=True)
class Questions:
    """What is asked about two runs."""

    asked: tuple[Asked, ...]  # all questions, statistics in the order of `ESTIMANDS`
    notes: tuple[str, ...]  # what takes no part, one sentence each
    missing: tuple[str, ...]  # those of them that are about sequences that the first run alone has measured
    expected: tuple[Compared, ...]  # conditions of the first run that the second should have


def questions(first: OpenedRun, second: OpenedRun, trackers: tuple[str, str] | None) -> Questions:
    """Read two runs and pair what they measured. `trackers`: None for those of the same name."""
    keys = _require_comparable(first, second)
    scenes: dict[str, list[str]] = {}
    for dataset, scene in sorted(
        {(sequence.dataset, sequence.scene) for sequence in (first.manifest.sequences[key].sequence for key in keys)}
    ):
        scenes.setdefault(dataset, []).append(scene)
    first_tables, second_tables = (_read(run, keys, scenes) for run in (first, second))
    matched = _matched_trackers(first_tables, second_tables, trackers)
    fitted = any(first.manifest.sequences[key].truth == TRIANGULATED for key in keys)
    missing = (*_failed_in(first, second), *_left_out(first, second))
    apart = _unmatched(first_tables, second_tables, matched if trackers is None else None)
    others = (*_left_out(second, first), *_refined_apart(first, second, keys))
    notes = (*missing, *others, *apart, *([_FITTED] if fitted else []))
    groups = groups_of_scenes(first.manifest.sequences, first.settings["dataset"].get("groups"))
    asked = [
        Asked(_compared(second.name, pair), estimand, values, names, groups.of(dataset, names), axis)
        for pair in _paired_conditions(first_tables, matched)
        if pair[1] in second_tables.values.frames
        for dataset, names in [(str(pair[0][0]), scenes[str(pair[0][0])])]
        for estimand in ESTIMANDS.values()
        if not (fitted and estimand.of_errors)
        for axis, values in _differences(estimand, (first_tables, second_tables), pair)
    ]
    partners = matched if trackers else {name: matched.get(name, name) for name in first_tables.trackers}
    expected = (_compared(second.name, pair) for pair in _paired_conditions(first_tables, partners))
    return Questions(tuple(asked), notes, missing, tuple(expected))


def _compared(run: str, pair: Pair) -> Compared:
    first, second = (dict(zip(POOLED, key, strict=True)) for key in pair)
    return Compared(run=run, other_tracker=second["tracker"], **first)


def _differences(
    estimand: Estimand, runs: tuple[RunTables, RunTables], pair: Pair
) -> Iterator[tuple[str | None, Differences]]:
    """Axis and differences, second run minus first run, of a statistic; nothing where a run does not have it."""
    scenes = runs[0].values.scenes[str(pair[0][0])]
    levels = [(run.values, key) for run, key in zip(runs, pair, strict=True)]
    source = estimand.values
    if isinstance(source, RoleValues):
        for axis in source.axes:
            if axis is None or all((key, axis) in run.errors.conditions for run, key in levels):
                yield axis, differences_of(source.role, levels, axis, scenes).reversed()
    elif all(key in run.numbers[estimand.name] for run, key in zip(runs, pair, strict=True)):
        both = source.paired(*(run.numbers[estimand.name][key] for run, key in zip(runs, pair, strict=True)))
        differences = number_differences(both, scenes, logarithms=estimand.unit == Unit.ratio)
        is_of_frames = source.axis == Axis.age and levels[0][0].errors.key_frames
        yield Axis.frame if is_of_frames else source.axis, differences.reversed()


_LEVELS = (0.5, 0.99)


def compare(
    first: str | Path,
    *others: str | Path,
    trackers: tuple[str, str] | None = None,
    gate: Gate | None = None,
    margin: float | None = None,
    level: float | None = None,
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
        and for shares 0.02. Default: that of the findings of the first run.
    level
        Probability that an interval contains the true change; any false claim has a probability of at most 1 - level.
        Default: that of the findings of the first run.
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
    _require(others, trackers, gate, margin, level, ages)
    base, *compared = _opened([path_of("run", path) for path in (first, *others)])
    stated = base.settings.get("findings", {})
    margin = stated.get("margin", MARGIN) if margin is None else margin
    level = stated.get("level", LEVEL) if level is None else level
    asked_of_runs = [questions(base, run, trackers) for run in compared]
    asked = [question for part in asked_of_runs for question in part.asked]
    sides = tuple(
        RunSide(run.name, str(run.folder.path), _differing(base, run), part.notes, TruthVerdict.of_run(run.folder))
        for run, part in zip(compared, asked_of_runs, strict=True)
    )
    rows = verdicts(asked, margin=margin, level=level, ages=ComparedAges(ages))
    missing = [sentence for part in asked_of_runs for sentence in part.missing]
    missing += [] if gate is None else [text for run in (base, *compared) for text in _unwanted_poses(run, gate)]
    expected = [condition for part in asked_of_runs for condition in part.expected]
    result = None if gate is None else judge(gate, asked, missing, expected)
    side = RunSide(base.name, str(base.folder.path), truth=TruthVerdict.of_run(base.folder))
    return Comparison(side, sides, tuple(rows), margin, level, ComparedAges(ages), result)


def _unwanted_poses(run: OpenedRun, gate: Gate) -> Iterator[str]:
    """A sentence about sequences of a run with other leading poses than the gate wants."""
    sequences = run.manifest.sequences
    other = [key for key, entry in sequences.items() if gate.poses not in (None, entry.leading_poses)]
    if other:
        yield f"poses of {_some(other)} in {run.name} are {sequences[other[0]].leading_poses}, not {gate.poses}"


def _require(
    others: Sequence[object], trackers: object, gate: object, margin: float | None, level: float | None, ages: str
) -> None:
    if not others:
        raise SettingsError("found one run to compare, expected at least two")
    if margin is not None:
        require_within("margin", margin, {"gt": 0})
    if level is not None:
        require_within("level", level, {"ge": _LEVELS[0], "le": _LEVELS[1]})
    require(ages in list(ComparedAges), "ages", ages, f"one of {', '.join(ComparedAges)}")
    pair = isinstance(trackers, tuple | list) and len(trackers) == 2
    require(trackers is None or pair, "trackers", trackers, "two names: in the first run, and in the others")
    require(gate is None or isinstance(gate, Gate), "gate", gate, "what `read_gate` returns")


def _opened(paths: Sequence[Path]) -> list[OpenedRun]:
    """The runs, by the names of their folders, and as many folders above them as it takes to distinguish them."""
    resolved = [path.resolve() for path in paths]
    if len(set(resolved[1:])) < len(resolved) - 1:
        raise SettingsError("found a run twice among those that are compared with the first, expected each once")
    return [OpenedRun.of(RunFolder(path), _name(whole, resolved)) for path, whole in zip(paths, resolved, strict=True)]


def _name(path: Path, paths: Iterable[Path]) -> str:
    """The shortest end of a path that no other of some paths has."""
    others = [other.parts for other in paths if other != path]
    ends = (path.parts[-length:] for length in range(1, len(path.parts) + 1))
    return next(str(Path(*end)) for end in ends if not any(other[-len(end) :] == end for other in others))
