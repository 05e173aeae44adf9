"""The data of a report: those of a run, and how the report draws them."""

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import polars as pl

from tracknoise.report import paper, style
from tracknoise.tables.identity import identifiers
from tracknoise.tables.store import FINDINGS_JSON, RunFolder
from tracknoise.text import absolute_paths, without_folders
from tracknoise.topics.catalogue import RUN_TABLES, results_about
from tracknoise.topics.run_data import RunData

_FIXED = ("by-lighting",)
"""How ids of figures of all trackers end that begin as those of single trackers."""


@dataclass(frozen=True)
class ReportData(RunData):
    """What figures, tables and sentences of a report are made of."""

    @classmethod
    def of(cls, run: RunFolder) -> "Self":
        """Read a run folder.

        Raises
        ------
        StoreError, SchemaError
            If there is no run, or one of its files is missing or damaged.
        """
        tables = {name: run.statistics(table) for name, table in RUN_TABLES.items()}
        run.document(FINDINGS_JSON)  # the same findings for other programs, which must not be damaged either
        return cls(run, run.manifest(), run.settings(), tables)

    def results(self, ids: Collection[str]) -> pl.DataFrame:
        """Rows of the table of results, which is made of the tables."""
        return results_about({table: self[name] for name, table in RUN_TABLES.items() if table.rows}, self.truth, ids)

    def shown(self, settings: Any) -> Any:
        """Settings, or a text about data, without the folders of the machine (`tracknoise.text.without_folders`)."""
        return without_folders(settings, self._paths)

    @cached_property
    def _paths(self) -> list[str]:
        return absolute_paths(self.settings)

    @cached_property
    def colour(self) -> dict[str, str]:
        """Colour of each tracker."""
        return dict(zip(self.trackers, style.colours(self.trackers), strict=True))

    def slug(self, tracker: str) -> str:
        """A tracker's name as part of a file name. Different trackers have different ones."""
        return self._slugs[tracker]

    @cached_property
    def _slugs(self) -> dict[str, str]:
        return identifiers(self.trackers, taken=_FIXED)

    def speed_colours(self, tracker: str) -> dict[str, str]:
        """Colour of each speed of a tracker, by the speed's label. A few speeds are shades of the tracker's colour."""
        colours = style.levels(self.colour[tracker], len(self.speeds))
        return dict(zip(map(str, self.speeds), colours, strict=True))

    @cached_property
    def comparison(self) -> pl.DataFrame:
        """Verdicts on factors with those of the paper (`tracknoise.report.paper.COMPARISON`).

        Those on errors are left out where true positions are fitted to the tracks.
        """
        entries = self.settings.get("trackers", [])
        kinds = {entry.get("name") or entry.get("kind"): str(entry.get("kind", "")) for entry in entries}
        trackers = {name: kinds.get(name, "") for name in self.trackers}
        asked = paper.Asked(self.settings.get("paper"), trackers, self.slowest)
        effects = self["effects"].filter(pl.col("axis").is_null()) if self.truth_is_fitted else self["effects"]
        return paper.compare(effects, self["dependence"], asked)
