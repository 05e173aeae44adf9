"""The headlines about the noise to set in an estimator, and about the noise that makes depths right."""

from dataclasses import replace
from typing import Any

import polars as pl
import pytest

from tracknoise.estimators.run_models import ADVICE
from tracknoise.estimators.window_noise import WINDOW_SIGMAS
from tracknoise.statistics.yardstick import ReferenceCondition
from tracknoise.tables.enumerations import Trimming
from tracknoise.tables.findings_schema import SUMMARY
from tracknoise.tables.schema import empty
from tracknoise.tables.trust import TRUST
from tracknoise.topics.headline import Headline, ReportedConditions
from tracknoise.topics.window_topic import depth_noise, estimator_noise

CONDITION = {
    "dataset": "d",
    "lighting": "l",
    "rotation": 0,
    "direction": "forward",
    "camera": "",
    "tracker": "lk",
    "speed": 1,
}
SCOPE = ReportedConditions(ReferenceCondition("l"), ("lk",), percentile=90.0, trimming=Trimming.untrimmed)
DRIFTING = {
    "consistent_sigma": (0.2, 0.17, 0.23),
    "residual_core": (0.04, 0.035, 0.045),
    "core_overconfidence": (5.0, 4.6, 5.6),
    "depth_share": (0.8, 0.7, 0.9),
}
HONEST = {**DRIFTING, "residual_core": (0.2, 0.18, 0.22), "core_overconfidence": (1.02, 0.97, 1.06)}


def windows(
    found: dict[str, tuple[float, float, float]], *, window: int = 15, n: int = 500, **where: Any
) -> pl.DataFrame:
    base = {**CONDITION, "trimming": "untrimmed", "level": 0.95, "resampled": "scenes", "n_scenes": 8, **where}
    rows = [
        {**base, "window": window, "quantity": name, "n": n, "value": value, "low": low, "high": high}
        for name, (value, low, high) in found.items()
    ]
    return pl.DataFrame(rows, schema=dict(WINDOW_SIGMAS))


def trust(verdict: str, share: float | None = None) -> pl.DataFrame:
    rows = [{"cause": "every", "verdict": verdict}, {"cause": "every", "tracker": "lk", "high": share}]
    return pl.DataFrame(rows if share is not None else rows[:1], schema=dict(TRUST))


TRUSTED = trust("trusted")


def headline(table: pl.DataFrame, scope: ReportedConditions = SCOPE, truth: pl.DataFrame = TRUSTED) -> Headline | None:
    summary = pl.DataFrame([CONDITION], schema=dict(SUMMARY))
    return depth_noise({"window_sigmas": table, "summary": summary, "trust": truth}, scope)


def text(*given: Any) -> str:
    found = headline(*given)
    assert found is not None
    return found.text.replace("\N{NO-BREAK SPACE}", " ")


def test_a_tracker_that_drifts_has_depths_less_certain_than_its_residuals_say() -> None:
    found = text(windows(DRIFTING))
    assert found.startswith(
        "Sigma for the depths of points at speed 1, from untrimmed errors. Windows have 15 frames. lk: the sigma for "
        "depths is"
    )
    assert "0.200 px (0.170 to 0.230). The residual core is 0.040 px. With the residual core as sigma, depths" in found
    assert "depths are 5.0 times (4.6 to 5.6) as uncertain as claimed." in found
    assert found.endswith("Brackets hold 95 % intervals over 8 scenes.")
    estimate = headline(windows(DRIFTING)).estimate
    assert (estimate.value, estimate.low, estimate.high, estimate.unit) == (0.2, 0.17, 0.23, "px")


def test_intervals_are_told_only_where_the_numbers_have_them() -> None:
    """As where the longest windows are of a few long scenes."""
    without = {name: (value, None, None) for name, (value, *_) in DRIFTING.items()}
    found = text(pl.concat([windows(without, n_scenes=3), windows(DRIFTING, window=5)]))
    assert found.endswith("of all scenes. Numbers have no intervals: 3 scenes are too few.")


def test_independent_noise_is_as_certain_as_claimed() -> None:
    assert "depths are 1.02 times (0.970 to 1.06) as uncertain as claimed, which counts as" in text(windows(HONEST))


@pytest.mark.parametrize("factor", [(1.2, 0.9, 1.5), (0.6, 0.5, 0.7)])
def test_what_is_not_established_or_smaller_is_stated_as_a_ratio(factor) -> None:
    found = text(windows({**DRIFTING, "core_overconfidence": factor}))
    assert f"depths are {factor[0]:.3g} times" in found.replace("1.20", "1.2").replace("0.600", "0.6")
    assert "counts as equal" not in found


def test_the_longest_window_up_to_15_that_shows_depth_often_enough_is_taken() -> None:
    longer = windows({**DRIFTING, "consistent_sigma": (9.0, 8.0, 10.0)}, window=20)
    rare = windows({**DRIFTING, "depth_share": (0.1, 0.05, 0.2)}, window=15)
    shorter = windows({**DRIFTING, "consistent_sigma": (0.11, 0.1, 0.12)}, window=10)
    found = text(pl.concat([longer, rare, shorter]))
    assert "Windows have 10 frames. lk: the sigma for depths is 0.110 px (0.100 to 0.120)." in found


def test_all_trackers_are_described_by_windows_of_one_length() -> None:
    both = replace(SCOPE, trackers=("lk", "sift"))
    short = windows(DRIFTING, tracker="sift", window=5)
    long = pl.concat([windows(DRIFTING, window=length) for length in (5, 10, 15)])
    found = text(pl.concat([long, short]), both)
    assert found.count("the sigma for depths is") == 2
    assert "Windows have 5 frames." in found
    without = windows({**DRIFTING, "depth_share": (0.0, 0.0, 0.0)}, tracker="sift", window=5)
    found = text(pl.concat([long, without]), both)
    assert "Windows have 15 frames. lk: the sigma for depths is 0.200 px (0.170 to 0.230)." in found
    assert "sift: too few windows of 15 frames show the depth of a point." in found


def test_without_depth_only_residuals_are_known() -> None:
    rare = windows({**DRIFTING, "depth_share": (0.1, 0.05, 0.2)})
    assert "lk: the residual core is 0.040 px (0.035 to 0.045)." in text(rare)
    assert "is unknown, because few windows show the depth of a point." in text(rare)
    fitted = ReportedConditions(ReferenceCondition("l"), ("lk",), fitted=True)
    without = windows({"residual_core": DRIFTING["residual_core"], "depth_share": (0.0, 0.0, 0.0)})
    assert "is unknown, because true positions are fitted to the tracks." in text(without, fitted)


GATED = {"sigma": (0.16, 0.14, 0.18), "innovations": (0.07, 0.06, 0.08), "track_gate": (0.31, None, None)}
ROBUST = {"sigma": (0.08, 0.05, 0.14), "innovations": (0.07, 0.06, 0.08), "knee": (0.85, None, None)}


def advice(found: dict[str, tuple[float, float | None, float | None]], name: str, **where: Any) -> pl.DataFrame:
    base = {**CONDITION, "estimator": name, "landmark": "free", "purpose": "newest_pose", "window": 11, **where}
    rows = [
        {**base, "quantity": quantity, "value": value, "low": low, "high": high}
        for quantity, (value, low, high) in found.items()
    ]
    return pl.DataFrame(rows, schema=dict(ADVICE))


def on_estimator(table: pl.DataFrame, truth: pl.DataFrame = TRUSTED) -> Headline | None:
    summary = pl.DataFrame([CONDITION], schema=dict(SUMMARY))
    return estimator_noise({"advice": table, "summary": summary, "trust": truth}, SCOPE)


def advised(table: pl.DataFrame, truth: pl.DataFrame = TRUSTED) -> str:
    found = on_estimator(table, truth)
    return "" if found is None else found.text.replace("\N{NO-BREAK SPACE}", " ")


def test_a_filter_has_sigma_and_gates_together() -> None:
    more = {**GATED, "observation_gate": (0.9, None, None)}
    found = advised(advice(more, "filter"))
    assert found.startswith("Noise to set in a filter, windows of 11 frames at speed 1. lk: set 0.160 px (0.14")
    assert "Set a track gate of 0.310 and an observation gate of 0.900." in found
    assert "Innovations will suggest 0.070 px." in found
    assert (
        "Sigma makes the covariance of the newest pose right where the gates reject nothing. Gates are factors on"
        in found
    )
    assert "NEES" not in found
    tried = advised(advice({**more, "gated_nees": (0.61, 0.5, 0.72)}, "filter"))
    assert "gate of 0.900. With this track gate, the NEES of the newest pose is 0.610 (0.500 to 0.720)." in tried


def test_sigma_of_a_second_view_is_said_to_be_for_both_cameras() -> None:
    ratios = {"position_of_both": (0.7, 0.6, 0.8), "rotation_of_both": (0.5, None, None)}
    found = advised(advice({**GATED, **ratios}, "filter"))
    assert "positions in both cameras. With both cameras, errors of the newest position are 0.700 (0.600" in found
    assert "both cameras" not in advised(advice(GATED, "filter"))


def test_features_in_the_state_have_a_sigma_of_their_own() -> None:
    found = advised(
        advice({**GATED, "state_sigma": (0.29, 0.2, 0.4), "observation_gate": (0.44, None, None)}, "openvins")
    )
    assert (
        "Set 0.290 px for features in the state. Set a track gate of 0.310 and an observation gate of 0.440." in found
    )


def test_a_window_has_sigma_and_loss_together() -> None:
    found = advised(advice(ROBUST, "sliding_window", kernel="cauchy"))
    assert "lk: set 0.080 px (0.050 to 0.140). Set the knee of the Cauchy loss to 0.850 sigma." in found
    assert "chi-square" not in found
    assert "Sigma makes the covariance of the newest pose right." in found


@pytest.mark.parametrize("bounds", [(0.14, 0.18), (None, None)])
def test_its_number_is_the_sigma_to_set(bounds: tuple[float | None, float | None]) -> None:
    """Whatever the order of the table, and also where only innovations have an interval."""
    table = advice({**GATED, "sigma": (0.16, *bounds)}, "filter").sort("quantity")
    found = on_estimator(table).estimate
    assert (found.value, found.low, found.high, found.unit) == (0.16, *bounds, "px")


def test_without_a_model_nothing_is_advised() -> None:
    assert advised(advice({}, "filter")) == ""


@pytest.mark.parametrize("verdict", ["trusted", "limited"])
def test_a_usable_truth_has_a_number_to_set(verdict: str) -> None:
    assert "lk: set 0.160 px (0.140 to 0.180). " in advised(advice(GATED, "filter"), trust(verdict, 0.3))
    found = text(windows(DRIFTING), SCOPE, trust(verdict, 0.3))
    assert "the sigma for depths is 0.200 px (0.170 to 0.230)." in found


@pytest.mark.parametrize(
    ("verdict", "says"),
    [("not trusted", "The truth is not trusted."), ("unknown", "Whether the truth can be trusted is unknown.")],
)
def test_another_truth_has_an_upper_bound_that_is_marked(verdict: str, says: str) -> None:
    found = advised(advice(GATED, "filter"), trust(verdict, 0.75))
    bound = "lk: set at most 0.160 px (0.140 to 0.180)"
    assert (
        f"{bound}. {says} The noise of the tracker alone may be as small as 0.080 px." in found
    )  # half, if it has a quarter of squares
    for unbounded in (trust(verdict, 1.0), trust(verdict)):
        assert f"{bound}. {says} Set a track gate" in advised(advice(GATED, "filter"), unbounded)
    found = text(windows(DRIFTING), SCOPE, trust(verdict, 0.75))
    assert f"for depths is at most 0.200 px (0.170 to 0.230). {says} The noise" in found


def test_trimmed_errors_lead_where_verdicts_are_about_them() -> None:
    scope = ReportedConditions(ReferenceCondition("l"), ("lk",), percentile=90.0, trimming=Trimming.trimmed)
    both = pl.concat([windows(DRIFTING), windows(HONEST, trimming="trimmed")])
    assert "from trimmed errors." in text(both, scope)
    assert "as uncertain as claimed, which counts as equal." in text(both, scope)
    untouched = ReportedConditions(ReferenceCondition("l"), ("lk",))
    assert text(windows(DRIFTING), untouched).startswith("Sigma for the depths of points at speed 1. Windows have 15")


def test_too_few_windows_say_nothing() -> None:
    assert headline(windows(DRIFTING, n=20)) is None
    assert headline(empty(WINDOW_SIGMAS)) is None


def test_intervals_are_named_by_what_the_reported_trackers_have() -> None:
    two = replace(SCOPE, trackers=("lk", "sift"))
    rare = windows(DRIFTING, tracker="sift", resampled="blocks", n_scenes=3)
    faster = windows(DRIFTING, speed=4, n_scenes=2)
    found = text(pl.concat([windows(DRIFTING), rare, faster]), two)
    assert "Brackets hold 95 % intervals over 8 scenes. Others hold 95 % intervals from blocks of tracks" in found
    assert "3 scenes" in found
    assert "2 scenes" not in found.replace("2 to", "")
    assert text(pl.concat([windows(DRIFTING), rare, faster])).endswith("Brackets hold 95 % intervals over 8 scenes.")
