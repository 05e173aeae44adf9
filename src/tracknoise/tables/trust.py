"""The verdict on the truth of a run: the same sentence wherever numbers are shown or written."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import polars as pl

from tracknoise.tables.enumerations import Trust, TruthCause
from tracknoise.tables.run_table import RunTable
from tracknoise.tables.store import RunFolder

TRUST = RunTable(
    "trust",
    {
        "dataset": pl.String,
        "cause": pl.Enum(TruthCause),
        "tracker": pl.String,
        "verdict": pl.Enum(Trust),
        "share": pl.Float64,
        "low": pl.Float64,
        "high": pl.Float64,
        "age": pl.Int64,
        "error_px": pl.Float64,
        "bound_px": pl.Float64,
        "text": pl.String,
        "step": pl.String,
    },
    title="verdict on the truth, and what it can explain",
)
"""The verdict on the truth, and how much of the errors it can explain.

The first row has the verdict, its sentence, and the step that would help most. The others have shares of the squared
errors up to the reference age: of each tracker by all causes together (`every`), and by single causes. Faults that are
established have no tracker: they are fitted to all together. high is the upper bound. error_px is the core of both
coordinates of the tracker at `age`, or its RMS where there was no audit, and bound_px how much of it the truth can
explain at most.
"""

_NOT_ASSESSED = "It was not assessed."
Range: TypeAlias = tuple[float, float]
"""Lower and upper bound of a share."""


@dataclass(frozen=True, slots=True)
class TruthVerdict:
    """A verdict on the truth.

    Attributes
    ----------
    verdict
        Whether the truth is trusted.
    text
        Why, in a sentence or two.
    step
        What would help most; empty where the truth is trusted.
    poses
        What reference tracks left of the errors of refined poses, and what the stated ones would add, two sentences;
        empty where stated poses lead.
    stated
        The verdict on the stated poses and the size of their errors, in sentences; empty where they lead.
    """

    verdict: Trust = Trust.unknown
    text: str = _NOT_ASSESSED
    step: str = "Run the experiment again."
    poses: str = ""
    stated: str = ""

    @classmethod
    def of(cls, trust: pl.DataFrame) -> "TruthVerdict":
        """The verdict of a table, schema `TRUST`; unknown where it is empty, as in runs of earlier versions."""
        if trust.is_empty():
            return cls()
        row = trust.row(0, named=True)
        texts = dict(trust.select("cause", "text").drop_nulls().iter_rows())
        pose_texts = (texts.get(cause, "") for cause in (TruthCause.refined_poses, TruthCause.stated_poses))
        return cls(Trust(row["verdict"]), row["text"], row["step"] or "", *pose_texts)

    @classmethod
    def of_run(cls, run: RunFolder) -> "TruthVerdict":
        """The verdict of a run.

        Raises
        ------
        StoreError
            If there is no finished run, or its table is damaged.
        """
        return cls.of(run.statistics(TRUST))

    @property
    def is_usable(self) -> bool:
        """Whether numbers for estimators may be taken from errors about this truth."""
        return self.verdict in (Trust.trusted, Trust.limited)

    @property
    def are_tracks_wrong(self) -> bool:
        """Whether tracks do not follow the images: then no number of the run means anything."""
        return self.verdict is Trust.not_assessed

    @property
    def opening(self) -> str:
        """The verdict alone: ``Truth: limited.``, or ``Tracks: wrong.``."""
        return "Tracks: wrong." if self.are_tracks_wrong else f"Truth: {self.verdict}."

    @property
    def caveat(self) -> str:
        """The verdict and why: ``Truth: limited. ...``; which poses lead."""
        return " ".join(filter(None, (self.opening, self.text, self.poses)))

    @property
    def sentence(self) -> str:
        """The caveat, and what would help most."""
        return f"{self.caveat} Next: {self.step}" if self.step else self.caveat


@dataclass(frozen=True, slots=True, eq=False)
class AssessedTruth:
    """What a run says about its truth: schema `TRUST`; without rows in runs of earlier versions."""

    rows: pl.DataFrame

    @classmethod
    def of(cls, tables: Mapping[str, pl.DataFrame]) -> "AssessedTruth":
        """That of the tables of a run, by their names."""
        return cls(tables[TRUST.name])

    @classmethod
    def of_run(cls, run: RunFolder) -> "AssessedTruth":
        """That of a run. Raises as `TruthVerdict.of_run`."""
        return cls(run.statistics(TRUST))

    @property
    def verdict(self) -> TruthVerdict:
        """The verdict on it."""
        return TruthVerdict.of(self.rows)

    @property
    def causes(self) -> pl.DataFrame:
        """Rows of what the verdict rests on."""
        return self.rows.filter(pl.col("verdict").is_null())

    @property
    def ranges(self) -> dict[str, Range]:
        """Shares of the squared errors that each cause may explain, of the tracker of which it may explain most."""
        shares = self.rows.drop_nulls("high").group_by("cause", maintain_order=True)
        bounds = shares.agg(pl.col("low").max().fill_null(0.0), pl.col("high").max())
        return {cause: (low, high) for cause, low, high in bounds.iter_rows()}

    def explained_share(self, tracker: str) -> float | None:
        """Largest share of the squared errors of a tracker that the truth can explain; None where it is not bounded."""
        rows = self.rows.filter(pl.col("cause") == TruthCause.every, tracker=tracker)
        return None if rows.is_empty() else float(rows["high"][0])
