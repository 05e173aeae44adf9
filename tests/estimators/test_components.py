from dataclasses import replace

import numpy as np
import pytest
from tests.estimators.simulated_tracks import MOTIONS, units

from tracknoise.estimators.components import (
    Equations,
    LeftOut,
    fit_components,
    fit_noise,
    independent_noun,
    independent_sums,
    matrix,
    without_negative,
)
from tracknoise.exceptions import SettingsError
from tracknoise.inference.track_noise import NAMES
from tracknoise.inference.units import BLOCKS, Resampled, Units

PLANTED = {
    "white": {"white": 0.3},
    "detection": {"first": 0.3, "white": 0.3},
    "walk": {"walk": 0.1},
    "both": {"white": 0.3, "walk": 0.1},
    "all": {"first": 0.2, "white": 0.2, "walk": 0.08},
    "drift": {"first": 0.2, "drift": 0.05},
}


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("name", PLANTED)
def test_planted_components_come_back_within_intervals(name: str, motion: str) -> None:
    planted = PLANTED[name]
    found = fit_components(units(3, scenes=12, motion=motion, **planted), level=0.99).components
    for component in NAMES:
        sigma = found[component].sigma
        assert (found[component].why_dropped is None) == (component in planted)
        assert sigma.low <= planted.get(component, 0.0) <= sigma.high
        assert sigma.value == pytest.approx(planted.get(component, 0.0), rel=0.05)


def test_magnification_is_not_read_as_a_walk() -> None:
    forward = units(5, scenes=12, motion="forward", first=0.3, white=0.05)
    ignored = Units(forward.sums.copy(), forward.points, forward.scenes, forward.scene, forward.resampled)
    errors = (forward.points["product"] == "error").to_numpy()
    ignored.sums[:, errors, 4] = ignored.sums[:, errors, 0]  # as if the image were not magnified
    found = [fit_components(each, level=0.95).components for each in (forward, ignored)]
    assert found[0]["walk"].why_dropped is not None
    assert found[1]["walk"].sigma.value > 0.02 or found[1]["drift"].sigma.value > 0.005


def test_directions_come_back() -> None:
    stretched = units(7, scenes=12, white=0.3, walk=0.1)
    sums = stretched.sums.copy()
    sums[..., 1] *= 4.0  # u
    sums[..., 2] *= 2.0  # uv
    found = fit_components(
        Units(sums, stretched.points, stretched.scenes, stretched.scene, stretched.resampled), level=0.95
    )
    white = found.components["white"].covariance
    assert white[0, 0] / white[1, 1] == pytest.approx(4.0, rel=0.1)
    assert np.linalg.eigvalsh(white)[0] > 0


def test_scenes_that_differ_widen_intervals() -> None:
    same, differing = (
        fit_components(units(9, scenes=12, white=0.3, spread=spread), level=0.95).components["white"].sigma
        for spread in (0.0, 0.3)
    )
    assert differing.high - differing.low > 3 * (same.high - same.low)


def test_units_have_components_of_their_own_that_describe_their_errors() -> None:
    made = units(11, scenes=12, first=0.3, white=0.3, spread=0.5)
    own = fit_components(made, level=0.95).of_units()
    is_error = (made.points["product"] == "error").to_numpy()
    counts, second, factors = made.sums[:, is_error, 0], made.sums[:, is_error][..., [1, 3]], made.sums[:, is_error, 4:]
    measured = second.sum(axis=(1, 2)) / counts.sum(axis=1) / 2.0
    described = np.einsum("uec,uc->u", factors, np.trace(own, axis1=2, axis2=3) / 2.0) / counts.sum(axis=1)
    assert measured.max() > 5.0 * measured.min()
    np.testing.assert_allclose(described, measured, rtol=0.1)


def test_a_unit_with_few_tracks_has_what_the_others_have() -> None:
    made = units(12, scenes=8, first=0.3, white=0.3)
    sums = made.sums.copy()
    sums[0] = 0.0
    fitted = fit_components(replace(made, sums=sums), level=0.95)
    whole = np.array([fitted.components[name].sigma.value ** 2 for name in ("first", "white")])
    np.testing.assert_allclose(np.trace(fitted.of_units()[0, :2], axis1=1, axis2=2) / 2.0, whole, rtol=0.02)


def test_intervals_of_a_walk_alone_contain_it_in_most_seeds() -> None:
    seeds = range(40)
    found = [fit_components(units(seed, scenes=8, n_tracks=60, walk=0.1), level=0.95).components for seed in seeds]
    contained = [one["walk"].sigma.low <= 0.1 <= one["walk"].sigma.high for one in found]
    assert 36 <= sum(contained) <= 40  # 95 % of 40 seeds are 38


@pytest.mark.parametrize(("seed", "kept"), [(3, True), (9, False)])
def test_intervals_hold_whichever_way_a_close_decision_goes(seed: int, kept: bool) -> None:
    faint = units(seed, scenes=8, n_tracks=60, walk=0.1, white=0.03)
    fitted = fit_components(faint, level=0.95)
    white, walk = NAMES.index("white"), NAMES.index("walk")
    assert (white in fitted.selection.active) is kept
    (alternative,) = fitted.selection.alternatives
    assert (white in alternative) is not kept
    own, other = (
        fitted.sums.half_traces(active, scale="log", level=0.95) for active in (fitted.selection.active, alternative)
    )
    places = fitted.selection.active.index(walk), alternative.index(walk)
    bounds = [(one.low[place] ** 0.5, one.high[place] ** 0.5) for one, place in zip((own, other), places, strict=True)]
    sigma = fitted.components["walk"].sigma
    assert (sigma.low, sigma.high) == pytest.approx((min(bounds)[0], max(high for _, high in bounds)))
    assert sigma.high - sigma.low > max(high - low for low, high in bounds)


def test_groups_of_scenes_are_left_out_as_a_whole() -> None:
    grouped = replace(units(1, scenes=8, white=0.3), resampled=Resampled.within, group=np.arange(8) // 2)
    left = independent_sums(grouped)
    assert len(left) == 4
    np.testing.assert_allclose(left[1], grouped.sums[2:4].sum(axis=0))
    assert fit_components(grouped, level=0.95).components["white"].sigma.value == pytest.approx(0.3, rel=0.05)


def test_reasons_name_what_was_left_out() -> None:
    few = units(11, scenes=4, n_tracks=60, first=0.2, white=0.2, walk=0.03)
    why = fit_components(few, level=0.95).components["drift"].why_dropped
    assert why == "other components describe blocks of tracks that were left out better"
    many = units(1, scenes=8, white=0.3)
    grouped = replace(many, resampled=Resampled.within, group=np.arange(8) // 2)
    in_two = replace(grouped, group=np.arange(8) // 4)  # too few to be left out
    named = [(independent_noun(one), len(independent_sums(one))) for one in (many, grouped, in_two)]
    assert named == [("scenes", 8), ("groups of scenes", 4), ("scenes", 8)]


@pytest.mark.parametrize("seed", [0, 2])
def test_few_scenes_without_blocks_are_left_out_themselves(seed: int) -> None:
    """At speeds above the lowest one, all tracks of a scene are in one block."""
    few = units(seed, scenes=4, n_tracks=300, white=0.2)
    sums = np.zeros_like(few.sums)
    np.add.at(sums, few.scene * BLOCKS, few.sums)
    fitted = fit_components(replace(few, sums=sums), level=0.95)
    assert fitted.selection.active == (NAMES.index("white"),)
    assert independent_noun(fitted.sums.units) == "scenes"
    for name in ("first", "walk", "drift"):
        component = fitted.components[name]
        assert "interval of its variance" not in component.why_dropped
        assert (component.sigma.low, component.sigma.high) == (None, None)
    white = fitted.components["white"].sigma
    assert (white.low, white.high) == (None, None)


def test_too_few_errors_are_refused() -> None:
    with pytest.raises(SettingsError, match="too few errors to fit"):
        fit_components(units(1, scenes=6, white=0.3, n_tracks=2), level=0.95)


def test_bounded_solutions_have_no_negative_eigenvalues() -> None:
    factors = np.array([[1.0, 1, 1, 1], [1, 1, 2, 4], [0, 2, 1, 1], [0, -1, 0, 1], [1, 1, 3, 9]])
    second = factors @ np.array([[0.1, 0.0, 0.1], [0.2, 0.1, 0.3], [0.1, 0.3, 0.1], [0.0, 0.0, 0.0]])
    found = Equations(second, factors).bounded(np.ones(5), range(4))
    for entries in found:
        assert np.linalg.eigvalsh(matrix(entries))[0] >= -1e-12
    free = Equations(second, factors).solved(np.ones(5), range(4))
    assert np.linalg.eigvalsh(matrix(free[2]))[0] < 0
    np.testing.assert_allclose(without_negative(np.array([1.0, 2.0, 1.0])), 1.5)


def test_covariances_alone_are_those_of_the_fit_with_intervals() -> None:
    for seed, planted in ((3, {"white": 0.3}), (4, {"first": 0.2, "walk": 0.1}), (5, {"white": 0.3, "drift": 0.02})):
        made = units(seed, scenes=8, **planted)
        with_intervals, alone = fit_components(made, level=0.95).noise, fit_noise(made, level=0.95)
        for name in ("first", "white", "walk", "drift"):
            np.testing.assert_array_equal(getattr(alone, name), getattr(with_intervals, name))


def test_each_choice_of_components_is_scored_once(monkeypatch: pytest.MonkeyPatch) -> None:
    scored, score = [], LeftOut.score

    def counted(self: LeftOut, weights: np.ndarray, active: tuple[int, ...]) -> float:
        scored.append(active)
        return score(self, weights, active)

    monkeypatch.setattr(LeftOut, "score", counted)
    fit_components(units(3, scenes=8, white=0.3, walk=0.1), level=0.95)
    assert len(scored) > 4
    assert len(scored) == len(set(scored))


def test_a_tracker_without_errors_has_no_noise() -> None:
    fitted = fit_components(units(0), level=0.95)
    assert {name: one.sigma.value for name, one in fitted.components.items()} == dict.fromkeys(NAMES, 0.0)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("white", [0.0, 1e-16, 1e-10, 1e-8])
def test_rounding_errors_are_no_noise(white: float, motion: str) -> None:
    """Beside the noise of the first position, they are too small for the precision of the sums."""
    found = fit_components(units(2, scenes=8, first=0.3, white=white, motion=motion), level=0.95)
    assert [name for name, one in found.components.items() if one.sigma.value > 0.0] == ["first"]
