"""What runs are compared by: a statistic, and how single scenes have values of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import polars as pl

from tracknoise.analysis.paired_tests import Family, Unit
from tracknoise.tables.enumerations import Axis


@dataclass(frozen=True, slots=True)
class RoleValues:
    """Values that `tracknoise.analysis.scene_values.differences_of` has by the role of the statistic."""

    role: str
    axes: Sequence[Axis | None] = tuple(Axis)  # that it is compared along; None for what has no axis

    @property
    def family(self) -> Family:
        """That of the role."""
        return Family.of_role(self.role)


def all_rows(first: pl.DataFrame, second: pl.DataFrame) -> Sequence[pl.DataFrame]:
    """Numbers of two runs as they are."""
    return first, second


@dataclass(frozen=True, slots=True)
class TableValues:
    """Values that are made of one table of each sequence."""

    table: str  # its name
    # makes them of the rows of a condition: columns scene, value, and at where a scene has several; None without any
    numbers: Callable[[pl.DataFrame], pl.DataFrame | None]
    rows: Mapping[str, str] = field(default_factory=dict)  # values of columns in the rows that are read
    axis: str | None = None  # what `at` is: `window`, or `age`, which is the frame where errors are zero in a key frame
    paired: Callable[[pl.DataFrame, pl.DataFrame], Sequence[pl.DataFrame]] = all_rows  # chooses numbers of two runs
    family: Family = Family.others  # of the questions about it


@dataclass(frozen=True, slots=True)
class Wording:
    """How sentences compare two runs by a statistic."""

    better: str  # what the better run is good for, or has: ``is better for depths``, ``has longer tracks``
    subject: str  # of an effect, with its verb: ``tracks live``
    more: str = "larger"
    less: str = "smaller"
    as_much: str = "large"  # after a factor: ``2.5 times as large``
    is_secondary: bool = False  # whether a conclusion names it only of a run that is better in nothing else


@dataclass(frozen=True, slots=True)
class Estimand:
    """One statistic that runs are compared by."""

    name: str  # in files
    meaning: str  # what is estimated
    values: RoleValues | TableValues  # of scenes
    wording: Wording
    unit: Unit = Unit.ratio  # of an effect
    called: str = ""  # for readers; by default the name
    larger_is_better: bool = False
    of_errors: bool = False  # whether it has no meaning where true positions are fitted to the tracks

    @property
    def title(self) -> str:
        """What it is called."""
        return self.called or self.name.replace("_", " ")


FREQUENCY = ("more frequent", "less frequent", "frequent")
"""More, less and as much, for statistics that count events."""
OVER_SCENES = "geometric mean over scenes"
OVER_ALL = f"{OVER_SCENES}, ages (or frames) and both coordinates"
"""What estimands are means over."""
