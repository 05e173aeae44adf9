"""Columns of the tables of one sequence, from what one tracker setup reported and the true positions."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.surroundings import Surroundings, unknown_surroundings
from tracknoise.measurement.recording import Recording
from tracknoise.measurement.tracking import TrackerSetup
from tracknoise.tables import schema
from tracknoise.tables.enumerations import EdgeSide
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.schema import TrackEnd, TruthStatus
from tracknoise.trackers.tracker import reports_causes
from tracknoise.truth.truth import TruePositions

Tables = tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame, pl.DataFrame]
"""`OBSERVATIONS`, `TRACKS`, `FRAME_COUNTS` and `FLOORS` of `tracknoise.tables.schema`."""


def setup_tables(
    sequence: SequenceId,
    setup: TrackerSetup,
    recording: Recording,
    positions: TruePositions,
    floors: dict[str, pl.Series],
    second: TruePositions | None = None,
) -> Tables:
    """Tables of one tracker setup on one sequence, with the columns of its `FLOORS` after those of the origin.

    The true positions of a second truth are among the observations, if there is one.

    Raises
    ------
    SchemaError
        If a column has a wrong type.
    """
    return (
        _table({**_observations(recording, positions), **_second_truth(second)}, schema.OBSERVATIONS, sequence, setup),
        _table(_tracks(recording, positions, reports_causes(setup.settings)), schema.TRACKS, sequence, setup),
        _table(_frames(recording, reports_causes(setup.settings)), schema.FRAME_COUNTS, sequence, setup),
        _table(floors, schema.FLOORS, sequence, setup),
    )


def _observations(recording: Recording, positions: TruePositions) -> dict[str, pl.Series]:
    error = recording.uv - positions.uv
    return {
        "track": pl.Series(recording.track),
        "frame": pl.Series(recording.frame),
        "age": pl.Series(recording.frame - recording.first_frame[recording.track]),
        "u_px": pl.Series(recording.uv[:, 0]),
        "v_px": pl.Series(recording.uv[:, 1]),
        "u_true_px": _nullable(positions.uv[:, 0]),
        "v_true_px": _nullable(positions.uv[:, 1]),
        "truth": _names(positions.status, TruthStatus),
        "du_px": _nullable(error[:, 0]),
        "dv_px": _nullable(error[:, 1]),
        "kept": pl.repeat(True, len(error), eager=True),
        **_covariance(positions.covariance, schema.TRUE_COVARIANCE),
        **_covariance(positions.leverage, schema.LEVERAGE),
        **_epipolar(positions.epipolar),
        **{schema.QUALITY_PREFIX + name: _nullable(values) for name, values in recording.quality.items()},
    }


def _covariance(covariance: NDArray[np.float64] | None, names: schema.Schema) -> dict[str, pl.Series]:
    if covariance is None:
        return {}
    values = covariance[:, [0, 0, 1], [0, 1, 1]].T
    return {name: _nullable(column) for name, column in zip(names, values, strict=True)}


def _second_truth(second: TruePositions | None) -> dict[str, pl.Series]:
    if second is None:
        return {}
    return {name: _nullable(column) for name, column in zip(schema.SECOND_TRUTH, second.uv.T, strict=True)}


def _epipolar(epipolar: NDArray[np.float64] | None) -> dict[str, pl.Series]:
    if epipolar is None:
        return {}
    return {name: _nullable(column) for name, column in zip(schema.EPIPOLAR, epipolar.T, strict=True)}


def _tracks(recording: Recording, positions: TruePositions, has_causes: bool) -> dict[str, pl.Series]:
    count = len(recording.first_frame)
    known = has_causes | (recording.end == TrackEnd.sequence_end)
    return {
        "track": pl.Series(np.arange(count, dtype=np.uint32)),
        "first_frame": pl.Series(recording.first_frame),
        "lifetime": pl.Series(recording.found),
        "end": _names(recording.end, TrackEnd).set(pl.Series(~known), None),
        "response": _nullable(recording.response),
        "depth_m": _nullable(positions.depth_m),
        "gradient_rad": _nullable(recording.gradient_rad),
        **_surroundings(positions.surroundings or unknown_surroundings(count)),
        "max_error_px": pl.repeat(None, count, dtype=pl.Float64, eager=True),
        "kept": pl.repeat(True, count, eager=True),
    }


def _surroundings(found: Surroundings) -> dict[str, pl.Series]:
    edge, side = pl.col("edge_px"), {one: pl.lit(one, dtype=schema.EDGE_SIDE) for one in EdgeSide}
    edges_px = pl.Series(found.edge_px, nan_to_null=True)  # infinite where there is no edge
    table = pl.DataFrame({"edge_px": edges_px, "incidence_deg": _nullable(found.incidence_deg)})
    return table.select(
        pl.when(edge.is_finite()).then(edge).cast(pl.Float32),
        edge_side=pl.when(edge.is_infinite())
        .then(side[EdgeSide.none])
        .when(edge > 0)
        .then(side[EdgeSide.near])
        .when(edge < 0)
        .then(side[EdgeSide.far]),
        incidence_deg=pl.col("incidence_deg").cast(pl.Float32),
    ).to_dict()


def _frames(recording: Recording, has_causes: bool) -> dict[str, pl.Series]:
    names = ("frame", "offered", "matched", "outliers", "new", "alive")
    counts = {name: pl.Series(recording.frames[:, column]) for column, name in enumerate(names)}
    unknown = pl.repeat(None, len(recording.frames), dtype=pl.UInt32, eager=True)
    return counts if has_causes else {**counts, "outliers": unknown}


def _table(
    columns: dict[str, pl.Series], layout: schema.Schema, sequence: SequenceId, setup: TrackerSetup
) -> pl.DataFrame:
    names = {name: getattr(sequence, name) for name in schema.SEQUENCE}
    origin = {**names, "tracker": setup.tracker, "speed": setup.speed}
    literals = [pl.lit(value, dtype=schema.ORIGIN[name]).alias(name) for name, value in origin.items()]
    table = pl.DataFrame(columns).with_columns(literals)
    return schema.check(table.select(list(schema.layout_of(layout, table.columns))), layout, setup.tracker)


def _nullable(values: NDArray[np.floating]) -> pl.Series:
    """A column in which what is not finite is unknown."""
    return pl.Series(np.where(np.isfinite(values), values, np.nan).astype(values.dtype), nan_to_null=True)


def _names(values: NDArray[np.int8], kind: type[TruthStatus] | type[TrackEnd]) -> pl.Series:
    """Enumeration values as the enumeration's column type."""
    names = [member.name for member in kind]
    return pl.Series(names, dtype=pl.Enum(names)).gather(values)
