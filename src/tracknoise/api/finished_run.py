"""A finished run, read from its folder, and rows of its tables by the values of columns.

- Choose rows of a table by the values of its columns.
"""

from collections.abc import Collection, Iterable, Mapping
from functools import cached_property
from numbers import Real
from pathlib import Path
from types import EllipsisType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypedDict, Unpack, get_args

import polars as pl

from tracknoise.checks import path_of, require, require_whole
from tracknoise.exceptions import DataError, SettingsError, StoreError, UnknownNameError
from tracknoise.tables.findings_schema import INTERVALS, OUTLIERS, SUMMARY
from tracknoise.tables.main_columns import main_columns
from tracknoise.tables.schema import ORIGIN, SEQUENCE, Schema, joined
from tracknoise.tables.store import SEQUENCE_TABLES, RunFolder
from tracknoise.tables.trust import TruthVerdict
from tracknoise.tables.truth_audit import AuditTables
from tracknoise.text import counted
from tracknoise.topics.catalogue import RUN_TABLES, run_results
from tracknoise.topics.headlines import read_findings

if TYPE_CHECKING:
    from tracknoise.api.sigma_to_set import SigmaToSet
    from tracknoise.report.charts import Chart, Charts


Names: TypeAlias = str | Collection[str] | EllipsisType
"""One name or several; ``...`` for all."""
Numbers: TypeAlias = int | Collection[int] | EllipsisType
"""One whole number or several; ``...`` for all."""
Wanted: TypeAlias = str | float | Collection[str | float | None] | None
"""One value, or several; None means a missing value."""
Columns: TypeAlias = Literal["main", "all"]
"""Which columns of results are returned."""


class ViewColumns(TypedDict, total=False):
    """Columns by which views of a scene are chosen; a column that is not given is not restricted."""

    lighting: Names
    rotation: Numbers
    direction: Names


class IntervalColumns(ViewColumns, total=False):
    """Further columns of the table of intervals: see `tracknoise.tables.findings_schema.INTERVALS`."""

    camera: Names
    aspect: Names
    axis: Names | None


class ResultColumns(ViewColumns, total=False):
    """Further columns of the table of results: see `tracknoise.tables.results.IDENTITY`."""

    id: Names
    topic: Names
    camera: Names
    factor: Names | None
    part: Names | None
    aspect: Names | None
    weighting: Names | None


def findings_about(run: RunFolder, findings: pl.DataFrame, tracker: str) -> pl.DataFrame:
    """Findings of a run that have a part about a tracker, with the text and the numbers of these parts.

    `findings`: schema `FINDINGS`.
    """
    about = [
        (row, [part for part in row["parts"] if part["tracker"] == tracker]) for row in findings.iter_rows(named=True)
    ]
    cited = {name for _, parts in about for part in parts for name in part["rows"]}
    numbers = {row["id"]: row for row in run_results(run, cited).iter_rows(named=True)}
    rows = []
    for row, parts in about:
        if not parts:
            continue
        ids = [name for part in parts for name in part["rows"]]
        first = row if row["rows"][:1] == ids[:1] else numbers.get(ids[0], {}) if ids else {}
        estimate = {name: first.get(name) for name in ("value", "low", "high", "unit")}
        text = " ".join(filter(None, [row["opening"], *(part["text"] for part in parts), row["closing"]]))
        rows.append({**row, **estimate, "text": text, "rows": ids, "parts": parts, "brief": ""})
    return pl.DataFrame(rows, schema=findings.schema)


def select(table: pl.DataFrame, wanted: Mapping[str, Any]) -> pl.DataFrame:
    """Rows that have the wanted values, in their order.

    Parameters
    ----------
    table
        Any table.
    wanted
        One value or several, by column.

    Raises
    ------
    UnknownNameError
        If there is no such column, or the column is one of names and does not have such a name.
    SettingsError
        If a column holds numbers or truth values, and a value is none.
    """
    for column, value in wanted.items():
        _require_type(column, _listed(value), table.schema.get(column))
        _require_known(table, column, _listed(value))
        table = filtered(table, {column: value})
    return table


def filtered(table: pl.DataFrame, wanted: Mapping[str, Any]) -> pl.DataFrame:
    """The same as `select`, without the check of names."""
    for column, value in wanted.items():
        if column not in table.columns:
            raise UnknownNameError("column", column, table.columns)
        values = pl.Series(_listed(value), dtype=pl.Float64) if table.schema[column].is_float() else _listed(value)
        table = table.filter(pl.col(column).is_in(values, nulls_equal=True))
    return table


def _listed(value: Wanted) -> list[str | float | None]:
    return list(value) if isinstance(value, Collection) and not isinstance(value, str) else [value]


def _require_known(table: pl.DataFrame, column: str, values: list[str | float | None]) -> None:
    names = _names(table, column)
    for value in values:
        if names is not None and value not in names:
            raise UnknownNameError(column, value, [name for name in names if name is not None])


def _require_type(column: str, values: Iterable[object], kind: pl.DataType | None) -> None:
    """Refuse values that polars cannot compare with the numbers or truth values of a column."""
    if kind is None:
        return
    for value in (candidate for candidate in values if candidate is not None):
        if kind.is_integer():
            require_whole(column, value)
        elif kind.is_float():
            require(isinstance(value, Real) and not isinstance(value, bool), column, value, "a number")
        elif kind == pl.Boolean:
            require(isinstance(value, bool), column, value, "True or False")


def _names(table: pl.DataFrame, column: str) -> list[Any] | None:
    """Which names a column can have; None where it holds no names, or is not there."""
    kind = table.schema.get(column)
    if isinstance(kind, pl.Enum):
        return [*kind.categories, None]
    return table[column].unique().to_list() if kind == pl.String or (kind and column in ORIGIN) else None


SEQUENCES: Schema = {
    "sequence": pl.String,
    **SEQUENCE,
    "camera": pl.String,
    "n_frames": pl.Int64,
    "width": pl.Int64,
    "height": pl.Int64,
    "truth": pl.String,
    "key_frame": pl.Int64,
    "notes": pl.List(pl.String),
}
"""One row per measured sequence: its key, its name, count and size (px) of its images, and the kind of its truth.

camera is empty where there is only one. key_frame is null where truth is not a scan. notes are what its reader
corrected or assumed, and what its trackers state.
"""
FAILURES: Schema = {"sequence": pl.String, "cause": pl.String}
"""One row per sequence that could not be measured."""
_IDENTITY = (*SEQUENCE, "camera")
_CONDITION = ("tracker", "speed")


def open_run(path: str | Path) -> "Run":
    """Open a finished run.

    Parameters
    ----------
    path
        Folder of the run.

    Raises
    ------
    SettingsError
        If `path` is no path.
    StoreError
        If there is no run, it is not finished, or it is damaged.
    """
    folder = RunFolder(path_of("run", path))
    if not folder.exists:
        raise StoreError(f"{path}: no run found, expected the folder of a finished run")
    folder.statistics(SUMMARY)
    return Run(folder)


class Run:
    """A finished run: its findings, intervals, figures and tables.

    Tables are polars data frames. They are read when they are asked for. Made by `open_run` and `analyse`.

    Parameters
    ----------
    folder
        Of a finished run.
    """

    def __init__(self, folder: RunFolder) -> None:
        self._folder = folder

    def __repr__(self) -> str:
        trackers = ", ".join(self._conditions["tracker"].unique(maintain_order=True))
        speeds = ", ".join(map(str, self._conditions["speed"].unique().sort()))
        manifest = self._folder.manifest()
        failed = f"; failed: {len(manifest.failures)}" if manifest.failures else ""
        counts = f"sequences: {len(manifest.sequences)}{failed}"
        return f"<Run {self.path}; {counts}; trackers: {trackers}; speeds: {speeds}>"

    def _repr_html_(self) -> str:
        """The cards of its trackers, which notebooks show."""
        from tracknoise.report.answer import run_html
        from tracknoise.report.report_data import ReportData

        return run_html(ReportData.of(self._folder))

    @property
    def path(self) -> Path:
        """The folder of the run."""
        return self._folder.path

    def sequences(self) -> pl.DataFrame:
        """List what was measured.

        Returns
        -------
        polars.DataFrame
            One row per sequence; columns are those of `SEQUENCES`.
        """
        entries = sorted(self._folder.manifest().sequences.items())
        rows = [
            (
                key,
                *(
                    getattr(entry.sequence if name in _IDENTITY else entry, name)
                    for name in SEQUENCES
                    if name != "sequence"
                ),
            )
            for key, entry in entries
        ]
        return pl.DataFrame(rows, schema=dict(SEQUENCES), orient="row")

    def failures(self) -> pl.DataFrame:
        """List the sequences that could not be measured, with the cause; no result includes them."""
        return pl.DataFrame(sorted(self._folder.manifest().failures.items()), schema=dict(FAILURES), orient="row")

    def results(
        self,
        *,
        quantity: Names = ...,
        tracker: Names = ...,
        speed: Numbers = ...,
        axis: Names | None = ...,
        at: Numbers | None = ...,
        coordinate: Names | None = ...,
        population: Names | None = ...,
        trimming: Names | None = ...,
        columns: Columns = "main",
        **others: Unpack[ResultColumns],
    ) -> pl.DataFrame:
        """Return the table of results: one row per number, with its interval and what it is of.

        For example ``run.results(quantity="sigma", tracker="lucas-kanade")``.

        Parameters
        ----------
        quantity, tracker, speed, axis, at, coordinate, population, trimming
            Only rows that have these values: one value or several, None for a missing value.
        columns
            "main": the twelve of `tracknoise.tables.main_columns.MAIN`, in which no two rows are alike. "all": those of
            `tracknoise.tables.results.RESULTS`.
        **others
            As the first: factor, part, aspect, weighting, topic, id, lighting, rotation, direction, camera.

        Returns
        -------
        polars.DataFrame
            Quantities are described in `tracknoise.topics.catalogue.EVERY_QUANTITY`.

        Raises
        ------
        UnknownNameError
            If a name is not among those of the run.
        StoreError
            If an earlier version made the run.
        """
        if columns not in get_args(Columns):
            raise UnknownNameError("choice of columns", columns, get_args(Columns))
        wanted = _given(
            quantity=quantity,
            tracker=tracker,
            speed=speed,
            axis=axis,
            at=at,
            coordinate=coordinate,
            population=population,
            trimming=trimming,
            **others,
        )
        results = run_results(self._folder)
        rows = select(results, wanted)
        return main_columns(rows, results) if columns == "main" else rows

    def findings(self, tracker: str | None = None) -> pl.DataFrame:
        """Return the findings, the most important first.

        Parameters
        ----------
        tracker
            Only findings that are about this tracker, in the sentences about it; by default all.

        Returns
        -------
        polars.DataFrame
            Columns rank, topic, text, figure, table, value, low, high, unit, rows, brief, opening, closing and parts:
            see `tracknoise.tables.findings_schema.FINDINGS`. `rows` are the ids of the rows of `results` whose numbers
            the text has; value, low and high are those of the first.

        Raises
        ------
        StoreError
            If the run has no findings, because an earlier version made it.
        UnknownNameError
            If the run has no such tracker.
        """
        findings = read_findings(self._folder)
        if tracker is None:
            return findings
        trackers = self._conditions["tracker"].unique(maintain_order=True).to_list()
        if tracker not in trackers:
            raise UnknownNameError("tracker", tracker, trackers)
        return findings_about(self._folder, findings, tracker)

    def sigma(
        self, estimator: str, *, window: int | None = None, features: int | None = None
    ) -> "dict[str, SigmaToSet]":
        """Say what to set in an estimator: the same numbers as its findings and ``export --to text``.

        For example ``run.sigma("openvins")["lucas-kanade"].sigma_px``.

        Parameters
        ----------
        estimator
            Its name or an alias, or a kind: see ``tracknoise export``.
        window, features
            Length of its window, frames, and features that it uses in a frame; by default those of the experiment if it
            names this estimator, else as shipped.

        Returns
        -------
        dict
            By tracker: sigma and its interval (px), gates, robust loss, and a caveat where the truth is not trusted. A
            tracker without a noise model is not in it.

        Raises
        ------
        UnknownNameError, SettingsError
            If the estimator is not known, takes no single sigma, or no tracker has a noise model.
        """
        from tracknoise.api.sigma_to_set import sigmas_to_set

        return sigmas_to_set(self._folder, estimator, window=window, features=features)

    @property
    def truth(self) -> TruthVerdict:
        """The verdict on the truth, why, and what would help most. The table ``trust`` holds its numbers."""
        return TruthVerdict.of_run(self._folder)

    def audit(self) -> list[str]:
        """Say whether the stated truth is wrong: its camera, poses, depths or times.

        Returns
        -------
        list of str
            Sentences, the answer first. The tables ``audit`` and ``audit_curves`` hold their numbers.
        """
        from tracknoise.truth_faults.audit_summary import audit_sentences

        return audit_sentences(AuditTables.of_run(self._folder).audit)

    def intervals(
        self,
        *,
        statistic: Names = ...,
        tracker: Names = ...,
        speed: Numbers = ...,
        at: Numbers | None = ...,
        coordinate: Names | None = ...,
        population: Names | None = ...,
        trimming: Names | None = ...,
        weighting: Names | None = ...,
        **others: Unpack[IntervalColumns],
    ) -> pl.DataFrame:
        """Return the intervals of all numbers that have one.

        Parameters
        ----------
        statistic, tracker, speed, at, coordinate, population, trimming, weighting
            Only rows that have these values: one value or several, None for a missing value.
        **others
            As the first: aspect, axis, lighting, rotation, direction, camera.

        Returns
        -------
        polars.DataFrame
            One row per number; columns are those of `tracknoise.tables.findings_schema.INTERVALS`.

        Raises
        ------
        UnknownNameError
            If a name is not among those of the run.
        """
        wanted = _given(
            statistic=statistic,
            tracker=tracker,
            speed=speed,
            at=at,
            coordinate=coordinate,
            population=population,
            trimming=trimming,
            weighting=weighting,
            **others,
        )
        return select(self._folder.statistics(INTERVALS), wanted)

    def figures(self) -> pl.DataFrame:
        """List the figures in the order of the report.

        Returns
        -------
        polars.DataFrame
            Columns figure (id), section, title, shows, look_for and absent: why there is no chart, null where there is.
        """
        return self._charts.table()

    def figure(self, name: str) -> "Chart":
        """Draw a figure.

        Parameters
        ----------
        name
            Id of a figure, or of a section: its first figure that can be drawn is used.

        Returns
        -------
        altair.ConcatChart
            Displays itself in a notebook, without network. `save` writes SVG, PNG, PDF, HTML or JSON, by the file's
            extension.

        Raises
        ------
        UnknownNameError
            If there is no such figure.
        FigureError
            If there is nothing to draw, with the reason.
        """
        return self._charts.chart(name)

    def tables(self) -> list[str]:
        """Names of the tables that `table` knows, sorted."""
        return sorted({*RUN_TABLES, *SEQUENCE_TABLES})

    def table(self, name: str, **wanted: Wanted) -> pl.DataFrame:
        """Return a table of the run.

        Parameters
        ----------
        name
            One of `tables`. A table that exists for each sequence only is concatenated from its parts.
        **wanted
            Only rows that have these values: one value or several, by column; None for a missing value.

        Returns
        -------
        polars.DataFrame
            Its columns are described in `tracknoise.tables.schema` and `tracknoise.tables.findings_schema`.

        Raises
        ------
        UnknownNameError
            If there is no such table or column, or a name is not among those of the run.
        StoreError, SchemaError
            If the table is missing or damaged, or the run does not keep it.
        """
        if name not in self.tables():
            raise UnknownNameError("table", name, self.tables())
        if name in RUN_TABLES:
            return select(self._folder.statistics(RUN_TABLES[name]), wanted)
        return self._of_sequences(name, wanted)

    def observations(
        self,
        *,
        scene: Names = ...,
        tracker: Names = ...,
        speed: Numbers = ...,
        camera: Names = ...,
        **views: Unpack[ViewColumns],
    ) -> pl.DataFrame:
        """Return single observations with their errors.

        Parameters
        ----------
        scene, tracker, speed, camera
            Only these: one value or several. Only the files of the chosen sequences are read.
        **views
            As the first: lighting, rotation, direction.

        Returns
        -------
        polars.DataFrame
            One row per feature and frame in which its tracker found it; columns are those of
            `tracknoise.tables.schema.OBSERVATIONS`.

        Raises
        ------
        UnknownNameError
            If a name is not among those of the run.
        StoreError, SchemaError
            If a file is missing or damaged, or the run keeps statistics alone.
        """
        return self._of_sequences(
            "observations", _given(scene=scene, tracker=tracker, speed=speed, camera=camera, **views)
        )

    def tracks(
        self,
        *,
        scene: Names = ...,
        tracker: Names = ...,
        speed: Numbers = ...,
        camera: Names = ...,
        **views: Unpack[ViewColumns],
    ) -> pl.DataFrame:
        """Return tracks: where each began, how long it lived, why it ended, and its largest error.

        Parameters
        ----------
        scene, tracker, speed, camera, **views
            As for `observations`.

        Returns
        -------
        polars.DataFrame
            One row per track; columns are those of `tracknoise.tables.schema.TRACKS`.

        Raises
        ------
        UnknownNameError, StoreError, SchemaError
            As for `observations`.
        """
        return self._of_sequences("tracks", _given(scene=scene, tracker=tracker, speed=speed, camera=camera, **views))

    def track(
        self,
        track: int,
        *,
        scene: Names = ...,
        tracker: Names = ...,
        speed: Numbers = ...,
        camera: Names = ...,
        **views: Unpack[ViewColumns],
    ) -> pl.DataFrame:
        """Return the observations of one track in the order of its frames.

        Parameters
        ----------
        track
            Its number.
        scene, tracker, speed, camera, **views
            As for `observations`; together they must name one sequence, tracker and speed.

        Returns
        -------
        polars.DataFrame
            Columns are those of `observations`.

        Raises
        ------
        SettingsError
            If there are several scenes, trackers, ... to choose from, or `track` is no whole number.
        DataError
            If there is no such track.
        UnknownNameError, StoreError, SchemaError
            As for `observations`.
        """
        require_whole("track", track)
        wanted = _given(scene=scene, tracker=tracker, speed=speed, camera=camera, **views)
        _require_one(self._chosen(wanted), _IDENTITY, track=track)
        observations = self._of_sequences("observations", wanted)
        _require_one(observations, _CONDITION, track=track)
        rows = observations.filter(pl.col("track") == track).sort("frame")
        if rows.is_empty():
            tracks = counted(observations["track"].n_unique(), "track")
            raise DataError(self.path, f"no track {track}", f"one of {tracks}")
        return rows

    def _chosen(self, wanted: Mapping[str, Any]) -> pl.DataFrame:
        """Rows of `sequences` whose names are wanted."""
        return select(self.sequences(), _part(wanted, _IDENTITY))

    def _of_sequences(self, name: str, wanted: Mapping[str, Any]) -> pl.DataFrame:
        """One table of the sequences that are wanted; each is cut down as it is read, so that little is held."""
        keys, condition = self._chosen(wanted)["sequence"], _part(wanted, _CONDITION)
        select(self._conditions, condition)  # a name may be missing from one sequence, but not from the run
        parts = (filtered(self._folder.sequence_table(name, key), condition) for key in keys)
        table = joined(parts, SEQUENCE_TABLES[name])
        chosen = (*_IDENTITY, *_CONDITION)
        return select(table, {column: value for column, value in wanted.items() if column not in chosen})

    @cached_property
    def _conditions(self) -> pl.DataFrame:
        """Trackers and speeds that were measured."""
        return self._folder.statistics(OUTLIERS).select(_CONDITION).unique(maintain_order=True)

    @cached_property
    def _charts(self) -> "Charts":
        from tracknoise.report.charts import Charts
        from tracknoise.report.report_data import ReportData

        return Charts(ReportData.of(self._folder))


def _given(**wanted: Any) -> dict[str, Any]:
    """What is restricted, by column."""
    return {column: value for column, value in wanted.items() if value is not ...}


def _part(wanted: Mapping[str, Any], columns: Collection[str]) -> dict[str, Any]:
    return {column: value for column, value in wanted.items() if column in columns}


def _require_one(table: pl.DataFrame, columns: Iterable[str], *, track: int) -> None:
    """Refuse a choice of several scenes, trackers, ... where a track needs one of each."""
    for column in columns:
        values = table[column].unique().sort().to_list()
        if len(values) > 1:
            listed = ", ".join(map(str, values))
            raise SettingsError(f"track {track}: several values of {column} match ({listed}), expected one")
