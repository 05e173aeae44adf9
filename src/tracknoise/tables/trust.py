"""The verdict on the truth of a run: the same sentence wherever numbers are shown or written."""

from dataclasses import dataclass
from typing import TypeAlias

import polars as pl

from tracknoise.tables.enumerations import Trust, TruthCause
from tracknoise.tables.findings_schema import TRUST
from tracknoise.tables.store import RunFolder

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


def explained_share(trust: pl.DataFrame, tracker: str) -> float | None:
    """Largest share of the squared errors of a tracker that the truth can explain; None where it is not bounded."""
    rows = trust.filter(pl.col("cause") == TruthCause.every, tracker=tracker)
    return None if rows.is_empty() else float(rows["high"][0])


def ranges(trust: pl.DataFrame) -> dict[str, Range]:
    """Shares of the squared errors that each cause may explain, of the tracker of which it may explain most."""
    shares = trust.drop_nulls("high").group_by("cause", maintain_order=True)
    bounds = shares.agg(pl.col("low").max().fill_null(0.0), pl.col("high").max())
    return {cause: (low, high) for cause, low, high in bounds.iter_rows()}
