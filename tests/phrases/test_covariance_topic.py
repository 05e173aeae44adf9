"""What is said of covariances that a tracker predicts: each verdict, and when truth or tails are the reason."""

import polars as pl
import pytest
from tests.phrases.short import too_long

from tracknoise.phrases.covariance_topic import covariances
from tracknoise.phrases.headline import ReportedConditions
from tracknoise.statistics.yardstick import ReferenceCondition
from tracknoise.tables.findings_schema import OWN_COVARIANCES, TRUST
from tracknoise.tables.schema import SUMMARY

CONDITION = {
    "dataset": "d", "lighting": "l", "rotation": 0, "direction": "forward", "camera": "", "tracker": "lk", "speed": 1,
}  # fmt: skip
SCOPE = ReportedConditions(ReferenceCondition("l"), ("lk",))
MADE = {"kind": "student", "level": 0.95, "resampled": "scenes", "n_units": 8, "n_scenes": 8, "n": 900}


def said(nees: tuple, gain: tuple, *, verdict: str, of_use: str, inside: float, half: float, trust: str = "trusted"):
    """The text and the short sentence about bounds (value, low, high)."""
    bounds = {"nees": nees, "gain": gain, "coverage_95": (inside, inside - 0.01, inside + 0.01)}
    bounds["coverage_50"] = (half, half - 0.01, half + 0.01)
    verdicts = {"nees": verdict, "gain": of_use}
    rows = [
        {**CONDITION, **MADE, "covariance": "cov", "trimming": str(SCOPE.trimming), "quantity": name,
         **dict(zip(("value", "low", "high"), values, strict=True)), "verdict": verdicts.get(name)}
        for name, values in bounds.items()
    ]  # fmt: skip
    trusted = {"dataset": "d", "cause": "every", "verdict": trust, "text": "Why."}
    tables = {
        "own_covariances": pl.DataFrame(rows, schema=dict(OWN_COVARIANCES)),
        "summary": pl.DataFrame([CONDITION], schema=dict(SUMMARY)),
        "trust": pl.DataFrame([trusted], schema=dict(TRUST)),
    }
    found = covariances(tables, SCOPE)
    assert found is not None
    assert too_long(found.text, ["lk"]) + too_long(found.brief, ["lk"]) == []
    return found.text.replace("\N{NO-BREAK SPACE}", " "), found.brief.replace("\N{NO-BREAK SPACE}", " ")


def test_too_small_covariances_have_their_factor() -> None:
    of = {"verdict": "no", "of_use": "yes", "inside": 0.71, "half": 0.3}
    text, brief = said((3.2, 2.9, 3.5), (0.2, 0.1, 0.3), **of)
    assert "lk's own covariances are too small: 95 % regions hold 71 %." in text
    assert "They would have to be multiplied by 3.20 (2.90 to 3.50)." in text
    assert "scaled, they gain 0.200 nat (0.100 to 0.300) per error over one sigma." in text
    assert brief == "lk's own covariances are too small: 95 % regions hold 71 %, multiply by 3.2."
    assert "multiplied by at most 3.20" in said((3.2, 2.9, 3.5), (0.2, 0.1, 0.3), trust="limited", **of)[0]


@pytest.mark.parametrize(
    ("nees", "verdict", "half", "says"),
    [
        ((1.0, 0.98, 1.02), "yes", 0.5, "lk's own covariances are right"),
        ((0.3, 0.2, 0.4), "no", 0.9, "lk's own covariances are too large"),
        ((1.4, 0.8, 2.4), "undecided", 0.4, "Whether lk's own covariances are right is undecided"),
        ((3.0, 2.5, 3.5), "undecided", 0.4, "They look too small, but errors of the truth can be the reason."),
        ((3.0, 2.5, 3.5), "no", 0.6, "But 50 % regions hold 60 %: a few large errors make the factor"),
    ],
)
def test_each_verdict_is_said(nees, verdict, half, says) -> None:
    text, _ = said(nees, (-0.2, -0.3, -0.1), verdict=verdict, of_use="no", inside=0.94, half=half)
    assert says in text
    assert "They do not tell which errors are large: one sigma for all is as good." in text
