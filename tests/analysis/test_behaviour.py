from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from tracknoise.analysis.growth_models import Agreement
from tracknoise.analysis.growth_verdict import Changes, Growth, Loss, behaves, grows
from tracknoise.inference.estimates import Estimate

SIZES = {
    "white": Estimate(0.2, 0.19, 0.21, "px"),
    "walk": Estimate(0.09, 0.08, 0.1, "px per sqrt(frame)"),
    "drift": Estimate(0.0, 0.0, 0.01, "px per frame"),
}
LIMITED = {
    "saturating_white": Estimate(0.01, 0.0, 0.02, "px"),
    "saturating": Estimate(0.3, 0.28, 0.32, "px"),
    "time_constant": Estimate(6.0, 5.0, 8.0, "frames"),
}
NONE = Estimate(0.01, 0.0, 0.02)
DRIFT = Estimate(0.03, 0.02, 0.04, "px per frame")
RISES, FLAT, OPEN = Estimate(1.5, 1.3, 1.7), Estimate(1.02, 0.97, 1.07), Estimate(1.08, 0.95, 1.22)
MARGIN = 0.1
FITS = Agreement(0.4, 0.1, np.array([-0.1, 0.0, 0.0, 0.0, 0.0]), np.zeros(5))
FAILS = Agreement(0.001, 0.02, np.array([0.0, 0.31, 0.0, 0.0, 0.0]), np.zeros(5))


def growth(ratio: Estimate | None = RISES, geometric: Mapping[str, Estimate] = SIZES, **changed: object) -> Growth:
    found = Growth(ratio, LIMITED, geometric, FITS, None, None, 30.0)
    return replace(found, **changed)


def changes(related: float = 0.0, mean: float | None = 0.0) -> Changes:
    return Changes(Estimate(related, related - 0.05, related + 0.05), mean)


def said(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.parametrize(
    ("ratio", "verdict"),
    [
        (RISES, "yes"),
        (Estimate(1.3, 1.09, 1.5), "undecided"),
        (FLAT, "no"),
        (Estimate(0.8, 0.7, 0.9), "no"),
        (OPEN, "undecided"),
        (Estimate(1.5), "undecided"),
        (None, "undecided"),
    ],
)
def test_growth_and_its_absence_are_both_shown_by_the_interval(ratio: Estimate | None, verdict: str) -> None:
    assert grows(ratio, MARGIN) == verdict


def test_every_established_part_is_named_the_larger_one_first() -> None:
    verdict, why = behaves(growth(), changes(), MARGIN)
    assert verdict == "random walk"
    assert said(why) == (
        "random walk: 0.0900 px per sqrt(frame) (0.0800 to 0.100); constant part: 0.200 px (0.190 to 0.210)"
    )
    verdict, why = behaves(growth(geometric={**SIZES, "drift": DRIFT}), changes(mean=0.01), MARGIN)
    assert verdict == "drift"
    assert said(why).startswith("drift: 0.0300 px per frame (0.0200 to 0.0400), of which the mean has 0.0100 px per")
    assert "random walk" in why
    assert "constant part" in why


@pytest.mark.parametrize(
    ("related", "expected"),
    [(-0.5, "independent from frame to frame"), (0.0, "mostly the same offset"), (-0.25, "0.200 px (0.190 to 0.210)")],
)
def test_errors_are_constant_where_they_are_shown_not_to_grow(related: float, expected: str) -> None:
    still = {**SIZES, "walk": NONE}
    verdict, why = behaves(growth(FLAT, still), changes(related), MARGIN)
    assert verdict == "white"
    assert expected in said(why)
    verdict, why = behaves(growth(OPEN, still), changes(related), MARGIN)
    assert (verdict, why) == ("undecided", "neither growth nor its absence is established")


def test_growth_whose_kind_is_open_is_still_growth() -> None:
    assert behaves(growth(RISES, {**SIZES, "walk": NONE}), changes(), MARGIN) == (
        "undecided",
        "neither random walk nor drift is established",
    )


def test_a_model_that_the_autocorrelations_refuse_gives_way_or_nothing_fits() -> None:
    verdict, why = behaves(growth(polynomial=FAILS, saturating=FITS), changes(), MARGIN)
    assert verdict == "saturating"
    assert said(why) == "saturating part: 0.300 px (0.280 to 0.320) with a time constant of 6 frames (5 to 8)"
    verdict, why = behaves(growth(polynomial=FAILS, saturating=FAILS), changes(), MARGIN)
    assert verdict == "none"
    assert why == "the autocorrelation of changes at lag 2 is 0.31, and 0.00 was predicted"
    endless = {**LIMITED, "time_constant": Estimate(90.0, 20.0, 120.0, "frames")}
    verdict, why = behaves(growth(sizes=endless, polynomial=FAILS, saturating=FITS), changes(), MARGIN)
    assert (verdict, "ages are up to 30" in why) == ("undecided", True)


def test_what_is_missed_by_chance_or_by_little_refuses_nothing() -> None:
    assert FAILS.refused
    assert not replace(FAILS, p=0.02).refused
    assert not replace(FAILS, measured=np.array([0.0, 0.02, 0.0, 0.0, 0.0])).refused
    assert replace(FAILS, measured=np.zeros(5), misfit=0.06).refused


def test_the_loss_of_tracks_refuses_every_model() -> None:
    verdict, why = behaves(growth(loss=Loss(0.001, 1.0, 20, -0.3)), changes(), MARGIN)
    assert verdict == "undecided"
    assert "seen at age 20 or later have a second moment 30.0 % smaller than all tracks" in said(why)
    assert behaves(growth(loss=Loss(0.001, 1.0, 20, -0.03)), changes(), MARGIN)[0] == "random walk"
    assert behaves(growth(loss=Loss(0.2, 0.001, 20, -0.3)), changes(), MARGIN)[0] == "undecided"
    assert behaves(growth(loss=Loss(0.5, 0.001, 20, -0.3)), changes(), MARGIN)[0] == "random walk"
