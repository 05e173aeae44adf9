from math import nan

import pytest

from tracknoise.findings.growth.behaviour import Growth, behaves
from tracknoise.findings.shape.verdict import Interval

SIZES = {"white": Interval(0.2, 0.19, 0.21), "walk": Interval(0.09, 0.08, 0.1), "drift": Interval(0.03, 0.02, 0.04)}
CLEAR, NOT = Interval(0.9, 0.7, 1.0), Interval(0.05, 0.0, 0.2)


def growth(term: str | None, *, related: float = 0.0, mean: float = 0.0, misfit: float = 0.02) -> Growth:
    shares = {name: CLEAR if name == term else NOT for name in SIZES}
    return Growth(SIZES, shares, Interval(related, related - 0.05, related + 0.05), mean, misfit)


@pytest.mark.parametrize(
    ("found", "verdict", "said"),
    [
        (growth("white", related=-0.5), "white", "differs from frame to frame as independent errors do"),
        (growth("white", related=0.0), "white", "0.200 px [0.190, 0.210], and mostly stays what it is"),
        (growth("white", related=-0.25), "white", "0.200 px [0.190, 0.210]"),
        (growth("walk"), "random walk", "behaves like a random walk: 0.0900 px per sqrt(frame) [0.0800, 0.100]"),
        (growth("drift", mean=0.01), "drift", "0.0300 px per frame [0.0200, 0.0400]; its mean changes by 0.0100 px"),
        (growth(None), "undecided", "none is more than half of it for certain"),
        (growth("walk", misfit=0.4), "none", "misses its square by 40.0 %"),
    ],
)
def test_the_sentence_says_what_was_found(found: Growth, verdict: str, said: str) -> None:
    named, why = behaves(found)
    assert named == verdict
    assert said in why.replace("\N{NO-BREAK SPACE}", " ")


def test_what_grows_besides_is_told() -> None:
    _, why = behaves(growth("white", related=-0.5))
    said = why.replace("\N{NO-BREAK SPACE}", " ")
    assert said.startswith("is mostly as large at first as later")
    assert said.endswith("; besides, it wanders by 0.0900 px per sqrt(frame) [0.0800, 0.100]; besides, it drifts by "
                         "0.0300 px per frame [0.0200, 0.0400]")  # fmt: skip
    still = {"white": SIZES["white"], "walk": Interval(0.01, 0.0, 0.02), "drift": Interval(0.0, 0.0, 0.01)}
    shares = {name: CLEAR if name == "white" else NOT for name in SIZES}
    _, alone = behaves(Growth(still, shares, Interval(0.0, -0.05, 0.05), 0.0, 0.02))
    assert alone.startswith("is as large at first as later")
    assert "besides" not in alone


def test_a_term_that_is_large_but_not_for_certain_decides_nothing() -> None:
    shares = {"white": Interval(0.6, 0.4, 0.8), "walk": Interval(0.4, 0.1, 0.6), "drift": NOT}
    assert behaves(Growth(SIZES, shares, Interval(0.0, nan, nan), nan, 0.0))[0] == "undecided"
    unknown = {name: Interval(share.value, nan, nan) for name, share in shares.items()}
    verdict, why = behaves(Growth(SIZES, unknown, Interval(0.0, nan, nan), nan, 0.0))
    assert verdict == "undecided"
    assert "nan" not in why
