"""What is said of covariances that a tracker predicts: each verdict, and when truth or tails are the reason."""

import polars as pl
import pytest
from tests.topics.short import too_long

from tracknoise.analysis.covariance_verdicts import OWN_COVARIANCES
from tracknoise.statistics.yardstick import ReferenceCondition
from tracknoise.tables.findings_schema import SUMMARY
from tracknoise.tables.trust import TRUST
from tracknoise.topics.covariance_topic import covariances
from tracknoise.topics.headline import ReportedConditions

CONDITION = {
    "dataset": "d", "lighting": "l", "rotation": 0, "direction": "forward", "camera": "", "tracker": "lk", "speed": 1,
}  # fmt: skip
SCOPE = ReportedConditions(ReferenceCondition("l"), ("lk",))
MADE = {"kind": "student", "level": 0.95, "resampled": "scenes", "n_units": 8, "n_scenes": 8, "n": 900}


RIGHT, CIRCLES, TURNED = (1.0, 0.98, 1.02), (1.9, 1.8, 2.0), (0.25, 0.2, 0.3)


def said(
    nees: tuple,
    gain: tuple,
    *,
    verdict: str,
    of_use: str,
    inside: float,
    half: float,
    trust: str = "trusted",
    shape: tuple[str, tuple, str] = ("own_along", RIGHT, "yes"),
    ranking: tuple[tuple, str] = ((2.0, 1.8, 2.2), "yes"),
):
    """The text and the short sentence about bounds (value, low, high)."""
    bounds = {"nees": nees, "gain": gain, "coverage_95": (inside, inside - 0.01, inside + 0.01)}
    bounds["coverage_50"] = (half, half - 0.01, half + 0.01)
    frame, ratio, has_shape = shape
    others = {f"shape_{one}": RIGHT for one in ("image_along", "image_turned", "own_turned")}
    bounds |= {**others, f"shape_{frame}": ratio, "shape": ratio, "ranking": ranking[0]}
    verdicts = {"nees": verdict, "gain": of_use, "shape": has_shape, "ranking": ranking[1]}
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
    assert "lk's own covariances are too small: 95 % regions contain 71 % of the errors." in text
    assert "They would have to be multiplied by 3.20 (2.90 to 3.50)." in text
    assert "After scaling, they gain 0.200 nat (0.100 to 0.300) per error over one sigma for all." in text
    assert "Their shape is right." in text
    ratio = "errors that are predicted as large are 2.00 (1.80 to 2.20) times the others"
    assert f"Larger covariances have larger errors: {ratio}." in text
    assert brief == "lk's own covariances are too small: 95 % regions contain 71 % of the errors, multiply by 3.2."
    assert "multiplied by at most 3.20" in said((3.2, 2.9, 3.5), (0.2, 0.1, 0.3), trust="limited", **of)[0]


@pytest.mark.parametrize(
    ("nees", "verdict", "half", "says"),
    [
        (
            (1.0, 0.98, 1.02),
            "yes",
            0.5,
            "lk's own covariances are right in size: 95 % regions contain 94 % of the errors.",
        ),
        ((0.3, 0.2, 0.4), "no", 0.9, "lk's own covariances are too large"),
        ((1.4, 0.8, 2.4), "undecided", 0.4, "Whether lk's own covariances are right in size is undecided"),
        ((3.0, 2.5, 3.5), "undecided", 0.4, "They look too small, but errors of the truth can be the reason."),
        (
            (3.0, 2.5, 3.5),
            "no",
            0.6,
            "But 50 % regions contain 60 % of the errors: a few large errors cause the factor",
        ),
    ],
)
def test_each_verdict_is_said(nees, verdict, half, says) -> None:
    text, _ = said(nees, (-0.2, -0.3, -0.1), verdict=verdict, of_use="no", inside=0.94, half=half)
    assert says in text
    assert "One sigma for all is better: after scaling, they gain \N{MINUS SIGN}0.200 nat" in text.replace(
        "-0.2", "\N{MINUS SIGN}0.2"
    )


SOME = {"verdict": "yes", "inside": 0.95, "half": 0.5}


@pytest.mark.parametrize(
    ("shape", "says"),
    [
        (("image_along", CIRCLES, "no"), "Whitened errors are 1.90 (1.80 to 2.00) times as large along u as across."),
        (("own_along", TURNED, "no"), "0.250 (0.200 to 0.300) times as large along their long axes as across."),
        (("own_turned", CIRCLES, "no"), "1.90 (1.80 to 2.00) times as large between their axes as across."),
        (("own_along", (1.1, 0.8, 1.4), "undecided"), "Whether their shape is right is undecided."),
    ],
)
def test_a_wrong_shape_is_said_although_the_size_is_right(shape, says) -> None:
    text, brief = said(RIGHT, (0.1, 0.05, 0.2), of_use="yes", shape=shape, **SOME)
    assert text.replace("\n", " ").count(says) == 1
    assert ("Their shape is wrong." in brief) == (shape[2] == "no")


def test_equal_sizes_do_not_tell_which_errors_are_large_although_they_gain() -> None:
    text, brief = said(RIGHT, (0.3, 0.2, 0.4), of_use="yes", ranking=((1.0, None, None), "no"), **SOME)
    assert "They do not say which errors are large: all have one size." in text
    assert "After scaling, they gain 0.300 nat" in text
    assert "One sigma" not in text + brief


@pytest.mark.parametrize(
    ("gain", "of_use", "says"),
    [
        ((0.0, -0.002, 0.002), "no", "One sigma for all is as good."),
        ((-1.33, -1.5, -1.2), "no", "One sigma for all is better"),
        ((0.05, -0.1, 0.2), "undecided", "Whether one sigma for all is as good is undecided."),
    ],
)
def test_one_sigma_is_better_or_as_good(gain, of_use, says) -> None:
    assert says in said(RIGHT, gain, of_use=of_use, **SOME)[0]
