import pytest

from tracknoise.findings.estimate import Estimate
from tracknoise.findings.growth.behaviour import Growth, behaves

SIZES = {
    "white": Estimate(0.2, 0.19, 0.21, "px"),
    "walk": Estimate(0.09, 0.08, 0.1, "px per sqrt(frame)"),
    "drift": Estimate(0.03, 0.02, 0.04, "px per frame"),
}
CLEAR, NOT = Estimate(0.9, 0.7, 1.0), Estimate(0.05, 0.0, 0.2)


def growth(term: str | None, *, related: float = 0.0, mean: float = 0.0, misfit: float = 0.02) -> Growth:
    shares = {name: CLEAR if name == term else NOT for name in SIZES}
    return Growth(SIZES, shares, Estimate(related, related - 0.05, related + 0.05), mean, misfit)


@pytest.mark.parametrize(
    ("found", "verdict", "said"),
    [
        (growth("white", related=-0.5), "white", "independent from frame to frame"),
        (growth("white", related=0.0), "white", "0.200 px (0.190 to 0.210), mostly the same offset"),
        (growth("white", related=-0.25), "white", "0.200 px (0.190 to 0.210)"),
        (growth("walk"), "random walk", "random walk: 0.0900 px per sqrt(frame) (0.0800 to 0.100)"),
        (growth("drift", mean=0.01), "drift", "0.0300 px per frame (0.0200 to 0.0400); the mean changes by 0.0100 px"),
        (growth(None), "undecided", "the intervals do not show which term dominates the second moment"),
        (growth("walk", misfit=0.4), "none", "misses the second moment by 40.0 %"),
    ],
)
def test_the_sentence_says_what_was_found(found: Growth, verdict: str, said: str) -> None:
    named, why = behaves(found)
    assert named == verdict
    assert said in why.replace("\N{NO-BREAK SPACE}", " ")


def test_what_grows_besides_is_told() -> None:
    _, why = behaves(growth("white", related=-0.5))
    said = why.replace("\N{NO-BREAK SPACE}", " ")
    assert said.startswith("mostly constant")
    assert said.endswith("; also a random walk of 0.0900 px per sqrt(frame) (0.0800 to 0.100); also a drift of "
                         "0.0300 px per frame (0.0200 to 0.0400)")  # fmt: skip
    still = {"white": SIZES["white"], "walk": Estimate(0.01, 0.0, 0.02), "drift": Estimate(0.0, 0.0, 0.01)}
    shares = {name: CLEAR if name == "white" else NOT for name in SIZES}
    _, alone = behaves(Growth(still, shares, Estimate(0.0, -0.05, 0.05), 0.0, 0.02))
    assert alone.startswith("constant")
    assert "also" not in alone


def test_a_term_that_is_large_but_not_for_certain_decides_nothing() -> None:
    shares = {"white": Estimate(0.6, 0.4, 0.8), "walk": Estimate(0.4, 0.1, 0.6), "drift": NOT}
    assert behaves(Growth(SIZES, shares, Estimate(0.0), None, 0.0))[0] == "undecided"
    unknown = {name: Estimate(share.value) for name, share in shares.items()}
    verdict, why = behaves(Growth(SIZES, unknown, Estimate(0.0), None, 0.0))
    assert verdict == "undecided"
    assert "nan" not in why
    assert "white 60.0" in why
