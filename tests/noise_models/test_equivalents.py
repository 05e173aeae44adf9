"""Standard deviations for all observations: of a first direction that is a state, they are those of the others."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.noise_models.simulated_tracks import units

from tracknoise.noise_models.fitting.components import fit_components
from tracknoise.noise_models.fitting.equivalents import equivalents
from tracknoise.noise_models.fitting.fit import equivalents_of
from tracknoise.noise_models.fitting.training_tables import training_tables
from tracknoise.noise_models.fitting.training_windows import windows
from tracknoise.noise_models.model import Interval, Landmark, Purpose
from tracknoise.tables.schema import WINDOW_NOISE, empty
from tracknoise.tables.store import RunFolder


def of_state(length: int, **planted: float) -> dict[Purpose, Interval]:
    fitted = fit_components(units(0, scenes=8, **planted), level=0.95)
    some = windows([], speed=1, length=length, lifetimes=np.full(50, 12))
    found = equivalents(fitted, some, length=length, speed=1, gates=(1.0, 1.0))
    return {one.purpose: one.sigma for one in found if one.landmark is Landmark.STATE}


@pytest.mark.parametrize("white", [0.1, 0.02])
@pytest.mark.parametrize("length", [5, 10])
def test_the_state_takes_the_noise_of_the_first_position_from_all_others(length: int, white: float) -> None:
    found = of_state(length, first=0.3, white=white)
    for purpose in (Purpose.INNOVATIONS, Purpose.ALL_POSES, Purpose.DEPTH):
        assert found[purpose].value == pytest.approx(white, rel=0.03)
        assert found[purpose].low < white < found[purpose].high


def test_gates_of_a_walk_do_not_depend_on_the_speed(planted_run: Path) -> None:
    """Where too few windows were measured: the walk of all frames between two of the tracker counts."""
    fitted = fit_components(units(0, scenes=8, walk=0.1), level=0.95)
    found = {}
    for speed in (1, 2):
        read = training_tables(RunFolder(planted_run), tracker="oracle", speed=speed)
        unmeasured = replace(read, tables={**read.tables, "window_noise": empty(WINDOW_NOISE)})
        kept = [one for one in equivalents_of(unmeasured, fitted, (5,)) if one.landmark is Landmark.FREE]
        found[speed] = next(one for one in kept if one.purpose is Purpose.INNOVATIONS)
    assert found[2].sigma.value > 1.2 * found[1].sigma.value
    assert found[2].gate_95 == pytest.approx(found[1].gate_95, rel=0.1)


def test_noise_of_the_first_position_alone_leaves_the_others_exact() -> None:
    assert of_state(5, first=0.3) == dict.fromkeys(Purpose, Interval(value=0.0))
