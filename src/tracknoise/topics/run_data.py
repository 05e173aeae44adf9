"""Settings, manifest and tables of a run, read once, and the view of it that is shown."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import polars as pl

from tracknoise.statistics.definitions import dropped_above, lightings_in_order
from tracknoise.statistics.truth_errors import FLOOR_COLUMNS, with_floor
from tracknoise.statistics.yardstick import ReferenceCondition
from tracknoise.tables.defaults import MARGIN
from tracknoise.tables.enumerations import Aspect, Trimming, Weighting
from tracknoise.tables.findings_schema import CURVES
from tracknoise.tables.manifest import Manifest, SequenceEntry
from tracknoise.tables.schema import VIEW
from tracknoise.tables.store import RunFolder
from tracknoise.tables.trust import AssessedTruth, TruthVerdict
from tracknoise.tables.truth_audit import AuditTables
from tracknoise.topics.bands import AGE, BOUNDS, FRAME, Axis, of_scalar, with_bounds
from tracknoise.topics.headline import ReportedConditions, intervals_of
from tracknoise.truth_faults.check_change import truth_change
from tracknoise.words import view_text

MOST_CONDITIONS = 40
"""More conditions than this are not all listed on the page."""
_DIRECTIONS = ("forward", "backward")


@dataclass(frozen=True)
class RunData:
    """What sentences, figures and tables of a run are made of.

    Attributes
    ----------
    run
        The run folder, which has the tables of single sequences.
    manifest, settings
        State of the run, and its resolved experiment.
    tables
        Tables of the run by their names. Those of an analysis that was not made have no rows.
    """

    run: RunFolder
    manifest: Manifest
    settings: Mapping[str, Any]
    tables: Mapping[str, pl.DataFrame]

    def __getitem__(self, name: str) -> pl.DataFrame:
        return self.tables[name]

    def with_tables(self, **tables: pl.DataFrame) -> Self:
        """The same data with other tables in place of some of the run."""
        return replace(self, tables={**self.tables, **tables})

    @cached_property
    def assessed_truth(self) -> AssessedTruth:
        """The verdict on the truth, and what it rests on."""
        return AssessedTruth.of(self.tables)

    @cached_property
    def truth(self) -> TruthVerdict:
        """The verdict on the truth."""
        return self.assessed_truth.verdict

    @cached_property
    def audit(self) -> AuditTables:
        """What the audit of the truth says."""
        return AuditTables.of(self.tables)

    @property
    def intervals(self) -> pl.DataFrame:
        """Intervals of all numbers."""
        return intervals_of(self.tables)

    def with_bounds_of(self, table: pl.DataFrame, statistic: str) -> pl.DataFrame:
        """A table of conditions with the bounds of one number of each (`tracknoise.topics.bands.of_scalar`)."""
        return of_scalar(table, self.intervals, statistic)

    @property
    def truth_change(self) -> str | None:
        """What the run changed in the verdict of a check, and why; None where it knows of no check."""
        return truth_change(self.run, self.assessed_truth)

    @property
    def name(self) -> str:
        """Name of the experiment."""
        return str(self.settings["name"])

    @property
    def population(self) -> str:
        """Which observations the experiment is about: `visible`, or `projected`, which includes the occluded."""
        return str(self.settings["truth"]["population"])

    @property
    def keeps_observations(self) -> bool:
        """Whether the run folder keeps single observations and tracks, or only statistics."""
        return bool(self.settings["keep"] == "observations")

    @property
    def estimator(self) -> str:
        """Name of the estimator that the experiment asks what to set in."""
        return str(self.settings.get("estimator", {}).get("name", "filter"))

    @property
    def margin(self) -> float:
        """Relative effect above which a factor counts."""
        margins = self["effects"]["margin"].drop_nulls()
        return float(margins.item(0)) if margins.len() else MARGIN

    @property
    def min_features(self) -> int:
        """Curves are cut where fewer features than this remain."""
        return int(self.settings["statistics"]["min_features"])

    @cached_property
    def percentile(self) -> float | None:
        """Percentile of the tracks' largest error above which tracks were dropped. None where none were."""
        return dropped_above(self["trims"])

    @property
    def truth_is_fitted(self) -> bool:
        """Whether any true positions were fitted to the tracks themselves."""
        return any(entry.truth_is_fitted for entry in self.manifest.sequences.values())

    @property
    def trimming(self) -> Trimming:
        """Errors that figures and verdicts are about: untrimmed, or trimmed as in the paper."""
        return Trimming(self.settings["findings"]["trimming"])

    @property
    def trimmings(self) -> tuple[Trimming, ...]:
        """Before trimming, and after it if it dropped any track."""
        return (Trimming.untrimmed,) if self.percentile is None else (Trimming.untrimmed, Trimming.trimmed)

    @property
    def errors_shown(self) -> str:
        """Name of the errors that figures and verdicts are about, at the start of a sentence."""
        return "Errors" if self.percentile is None else f"{self.trimming.capitalize()} errors"

    @property
    def tracks_shown(self) -> str:
        """Name of the tracks that these errors are of."""
        if self.percentile is None:
            return "all tracks (nothing was trimmed in this run)"
        return "the tracks that trimming kept" if self.trimming == Trimming.trimmed else "all tracks"

    def cuts(self, tracker: str) -> pl.DataFrame:
        """Error above which trimming drops a tracker's tracks, px, as median over scenes: columns speed and cut."""
        trims = self.reference(self["trims"]).filter(tracker=tracker).drop_nulls("threshold_px")
        cuts = trims.group_by("speed").agg(cut=pl.col("threshold_px").median()).sort("speed")
        return cuts.clear() if self.percentile is None else cuts

    @cached_property
    def axis(self) -> Axis:
        """Axis of the curves: frames where every sequence has a key frame, otherwise ages."""
        entries = self.manifest.sequences.values()
        return FRAME if entries and all(entry.key_frame is not None for entry in entries) else AGE

    @cached_property
    def points(self) -> pl.DataFrame:
        """Points of the curves that are not cut, features pooled. Second moments are roots, px.

        Columns u_low, u_high, v_low and v_high hold the bounds. Columns level, resampled and n_resampled hold their
        kind (`tracknoise.topics.bands`). All are null where a point has no interval. Columns floor_u and floor_v hold
        the truth floor (`tracknoise.statistics.truth_errors.with_floor`), second moments as roots, px. Column `role`
        names the statistic on either axis: mean, absolute, second or central. Column `since` holds the distance from
        where errors are zero by construction, in frames of the sequence.
        """
        return pl.concat([self._points_of(self["curves"]), self._core_points])

    @cached_property
    def _core_points(self) -> pl.DataFrame:
        """Rows of `points` with the robust scale, whose role is core: geometric means over scenes."""
        labels = {"statistic": "core", "weighting": Weighting.geometric, "unit": "px"}
        values = {"u": pl.col("core_u_px"), "v": pl.col("core_v_px"), "uv": pl.lit(None, dtype=pl.Float64)}
        values |= {name: pl.max_horizontal(f"{name}_u", f"{name}_v") for name in ("n", "n_scenes")}
        table = (
            self["cores"]
            .with_columns(**{name: pl.lit(value, dtype=CURVES[name]) for name, value in labels.items()}, **values)
            .select(list(CURVES))
        )
        return self._rooted(table.filter(~pl.col("cut")), {"core": "core"})

    @cached_property
    def aspect_points(self) -> pl.DataFrame:
        """The same for every aspect (column `aspect`), of visible features. Here u is along and v across its axis."""
        points = self._points_of(self["aspect_curves"])
        in_image = pl.when(pl.col("aspect") == Aspect.long_lived)  # the floor is known in u and v only
        return points.with_columns(in_image.then(pl.col(name)).alias(name) for name in FLOOR_COLUMNS)

    def _points_of(self, curves: pl.DataFrame) -> pl.DataFrame:
        is_shown = (pl.col("weighting") == "features") & (pl.col("axis") == self.axis.name) & ~pl.col("cut")
        return self._rooted(curves.filter(is_shown), self.axis.roles)

    def _rooted(self, curves: pl.DataFrame, roles: Mapping[str, str]) -> pl.DataFrame:
        """Curves with bounds and roles, px."""
        table = with_floor(with_bounds(curves, self.intervals), self["floor"]).with_columns(
            role=pl.col("statistic").replace_strict(roles, return_dtype=pl.String)
        )
        moments = pl.col("role").is_in(["second", "central"])
        lengths = pl.col("u", "v", *BOUNDS, *FLOOR_COLUMNS)
        roots = pl.when(moments).then(lengths.clip(lower_bound=0.0).sqrt()).otherwise(lengths)
        table = table.with_columns(roots, since=pl.col("at").cast(pl.Int64) - self._zero).drop_nulls(["u", "v"])
        return table.drop("uv", "weighting", "axis", "statistic", "unit", "cut")

    def key_frame(self, direction: str) -> int | None:
        """Key frame of sequences played in a direction. None where curves run along ages."""
        entries = [entry for entry in self.manifest.sequences.values() if entry.sequence.direction == direction]
        frames = [entry.key_frame for entry in entries if entry.key_frame is not None]
        return max(frames, default=0) if self.axis is FRAME else None

    def since_zero(self, at: int) -> int:
        """Distance of an age or a frame of the `view` from where errors are zero, in frames of the sequence."""
        return at - (self.key_frame(self.view["direction"]) or 0)

    @property
    def _zero(self) -> pl.Expr:
        """Where the errors of a curve are zero by construction."""
        zeros = {direction: self.key_frame(direction) or 0 for direction in self.directions}
        return pl.col("direction").replace_strict(zeros, return_dtype=pl.Int64)

    @cached_property
    def trackers(self) -> list[str]:
        """Trackers with results, in the order in which the experiment names them."""
        configured = [entry.get("name") or entry["kind"] for entry in self.settings["trackers"]]
        return _ordered(self._measured("tracker"), configured)

    @cached_property
    def speeds(self) -> list[int]:
        """Speeds with results, ascending."""
        return sorted(self._measured("speed"))

    @cached_property
    def lightings(self) -> list[str]:
        """Lightings with results, in the order in which the experiment names them, or else by name, diffuse first."""
        return lightings_in_order(self._measured("lighting"), self.settings["dataset"].get("lightings"))

    @cached_property
    def rotations(self) -> list[int]:
        """Image rotations with results, ascending."""
        return sorted(self._measured("rotation"))

    @cached_property
    def directions(self) -> list[str]:
        """Directions of play with results, forward first."""
        return _ordered(self._measured("direction"), _DIRECTIONS)

    @cached_property
    def cameras(self) -> list[str]:
        """Cameras with results, by name."""
        return sorted(self._measured("camera"))

    @cached_property
    def view(self) -> dict[str, Any]:
        """The view that figures show unless they compare views: lighting, rotation, direction and camera.

        It is the first lighting, upright and forward, of the first camera, if there is such a view. Otherwise it is the
        nearest to it, in this order: played forward, least rotation, first lighting, first camera.
        """
        parts = [table.select(*VIEW) for table in (self["counts"], self["outliers"], self["lifetimes"], self["curves"])]
        views = pl.concat(parts).unique().to_dicts()
        return min(views, key=self._remoteness, default=dict.fromkeys(VIEW))

    @property
    def slowest(self) -> int:
        """The lowest speed: 1 is the nominal sequence."""
        return self.speeds[0] if self.speeds else 1

    @property
    def tracker_place(self) -> pl.Expr:
        """Position of the tracker of a row in every list of trackers; others come last."""
        order = {name: place for place, name in enumerate(self.trackers)}
        return pl.col("tracker").replace_strict(order, return_dtype=pl.Int64, default=len(order))

    def conditions(self, speed: int | None = None) -> ReportedConditions:
        """Every tracker at a speed, by default the lowest, in the `view`."""
        frames = {name: frame for name in self.directions if (frame := self.key_frame(name)) is not None}
        at = ReferenceCondition(**self.view, speed=self.slowest if speed is None else speed, key_frames=frames)
        return ReportedConditions(
            at, self.trackers, self.population, self.percentile, fitted=self.truth_is_fitted, trimming=self.trimming
        )

    def place(self, tracker: str) -> int:
        """Position of a tracker in every list of trackers."""
        return self.trackers.index(tracker)

    def reference(self, table: pl.DataFrame) -> pl.DataFrame:
        """Rows of the `view`."""
        return self.across(table, "")

    def nominal(self, table: pl.DataFrame) -> pl.DataFrame:
        """Rows of the `view` at the lowest speed."""
        return self.reference(table).filter(pl.col("speed") == self.slowest)

    def across(self, table: pl.DataFrame, factor: str) -> pl.DataFrame:
        """Rows of every lighting, rotation, direction or camera, as `factor` names, and otherwise of the `view`."""
        if not self.lightings:
            return table.clear()
        return table.filter(*(pl.col(name) == value for name, value in self.view.items() if name != factor))

    @property
    def sequences(self) -> dict[str, SequenceEntry]:
        """Measured sequences of the `view`, by key."""
        entries = sorted(self.manifest.sequences.items())
        return {
            key: entry for key, entry in entries if {name: getattr(entry.sequence, name) for name in VIEW} == self.view
        }

    @property
    def where(self) -> str:
        """Lighting, rotation, direction and camera of the `view`, where there are several. Empty otherwise."""
        return self.elsewhere("")

    def elsewhere(self, factor: str) -> str:
        """As `where`, without the factor that a figure or table compares."""
        return view_text(self.view, [name for name in self.varied if name != factor])

    @property
    def varied(self) -> dict[str, list[Any]]:
        """Values of those parts of the view that have several: lighting, rotation, direction, camera."""
        parts: dict[str, list[Any]] = {
            "lighting": self.lightings,
            "rotation": self.rotations,
            "direction": self.directions,
            "camera": self.cameras,
        }
        return {name: values for name, values in parts.items() if len(values) > 1}

    @property
    def condition_columns(self) -> dict[str, str]:
        """Headings of the columns that distinguish the listed conditions, by their names."""
        if self.is_large:
            return {"tracker": "tracker", "speed": "speed"}
        varied = {name: "rotation (°)" if name == "rotation" else name for name in self.varied}
        return {"tracker": "tracker", "speed": "speed", **varied}

    def in_order(self, table: pl.DataFrame) -> pl.DataFrame:
        """Sort conditions by tracker, speed, lighting, rotation, direction and camera, as in the experiment."""
        order = {"tracker": self.trackers, "lighting": self.lightings, "direction": self.directions}
        keys = [
            pl.col(name).replace_strict(list(order[name]), range(len(order[name])), return_dtype=pl.Int64)
            if name in order
            else pl.col(name)
            for name in ("tracker", "speed", "lighting", "rotation", "direction", "camera")
            if name in table.columns
        ]
        return table.sort(keys)

    @cached_property
    def is_large(self) -> bool:
        """Whether there are too many conditions for a table of all of them."""
        return self["summary"].height > MOST_CONDITIONS

    def listed(self, table: pl.DataFrame) -> pl.DataFrame:
        """Rows of the conditions that the page lists: all, or those of the `view` where there are too many."""
        return self.reference(table) if self.is_large else table

    def _remoteness(self, view: Mapping[str, Any]) -> tuple[int, int, int, str]:
        direction, lighting = self.directions.index(view["direction"]), self.lightings.index(view["lighting"])
        return direction, view["rotation"], lighting, view["camera"]

    def _measured(self, column: str) -> list[Any]:
        tables = (self["counts"], self["outliers"], self["lifetimes"], self["curves"])
        return list(dict.fromkeys(value for table in tables for value in table[column].unique().sort().to_list()))


def _ordered(present: list[Any], wanted: Iterable[Any]) -> list[Any]:
    """`present`, in the order of `wanted`; what is not among them comes last."""
    first = [name for name in dict.fromkeys(wanted) if name in present]
    return first + [name for name in present if name not in first]
