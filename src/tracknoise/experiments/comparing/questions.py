"""The questions about two runs: the paired values of every statistic of the conditions that both have."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import polars as pl

from tracknoise.experiments.comparing.comparable import OpenedRun, failed_in, left_out, require_comparable
from tracknoise.experiments.comparing.matching import Measured, Pair, matched_conditions, matched_trackers, unmatched
from tracknoise.experiments.comparing.run_tables import RunTables, read_run
from tracknoise.findings.comparison.asked import Asked
from tracknoise.findings.comparison.error_values import error_values
from tracknoise.findings.comparison.estimands import ESTIMANDS, OF_ERRORS, Unit
from tracknoise.findings.comparison.number_values import number_values
from tracknoise.findings.comparison.paired_values import PairedValues, of_differences
from tracknoise.findings.comparison.result import Compared
from tracknoise.findings.factors.scene_counts import lifetime_differences, outlier_differences
from tracknoise.findings.headlines.window_topic import LONGEST_WINDOW
from tracknoise.findings.sampling.groups_of_scenes import groups_of_scenes
from tracknoise.findings.sampling.units import MIN_SCENES
from tracknoise.sequences.sequence import TRIANGULATED
from tracknoise.statistics.definitions import POOLED

_RECOMMENDED = "consistent_sigma"
_WINDOWED = (_RECOMMENDED, "residual_sigma", "overconfidence")
_Found = tuple[str, str | None, PairedValues]
"""Name of a statistic, axis of its places, and its values."""
_FITTED = "True positions are fitted to the tracks, so that errors are not compared."


@dataclass(frozen=True, slots=True)
class Questions:
    """What is asked about two runs.

    Attributes
    ----------
    asked
        All questions, statistics in the order of `ESTIMANDS`.
    notes
        What takes no part, one sentence each.
    missing
        Those of them that are about sequences that the second run could not measure.
    """

    asked: tuple[Asked, ...]
    notes: tuple[str, ...]
    missing: tuple[str, ...]


def questions(first: OpenedRun, second: OpenedRun, trackers: tuple[str, str] | None) -> Questions:
    """Read two runs and pair what they measured.

    Parameters
    ----------
    first, second
        The runs.
    trackers
        One tracker of each; None for those of the same name.

    Raises
    ------
    SettingsError, UnknownNameError
        If they cannot be compared.
    StoreError, SchemaError
        If a file is damaged.
    """
    keys = require_comparable(first, second)
    scenes = _scenes(first, keys)
    tables = read_run(first, keys, scenes), read_run(second, keys, scenes)
    known, found = Measured(first.name, frozenset(tables[0].frames)), Measured(second.name, frozenset(tables[1].frames))
    matched = matched_trackers(known, found, trackers)
    fitted = any(first.manifest.sequences[key].truth == TRIANGULATED for key in keys)
    missing = tuple(failed_in(first, second))
    apart = unmatched(known, found, matched if trackers is None else None)
    notes = (*missing, *left_out(first, second), *apart, *([_FITTED] if fitted else []))
    groups = groups_of_scenes(first.manifest.sequences, first.settings["dataset"].get("groups"))
    pairs = matched_conditions(known, found, matched)
    asked = [
        Asked(_compared(second.name, pair), name, values, names, groups.of(str(pair[0][0]), names), axis)
        for pair, names in ((pair, scenes[str(pair[0][0])]) for pair in pairs)
        for name, axis, values in _in_order(_values(tables, pair, names))
        if not (fitted and name in OF_ERRORS)
    ]
    return Questions(tuple(asked), notes, missing)


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


def _in_order(found: Iterable[_Found]) -> list[_Found]:
    order = list(ESTIMANDS)
    return sorted(found, key=lambda item: order.index(item[0]))


def _values(tables: tuple[RunTables, RunTables], pair: Pair, scenes: Sequence[str]) -> Iterator[_Found]:
    """Name, axis and paired values of every statistic of a condition."""
    first, second = tables
    for name, axis, values in error_values((first.errors, second.errors), pair, scenes):
        yield name, str(axis), values
    frames = [second.frames[pair[1]], first.frames[pair[0]]]
    yield "outlier_ratio", None, of_differences(outlier_differences(frames, scenes))
    ends = [second.ends[pair[1]], first.ends[pair[0]]]
    yield "lifetime", None, of_differences(lifetime_differences(ends, scenes))
    for name, found in first.numbers.items():
        known, other = found.get(pair[0]), second.numbers.get(name, {}).get(pair[1])
        if known is not None and other is not None:
            if name == _RECOMMENDED:
                known, other = _at_the_reported_window(known, other)
            values = number_values(known, other, scenes, logarithms=ESTIMANDS[name].unit == Unit.ratio)
            yield name, "window" if name in _WINDOWED else None, values


def _at_the_reported_window(first: pl.DataFrame, second: pl.DataFrame) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Rows of the longest windows that findings report and enough scenes of both runs have.

    The sigma to set depends on the length of windows, so that a mean over lengths is no sigma that anyone sets.
    """
    both = first.join(second, on=["scene", "at"]).filter(pl.col("at") <= LONGEST_WINDOW)
    counts = both.group_by("at").len()
    most = counts.select(pl.col("len").max()).item() or 0
    enough = counts.filter(pl.col("len") >= max(most / 2, min(most, MIN_SCENES))).sort("at")["at"]
    longest = pl.col("at").is_in(enough.tail(1).to_list())
    return first.filter(longest), second.filter(longest)
