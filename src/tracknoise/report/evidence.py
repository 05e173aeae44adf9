"""What the report is written from: the run folder's settings, manifest and pooled tables, read once."""

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import polars as pl

from tracknoise.exceptions import StoreError
from tracknoise.report import style
from tracknoise.tables.store import STATISTICS_TABLES, Manifest, RunFolder


@dataclass(frozen=True)
class Evidence:
    """A run, as figures and sentences see it.

    Attributes
    ----------
    run
        The folder, for tables a sequence.
    manifest, settings
        Where the run stands, and its resolved experiment.
    curves, lifetimes, outliers, trims, errors, counts, summary
        Its pooled tables.
    """

    run: RunFolder
    manifest: Manifest
    settings: Mapping[str, Any]
    curves: pl.DataFrame
    lifetimes: pl.DataFrame
    outliers: pl.DataFrame
    trims: pl.DataFrame
    errors: pl.DataFrame
    counts: pl.DataFrame
    summary: pl.DataFrame

    @classmethod
    def of(cls, run: RunFolder) -> "Evidence":
        """Read a run folder.

        Raises
        ------
        StoreError, SchemaError
            If there is no run, or one of its files is missing or damaged.
        """
        tables = {name: run.statistics(name) for name in STATISTICS_TABLES}
        return cls(run=run, manifest=run.manifest(), settings=_settings(run), **tables)

    @property
    def name(self) -> str:
        """What the experiment is called."""
        return str(self.settings.get("name", self.run.path.name))

    @property
    def population(self) -> str:
        """Which observations the experiment is about: `visible`, or `projected`, the occluded too."""
        return str(self._section("truth").get("population", "visible"))

    @property
    def min_features(self) -> int:
        """Where fewer features than this remain, curves are cut."""
        return int(self._section("statistics").get("min_features", 100))

    @cached_property
    def percentile(self) -> float | None:
        """Percentile of the tracks' largest error above which they were dropped; None where none was."""
        found = self.trims["percentile"].drop_nulls().unique().to_list()
        return found[0] if found and found[0] < 100 else None

    @property
    def errors_kept(self) -> str:
        """What the errors of the kept tracks are called, at the start of a sentence."""
        return "Errors" if self.percentile is None else "Trimmed errors"

    def cuts(self, tracker: str) -> pl.DataFrame:
        """Where trimming cut a tracker's tracks, px, the median over the scenes: columns speed and cut."""
        trims = self.reference(self.trims).filter(tracker=tracker).drop_nulls("threshold_px")
        cuts = trims.group_by("speed").agg(cut=pl.col("threshold_px").median()).sort("speed")
        return cuts.clear() if self.percentile is None else cuts

    @cached_property
    def points(self) -> pl.DataFrame:
        """Curves that are not cut, features pooled, of the experiment's population; second moments as roots, px."""
        whole = (pl.col("weighting") == "features") & ~pl.col("cut")
        moments = pl.col("statistic").is_in(["Phi", "central"])
        roots = [pl.when(moments).then(pl.col(axis).sqrt()).otherwise(pl.col(axis)).alias(axis) for axis in "uv"]
        table = self.curves.filter(whole).with_columns(roots).drop_nulls(["u", "v"])
        return table.drop("uv", "weighting", "axis", "unit", "cut")

    @cached_property
    def trackers(self) -> list[str]:
        """Trackers with results, in the order in which the experiment names them."""
        configured = [entry.get("name") or entry.get("kind") for entry in self.settings.get("trackers", [])]
        return _ordered(self._measured("tracker"), configured)

    @cached_property
    def speeds(self) -> list[int]:
        """Speeds with results, ascending."""
        return sorted(self._measured("speed"))

    @cached_property
    def lightings(self) -> list[str]:
        """Lightings with results, in the order in which the experiment names them, or else by name."""
        return _ordered(sorted(self._measured("lighting")), self._section("dataset").get("lightings") or [])

    @cached_property
    def rotations(self) -> list[int]:
        """Image rotations with results, ascending."""
        return sorted(self._measured("rotation"))

    @property
    def slowest(self) -> int:
        """The lowest speed: 1 is the nominal sequence."""
        return self.speeds[0] if self.speeds else 1

    @cached_property
    def colour(self) -> dict[str, str]:
        """Colour of each tracker."""
        return dict(zip(self.trackers, style.colours(self.trackers), strict=True))

    def place(self, tracker: str) -> int:
        """Position of a tracker in every list of trackers."""
        return self.trackers.index(tracker)

    def slug(self, tracker: str) -> str:
        """A tracker's name as part of a file name, different for different trackers."""
        slugs = [re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-") or "tracker" for name in self.trackers]
        place = self.place(tracker)
        return slugs[place] if slugs.count(slugs[place]) == 1 else f"{slugs[place]}-{place + 1}"

    def speed_colours(self, tracker: str) -> dict[str, str]:
        """Shade of each speed of a tracker, by the speed's label."""
        shades = style.shades(self.colour[tracker], len(self.speeds))
        return dict(zip(map(str, self.speeds), shades, strict=True))

    def reference(self, table: pl.DataFrame) -> pl.DataFrame:
        """Rows under the first lighting and the first rotation."""
        if not self.lightings:
            return table.clear()
        lighting, rotation = self.lightings[0], self.rotations[0]
        return table.filter((pl.col("lighting") == lighting) & (pl.col("rotation") == rotation))

    def nominal(self, table: pl.DataFrame) -> pl.DataFrame:
        """Rows under the first lighting and rotation at the lowest speed."""
        return self.reference(table).filter(pl.col("speed") == self.slowest)

    @property
    def where(self) -> str:
        """Which of several lightings or rotations `reference` stands for; empty where there is no choice."""
        parts = [f"under lighting {self.lightings[0]}"] if len(self.lightings) > 1 else []
        parts += [f"at rotation {self.rotations[0]}°"] if len(self.rotations) > 1 else []
        return "".join(f" {part}" for part in parts)

    def _section(self, name: str) -> Mapping[str, Any]:
        section: Mapping[str, Any] = self.settings.get(name, {})
        return section

    def _measured(self, column: str) -> list[Any]:
        tables = (self.counts, self.outliers, self.lifetimes, self.curves)
        return list(dict.fromkeys(value for table in tables for value in table[column].unique().sort().to_list()))


def _settings(run: RunFolder) -> dict[str, Any]:
    try:
        return tomllib.loads(run.experiment_toml())
    except tomllib.TOMLDecodeError as error:
        place = run.path / "experiment.toml"
        raise StoreError(f"{place}: damaged ({error}), expected the settings of a run") from error


def _ordered(present: list[Any], wanted: Iterable[Any]) -> list[Any]:
    """`present`, in the order of `wanted`; what is not among them comes last."""
    first = [name for name in dict.fromkeys(wanted) if name in present]
    return first + [name for name in present if name not in first]
