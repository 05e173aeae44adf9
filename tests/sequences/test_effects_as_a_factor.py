"""Effects of a camera as levels of a factor: each scene is seen with each."""

import numpy as np
import pytest

from tracknoise.exceptions import SettingsError
from tracknoise.experiments.load import load_experiment
from tracknoise.experiments.plan import plan
from tracknoise.experiments.run_statistics import first_lighting
from tracknoise.sequences.reader_registry import make_reader

SMALL = {"motions": ["forward"], "worlds": 1, "frames": 3, "width": 64, "height": 48, "supersampling": 1}
EFFECTS = [
    {"name": "none", "imaging": {"rate_hz": 30.0}},
    {"name": "motion-blur", "imaging": {"rate_hz": 30.0, "exposure_s": 0.03}},
    {"name": "rolling-shutter", "imaging": {"rate_hz": 30.0, "readout_s": 0.03}},
]


def reader(**options):
    return make_reader("simulated", None, {**SMALL, **options})


def test_each_scene_is_seen_with_each_effect_in_the_same_world():
    made = reader(effects=EFFECTS)
    names = made.sequences()
    assert [(one.scene, one.lighting) for one in names] == [
        ("forward-00", "motion-blur"),
        ("forward-00", "none"),
        ("forward-00", "rolling-shutter"),
    ]
    blurred, plain, rolling = map(made.open, names)
    assert plain.shutter is None
    assert rolling.shutter is not None
    np.testing.assert_array_equal(blurred.world_from_camera, plain.world_from_camera)
    assert not np.array_equal(blurred.image(1), plain.image(1))


@pytest.mark.parametrize("place", range(3))
def test_a_sequence_with_an_effect_is_the_one_that_its_imaging_alone_gives(place):
    made, alone = reader(effects=EFFECTS), reader(imaging=EFFECTS[place]["imaging"])
    (name,) = [one for one in made.sequences() if one.lighting == EFFECTS[place]["name"]]
    np.testing.assert_array_equal(made.open(name).image(2), alone.open(alone.sequences()[0]).image(2))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"effects": EFFECTS, "imaging": {"rate_hz": 20.0}}, "effects exclude imaging, and several lightings"),
        ({"effects": EFFECTS, "lightings": ["default", "east"]}, "and several lightings"),
        ({"effects": [EFFECTS[0], EFFECTS[0]]}, "expected different names"),
        ({"effects": [{"name": ""}]}, "names that are not empty"),
        ({"effects": [{"name": "a", "imaging": {"rate_hz": 30.0, "exposur_s": 0.1}}]}, "exposur_s: unknown setting"),
        ({"effects": [{"imaging": {}}]}, "name: missing"),
    ],
)
def test_effects_that_cannot_be_are_named(options, message):
    with pytest.raises(SettingsError, match=message):
        reader(**options)


def test_the_preset_sees_its_scenes_with_each_effect_and_first_without_any():
    experiment = load_experiment("effects", scenes=1)
    names = {task.sequence.lighting for task in plan(experiment)}
    assert names == set(experiment.dataset.lightings)
    assert first_lighting(names, experiment) == "none"
