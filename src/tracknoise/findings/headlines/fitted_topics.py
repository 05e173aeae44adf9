"""Headlines of runs whose true positions are fitted to the tracks: what that hides, and the noise corrected for it."""

import polars as pl

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.estimate_text import format_estimate
from tracknoise.findings.headlines.headline import Headline, Part, RunTables, by_tracker, in_brackets
from tracknoise.findings.headlines.reported_conditions import ReportedConditions
from tracknoise.findings.wording import SELF_REFERENTIAL
from tracknoise.tables.enumerations import FittedMeasure

_WITHHELD = (
    "Bias, shape and growth of the errors, survivorship bias, and effects of factors on errors are therefore not "
    "reported. True positions also contain the errors of poses and calibration."
)
_MEASURES = {
    FittedMeasure.triangulated: "From errors about the fitted points",
    FittedMeasure.epipolar: "From distances to epipolar lines",
}


def self_referential(_tables: RunTables, _conditions: ReportedConditions) -> Headline:
    """Say what errors about fitted points cannot contain."""
    return Headline("truth", f"{SELF_REFERENTIAL} {_WITHHELD}", "limits", "triangulated_noise")


def noise(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Noise of one coordinate of a position, corrected for what the fit absorbs."""
    known = tables["triangulated_noise"].filter(
        pl.col("length_low").is_null(), trimming=conditions.trimming, coordinate="both"
    )
    brackets = in_brackets(conditions.reported(known))
    return by_tracker(
        conditions.trackers,
        lambda tracker: _noise_of(conditions.of(known, tracker), tracker),
        opening=f"Noise of one coordinate {conditions.where(tables['summary'])}, as standard deviation.",
        closing=f"A track of N observations has 2 N - 3 degrees of freedom, which the noise allows for.{brackets}",
        topic="noise",
        figure="findings",
        table="triangulated_noise",
    )


def _noise_of(table: pl.DataFrame, tracker: str) -> Part | None:
    sentences: list[str] = []
    estimates: list[Estimate] = []
    for measure, source in _MEASURES.items():
        for row in table.filter(measure=measure).to_dicts():
            estimates.append(Estimate.of_row(row, "sigma_px", "low", "high", "px"))
            of = " it is" if sentences else f", the noise of {tracker} is"
            sentences.append(f"{source}{of} {format_estimate(estimates[-1])}.")
    return (" ".join(sentences), estimates) if sentences else None
