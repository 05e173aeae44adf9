"""Whether covariances that trackers predict are right in size, shape and order, and whether they are of use."""

from collections.abc import Mapping
from typing import Any

import polars as pl

from tracknoise.analysis.covariance_verdicts import ALIKE, LEAST_GAIN, OWN_COVARIANCES, allowing_for_truth, worst_shape
from tracknoise.analysis.covariance_verdicts import own_covariances as own_covariance_table
from tracknoise.analysis.run_inputs import RunInputs
from tracknoise.inference.estimates import Estimate
from tracknoise.statistics.definitions import POOLED
from tracknoise.tables.enumerations import Trust, Verdict
from tracknoise.tables.trust import TRUST, AssessedTruth
from tracknoise.topics.headline import Headline, Part, ReportedConditions, RunTables, in_brackets
from tracknoise.topics.run_data import RunData
from tracknoise.topics.topic import NO_ROWS, Analysis, Topic
from tracknoise.words import SPACE, format_as, format_estimate, number, thousandths

_LEAST = 100
"""With fewer errors than this, a covariance is not judged."""
_USUAL = "cov"
"""Name of the covariance of files of tracks, which no sentence has."""
Rows = Mapping[str, dict[str, Any]]
"""Rows of one covariance of a tracker at all ages together, by quantity."""


def covariances(tables: RunTables, conditions: ReportedConditions) -> Headline | None:
    """Of every tracker that predicts covariances, whether they are right, and what would make them right."""
    rows = conditions.reported(tables["own_covariances"]).filter(pl.col("at").is_null(), trimming=conditions.trimming)
    errors = "" if conditions.percentile is None else f", from {conditions.trimming} errors"
    most = "" if AssessedTruth.of(tables).verdict.verdict is Trust.trusted else "at most "
    return conditions.headline(
        lambda tracker: _part(conditions.of(rows, tracker), tracker, most),
        opening=f"Covariances that trackers predict {conditions.where(tables)}{errors}.",
        closing=in_brackets(rows).strip(),
        figure="estimator",
        table="own_covariances",
    )


def _part(table: pl.DataFrame, tracker: str, most: str) -> Part | None:
    """What is said about a tracker; `most` is said before a factor that errors of the truth may have made larger."""
    judged = [(_called(tracker, name), rows) for name, rows in _by_name(table).items()]
    if not judged:
        return None
    texts = [" ".join(_sentences(called, rows, most)) for called, rows in judged]
    estimates = [
        Estimate.of_row(rows[name], "value", "low", "high", "nat" if name == "gain" else "")
        for _, rows in judged
        for name in ("nees", "coverage_95", "coverage_50", "shape", "ranking", "gain")
        if name in rows
    ]
    return Part(" ".join(texts), estimates, _in_short(*judged[0]))


def _by_name(table: pl.DataFrame) -> dict[str, Rows]:
    """Rows of each covariance of a tracker that has enough errors, by its name."""
    by_name: dict[str, dict[str, dict[str, Any]]] = {}
    for row in table.to_dicts():
        by_name.setdefault(row["covariance"], {})[row["quantity"]] = row
    return {name: rows for name, rows in by_name.items() if "nees" in rows and rows["nees"]["n"] >= _LEAST}


def _called(tracker: str, name: str) -> str:
    return f"{tracker}'s own covariances" if name == _USUAL else f"{tracker}'s covariances '{name}'"


def _sentences(called: str, rows: Rows, most: str) -> list[str]:
    nees = Estimate.of_row(rows["nees"], "value", "low", "high")
    judged = f"{_judged(called, rows['nees'])}: {_held(rows, 95)}."
    is_wrong = rows["nees"]["verdict"] == Verdict.no
    size = f"{f'They would have to be multiplied by {most}' if is_wrong else 'Their NEES is '}{format_estimate(nees)}."
    parts = (_of_truth(nees, rows), _of_large_errors(rows), _shape(rows), _ranking(rows), _use(rows))
    return [judged, size, *(sentence for part in parts for sentence in part)]


def _of_truth(nees: Estimate, rows: Rows) -> list[str]:
    """Where covariances look too small, and the truth can be the reason."""
    if rows["nees"]["verdict"] == Verdict.undecided and nees.above(ALIKE**2):
        return ["They look too small, but errors of the truth can be the reason."]
    return []


def _judged(called: str, nees: Mapping[str, Any]) -> str:
    if nees["verdict"] == Verdict.yes:
        return f"{called} are right in size"
    if nees["verdict"] == Verdict.no:
        return f"{called} are too {'small' if nees['value'] > 1.0 else 'large'}"
    return f"Whether {called} are right in size is undecided"


def _held(rows: Rows, level: int) -> str:
    return f"{level}{SPACE}% regions contain {100.0 * rows[f'coverage_{level}']['value']:.0f}{SPACE}% of the errors"


def _of_large_errors(rows: Rows) -> list[str]:
    """Where covariances are too small although at least half of the errors lie in the regions of half of them."""
    low = rows["coverage_50"]["low"]
    too_small = rows["nees"]["verdict"] == Verdict.no and rows["nees"]["value"] > 1.0
    if not too_small or low is None or low < 0.5:
        return []
    return [f"But {_held(rows, 50)}: a few large errors cause the factor.", "A robust loss handles them better."]


def _shape(rows: Rows) -> list[str]:
    """Whether ellipses are as long and lie as they should."""
    if "shape" not in rows:
        return []
    verdict, worst = rows["shape"]["verdict"], worst_shape(rows)
    if verdict == Verdict.yes:
        return ["Their shape is right."]
    if verdict == Verdict.undecided or worst is None:
        return ["Whether their shape is right is undecided."]
    ratio = Estimate.of_row(rows["shape"], "value", "low", "high")
    larger = f"Whitened errors are {format_estimate(ratio)} times as large {_AXES[worst]} as across"
    return ["Their shape is wrong.", f"{larger}."]


_AXES = {
    "shape_image_along": "along u",
    "shape_image_turned": "along the diagonal",
    "shape_own_along": "along their long axes",
    "shape_own_turned": "between their axes",
    "shape_motion_along": "along the motion",
    "shape_motion_turned": "oblique to the motion",
}


def _ranking(rows: Rows) -> list[str]:
    """Whether larger covariances are of larger errors."""
    if "ranking" not in rows:
        return []
    estimate = Estimate.of_row(rows["ranking"], "value", "low", "high")
    verdict = rows["ranking"]["verdict"]
    if verdict == Verdict.undecided:
        return ["Whether larger covariances have larger errors is undecided."]
    if estimate.low is None:
        return ["They do not say which errors are large: all have one size."]
    ratio = f"errors that are predicted as large are {format_estimate(estimate)} times the others"
    return [f"Larger covariances {'have' if verdict == Verdict.yes else 'do not have'} larger errors: {ratio}."]


def _use(rows: Rows) -> list[str]:
    """Whether one sigma is better, as good, or worse."""
    if "gain" not in rows:
        return []
    gain = Estimate.of_row(rows["gain"], "value", "low", "high")
    gain_text = format_as(gain, thousandths, unit=f"{SPACE}nat")
    if rows["gain"]["verdict"] == Verdict.yes:
        return [f"After scaling, they gain {gain_text} per error over one sigma for all."]
    if rows["gain"]["verdict"] == Verdict.no:
        return [f"One sigma for all is better: after scaling, they gain {gain_text}." if _is_worse(gain) else _AS_GOOD]
    return ["Whether one sigma for all is as good is undecided."]


_AS_GOOD = "One sigma for all is as good."


def _is_worse(gain: Estimate) -> bool:
    """Whether covariances are certainly worse than one sigma."""
    return gain.high is not None and gain.high < -LEAST_GAIN


def _in_short(called: str, rows: Rows) -> str:
    nees = rows["nees"]
    factor = f", multiply by {number(nees['value'], digits=2)}" if nees["verdict"] == Verdict.no else ""
    text = f"{_judged(called, nees)}: {_held(rows, 95)}{factor}."
    if rows.get("shape", {}).get("verdict") == Verdict.no:
        text = f"{text} Their shape is wrong."
    if rows.get("gain", {}).get("verdict") != Verdict.no:
        return text
    gain = Estimate.of_row(rows["gain"], "value", "low", "high")
    return f"{text} One sigma for all is better." if _is_worse(gain) else f"{text} {_AS_GOOD}"


def own_covariances(data: RunData) -> pl.DataFrame:
    """Rows of the reference view at the lowest speed that have enough errors, with the column `line` that names them.

    Returns: columns of `tracknoise.analysis.covariance_verdicts.OWN_COVARIANCES`, and line.
    """
    rows = data.nominal(data["own_covariances"]).filter(trimming=data.trimming)
    judged = rows.filter(pl.col("n") >= _LEAST, pl.col("at").is_null(), quantity="nees")
    names = pl.when(covariance=_USUAL).then("tracker").otherwise(pl.format("{}: {}", "tracker", "covariance"))
    key = [*POOLED, "covariance"]
    return rows.join(judged.select(key), on=key, how="semi", maintain_order="left").with_columns(line=names)


def covariance_sentence(data: RunData, tracker: str) -> str:
    """The same in one sentence, of the first covariance of a tracker; empty where it predicts none."""
    table = own_covariances(data).filter(pl.col("at").is_null(), tracker=tracker)
    judged = [_in_short(_called(tracker, name), rows) for name, rows in _by_name(table).items()]
    return judged[0] if judged else ""


def covariance_message(data: RunData) -> str:
    """The first verdict that is decided, in a few words; empty where none is."""
    table = own_covariances(data).filter(pl.col("at").is_null())
    for tracker in data.trackers:
        for name, rows in _by_name(table.filter(tracker=tracker)).items():
            if rows["nees"]["verdict"] != Verdict.undecided:
                return f"{_judged(_called(tracker, name), rows['nees'])}: {_held(rows, 95)}"
    return ""


def _allowing_for_truth(inputs: RunInputs) -> list[pl.DataFrame]:
    table = own_covariance_table(inputs.run.stored_tables("covariance_sums"), inputs.sampling)
    return [allowing_for_truth(table, inputs[TRUST])]


COVARIANCES = Topic(
    "covariances",
    (Analysis((OWN_COVARIANCES,), _allowing_for_truth, needs=(TRUST,), if_fitted=NO_ROWS),),
    headline=covariances,
    sentence=covariance_sentence,
)
