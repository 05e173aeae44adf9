from collections.abc import Callable
from pathlib import Path

import pytest

from tracknoise.exceptions import DataError
from tracknoise.simulation.sdf_files import Library, model_file, model_names


def test_model_uris_are_looked_for_in_each_root_in_turn(tmp_path: Path) -> None:
    for place in ("a/crate", "b/crate", "b/barrel/meshes"):
        (tmp_path / place).mkdir(parents=True)
    library = Library((tmp_path / "a", tmp_path / "b"))
    assert library.find("model://crate", tmp_path) == tmp_path / "a/crate"
    assert library.find("model://barrel/meshes", tmp_path) == tmp_path / "b/barrel/meshes"
    assert library.find("model://bus", tmp_path) is None


@pytest.mark.parametrize("name", ["a" * 5000, "a\0b"])
def test_a_name_that_no_file_can_have_is_not_found(tmp_path: Path, name: str) -> None:
    assert Library((tmp_path,)).find(f"model://{name}", tmp_path) is None


def test_paths_start_beside_the_file_that_has_them(tmp_path: Path) -> None:
    mesh = tmp_path / "meshes" / "quad.obj"
    mesh.parent.mkdir()
    mesh.touch()
    library = Library(())
    assert library.find("meshes/quad.obj", tmp_path) == mesh
    assert library.find(f"file://{mesh}", Path("/")) == mesh
    assert library.find("meshes/QUAD.obj", tmp_path) == mesh
    assert library.find("https://example.org/meshes/quad.obj", tmp_path) is None


@pytest.mark.parametrize(
    ("place", "name"),
    [
        ("meshes/wood.png", "wood.png"),
        ("meshes/wood.png", "C:\\work\\Wood.PNG"),
        ("meshes/images/wood.png", "images/wood.png"),
        ("meshes/dark wood.png", "dark%20wood.png"),
        ("materials/textures/wood.png", "../materials/textures/wood.png"),
        ("materials/textures/wood.png", "wood.png"),
        ("materials/textures/Wood.png", "file:///home/somebody/wood.png"),
        ("textures/wood.png", "wood.png"),
    ],
)
def test_textures_are_found_where_gazebo_keeps_them(tmp_path: Path, place: str, name: str) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / place).touch()
    found = Library(()).find_texture(name, tmp_path / "meshes")
    assert found is not None
    assert found.samefile(tmp_path / place)


def test_a_texture_that_is_nowhere_is_not_found(tmp_path: Path) -> None:
    assert Library(()).find_texture("wood.png", tmp_path) is None


def test_models_are_the_folders_with_a_config(tmp_path: Path, model: Callable) -> None:
    folder = model("crate", "").parent
    (folder / "notes").mkdir()
    assert model_names(folder) == ["crate"]
    for bad, message in ((tmp_path / "none", "no such folder"), (tmp_path / "models" / "notes", "no model")):
        with pytest.raises(DataError, match=message):
            model_names(bad)


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ("<model/>", r"model\.config: no SDF file named, expected <sdf"),
        ("<model><sdf version='1.6'>gone.sdf</sdf></model>", r"gone\.sdf: no such file, expected the model's SDF file"),
        ("<model>", r"model\.config:1: malformed XML"),
    ],
)
def test_a_config_that_leads_nowhere_is_named(model: Callable, config: str, message: str) -> None:
    folder = model("crate", "")
    (folder / "model.config").write_text(config)
    with pytest.raises(DataError, match=message):
        model_file(folder)
