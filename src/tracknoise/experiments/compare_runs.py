"""Compare runs with the first of them, paired by scene, and read the gate that the comparison has to pass.

Runs can be compared if they have the same data, truth and libraries, whatever their trackers are.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from tracknoise.analysis.condition_units import groups_of_scenes
from tracknoise.analysis.gate import Gate, judge, verdicts
from tracknoise.analysis.paired_tests import Unit
from tracknoise.analysis.run_changes import ESTIMANDS, OF_ERRORS, Asked, Compared, Comparison, RunSide
from tracknoise.analysis.run_inputs import read_kind_tables
from tracknoise.analysis.scene_values import (
    NUMBERS,
    SIGNED,
    RunErrors,
    RunValues,
    differences_by_kind,
    differences_of,
    number_differences,
    run_errors,
)
from tracknoise.checks import path_of, require, require_within
from tracknoise.estimators.window_noise import scene_quantities
from tracknoise.exceptions import DataError, SettingsError, UnknownNameError
from tracknoise.experiments.resume import LIBRARIES
from tracknoise.experiments.settings import OF_NO_RESULT, dotted
from tracknoise.foreign_files import MIB, read_text
from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.paired_differences import Differences
from tracknoise.inference.units import MIN_SCENES
from tracknoise.measurement.reference_tracks import KINDS
from tracknoise.sequences.sequence import TRIANGULATED
from tracknoise.statistics.definitions import POOLED
from tracknoise.statistics.grouping import Condition, TablesByCondition, by_condition
from tracknoise.tables.defaults import MARGIN
from tracknoise.tables.enumerations import Axis, ComparedAges, Trimming
from tracknoise.tables.findings_schema import CURVES, SUMMARY
from tracknoise.tables.identity import readable
from tracknoise.tables.manifest import LEADING, REFINED, Manifest, SequenceEntry, joined_fit
from tracknoise.tables.quantities import RATIOS
from tracknoise.tables.schema import POINT_TRACKING, WINDOW_NOISE
from tracknoise.tables.schema import RATIOS as RATIO_SUMS
from tracknoise.tables.store import SEQUENCE_TABLES, RunFolder
from tracknoise.tables.trust import TruthVerdict
from tracknoise.text import parse_toml
from tracknoise.topics.window_topic import LONGEST_WINDOW
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


def require_comparable(first: OpenedRun, second: OpenedRun) -> list[str]:
    """Keys of the sequences that both runs have measured, sorted."""
    _require_settings(first, second)
    _require_libraries(first, second)
    common = sorted(set(first.manifest.sequences) & set(second.manifest.sequences))
    if not common:
        known, found = (_some(run.manifest.sequences) for run in (first, second))
        raise _refusal(first, second, "other data", f"sequences {known} and {found}", "at least one of the same name")
    for key in common:
        _require_sequence(first, second, key)
    return common


def differing(first: OpenedRun, second: OpenedRun) -> tuple[tuple[str, str, str], ...]:
    """Settings and versions that differ: name, value in the first run, value in the second."""
    settings = [dict(dotted(run.settings)) for run in (first, second)]
    versions = [
        {f"version of {name}": value for name, value in run.manifest.versions.items()} for run in (first, second)
    ]
    return tuple(
        (name, _shown(a.get(name)), _shown(b.get(name)))
        for a, b in (settings, versions)
        for name in dict.fromkeys([*a, *b])
        if a.get(name) != b.get(name) and name not in OF_NO_RESULT
    )


def _require_settings(first: OpenedRun, second: OpenedRun) -> None:
    known, found = first.flat(), second.flat()
    for name in dict.fromkeys([*known, *found]):
        counts = name.startswith((_DATA, _TRUTH)) and not name.startswith(_FREE)
        if counts and known.get(name) != found.get(name):
            what = "other data" if name.startswith(_DATA) else "other truth"
            values = f"{name} is {_shown(known.get(name))} and {_shown(found.get(name))}"
            raise _refusal(first, second, what, values, "the same")


def _require_libraries(first: OpenedRun, second: OpenedRun) -> None:
    known, found = first.manifest.versions, second.manifest.versions
    for name in LIBRARIES:
        if known.get(name) != found.get(name):
            values = f"{name} {known.get(name, 'of unknown version')} and {found.get(name, 'of unknown version')}"
            raise _refusal(first, second, "another library", values, "the same version")


def _require_sequence(first: OpenedRun, second: OpenedRun, key: str) -> None:
    """Refuse a sequence whose images or true geometry are not the same."""
    known, found = (run.manifest.sequences[key] for run in (first, second))
    sequence = readable(key)
    for what, names in (("other data", _OF_IMAGES), ("other truth", _OF_TRUTH)):
        for name in names:
            if getattr(known, name) != getattr(found, name):
                values = f"{name} of {sequence} is {getattr(known, name)} and {getattr(found, name)}"
                raise _refusal(first, second, what, values, "the same")
    if known.snapshot_frame == found.snapshot_frame and _hash(known, "snapshots") != _hash(found, "snapshots"):
        raise _refusal(
            first, second, "other data", f"frame {known.snapshot_frame} of {sequence} differs", "the same image"
        )
    leading = known.leading_poses, found.leading_poses
    if leading[0] != leading[1]:
        values = f"poses of {sequence} are {leading[0]} and {leading[1]}"
        raise _refusal(first, second, "other truth", values, 'the same, as with poses = "stated" in [truth] of both')
    for name in ("cameras",) if leading[0] == REFINED else ("poses", "cameras"):
        if _hash(known, name) != _hash(found, name) and not _equal(first, second, name, key):
            raise _refusal(first, second, "other truth", f"{name} of {sequence} differ", "the same")


def _hash(entry: SequenceEntry, name: str) -> str | None:
    return entry.sha256.get(name)


def _equal(first: OpenedRun, second: OpenedRun, name: str, key: str) -> bool:
    """Whether two tables have the same content, although their files differ."""
    return first.folder.sequence_table(name, key).equals(second.folder.sequence_table(name, key))


def _refusal(first: OpenedRun, second: OpenedRun, what: str, found: str, expected: str) -> SettingsError:
    pair = f"{first.name} and {second.name} cannot be compared"
    return SettingsError(f"{pair}: {what}: {found}, expected {expected}")


def _shown(value: object) -> str:
    return "not set" if value is None else str(value)


def _some(keys: Iterable[str]) -> str:
    """A few keys."""
    ordered = sorted(keys)
    return ", ".join(ordered[:_SHORT]) + (", ..." if len(ordered) > _SHORT else "")


def _refined_apart(first: OpenedRun, second: OpenedRun, keys: Iterable[str]) -> Iterator[str]:
    """A sentence about sequences whose poses were refined twice, with results that differ."""
    apart = [
        key
        for key in keys
        if first.manifest.sequences[key].leading_poses == REFINED
        and _hash(first.manifest.sequences[key], "poses") != _hash(second.manifest.sequences[key], "poses")
        and not _equal(first, second, "poses", key)
    ]
    fit = joined_fit([run.manifest.sequences[key].pose_fit for key in apart for run in (first, second)])
    if fit is not None and fit.left_px is not None:
        left = f"differences may contain what is left of their errors, {pixels(fit.left_px)} px at age {fit.age}"
        yield f"Poses of {_some(apart)} were refined in other parts of frames: {left}."


def failed_in(first: OpenedRun, second: OpenedRun) -> Iterator[str]:
    """Sentences about sequences that the first run has measured, and the second could not."""
    failed = set(first.manifest.sequences) & set(second.manifest.failures)
    if failed:
        yield f"{second.name} could not measure {_some(failed)}, which {first.name} measured."


def left_out(one: OpenedRun, other: OpenedRun) -> Iterator[str]:
    """Sentences about sequences that one run has measured, and the other was not to."""
    known = set(other.manifest.sequences) | set(other.manifest.failures)
    if only := set(one.manifest.sequences) - known:
        yield f"{other.name} has no {_some(only)}, which {one.name} measured."


_TRACKER, _SPEED = POOLED.index("tracker"), POOLED.index("speed")
_EXPECTED = "trackers of the same name, or one of each run, named by --trackers"
Pair = tuple[Condition, Condition]
"""A condition of the first run, and the one of the second that it is compared with."""


@dataclass(frozen=True, slots=True)
class Measured:
    """Conditions of a run."""

    name: str  # name of the run
    conditions: frozenset[Condition]  # values of `POOLED`, of everything that was measured

    @property
    def trackers(self) -> set[str]:
        """Names of its trackers."""
        return {str(key[_TRACKER]) for key in self.conditions}

    @property
    def speeds(self) -> set[int]:
        """Its speeds."""
        return {int(key[_SPEED]) for key in self.conditions}


def matched_trackers(first: Measured, second: Measured, asked: tuple[str, str] | None) -> dict[str, str]:
    """Name of the tracker of the second run, by that of the first. `asked`: None for those of the same name."""
    if asked is None:
        common = {name: name for name in sorted(first.trackers & second.trackers)}
        if not common:
            have = " and ".join(", ".join(sorted(run.trackers)) for run in (first, second))
            pair = f"{first.name} and {second.name} cannot be compared"
            raise SettingsError(f"{pair}: trackers {have}, expected {_EXPECTED}")
        return common
    for run, name in zip((first, second), asked, strict=True):
        if name not in run.trackers:
            raise UnknownNameError(f"tracker of {run.name}", name, run.trackers)
    return {asked[0]: asked[1]}


def paired_conditions(first: Measured, trackers: Mapping[str, str]) -> list[Pair]:
    """Conditions of a run and those that another should have, sorted. `trackers`: as of `matched_trackers`."""
    return [
        (key, _with_tracker(key, trackers[str(key[_TRACKER])]))
        for key in sorted(first.conditions)
        if str(key[_TRACKER]) in trackers
    ]


def unmatched(first: Measured, second: Measured, trackers: Mapping[str, str] | None) -> Iterator[str]:
    """Sentences about trackers that take no part, unless None is given, and about speeds that only one run has."""
    if trackers is not None:
        for run, matched in ((first, set(trackers)), (second, set(trackers.values()))):
            for name in sorted(run.trackers - matched):
                yield f"Tracker {name} of {run.name} takes no part."
    for run, only in ((first, first.speeds - second.speeds), (second, second.speeds - first.speeds)):
        for speed in sorted(only):
            yield f"Speed {speed} is in {run.name} only."


def _with_tracker(key: Condition, tracker: str) -> Condition:
    return (*key[:_TRACKER], tracker, *key[_TRACKER + 1 :])


LEAST_OF_RATIO = 30
"""Fewest features that a ratio of a scene at an age rests on."""
LEAST_WINDOWS = 10
"""Fewest windows that a quantity of a scene rests on."""
_RASTER = "256x256"
_WINDOWS = {
    "consistent_sigma": "consistent_sigma",
    "residual_sigma": "residual_core",
    "overconfidence": "core_overconfidence",
}
_TAP = {
    "tap_delta_avg": "delta_avg",
    "tap_delta_avg_reported": "delta_avg_reported",
    "tap_average_jaccard": "average_jaccard",
    "tap_occlusion_accuracy": "occlusion_accuracy",
    "expected_feature_age": "expected_feature_age",
}


@dataclass(frozen=True, slots=True)
class RunTables:
    """What one run measured of the sequences that both runs have."""

    values: RunValues
    numbers: Mapping[str, TablesByCondition]  # tables of `NUMBERS`, by statistic and condition


def read_run(run: OpenedRun, keys: Sequence[str], scenes: Mapping[str, Sequence[str]]) -> RunTables:
    """Read the sequences that both runs have. `scenes`: names of their scenes, sorted, by dataset."""
    errors = {"population": run.settings["truth"]["population"], "trimming": str(Trimming.untrimmed)}
    entries = run.manifest.sequences.values()
    zeros = {str(entry.sequence.direction): entry.key_frame for entry in entries if entry.key_frame is not None}
    curves = run.folder.statistics(CURVES)

    def chosen(table: pl.DataFrame) -> pl.DataFrame:
        return table.filter(pl.col("n") > 0, **errors)

    def errors_by(tables: Mapping[str, TablesByCondition]) -> RunErrors:
        moments, scales = tables["moments"], tables["scales"]
        return run_errors(moments, scales, curves, errors=errors, key_frames=zeros, scenes=scenes)

    every = {name: _read(run.folder, name, keys, chosen) for name in ("moments", "scales")}
    alone = read_kind_tables(run.folder, keys, every, KINDS, chosen)
    ends, frames = (_read(run.folder, name, keys) for name in ("ends", "frames"))
    by_kind = {kind: errors_by(tables) for kind, tables in alone.items()}
    numbers = {
        "feature_count": {key: _feature_counts(table) for key, table in frames.items()},
        **_windows(run.folder, keys),
        **_point_tracking(run.folder, keys),
        **_ratios(run.folder, keys),
    }
    return RunTables(RunValues(errors_by(every), by_kind, ends, frames), numbers)


def _read(
    folder: RunFolder,
    name: str,
    keys: Sequence[str],
    reduce: Callable[[pl.DataFrame], pl.DataFrame] = lambda table: table,
) -> TablesByCondition:
    return by_condition(folder.stacked_tables(name, keys), SEQUENCE_TABLES[name], name, reduce)


def _feature_counts(frames: pl.DataFrame) -> pl.DataFrame:
    """Mean number of features per frame."""
    return _numbers(frames.group_by("scene").agg(value=pl.col("alive").mean()))


def _windows(folder: RunFolder, keys: Sequence[str]) -> dict[str, TablesByCondition]:
    """Quantities of windows of each length."""
    kept = (folder.sequence_table("window_noise", key).filter(trimming=Trimming.untrimmed) for key in keys)
    found = {
        key: scene_quantities(table).filter(pl.col("n") >= LEAST_WINDOWS).rename({"window": "at"})
        for key, table in by_condition(kept, WINDOW_NOISE, "window noise").items()
    }
    return {
        name: {key: _numbers(table.filter(quantity=quantity)) for key, table in found.items()}
        for name, quantity in _WINDOWS.items()
    }


def _ratios(folder: RunFolder, keys: Sequence[str]) -> dict[str, TablesByCondition]:
    """Ratios of sums over features of each scene, by age, where both runs have enough features."""
    entries = folder.manifest().sequences
    there = (folder.sequence_table("ratio_sums", key) for key in keys if "ratio_sums" in entries[key].sha256)
    tables = by_condition((table.filter(trimming=Trimming.untrimmed) for table in there), RATIO_SUMS, "ratio sums")
    found: dict[str, TablesByCondition] = {}
    for name in RATIOS:
        sums = {
            key: table.filter(quantity=name).group_by("scene", "at", maintain_order=True).agg(pl.col("n", "sum").sum())
            for key, table in tables.items()
        }
        found[name] = {
            key: _numbers(table.filter(pl.col("n") >= LEAST_OF_RATIO).with_columns(value=pl.col("sum") / pl.col("n")))
            for key, table in sums.items()
        }
    return found


def _point_tracking(folder: RunFolder, keys: Sequence[str]) -> dict[str, TablesByCondition]:
    """Metrics of point trackers, where the run has them."""
    entries = folder.manifest().sequences
    there = (folder.sequence_table("point_tracking", key) for key in keys if "point_tracking" in entries[key].sha256)
    tables = by_condition((table.filter(raster=_RASTER) for table in there), POINT_TRACKING, "point tracking")
    known = {name: {key: table.drop_nulls(of) for key, table in tables.items()} for name, of in _TAP.items()}
    return {
        name: {key: _numbers(table.with_columns(value=_TAP[name])) for key, table in found.items() if table.height}
        for name, found in known.items()
        if tables
    }


def _numbers(table: pl.DataFrame) -> pl.DataFrame:
    """Columns of `NUMBERS`, of a table that has a scene, a value and maybe places."""
    placed = table if "at" in table.columns else table.with_columns(at=None)
    return placed.select(pl.col(name).cast(kind) for name, kind in NUMBERS.items())


_RECOMMENDED = "consistent_sigma"
_WINDOWED = (_RECOMMENDED, "residual_sigma", "overconfidence")
_FITTED = "True positions are fitted to the tracks, so that errors are not compared."


@dataclass(frozen=True, slots=True)
class Questions:
    """What is asked about two runs."""

    asked: tuple[Asked, ...]  # all questions, statistics in the order of `ESTIMANDS`
    notes: tuple[str, ...]  # what takes no part, one sentence each
    missing: tuple[str, ...]  # those of them that are about sequences that the first run alone has measured
    expected: tuple[Compared, ...]  # conditions of the first run that the second should have


def questions(first: OpenedRun, second: OpenedRun, trackers: tuple[str, str] | None) -> Questions:
    """Read two runs and pair what they measured. `trackers`: None for those of the same name."""
    keys = require_comparable(first, second)
    scenes = _scenes(first, keys)
    tables = read_run(first, keys, scenes), read_run(second, keys, scenes)
    known, found = (
        Measured(run.name, frozenset(of.values.frames)) for run, of in zip((first, second), tables, strict=True)
    )
    matched = matched_trackers(known, found, trackers)
    fitted = any(first.manifest.sequences[key].truth == TRIANGULATED for key in keys)
    missing = (*failed_in(first, second), *left_out(first, second))
    apart = unmatched(known, found, matched if trackers is None else None)
    others = (*left_out(second, first), *_refined_apart(first, second, keys))
    notes = (*missing, *others, *apart, *([_FITTED] if fitted else []))
    groups = groups_of_scenes(first.manifest.sequences, first.settings["dataset"].get("groups"))
    pairs = [(key, other) for key, other in paired_conditions(known, matched) if other in found.conditions]
    asked = [
        Asked(_compared(second.name, pair), name, values, names, groups.of(str(pair[0][0]), names), axis, by_kind)
        for pair, names in ((pair, scenes[str(pair[0][0])]) for pair in pairs)
        for name in ESTIMANDS
        if not (fitted and name in OF_ERRORS)
        for axis, values, by_kind in _values(name, tables, pair, names)
    ]
    partners = matched if trackers else {name: matched.get(name, name) for name in known.trackers}
    expected = (_compared(second.name, pair) for pair in paired_conditions(known, partners))
    return Questions(tuple(asked), notes, missing, tuple(expected))


def _scenes(run: OpenedRun, keys: Sequence[str]) -> dict[str, list[str]]:
    """Names of the scenes of some sequences, sorted, by dataset."""
    named = [run.manifest.sequences[key].sequence for key in keys]
    scenes: dict[str, list[str]] = {}
    for dataset, scene in sorted({(one.dataset, one.scene) for one in named}):
        scenes.setdefault(dataset, []).append(scene)
    return scenes


def _compared(run: str, pair: Pair) -> Compared:
    first, second = (dict(zip(POOLED, key, strict=True)) for key in pair)
    return Compared(run=run, other_tracker=second["tracker"], **first)


_ROLES = {"core": "core", "second_moment": "second", "bias": SIGNED, "tails": "tails", "growth": "growth"}
"""Roles of the statistics of errors that have one."""
_OF_EVENTS = ("outlier_ratio", "lifetime")


def _values(
    name: str, tables: tuple[RunTables, RunTables], pair: Pair, scenes: Sequence[str]
) -> Iterator[tuple[str | None, Differences, list[Differences]]]:
    """Axis and differences of a statistic of a condition, second run minus first run, and those by each kind alone."""
    levels = [(run.values, key) for run, key in zip(tables, pair, strict=True)]
    if name in _OF_EVENTS:
        yield None, differences_of(name, levels, None, scenes).reversed(), []
    elif name not in _ROLES:
        yield from _of_numbers(name, tables, pair, scenes)
    else:
        for axis in (Axis.age,) if name == "growth" else Axis:
            if all((key, axis) in run.errors.conditions for run, key in levels):
                found, *by_kind = (
                    one.reversed()
                    for one in (
                        differences_of(_ROLES[name], levels, axis, scenes),
                        *differences_by_kind(_ROLES[name], levels, axis, scenes),
                    )
                )
                yield str(axis), found, by_kind


def _of_numbers(
    name: str, tables: tuple[RunTables, RunTables], pair: Pair, scenes: Sequence[str]
) -> Iterator[tuple[str | None, Differences, list[Differences]]]:
    """The same of numbers; nothing where a run has none."""
    first, second = (run.numbers.get(name, {}).get(key) for run, key in zip(tables, pair, strict=True))
    if first is not None and second is not None:
        both = _at_the_reported_window(first, second) if name == _RECOMMENDED else (first, second)
        found = number_differences(both, scenes, logarithms=ESTIMANDS[name].unit == Unit.ratio)
        along = Axis.frame if tables[0].values.errors.key_frames else Axis.age
        axis = "window" if name in _WINDOWED else str(along) if name in RATIOS else None
        yield axis, found.reversed(), []


def _at_the_reported_window(first: pl.DataFrame, second: pl.DataFrame) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Rows of the longest windows that findings report and enough scenes of both runs have.

    The sigma for depths depends on the length of windows, so that a mean over lengths is no sigma that anyone sets.
    """
    both = first.join(second, on=["scene", "at"]).filter(pl.col("at") <= LONGEST_WINDOW)
    counts = both.group_by("at").len()
    most = counts.select(pl.col("len").max()).item() or 0
    enough = counts.filter(pl.col("len") >= max(most / 2, min(most, MIN_SCENES))).sort("at")["at"]
    longest = pl.col("at").is_in(enough.tail(1).to_list())
    return first.filter(longest), second.filter(longest)


_KEYS = ("tolerances", "trackers", "speeds", "level", "ages", "poses")
_MOST = 1000
"""Largest tolerance."""
_RENAMED = {
    "window_sigma": "residual_sigma, its name now, or consistent_sigma, which makes depths of points right",
}
"""Former names of statistics, and what to write instead."""


def read_gate(path: Path) -> Gate:
    """Read and check a gate.

    Parameters
    ----------
    path
        A TOML file with a table ``tolerances``, and optionally ``trackers``, ``speeds``, ``level``,
        ``ages`` and ``poses``.

    Raises
    ------
    SettingsError, UnknownNameError
        If it cannot be read, or a key or value is wrong.
    """
    found = _loaded(path)
    for key in found:
        if key not in _KEYS:
            raise UnknownNameError(f"key in {path}", key, _KEYS)
    return Gate(
        _tolerances(path, found.get("tolerances", {})),
        trackers=_listed(path, found, "trackers", str),
        speeds=_listed(path, found, "speeds", int),
        level=_level(path, found.get("level", LEVEL)),
        ages=_ages(path, found.get("ages", ComparedAges.every)),
        poses=_poses(path, found.get("poses")),
    )


def _loaded(path: Path) -> Mapping[str, Any]:
    try:
        return parse_toml(read_text(path, "a file of tolerances", most=MIB))
    except DataError as error:
        raise SettingsError(f"{path}: cannot be read ({error.found}), expected TOML with tolerances") from error
    except ValueError as error:
        found, _, expected = str(error).partition(", expected ")
        kind = f"TOML with {expected}" if expected not in ("", "TOML") else "TOML"
        raise SettingsError(f"{path}: {found}, expected {kind}") from error


def _tolerances(path: Path, found: object) -> dict[str, float]:
    if not isinstance(found, dict) or not found:
        raise SettingsError(f"{path}: tolerances: found {found!r}, expected a table with at least one statistic")
    for name, value in found.items():
        if name in _RENAMED:
            raise SettingsError(f"{path}: tolerances: found the former name {name!r}, expected {_RENAMED[name]}")
        if name not in ESTIMANDS:
            raise UnknownNameError(f"statistic in {path}", name, ESTIMANDS)
        if not _is_number(value) or not 0 < value <= _MOST:
            raise SettingsError(f"{path}: tolerances.{name}: found {value!r}, expected more than 0, at most {_MOST}")
    return {name: float(value) for name, value in found.items()}


def _listed(path: Path, found: Mapping[str, Any], key: str, kind: type) -> tuple[Any, ...] | None:
    """A list of texts or whole numbers."""
    if key not in found:
        return None
    values = found[key]
    if not isinstance(values, list) or not values or not all(type(value) is kind for value in values):
        names = {str: "names", int: "whole numbers"}
        raise SettingsError(f"{path}: {key}: found {values!r}, expected a list of {names[kind]}")
    return tuple(values)


def _level(path: Path, value: object) -> float:
    if not _is_number(value) or not 0.5 <= value <= 0.99:  # type: ignore[operator]
        raise SettingsError(f"{path}: level: found {value!r}, expected a number from 0.5 to 0.99")
    return float(value)  # type: ignore[arg-type]


def _ages(path: Path, value: object) -> ComparedAges:
    if value not in list(ComparedAges):
        raise SettingsError(f"{path}: ages: found {value!r}, expected one of {', '.join(ComparedAges)}")
    return ComparedAges(str(value))


def _poses(path: Path, value: object) -> str | None:
    if value not in (None, *LEADING):
        raise SettingsError(f"{path}: poses: found {value!r}, expected one of {', '.join(LEADING)}")
    return None if value is None else str(value)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


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
    _require(others, margin, level, ages)
    _require_choices(trackers, gate)
    known, *compared = _opened([path_of("run", path) for path in (first, *others)])
    stated = known.settings.get("findings", {})
    margin = stated.get("margin", MARGIN) if margin is None else margin
    level = stated.get("level", LEVEL) if level is None else level
    found = [questions(known, run, trackers) for run in compared]
    asked = [one for part in found for one in part.asked]
    sides = tuple(
        RunSide(run.name, str(run.folder.path), differing(known, run), part.notes, TruthVerdict.of_run(run.folder))
        for run, part in zip(compared, found, strict=True)
    )
    rows = verdicts(asked, margin=margin, level=level, ages=ComparedAges(ages))
    missing = [sentence for part in found for sentence in part.missing]
    missing += [] if gate is None else [text for run in (known, *compared) for text in _unwanted_poses(run, gate)]
    expected = [condition for part in found for condition in part.expected]
    result = None if gate is None else judge(gate, asked, missing, expected)
    side = RunSide(known.name, str(known.folder.path), truth=TruthVerdict.of_run(known.folder))
    return Comparison(side, sides, tuple(rows), margin, level, ComparedAges(ages), result)


def _unwanted_poses(run: OpenedRun, gate: Gate) -> Iterator[str]:
    """A sentence about sequences of a run with other leading poses than the gate wants."""
    sequences = run.manifest.sequences
    other = [key for key, entry in sequences.items() if gate.poses not in (None, entry.leading_poses)]
    if other:
        yield f"poses of {_some(other)} in {run.name} are {sequences[other[0]].leading_poses}, not {gate.poses}"


def _require(others: Sequence[object], margin: float | None, level: float | None, ages: str) -> None:
    if not others:
        raise SettingsError("found one run to compare, expected at least two")
    if margin is not None:
        require_within("margin", margin, {"gt": 0})
    if level is not None:
        require_within("level", level, {"ge": _LEVELS[0], "le": _LEVELS[1]})
    require(ages in list(ComparedAges), "ages", ages, f"one of {', '.join(ComparedAges)}")


def _require_choices(trackers: object, gate: object) -> None:
    pair = isinstance(trackers, tuple | list) and len(trackers) == 2
    require(trackers is None or pair, "trackers", trackers, "two names: in the first run, and in the others")
    require(gate is None or isinstance(gate, Gate), "gate", gate, "what `read_gate` returns")


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
