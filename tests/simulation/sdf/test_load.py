from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import DataError, DataWarning
from tracknoise.simulation.sdf_worlds import load_model, load_world

QUAD = "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
FACE = "f 1/1 2/2 3/3 4/4\n"
BOX = "<geometry><box><size>2 4 6</size></box></geometry>"

# Sizes (m) that a person would guess for what the models stand for: the smallest and the largest extent of all.
PLAUSIBLE = {
    "ambulance": (2.0, 9.0),
    "bus": (2.0, 14.0),
    "cafe": (2.0, 30.0),
    "construction_barrel": (0.5, 2.0),
    "dumpster": (1.0, 3.5),
    "fire_station": (8.0, 30.0),
    "fountain": (1.0, 4.0),
    "house_1": (5.0, 20.0),
    "jersey_barrier": (0.4, 5.0),
    "mailbox": (0.1, 1.6),
    "office_building": (10.0, 40.0),
    "pickup": (1.4, 7.0),
    "suv": (1.4, 6.0),
    "school": (8.0, 50.0),
}


def in_world(visual: str, pose: str = "0 0 0 0 0 0") -> str:
    return f"<model name='m'><link name='l'><visual name='v'><pose>{pose}</pose>{visual}</visual></link></model>"


def reflectance(scenery) -> float:
    """Of a world in a single even colour."""
    (texture,) = scenery.world.textures
    return float(texture.mean())


def test_a_box_ends_up_where_its_poses_say(world: Callable) -> None:
    scenery = load_world(world(in_world(BOX, "10 20 30 0 0 1.5707963267948966")))
    vertices = scenery.world.vertices
    np.testing.assert_allclose(vertices.min(axis=0), [8, 19, 27])
    np.testing.assert_allclose(vertices.max(axis=0), [12, 21, 33])
    assert len(scenery.world.faces) == 12
    assert scenery.notes == ()
    assert reflectance(scenery) == pytest.approx(0.7)


def test_a_mesh_is_scaled_before_it_is_turned_and_degenerate_faces_are_dropped(world: Callable, tmp_path: Path) -> None:
    (tmp_path / "quad.obj").write_text(QUAD + FACE + "f 1/1 2/2 2/2\n" + "v 0.5 0 0\nf 1/1 2/2 5/2\n")
    mesh = "<geometry><mesh><uri>quad.obj</uri><scale>2 3 4</scale></mesh></geometry>"
    scenery = load_world(world(in_world(mesh, "0 0 0 1.5707963267948966 0 0")))
    assert len(scenery.world.faces) == 2
    np.testing.assert_allclose(scenery.world.vertices.min(axis=0), [0, -4, 0], atol=1e-12)  # z is turned to -y
    np.testing.assert_allclose(scenery.world.vertices.max(axis=0), [2, 0, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        ("<diffuse>1 0 0 1</diffuse>", 0.299),
        ("<diffuse>0 1 0</diffuse>", 0.587),
        ("<script><uri>scripts</uri><name>Test/Blue</name></script>", 0.114),
        ("<script><uri>scripts/test.material</uri><name>Test/Textured</name></script>", 100 / 255),
        ("<pbr><metal><albedo_map>textures/even.png</albedo_map></metal></pbr>", 100 / 255),
        ("<ambient>1 1 1 1</ambient>", 0.7),
    ],
)
def test_materials_of_the_visual(world: Callable, tmp_path: Path, material: str, expected: float) -> None:
    for folder in ("scripts", "textures"):
        (tmp_path / folder).mkdir()
    cv2.imwrite(str(tmp_path / "textures" / "even.png"), np.full((4, 4), 100, np.uint8))
    (tmp_path / "scripts" / "test.material").write_text(
        "material Test/Blue\n{\n technique { pass {\n diffuse 0 0 1 1\n } }\n}\n"
        "material Test/Textured : Test/Blue\n{\n technique\n {\n pass\n {\n texture_unit\n {\n"
        "  texture even.png\n }\n }\n }\n}\n"
    )
    scenery = load_world(world(in_world(BOX + f"<material>{material}</material>")))
    assert reflectance(scenery) == pytest.approx(expected, abs=1e-6)
    assert scenery.notes == ()


def test_the_material_of_the_visual_takes_the_place_of_the_meshs_own(world: Callable, tmp_path: Path) -> None:
    (tmp_path / "quad.mtl").write_text("newmtl own\nKd 1 0 0\n")
    (tmp_path / "quad.obj").write_text(f"mtllib quad.mtl\n{QUAD}usemtl own\n{FACE}")
    mesh = "<geometry><mesh><uri>quad.obj</uri></mesh></geometry>"
    assert reflectance(load_world(world(in_world(mesh)))) == pytest.approx(0.299)
    diffuse = "<material><diffuse>0 1 0 1</diffuse></material>"
    assert reflectance(load_world(world(in_world(mesh + diffuse)))) == pytest.approx(0.587)


@pytest.mark.parametrize(
    ("shape", "side"), [((100, 100), 128), ((90, 90), 64), ((512, 1024), 1024), ((40, 2000), 1024), ((1, 1), 1)]
)
def test_textures_become_squares_of_a_power_of_two(world: Callable, tmp_path: Path, shape: tuple, side: int) -> None:
    """Of an image that grows brighter to the right, the texture does so too, with the same mean, and not downwards."""
    ramp = np.broadcast_to(np.linspace(0, 250, shape[1]), shape).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "ramp.png"), ramp)
    material = "<material><pbr><metal><albedo_map>ramp.png</albedo_map></metal></pbr></material>"
    (texture,) = load_world(world(in_world(BOX + material))).world.textures
    assert texture.shape == (side, side)
    assert texture.mean() * 255 == pytest.approx(ramp.mean(), abs=0.5)
    assert np.ptp(texture, axis=0).max() < 1e-6
    assert np.diff(texture[0]).min(initial=0.0) > -1e-6


@pytest.mark.parametrize(
    ("visual", "remark"),
    [
        ("<geometry><capsule/></geometry>", "test.world: <capsule> of visual 'v' of model 'm' is not supported"),
        ("<geometry><heightmap/></geometry>", "test.world: <heightmap> of visual 'v' of model 'm' is not supported"),
        (
            "<geometry><mesh><uri>model://bus/bus.dae</uri></mesh></geometry>",
            "test.world: mesh 'model://bus/bus.dae' of visual 'v' of model 'm' is not found",
        ),
        (
            "<geometry><mesh><uri>quad.obj</uri><submesh><name>door</name></submesh></mesh></geometry>",
            "test.world: <submesh> of visual 'v' of model 'm' is not supported",
        ),
        (
            "<geometry><mesh><uri>quad.ply</uri></mesh></geometry>",
            "quad.ply: mesh format '.ply' is not supported",
        ),
        (
            BOX + "<material><script><uri>none</uri><name>Gazebo/Grey</name></script></material>",
            "test.world: material 'Gazebo/Grey' is not found",
        ),
        (
            BOX + "<material><script><uri>empty.material</uri><name>Empty</name></script></material>",
            "empty.material: material 'Empty' has neither texture nor diffuse colour",
        ),
        (
            BOX + "<material><pbr><metal><albedo_map>gone.png</albedo_map></metal></pbr></material>",
            "test.world: texture 'gone.png' is not found",
        ),
        (
            BOX + "<material><pbr><metal><albedo_map>broken.png</albedo_map></metal></pbr></material>",
            "broken.png: cannot be read as an image",
        ),
        (
            "<geometry><mesh><uri>bare.obj</uri></mesh></geometry>"
            "<material><pbr><metal><albedo_map>broken.png</albedo_map></metal></pbr></material>",
            "broken.png: used by a mesh without texture coordinates",
        ),
        (
            BOX + "<material><script><uri>odd.material</uri><name>Odd</name></script></material>",
            "odd.material: material 'Odd' has neither texture nor diffuse colour",
        ),
        ("<geometry><mesh><uri>odd.obj</uri></mesh></geometry>", "odd.mtl: colour '1.2.3 0 0' cannot be read"),
        ("<geometry><mesh><uri>nan.obj</uri></mesh></geometry>", "nan.obj:1: 'v 0 0 nan' cannot be read"),
        ("<geometry><mesh><uri>none.obj</uri></mesh></geometry>", "none.obj: OBJ file without triangles"),
    ],
)
def test_what_is_not_shown_is_one_warning_and_one_note(
    world: Callable, tmp_path: Path, visual: str, remark: str
) -> None:
    (tmp_path / "quad.obj").write_text(QUAD + FACE)
    (tmp_path / "bare.obj").write_text(QUAD + "f 1 2 3\n")
    (tmp_path / "quad.ply").touch()
    (tmp_path / "broken.png").touch()
    (tmp_path / "empty.material").write_text("material Empty\n{\n}\n")
    (tmp_path / "odd.material").write_text("material Odd\n{\ndiffuse 1.2.3 0 0\n}\n")
    (tmp_path / "odd.obj").write_text(f"mtllib odd.mtl\nusemtl odd\n{QUAD}f 1 2 3\n")
    (tmp_path / "odd.mtl").write_text("newmtl odd\nKd 1.2.3 0 0\n")
    (tmp_path / "nan.obj").write_text("v 0 0 nan\n")
    (tmp_path / "none.obj").write_text("v 0 0 0\n")
    with pytest.warns(DataWarning) as caught:
        scenery = load_world(world(in_world(visual) + in_world(BOX)))
    assert [str(item.message) for item in caught] == list(scenery.notes)
    assert len(scenery.notes) == 1
    assert scenery.notes[0].startswith(f"{tmp_path}/{remark}")


@pytest.mark.parametrize(
    ("contents", "found"),
    [
        ("", "nothing visible"),
        (in_world("<geometry><empty/></geometry>"), "nothing visible"),
        (
            in_world("<geometry><torus/></geometry>"),
            "nothing visible; {path}: <torus> of visual 'v' of model 'm' is not supported; it is left out",
        ),
    ],
)
def test_a_world_in_which_nothing_can_be_seen_is_one_line(world: Callable, contents: str, found: str) -> None:
    path = world(contents)
    with pytest.raises(DataError) as caught:
        load_world(path)
    expected = "a mesh, box, sphere, cylinder or plane that can be rendered"
    assert str(caught.value) == f"{path}: {found.format(path=path)}, expected {expected}"


def test_every_model_of_the_samples_is_read_whole_and_has_a_plausible_size(sample: Callable) -> None:
    folder = sample("gazebo_models")
    names = sorted(path.parent.name for path in folder.glob("*/model.config"))
    assert len(names) >= 24
    for name in names:
        scenery = load_model(folder / name)
        assert scenery.notes == ()
        vertices = scenery.world.vertices
        assert vertices[:, 2].min() == pytest.approx(0.0, abs=0.05)  # stands on the ground
        smallest, largest = np.sort(np.ptp(vertices, axis=0))[[0, 2]]
        least, most = PLAUSIBLE.get(name, (2.0, 50.0))
        assert least < smallest <= largest < most, name
        assert scenery.world.textures[0].shape > (64, 64) or name in ("office_building", "cafe")


def test_a_world_of_six_models_shows_each_where_it_stands(world: Callable, sample: Callable, render: Callable) -> None:
    """One after the other alone in the world, at the same place as with the others: the image there is the same."""
    names = ("fire_station", "bus", "house_1", "post_office", "pickup", "dumpster")
    places = ("-30 70", "-8 30", "18 70", "2 60", "12 40", "0 20")
    includes = [
        f"<include><uri>model://{name}</uri><pose>{place} -3 0 0 {turn}</pose></include>"
        for name, place, turn in zip(names, places, (3.14, 0, 3.14, 0, 1.57, 3.14), strict=True)
    ]
    folder = sample("gazebo_models")
    together = render(load_world(world("".join(includes)), models=folder).world)
    for include in includes:
        alone = render(load_world(world(include), models=folder).world)
        shown = np.abs(alone - 0.8) > 1e-3  # the sky is 0.8
        same = np.abs(alone - together) < 1e-6
        assert np.mean(same[shown]) > 0.5
        assert np.std(alone[shown & same]) > 0.03
    assert np.mean(np.abs(together - 0.8) > 1e-3) > 0.1


def test_reading_twice_gives_the_same(sample: Callable) -> None:
    first, again = (load_model(sample("gazebo_models") / "cafe").world for _ in range(2))
    np.testing.assert_array_equal(first.vertices, again.vertices)
    np.testing.assert_array_equal(first.corner_uv, again.corner_uv)
    np.testing.assert_array_equal(first.texture, again.texture)
    for one, other in zip(first.textures, again.textures, strict=True):
        np.testing.assert_array_equal(one, other)
