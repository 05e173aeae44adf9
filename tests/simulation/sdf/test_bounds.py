"""Worlds from strangers: what they may name, how deep and how often they may include, and what damaged meshes do."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tracknoise import parsing_child
from tracknoise.exceptions import DataError
from tracknoise.simulation.sdf_files import (
    MOST_INCLUDE_LEVELS,
    MOST_INCLUDES,
    Library,
    Remarks,
    model_file,
    read_visuals,
)
from tracknoise.simulation.sdf_meshes import Part, read_mesh
from tracknoise.simulation.sdf_worlds import load_world

BOX = "<geometry><box><size>1 1 1</size></box></geometry>"
BOX_MODEL = f"<model name='m'><link name='l'><visual name='v'>{BOX}</visual></link></model>"
QUAD = "v 0 0 0\nv 1 0 0\nv 1 0 1\nvt 0 0\nvt 1 0\nvt 1 1\n"


def mesh(tmp_path: Path, name: str, content: str | bytes) -> tuple[list[Part], tuple[str, ...]]:
    path = tmp_path / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    remarks = Remarks()
    return read_mesh(path, Library(()), remarks), remarks.lines


@pytest.mark.parametrize(
    "uri",
    [
        "../outside.obj",
        "models/../../outside.obj",
        "model://../outside.obj",
        "model://../../outside.obj",
        "file://{outside}",
        "{outside}",
        "link.obj",
        "pipe.obj",
        "/dev/zero",
        "model:///dev/zero",
        "a\n/b",
    ],
)
def test_only_regular_files_below_the_roots_are_found(tmp_path: Path, uri: str) -> None:
    own = tmp_path / "own"
    (own / "models").mkdir(parents=True)
    (tmp_path / "outside.obj").write_text(QUAD)
    (own / "link.obj").symlink_to(tmp_path / "outside.obj")
    os.mkfifo(own / "pipe.obj")
    library = Library((own, own / "models"))
    uri = uri.format(outside=tmp_path / "outside.obj")
    assert library.find(uri, own) is None
    assert library.find_texture(uri.replace("outside.obj", "wall.png"), own) is None


def test_a_world_outside_of_a_models_folder_does_not_see_what_lies_beside_its_folder(tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.mkdir()
    (tmp_path / "secret").mkdir()
    (tmp_path / "secret" / "model.sdf").write_text(f"<sdf>{BOX_MODEL}</sdf>")
    (own / "w.world").write_text("<sdf><world name='w'><include><uri>model://secret</uri></include></world></sdf>")
    with pytest.raises(DataError, match=r"nothing visible; .*model 'model://secret' is not in "):
        load_world(own / "w.world")


def test_the_file_of_a_model_is_in_its_folder(model: Callable, tmp_path: Path) -> None:
    folder = model("crate", BOX)
    (tmp_path / "models" / "other.sdf").write_text("<sdf/>")
    (folder / "model.config").write_text("<model><sdf version='1.6'>../other.sdf</sdf></model>")
    with pytest.raises(
        DataError, match=r"model.config: the file '../other.sdf', expected one in the folder of the model"
    ):
        model_file(folder)
    (folder / "model.config").write_text(f"<model><sdf version='{'9' * 5000}'>{'a' * 500}</sdf></model>")
    with pytest.raises(DataError, match="no such file"):
        model_file(folder)


def chain(tmp_path: Path, levels: int, copies: int) -> Path:
    """Files that each include the next, several times."""
    for level in range(levels):
        include = f"<include><uri>level{level + 1}.sdf</uri></include>" * copies
        text = f"<sdf><model name='m{level}'>{include}</model></sdf>"
        (tmp_path / f"level{level}.sdf").write_text(text)
    (tmp_path / f"level{levels}.sdf").write_text(f"<sdf>{BOX_MODEL}</sdf>")
    return tmp_path / "level0.sdf"


def test_includes_nest_only_so_deep(tmp_path: Path) -> None:
    visuals = read_visuals(chain(tmp_path, MOST_INCLUDE_LEVELS, 1), Library(()), Remarks())
    assert len(visuals) == 1
    with pytest.raises(DataError, match=f"at most {MOST_INCLUDE_LEVELS} levels of includes"):
        read_visuals(chain(tmp_path, MOST_INCLUDE_LEVELS + 1, 1), Library(()), Remarks())


def test_there_are_only_so_many_includes(tmp_path: Path) -> None:
    """Eight levels of eight includes each are 16 million files."""
    with pytest.raises(DataError, match=f"more than {MOST_INCLUDES} includes, expected fewer models"):
        read_visuals(chain(tmp_path, 8, 8), Library(()), Remarks())


def test_models_nest_only_so_deep(world: Callable) -> None:
    with pytest.raises(DataError, match=r"test.world: elements nested more than 32 deep, expected fewer levels$"):
        load_world(world("<model name='m'>" * 900 + "</model>" * 900))


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        ("<pose rotation_format='quat_xyzw'>0 0 0 1e-320 0 0 0</pose>", "expected a non-zero quaternion"),
        ("<pose>1e308 0 0 0 0 0</pose>", r"expected numbers up to 1e\+09"),
        (f"<pose>{'1 ' * 100_000}</pose>", "expected 6 finite numbers"),
    ],
)
def test_numbers_that_are_no_poses(world: Callable, pose: str, message: str) -> None:
    with pytest.raises(DataError, match=message):
        load_world(world(f"<model name='m'>{pose}</model>"))


@pytest.mark.parametrize("line", ["vt", "vt nan 0", "vt 0 inf", "v 0 0 nan", "f 1/1 2/2 9/9", f"v {'9' * 400} 0 0"])
def test_lines_of_wavefront_files_that_cannot_be_used(tmp_path: Path, line: str) -> None:
    parts, remarks = mesh(tmp_path, "a.obj", f"{QUAD}{line}\nf 1/4 2/2 3/3\n" if line == "vt" else f"{QUAD}{line}\n")
    assert parts == []
    assert remarks[0].startswith(f"{tmp_path}/a.obj:7: {line[:10]!r}"[:-1])


def test_stl_of_several_solids_is_read(tmp_path: Path) -> None:
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 {}\nvertex 1 0 0\nVERTEX 0 1 0\nendloop\nendfacet\n"
    solid = f"solid {{}}\n{facet}endsolid\n"
    (part,), remarks = mesh(tmp_path, "a.stl", solid.format("one", 1) + solid.format("two", 2))
    np.testing.assert_array_equal(part.corners[:, 0, 2], [1, 2])
    assert remarks == ()


@pytest.mark.parametrize(
    ("content", "remark"),
    [
        ("solid a\nvertex 1 2\n", "damaged STL file (a vertex that is not three numbers); it is left out"),
        ("solid a\nvertex 1 2 3\n", "damaged STL file (1 vertex); it is left out"),
        (bytes(80) + b"\xff\xff\xff\xff" + bytes(50), "STL file without triangles"),
    ],
)
def test_damaged_stl_names_itself(tmp_path: Path, content: str | bytes, remark: str) -> None:
    _, remarks = mesh(tmp_path, "a.stl", content)
    assert remarks == (f"{tmp_path}/a.stl: {remark}",)


def test_collada_that_grows_exponentially_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of 40 nodes has the next one twice."""
    monkeypatch.setattr(parsing_child, "_CPU_S", 1)
    nodes = "".join(
        f"<node id='n{k}'><instance_node url='#n{k + 1}'/><instance_node url='#n{k + 1}'/></node>" for k in range(40)
    )
    scene = "<visual_scene id='s'><node id='r'><instance_node url='#n0'/></node></visual_scene>"
    text = (
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/>'
        f"<library_nodes>{nodes}<node id='n40'/></library_nodes><library_visual_scenes>{scene}</library_visual_scenes>"
        "<scene><instance_visual_scene url='#s'/></scene></COLLADA>"
    )
    parts, remarks = mesh(tmp_path, "a.dae", text)
    assert parts == []
    assert remarks == (f"{tmp_path}/a.dae: damaged COLLADA file (its parser takes too long); it is left out",)


@pytest.mark.parametrize(
    "script",
    [
        "material A : " * 30_000,
        "material A :\n" * 30_000,
        " \n" * 50_000,
        "material A" + " " * 100_000 + "\n" * 100_000,
        "material A\n{\n diffuse " + "1" * 100_000,
        "material A\n{\n diffuse 0.5 " + "1." * 50_000,
        "material A\n{\n" + "\n " * 50_000 + "x",
    ],
)
def test_material_scripts_take_no_quadratic_time(world: Callable, tmp_path: Path, script: str) -> None:
    (tmp_path / "a.material").write_text(script)
    material = "<material><script><uri>a.material</uri><name>A</name></script></material>"
    started = time.monotonic()
    load_world_quietly(world(BOX_MODEL.replace(BOX, BOX + material)))
    assert time.monotonic() - started < 5


def load_world_quietly(path: Path) -> None:
    with pytest.warns(UserWarning, match="is not found|has neither"):
        load_world(path)


def test_meshes_with_numbers_that_are_too_large_are_left_out(world: Callable, tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(f"v 1e300 0 0\n{QUAD}vt 1e300 0\nf 1/1 2/2 3/3\nf 2/4 3/2 4/3\nf 2/1 3/2 4/3\n")
    visual = "<geometry><mesh><uri>a.obj</uri><scale>1e8 1e8 1e8</scale></mesh></geometry>"
    assert len(load_world(world(BOX_MODEL.replace(BOX, visual))).world.faces) == 1
