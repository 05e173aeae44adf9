"""Options of trackers as factors: trackers of one kind that differ in exactly one option.

The difference between two such trackers is the effect of that option, such as the detector. Trackers that differ in
several options are compared as trackers only.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from tracknoise.findings.factors.questions import Cell
from tracknoise.statistics.conditions import Condition

Options = Mapping[str, object]


@dataclass(frozen=True, slots=True)
class OptionFactor:
    """An option in which alone some trackers differ.

    Attributes
    ----------
    name
        Of the option; those of nested settings with a dot, such as ``detection.detector``.
    of
        Kind of the trackers. Where the same option varies among several sets of trackers of this kind, their names.
    levels
        Name of the tracker with each value of the option, in the order of the trackers.
    """

    name: str
    of: str
    levels: Mapping[str, str]


def option_factors(trackers: Mapping[str, tuple[str, Options]]) -> list[OptionFactor]:
    """The options in which alone trackers differ, sorted by name.

    Parameters
    ----------
    trackers
        Kind and options by the name of each tracker. All options are given, also those that have their defaults.
    """
    flat = {name: (kind, dict(_flat(options))) for name, (kind, options) in trackers.items()}
    paths = sorted({path for _, options in flat.values() for path in options})
    return [factor for path in paths for factor in _varied(path, flat)]


def _flat(options: Options, within: str = "") -> Iterator[tuple[str, str]]:
    """Values as text by the dotted names of their options."""
    for name, value in options.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{within}{name}.")
        else:
            yield f"{within}{name}", str(value)


def _varied(path: str, trackers: Mapping[str, tuple[str, dict[str, str]]]) -> list[OptionFactor]:
    """Sets of trackers that differ in an option alone."""
    alike = defaultdict[tuple[str, tuple[tuple[str, str], ...]], dict[str, str]](dict)
    for tracker, (kind, options) in trackers.items():
        others = tuple(sorted((name, value) for name, value in options.items() if name != path))
        alike[kind, others].setdefault(options.get(path, "none"), tracker)
    found = [(kind, levels) for (kind, _), levels in alike.items() if len(levels) > 1]
    kinds = [kind for kind, _ in found]
    return [
        OptionFactor(path, kind if kinds.count(kind) == 1 else ", ".join(levels.values()), levels)
        for kind, levels in found
    ]


def option_cells(cells: Iterable[Cell], factors: Sequence[OptionFactor]) -> Iterator[Cell]:
    """The cells about options: those about trackers, of the trackers that differ in one option alone.

    Parameters
    ----------
    cells
        All cells.
    factors
        The options.
    """
    for cell in cells:
        for factor in factors if cell.factor == "tracker" else ():
            known = {value: name for value, name in factor.levels.items() if name in cell.levels}
            levels: dict[object, Condition] = {value: cell.levels[name] for value, name in known.items()}
            if len(levels) > 1:
                held = {**cell.held, "tracker": factor.of}
                yield Cell(factor.name, held, cell.axis, levels, cell.statistics)
