import numpy as np
import pytest

from tracknoise.inference.multiple_tests import benjamini_hochberg, hochberg, holm, in_families

P = [0.04, 0.01, 0.03]


def test_holm_by_hand() -> None:
    # 3 x 0.01, then 2 x 0.03, then 0.04, which may not be less than the one before
    assert holm(P) == pytest.approx([0.06, 0.03, 0.06])


def test_benjamini_and_hochberg_by_hand() -> None:
    # 0.04, then 3/2 x 0.03 = 0.045, which may not be more than the one after, then 3 x 0.01
    assert benjamini_hochberg(P) == pytest.approx([0.04, 0.03, 0.04])


def test_hochberg_by_hand() -> None:
    # 0.04, then 2 x 0.03 and 3 x 0.01, which may not be more than the ones after
    assert hochberg(P) == pytest.approx([0.04, 0.03, 0.04])
    assert hochberg([0.03, 0.02, 0.9]) == pytest.approx([0.06, 0.06, 0.9])


def test_a_family_is_adjusted_as_if_there_were_no_other() -> None:
    found = in_families(holm, [0.04, 0.9, 0.01, None, 0.03, 0.2], ["a", "b", "a", "a", "a", "b"])
    assert found[[0, 2, 4]] == pytest.approx(holm(P))
    assert found[[1, 5]] == pytest.approx(holm([0.9, 0.2]))
    assert np.isnan(found[3])


@pytest.mark.parametrize("adjust", [holm, hochberg, benjamini_hochberg])
class TestEach:
    def test_a_single_test_stays_as_it_is(self, adjust) -> None:
        assert adjust([0.2]).tolist() == [0.2]

    def test_tests_that_there_were_not_do_not_count(self, adjust) -> None:
        found = adjust([None, 0.04, float("nan"), 0.01, 0.03])
        assert np.isnan(found[[0, 2]]).all()
        assert found[[1, 3, 4]].tolist() == adjust(P).tolist()

    def test_none_at_all(self, adjust) -> None:
        assert adjust([]).shape == (0,)
        assert np.isnan(adjust([None, None])).all()

    def test_never_above_one_and_never_below_p(self, adjust) -> None:
        p = np.random.default_rng(0).uniform(size=50)
        found = adjust(p)
        assert ((p <= found) & (found <= 1)).all()

    def test_keeps_the_order_and_ties(self, adjust) -> None:
        p = np.round(np.random.default_rng(1).uniform(size=40) ** 3, 2)
        found = adjust(p)
        assert (np.diff(found[np.argsort(p, kind="stable")]) >= 0).all()
        assert all(len(set(found[p == value])) == 1 for value in p)

    def test_what_is_given_is_not_changed(self, adjust) -> None:
        p = np.array([0.5, 0.01])
        adjust(p)
        assert p.tolist() == [0.5, 0.01]


def test_holm_is_the_more_careful() -> None:
    p = np.random.default_rng(2).uniform(size=30) ** 2
    assert (holm(p) >= hochberg(p)).all()
    assert (hochberg(p) >= benjamini_hochberg(p)).all()
