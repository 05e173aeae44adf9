from typing import Any

import polars as pl

from tracknoise.estimators.depth_intervals import DEPTH_INTERVALS
from tracknoise.statistics.yardstick import ReferenceCondition
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.findings_schema import SUMMARY
from tracknoise.tables.schema import empty
from tracknoise.topics.depth_topic import depths
from tracknoise.topics.headline import Headline, ReportedConditions

CONDITION = {
    "dataset": "d", "lighting": "l", "rotation": 0, "direction": "forward", "camera": "", "tracker": "lk", "speed": 1,
}  # fmt: skip
SCOPE = ReportedConditions(ReferenceCondition("l"), ("lk",), percentile=90.0, trimming=Trimming.untrimmed)
HELD = {"1 px": 0.99, "residual sigma": 0.62, "consistent sigma": 0.94, "whole tracks": 0.951}


def shares(held: dict[str, float] = HELD, *, window: int = 15, n: int = 500, **where: Any) -> pl.DataFrame:
    base = {**CONDITION, "trimming": "untrimmed", "quantity": "coverage_95", "window": window, "n": n, **where}
    base |= {"level": 0.95, "resampled": "scenes", "n_scenes": 8}
    rows = [
        {**base, "covariance": name, "sigma_px": 0.2, "value": value, "low": value - 0.05, "high": value + 0.04}
        for name, value in held.items()
    ]
    return pl.DataFrame(rows, schema=dict(DEPTH_INTERVALS))


def headline(table: pl.DataFrame) -> Headline | None:
    return depths({"depth_intervals": table, "summary": pl.DataFrame([CONDITION], schema=dict(SUMMARY))}, SCOPE)


def text(table: pl.DataFrame) -> str:
    found = headline(table)
    assert found is not None
    return found.text.replace("\N{NO-BREAK SPACE}", " ")


def test_a_sentence_says_how_many_depths_each_noise_holds() -> None:
    found = headline(shares())
    assert found is not None
    assert text(shares()) == (
        "Coverage of 95 % depth intervals at speed 1, from untrimmed errors. Windows have 15 frames. lk: intervals "
        "from the residual core contain 62 % (57 to 66) of the true depths. Intervals from the sigma for depths "
        "contain 94 % (89 to 98). Intervals from the covariance of whole tracks contain 95 % (90 to 99). The noise of "
        "each interval was learned from other scenes. Brackets hold 95 % intervals over 8 scenes."
    )
    assert (found.figure, found.table) == ("estimator", "depth_intervals")
    assert found.estimate is not None
    assert (found.estimate.value, found.estimate.unit) == (0.62, "share")


def test_what_was_not_learned_is_left_out() -> None:
    only = {name: HELD[name] for name in ("1 px", "residual sigma")}
    assert "contain 62 % (57 to 66) of the true depths. The noise of each" in text(shares(only))


def test_the_longest_window_with_enough_tracks_is_reported() -> None:
    assert "Windows have 10 frames." in text(pl.concat([shares(window=10), shares(n=99)]))
    assert headline(shares(n=99)) is None


def test_other_conditions_and_no_rows_say_nothing() -> None:
    assert headline(shares(tracker="other")) is None
    assert headline(shares(speed=2)) is None
    assert headline(empty(DEPTH_INTERVALS)) is None
