from dataclasses import replace

import numpy as np
import pytest

from tracknoise.analysis.growth_models import Agreement, Model
from tracknoise.analysis.growth_verdict import Changes, Growth, Loss, behaves
from tracknoise.inference.estimates import Estimate

SIZES = {
    "white": Estimate(0.2, 0.19, 0.21, "px"),
    "walk": Estimate(0.09, 0.08, 0.1, "px per sqrt(frame)"),
    "drift": Estimate(0.03, 0.02, 0.04, "px per frame"),
    "saturating_white": Estimate(0.01, 0.0, 0.02, "px"),
    "saturating": Estimate(0.3, 0.28, 0.32, "px"),
    "time_constant": Estimate(6.0, 5.0, 8.0, "frames"),
}
CLEAR, NOT = Estimate(0.9, 0.7, 1.0), Estimate(0.05, 0.0, 0.2)
FITS = Agreement(0.4, 0.1, np.array([-0.1, 0.0, 0.0, 0.0, 0.0]), np.zeros(5))
FAILS = Agreement(0.001, 0.02, np.array([0.0, 0.31, 0.0, 0.0, 0.0]), np.zeros(5))
TERMS = ("white", "walk", "drift")


def model(term: str | None, agreement: Agreement = FITS, terms: tuple[str, ...] = TERMS) -> Model:
    return Model({name: CLEAR if name == term else NOT for name in terms}, agreement)


def growth(term: str | None, **changed: object) -> Growth:
    found = Growth(SIZES, {}, model(term), None, None, 30.0)
    return replace(found, **changed)


def changes(related: float = 0.0, mean: float | None = 0.0) -> Changes:
    return Changes(Estimate(related, related - 0.05, related + 0.05), mean)


def said(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.parametrize(
    ("term", "changed", "verdict", "expected"),
    [
        ("white", changes(-0.5), "white", "independent from frame to frame"),
        ("white", changes(0.0), "white", "0.200 px (0.190 to 0.210), mostly the same offset"),
        ("white", changes(-0.25), "white", "0.200 px (0.190 to 0.210)"),
        ("walk", changes(), "random walk", "random walk: 0.0900 px per sqrt(frame) (0.0800 to 0.100)"),
        ("drift", changes(mean=0.01), "drift", "0.0300 px per frame (0.0200 to 0.0400); the mean changes by 0.0100 px"),
        (None, changes(), "undecided", "the intervals do not show which term dominates the second moment"),
    ],
)
def test_the_sentence_says_what_was_found(term: str | None, changed: Changes, verdict: str, expected: str) -> None:
    named, why = behaves(growth(term), changed)
    assert named == verdict
    assert expected in said(why)


def test_what_grows_besides_is_told() -> None:
    _, why = behaves(growth("white"), changes(-0.5))
    assert said(why).startswith("mostly constant")
    assert said(why).endswith("; also a random walk of 0.0900 px per sqrt(frame) (0.0800 to 0.100); also a drift of "
                              "0.0300 px per frame (0.0200 to 0.0400)")  # fmt: skip
    still = {**SIZES, "walk": Estimate(0.01, 0.0, 0.02), "drift": Estimate(0.0, 0.0, 0.01)}
    _, alone = behaves(growth("white", sizes=still), changes())
    assert alone.startswith("constant")
    assert "also" not in alone


def test_a_term_that_is_large_but_not_for_certain_decides_nothing() -> None:
    shares = {"white": Estimate(0.6, 0.4, 0.8), "walk": Estimate(0.4, 0.1, 0.6), "drift": NOT}
    assert behaves(growth(None, polynomial=Model(shares, FITS)), changes())[0] == "undecided"
    unknown = {name: Estimate(share.value) for name, share in shares.items()}
    verdict, why = behaves(growth(None, polynomial=Model(unknown, FITS)), changes())
    assert verdict == "undecided"
    assert "nan" not in why
    assert "white 60.0" in why


def test_a_model_that_the_autocorrelations_refuse_gives_way_or_nothing_fits() -> None:
    refused = model("walk", FAILS)
    limited = model("saturating", terms=("white", "saturating"))
    verdict, why = behaves(growth("walk", polynomial=refused, saturating=limited), changes())
    assert verdict == "saturating"
    assert said(why) == "saturating: 0.300 px (0.280 to 0.320) with a time constant of 6 frames (5 to 8)"
    worse = model("saturating", FAILS, terms=("white", "saturating"))
    verdict, why = behaves(growth("walk", polynomial=refused, saturating=worse), changes())
    assert verdict == "none"
    assert why == "none of the models fits: the autocorrelation of changes at lag 2 is 0.31, and 0.00 was predicted"
    endless = {**SIZES, "time_constant": Estimate(90.0, 20.0, 120.0, "frames")}
    verdict, why = behaves(growth("walk", sizes=endless, polynomial=refused, saturating=limited), changes())
    assert (verdict, "ages are up to 30" in why) == ("undecided", True)


def test_what_is_missed_by_chance_or_by_little_refuses_nothing() -> None:
    assert FAILS.refused
    assert not replace(FAILS, p=0.02).refused
    assert not replace(FAILS, measured=np.array([0.0, 0.02, 0.0, 0.0, 0.0])).refused
    assert replace(FAILS, measured=np.zeros(5), misfit=0.06).refused


def test_the_loss_of_tracks_refuses_every_model() -> None:
    verdict, why = behaves(growth("walk", loss=Loss(0.001, 1.0, 20, -0.3)), changes())
    assert verdict == "undecided"
    assert "seen at age 20 or later have a second moment 30.0 % smaller than all tracks" in said(why)
    assert behaves(growth("walk", loss=Loss(0.001, 1.0, 20, -0.03)), changes())[0] == "random walk"
    assert behaves(growth("walk", loss=Loss(0.2, 0.001, 20, -0.3)), changes())[0] == "undecided"
    assert behaves(growth("walk", loss=Loss(0.5, 0.001, 20, -0.3)), changes())[0] == "random walk"
