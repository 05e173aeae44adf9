"""Covariances of the true positions of one tracker setup, and its truth floor."""

from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.measurement.floors import FloorSums, Places
from tracknoise.measurement.recording import Recording
from tracknoise.sequences.sequence import Sequence, TruthKind
from tracknoise.sequences.views import frame_step
from tracknoise.tables.enumerations import Axis, FloorSource
from tracknoise.tables.schema import AXIS, FLOOR_SOURCE, FLOORS, ORIGIN, TruthStatus
from tracknoise.truth.accuracies import AccuracyRule, known_accuracy
from tracknoise.truth.sensitivity import TruthDerivatives, anchored_points
from tracknoise.truth.truth import TruePositions, Truth
from tracknoise.truth.uncertainty import TrueErrors

_COLUMNS = {name: kind for name, kind in FLOORS.items() if name not in ORIGIN}
NO_FLOOR = pl.DataFrame(schema=_COLUMNS)
"""Columns of `FLOORS` without those of the origin: where nothing is known of the accuracy of a truth."""


@dataclass(frozen=True, slots=True, eq=False)
class TruthFloor:
    """Uncertainty of the truth of one sequence.

    Attributes
    ----------
    sequence
        The sequence.
    errors
        Of true positions; None where the kind of truth has no anchors, or nothing is known.
    key_frame
        The frame in which a scan anchors all features, or None.
    notes
        What counts, and where the figures are from, one sentence each.
    """

    sequence: Sequence
    errors: TrueErrors | None
    key_frame: int | None
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, sequence: Sequence, truth: Truth, rule: AccuracyRule) -> "TruthFloor":
        """That of a sequence: for the kinds of truth that fix a point in one frame (`TruthKind`)."""
        if truth.kind not in tuple(TruthKind):
            return cls(sequence, None, truth.key_frame)
        known = known_accuracy(sequence, truth.kind, rule)
        if known.figures.is_exact and not known.is_complete:
            return cls(sequence, None, truth.key_frame)
        errors = TrueErrors(TruthDerivatives(sequence), known.figures, step=frame_step(sequence))
        return cls(sequence, errors, truth.key_frame, known.notes)

    def add(self, recording: Recording, positions: TruePositions) -> tuple[TruePositions, pl.DataFrame]:
        """Fill in the covariances of true positions, unless the truth states them.

        Returns
        -------
        positions
            With covariances, where these are known and not all 0.
        floors
            Columns of `FLOORS` after those of the origin; no rows where nothing is known.
        """
        if positions.covariance is not None:
            return positions, self._stated(recording, positions, positions.covariance)
        if self.errors is None:
            return positions, NO_FLOOR
        if self.errors.is_exact:
            return positions, self._stated(recording, positions, np.zeros((len(positions.uv), 2, 2)))
        return self._propagated(self.errors, recording, positions)

    @property
    def _axis(self) -> Axis:
        return Axis.age if self.key_frame is None else Axis.frame

    def _propagated(
        self, errors: TrueErrors, recording: Recording, positions: TruePositions
    ) -> tuple[TruePositions, pl.DataFrame]:
        frame, track = recording.frame.astype(np.intp), recording.track.astype(np.intp)
        rows, points = anchored_points(self.sequence, frame, track, positions, key_frame=self.key_frame)
        covariance = np.full((len(frame), 2, 2), np.nan)
        visible = positions.status[rows] == TruthStatus.valid
        sums = FloorSums(Places(points, visible, self._axis), errors.sources)
        for part, found in errors.of(points):
            covariance[rows[part]] = sum(found.covariance.values())
            sums.add(part, found)
        return replace(positions, covariance=covariance), sums.table(errors.pose_laws)

    def _stated(self, recording: Recording, positions: TruePositions, covariance: NDArray[np.float64]) -> pl.DataFrame:
        """Floors of covariances whose causes are not known one by one; errors of the mean are known where all are 0."""
        age = recording.frame - recording.first_frame[recording.track]
        counted = (positions.status == TruthStatus.valid) & np.isfinite(covariance).all(axis=(1, 2))
        at = (age if self.key_frame is None else recording.frame)[counted].astype(np.intp)
        number = np.bincount(at)
        seen = np.flatnonzero(number)
        entries = {"sum_uu": (0, 0), "sum_uv": (0, 1), "sum_vv": (1, 1)}
        sums = {name: np.bincount(at, covariance[counted, *entry])[seen] for name, entry in entries.items()}
        of_mean = None if covariance.any() else 0.0
        table = pl.DataFrame({"at": seen, "n": number[seen], **sums}).with_columns(
            pl.lit(FloorSource.all, dtype=FLOOR_SOURCE).alias("source"),
            pl.lit(self._axis, dtype=AXIS).alias("axis"),
            *(pl.lit(of_mean, dtype=pl.Float64).alias(name) for name in ("own_uu", "own_vv", "shared_u", "shared_v")),
        )
        return table.select(pl.col(name).cast(kind) for name, kind in _COLUMNS.items())
