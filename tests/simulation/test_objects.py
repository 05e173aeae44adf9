from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera
from tracknoise.simulation.built_worlds import PLACES, objects_world
from tracknoise.simulation.motion import MOTIONS
from tracknoise.simulation.ray_casting import Raycaster, depth_map
from tracknoise.simulation.world import Scenery

BOX = "<geometry><box><size>{} {} {}</size></box></geometry><pose>0 0 {} 0 0 0</pose>"


def built(models: Path | None = None, seed: int = 0) -> Scenery:
    return objects_world(np.random.default_rng(seed), models)


@pytest.fixture(scope="module", params=["boxes", "models"])
def scenery(request: pytest.FixtureRequest, sample: Callable) -> Scenery:
    return built(None if request.param == "boxes" else sample("gazebo_models"))


@pytest.fixture
def shelf(tmp_path: Path) -> Callable[..., Path]:
    """Writes models of a single box each, that stand on the ground, by name."""

    def write(**sizes: tuple[float, float, float]) -> Path:
        for name, size in sizes.items():
            folder = tmp_path / "shelf" / name
            folder.mkdir(parents=True)
            (folder / "model.config").write_text("<model><sdf version='1.6'>model.sdf</sdf></model>")
            visual = f"<visual name='v'>{BOX.format(*size, size[2] / 2)}</visual>"
            (folder / "model.sdf").write_text(
                f"<sdf version='1.6'><model name='{name}'><link name='l'>{visual}</link></model></sdf>"
            )
        return tmp_path / "shelf"

    return write


@pytest.mark.parametrize("name", PLACES["objects"].motions)
def test_every_view_is_full_deep_and_clear_of_surfaces(scenery: Scenery, name: str) -> None:
    camera = Camera(40, 30, 34.6, 34.6, 19.5, 14.5)
    raycaster = Raycaster(scenery.world)
    near = []
    for pose in MOTIONS[name](1000, np.random.default_rng(0))[::37]:
        depth = depth_map(raycaster, camera, pose)
        assert depth.valid.all()
        near.append(np.mean(depth.depth_m < 40.0))
        assert depth.depth_m.min() > 2.0
        assert np.quantile(depth.depth_m, 0.9) > 2.0 * np.quantile(depth.depth_m, 0.1)
    assert np.mean(near) > 0.6


def test_the_generator_decides(shelf: Callable) -> None:
    folder = shelf(bus=(10, 3, 3), hall=(20, 15, 8))
    for models in (None, folder):
        first, again, other = built(models), built(models), built(models, seed=1)
        np.testing.assert_array_equal(first.world.vertices, again.world.vertices)
        assert first.notes == again.notes
        assert np.abs(first.world.vertices[-40:] - other.world.vertices[-40:]).max() > 0.1


def test_models_stand_side_by_side_on_the_ground_low_ones_in_front(shelf: Callable) -> None:
    world = built(shelf(bus=(10, 3, 3), car=(5, 2, 1.5), hall=(20, 15, 8), tower=(9, 9, 19))).world
    grey = [index for index, texture in enumerate(world.textures) if texture.size == 1]  # what the boxes wear
    boxes = world.corners[np.isin(world.texture, grey)].reshape(-1, 36, 3)
    low, high = boxes.min(axis=1), boxes.max(axis=1)
    tall = high[:, 2] > 4.5
    assert {3.0, 1.5, 8.0, 19.0} == set(high[:, 2].round(9))
    np.testing.assert_allclose(low[:, 2], 0.0, atol=1e-12)
    for row, (nearest, farthest), half in ((~tall, (2.0, 4.5), 24.0), (tall, (13.0, 18.0), 36.0)):
        assert np.all((low[row, 1] >= nearest) & (low[row, 1] <= farthest))
        assert low[row, 0][0] == pytest.approx(-half)
        assert np.all(low[row, 0][1:] > high[row, 0][:-1] + 0.5 - 1e-9)
        assert high[row, 0][-1] > half - 5.0


def test_the_notes_name_the_models_and_those_left_out(shelf: Callable) -> None:
    folder = shelf(bus=(10, 3, 3), carpet=(90, 90, 0.01), city=(100, 80, 9))
    (folder / "sun").mkdir()
    (folder / "sun" / "model.config").write_text("<model><sdf version='1.6'>sun.sdf</sdf></model>")
    (folder / "sun" / "sun.sdf").write_text("<sdf version='1.6'><light name='sun' type='directional'/></sdf>")
    notes = built(folder).notes
    assert notes[0] == f"its objects are the Gazebo models bus of {folder}"
    assert sorted(notes[1:])[0] == "model carpet is left out: 90 x 90 x 0.01 m is not the size of an object"
    assert sorted(notes[1:])[1] == "model city is left out: 100 x 80 x 9 m is not the size of an object"
    assert sorted(notes[1:])[2].startswith("model sun is left out: ")
    assert len(notes) == 4


def test_a_folder_without_a_usable_model_is_one_line(shelf: Callable) -> None:
    folder = shelf(carpet=(90, 90, 0.01))
    with pytest.raises(DataError, match=r"no usable model; .*model carpet is left out") as caught:
        built(folder)
    assert "\n" not in str(caught.value)
