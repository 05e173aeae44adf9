"""Intervals of the core, whose blocks are those of a condition of few scenes, or of few groups of scenes."""

import numpy as np
import pytest

from tracknoise.analysis.curve_intervals import core_bounds
from tracknoise.inference.bootstrap import Draws
from tracknoise.inference.intervals import Method
from tracknoise.inference.units import SceneGroups
from tracknoise.statistics.prepared import prepare_sequence
from tracknoise.statistics.scales import scale_blocks, scales


@pytest.mark.parametrize(
    ("n_scenes", "n_groups", "resampled"),
    [(5, 5, "blocks"), (6, 6, "scenes"), (6, 4, "blocks"), (8, 4, "within"), (12, 6, "groups")],
)
def test_scenes_of_one_group_are_not_taken_for_independent(
    see_errors, n_scenes: int, n_groups: int, resampled: str
) -> None:
    rng = np.random.default_rng(1)
    seen = see_errors(list(0.3 * rng.standard_normal((n_scenes, 200, 4, 2))), percentile=None)
    prepared = prepare_sequence(seen.observations, seen.tracks)
    whole, blocks = (
        table.filter(population="visible", trimming="untrimmed") for table in (scales(prepared), scale_blocks(prepared))
    )
    names = whole["scene"].unique().sort().to_list()
    groups = SceneGroups({("d", scene): f"place-{place % n_groups}" for place, scene in enumerate(names)})
    found = core_bounds(whole, blocks, Draws(names, n_draws=0, dataset="d", groups=groups), Method())
    assert found.units.resampled == resampled
    assert ((found.estimates.low < 0.3) & (found.estimates.high > 0.3)).mean() > 0.8


@pytest.mark.parametrize("n_scenes", [2, 7])
def test_the_core_of_one_coordinate_has_bounds_where_the_other_is_exactly_zero(see_errors, n_scenes: int) -> None:
    rng = np.random.default_rng(2)
    errors = [np.stack([np.zeros((400, 3)), rng.standard_normal((400, 3))], axis=-1) for _ in range(n_scenes)]
    seen = see_errors(errors, percentile=None)
    prepared = prepare_sequence(seen.observations, seen.tracks)
    whole, blocks = (
        table.filter(population="visible", trimming="untrimmed") for table in (scales(prepared), scale_blocks(prepared))
    )
    names = whole["scene"].unique().sort().to_list()
    found = core_bounds(whole, blocks, Draws(names, n_draws=0), Method()).estimates
    assert np.isnan(found.value[0]).all()
    assert (found.n_scenes[0] == 0).all()
    assert ((found.low[1] < found.value[1]) & (found.value[1] < found.high[1])).all()
    assert (found.n_scenes[1] == n_scenes).all()
