"""Textured squares written by hand in each format, rendered: what is upper left in the image must be so on the wall."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from trimesh.creation import box

from tracknoise.simulation.sdf_files import Library, Remarks
from tracknoise.simulation.sdf_meshes import Look, Part, read_mesh
from tracknoise.simulation.sdf_worlds import load_world

QUARTERS = np.array([[20, 90], [160, 240]]) / 255.0

# A square of 2 units in the plane y = 0, seen from the south: corners and texture coordinates from the lower left.
CORNERS = "-1 0 -1  1 0 -1  1 0 1  -1 0 1"
OBJ = """# a square
mtllib square.mtl
v -1 0 -1
v 1 0 -1
v 1 0 1
v -1 0 1
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vn 0 -1 0
usemtl {material}
f {faces}
"""
TRIANGLES = "<triangles material='wall' count='2'>{inputs}<p>0 1 2 0 2 3</p></triangles>"
POLYGON = "<polylist material='wall' count='1'>{inputs}<vcount>4</vcount><p>0 1 2 3</p></polylist>"
TEXTURE = "<texture texture='sampler' texcoord='UV'/>"
COLOUR = "<color>0.2 0.4 0.6 1</color>"
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="something" meter="{meter}"/><up_axis>{up}</up_axis></asset>
  <library_images><image id="image"><init_from>{image}</init_from></image></library_images>
  <library_effects><effect id="effect"><profile_COMMON>
    <newparam sid="surface"><surface type="2D"><init_from>image</init_from></surface></newparam>
    <newparam sid="sampler"><sampler2D><source>surface</source></sampler2D></newparam>
    <technique sid="common"><phong><diffuse>{diffuse}</diffuse></phong></technique>
  </profile_COMMON></effect></library_effects>
  <library_materials><material id="material"><instance_effect url="#effect"/></material></library_materials>
  <library_geometries><geometry id="square"><mesh>
    <source id="position"><float_array id="p" count="12">{corners}</float_array><technique_common>
      <accessor source="#p" count="4" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
      </accessor></technique_common></source>
    <source id="texcoord"><float_array id="t" count="8">0 0 1 0 1 1 0 1</float_array><technique_common>
      <accessor source="#t" count="4" stride="2">
        <param name="S" type="float"/><param name="T" type="float"/>
      </accessor></technique_common></source>
    <vertices id="vertices"><input semantic="POSITION" source="#position"/></vertices>
    {primitive}
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="scene">
    <node id="node">{transform}<instance_geometry url="#square"><bind_material><technique_common>
      <instance_material symbol="wall" target="#material"/>
    </technique_common></bind_material></instance_geometry></node>
  </visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>
"""
INPUTS = (
    "<input semantic='VERTEX' source='#vertices' offset='0'/><input semantic='TEXCOORD' source='#texcoord' offset='0'/>"
)


def obj(
    folder: Path, *, faces: str = "1/1/1 2/2/1 3/3/1 4/4/1", material: str = "wall", mtl: str | None = None
) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "square.obj").write_text(OBJ.format(faces=faces, material=material))
    (folder / "square.mtl").write_text(mtl or "newmtl wall\n\tKd 0.2 0.4 0.6\n\tmap_Kd wall.png\n")
    return folder / "square.obj"


def dae(folder: Path, *, primitive: str = TRIANGLES, inputs: str = INPUTS, **change: object) -> Path:
    folder.mkdir(exist_ok=True)
    usual = {"meter": 1, "up": "Z_UP", "image": "wall.png", "diffuse": TEXTURE, "corners": CORNERS, "transform": ""}
    (folder / "square.dae").write_text(DAE.format(primitive=primitive.format(inputs=inputs), **{**usual, **change}))
    return folder / "square.dae"


def read(path: Path, remarks: Remarks | None = None) -> list[Part]:
    return read_mesh(path, Library(()), remarks or Remarks())


def size(parts: list[Part]) -> np.ndarray:
    corners = np.concatenate([part.corners.reshape(-1, 3) for part in parts])
    return np.ptp(corners, axis=0)


@pytest.mark.parametrize("write", [obj, dae])
@pytest.mark.parametrize("place", ["meshes", "materials/textures"])
def test_a_texture_is_the_right_way_round_on_the_wall(
    world: Callable, picture: Callable, render: Callable, tmp_path: Path, write: Callable, place: str
) -> None:
    mesh = write(tmp_path / "meshes")
    picture(tmp_path / place / "wall.png")
    visual = f"<geometry><mesh><uri>meshes/{mesh.name}</uri></mesh></geometry>"
    model = f"<model name='m'><pose>0 4 0 0 0 0</pose><link name='l'><visual name='v'>{visual}</visual></link></model>"
    scenery = load_world(world(model))
    assert scenery.notes == ()
    image = render(scenery.world)  # the square is 40 px wide, about (47.5, 31.5)
    np.testing.assert_allclose(image[[[16], [46]], [32, 63]], QUARTERS, atol=1e-6)
    np.testing.assert_allclose(image[31, 10], 0.8)


@pytest.mark.parametrize("primitive", [TRIANGLES, POLYGON])
def test_collada_is_in_its_unit_with_its_nodes_transforms(tmp_path: Path, primitive: str) -> None:
    transform = "<translate>10 0 0</translate><scale>1 1 3</scale>"
    (part,) = read(dae(tmp_path, primitive=primitive, meter=0.01, transform=transform))
    np.testing.assert_allclose(part.corners.min(axis=(0, 1)), [0.09, 0.0, -0.03], atol=1e-7)
    np.testing.assert_allclose(part.corners.max(axis=(0, 1)), [0.11, 0.0, 0.03], atol=1e-7)


def test_collada_lies_as_it_is_whatever_axis_it_says_is_up(tmp_path: Path) -> None:
    remarks = Remarks()
    parts = read(dae(tmp_path, up="Y_UP", diffuse=COLOUR), remarks)
    np.testing.assert_allclose(size(parts), [2, 0, 2])
    assert remarks.lines == (f"{tmp_path / 'square.dae'}: <up_axis> Y_UP is not applied, as in Gazebo; z is up",)


def test_an_even_colour_is_its_luma(tmp_path: Path) -> None:
    luma = pytest.approx(0.299 * 0.2 + 0.587 * 0.4 + 0.114 * 0.6)
    (part,) = read(dae(tmp_path, diffuse=COLOUR))
    assert part.look == Look(reflectance=luma)
    (part,) = read(obj(tmp_path, mtl="newmtl wall\nKd 0.2 0.4 0.6\n"))
    assert part.look == Look(reflectance=luma)


def test_wavefront_counts_from_the_end_too(tmp_path: Path) -> None:
    (usual,), (negative,) = read(obj(tmp_path)), read(obj(tmp_path, faces="-4/-4 -3/-3 -2/-2 -1/-1"))
    np.testing.assert_array_equal(negative.corners, usual.corners)
    np.testing.assert_array_equal(negative.corner_uv, usual.corner_uv)


@pytest.mark.parametrize("faces", ["1 2 3 4", "1//1 2//1 3//1 4//1"])
def test_wavefront_without_texture_coordinates(tmp_path: Path, faces: str) -> None:
    (part,) = read(obj(tmp_path, faces=faces))
    assert part.corner_uv is None
    np.testing.assert_allclose(size([part]), [2, 0, 2])


def test_collada_without_texture_coordinates(tmp_path: Path) -> None:
    (part,) = read(dae(tmp_path, inputs=INPUTS.split("<input semantic='TEXCOORD'")[0], diffuse=COLOUR))
    assert part.corner_uv is None
    np.testing.assert_allclose(size([part]), [2, 0, 2])


def test_stl_has_no_look(tmp_path: Path) -> None:
    path = tmp_path / "brick.STL"
    path.write_bytes(box(extents=[1.0, 2.0, 3.0]).export(file_type="stl"))
    (part,) = read(path)
    np.testing.assert_allclose(size([part]), [1, 2, 3])
    assert (part.corner_uv, part.look) == (None, None)


@pytest.mark.parametrize(
    ("write", "remark"),
    [
        (lambda folder: dae(folder, image="gone.png"), "square.dae: texture 'gone.png' is not found"),
        (lambda folder: obj(folder), "square.mtl: texture 'wall.png' is not found"),
        (lambda folder: obj(folder, faces="1/1 2/2 9/3"), "square.obj:13: 'f 1/1 2/2 9/3' cannot be read"),
        (lambda folder: dae(folder, corners="1 2"), "square.dae: part of the file cannot be used"),
        (lambda folder: dae(folder, up="<"), "square.dae: damaged COLLADA file"),
        (lambda folder: dae(folder, primitive="<triangles/>"), "square.dae: part of the file cannot be used"),
    ],
)
def test_what_is_missing_or_damaged_names_itself(tmp_path: Path, write: Callable, remark: str) -> None:
    remarks = Remarks()
    path = write(tmp_path)
    read(path, remarks)
    assert len(remarks.lines) == 1
    assert remarks.lines[0].startswith(f"{tmp_path}/{remark}")
    assert "\n" not in remarks.lines[0]


def test_a_collada_file_without_triangles_names_itself(tmp_path: Path) -> None:
    remarks = Remarks()
    path = dae(tmp_path / "meshes", primitive="")
    assert read(path, remarks) == []
    assert remarks.lines == (f"{path}: COLLADA file without triangles",)


def test_a_missing_material_file_and_an_unknown_format_name_themselves(tmp_path: Path) -> None:
    remarks = Remarks()
    path = obj(tmp_path)
    (tmp_path / "square.mtl").unlink()
    (part,) = read(path, remarks)
    assert part.look is None
    (tmp_path / "square.ply").touch()
    (tmp_path / "square.stl").write_bytes(b"solid nothing")
    assert read(tmp_path / "square.ply", remarks) == []
    read(tmp_path / "square.stl", remarks)
    assert "material file 'square.mtl' is not found" in remarks.lines[0]
    assert "mesh format '.ply' is not supported (.dae, .obj, .stl are)" in remarks.lines[1]
    assert "STL file without triangles" in remarks.lines[2]
