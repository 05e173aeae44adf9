"""Which windows something is learned from, and which it is tried on."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from benchmarks.noise.arms import PlantedNoise
from benchmarks.noise.windows import Problem, divided, scenes_of, with_joined_scenes
from benchmarks.planted_windows import simulated_problem
from tests.estimators.models import TRAINING

from tracknoise.estimators.linear_window import Motion
from tracknoise.exceptions import SettingsError

FITTED = replace(TRAINING, dataset="places", scenes=())
HALVES = "There is one scene. Its first half was learned from, its second half tried. One scene decides nothing."
SAME = "The model was fitted to all scenes with windows, so that the gain of whole tracks may be too large."
ALIKE = "Scenes of one group are not independent of each other: what is found holds for these groups only."


def _problems(*scenes: str) -> list[Problem]:
    window = simulated_problem(Motion.SIDEWAYS, PlantedNoise(), n_frames=4, n_tracks=5)
    return [replace(window, scene=scene) for scene in scenes]


def _folder(groups: dict[str, str | None]) -> SimpleNamespace:
    """A run whose reader knows groups of scenes."""
    entries = {
        scene: SimpleNamespace(sequence=SimpleNamespace(scene=scene, dataset="places"), group=group, image="")
        for scene, group in groups.items()
    }
    return SimpleNamespace(
        path="run", manifest=lambda: SimpleNamespace(sequences=entries), settings=lambda: {"dataset": {}}
    )


PLACES = {f"{place}{recording}": place for place in "abcdefghijklmn" for recording in (1, 2, 3)}


def test_recordings_of_a_place_are_learned_from_or_tried_on_together() -> None:
    found = divided(_folder(PLACES), _problems(*PLACES), FITTED)
    learned, tested = ({scene[0] for scene in scenes_of(part)} for part in (found.learned_from, found.tested))
    assert not learned & tested
    assert len(learned) == len(tested) == 7
    assert found.limits == ()
    assert {problem.scene for problem in with_joined_scenes(_folder(PLACES), found.tested)} == {
        f"group {number}" for number in range(7)
    }


def test_scenes_without_groups_are_alternated() -> None:
    alone = dict.fromkeys("abcd")
    found = divided(_folder(alone), _problems(*alone), FITTED)
    assert (scenes_of(found.learned_from), scenes_of(found.tested)) == (("a", "c"), ("b", "d"))
    assert found.limits == ()
    assert scenes_of(with_joined_scenes(_folder(alone), found.tested)) == ("b", "d")


@pytest.mark.parametrize(
    ("groups", "fitted"),
    [
        ({scene: PLACES[scene] for scene in PLACES if scene[0] in "abcd"}, ()),  # too few places to resample them
        (PLACES, ("a1", "b1")),  # the model was fitted to other recordings of the same places
    ],
)
def test_says_so_if_tested_scenes_are_like_each_other_or_like_those_of_the_model(groups: dict, fitted: tuple) -> None:
    found = divided(_folder(groups), _problems(*groups), replace(FITTED, scenes=fitted))
    assert found.limits == (ALIKE,)


def test_the_earlier_half_of_one_scene_is_learned_from_and_the_later_one_tried() -> None:
    windows = [
        replace(window, start=start) for window, start in zip(_problems(*"aaaaa"), (40, 0, 10, 20, 30), strict=True)
    ]
    found = divided(_folder({"a": None}), windows, FITTED)
    assert [window.start for window in found.learned_from] == [0, 10]
    assert [window.start for window in found.tested] == [40, 20, 30]
    assert found.limits == (HALVES,)


def test_windows_of_one_time_are_not_divided() -> None:
    """One scene under two lights: both windows show the same moment."""
    with pytest.raises(SettingsError, match="usable windows at 1 time in 1 scene, expected two times"):
        divided(_folder({"a": None}), _problems("a", "a"), FITTED)


def test_says_so_if_the_model_was_fitted_to_the_only_scene() -> None:
    windows = [replace(window, start=start) for start, window in enumerate(_problems("a", "a"))]
    found = divided(_folder({"a": None}), windows, replace(FITTED, scenes=("a",)))
    assert found.limits == (HALVES, SAME)
