from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.simulation.sdf_files import Library, Remarks, read_visuals

BOX = "<geometry><box><size>1 1 1</size></box></geometry>"
HALF_PI = "1.5707963267948966"


def visual(pose: str = "", name: str = "v") -> str:
    return f"<visual name='{name}'>{pose}{BOX}</visual>"


def centres(path: Path, remarks: Remarks | None = None) -> np.ndarray:
    """Where the visuals of a file have their origins."""
    found = read_visuals(path, Library((path.parent / "models",)), remarks or Remarks())
    return np.array([item.world_from_visual[:3, 3] for item in found])


@pytest.mark.parametrize(
    ("pose", "centre"),
    [
        (f"<pose>0 0 0 {HALF_PI} 0 0</pose>", [1, -3, 2]),  # y to z
        (f"<pose>0 0 0 0 {HALF_PI} 0</pose>", [3, 2, -1]),  # z to x
        (f"<pose>0 0 0 0 0 {HALF_PI}</pose>", [-2, 1, 3]),  # x to y
        (f"<pose>10 20 30 {HALF_PI} 0 {HALF_PI}</pose>", [13, 21, 32]),  # roll first, about the parent's axes
        (f"<pose>0 0 0 {HALF_PI} {HALF_PI} 0</pose>", [2, -3, -1]),
        ("<pose degrees='true'>10 20 30 90 0 90</pose>", [13, 21, 32]),
        ("<pose rotation_format='quat_xyzw'>0 0 0 0 0 0.7071067811865476 0.7071067811865476</pose>", [-2, 1, 3]),
        ("<pose></pose>", [1, 2, 3]),
        ("", [1, 2, 3]),
    ],
)
def test_a_pose_turns_by_roll_then_pitch_then_yaw_about_fixed_axes(world: Callable, pose: str, centre: list) -> None:
    path = world(f"<model name='m'>{pose}<link name='l'>{visual('<pose>1 2 3 0 0 0</pose>')}</link></model>")
    np.testing.assert_allclose(centres(path), [centre], atol=1e-12)


def test_poses_of_nested_models_links_and_visuals_follow_each_other(world: Callable) -> None:
    turned = f"0 0 0 0 0 {HALF_PI}"
    link = f"<link name='l'><pose>0 5 0 0 0 0</pose>{visual('<pose>1 0 0 0 0 0</pose>')}</link>"
    inner = f"<model name='inner'><pose>{turned}</pose>{link}</model>"
    path = world(f"<model name='outer'><pose>100 0 0 0 0 {HALF_PI}</pose>{inner}{link}</model>")
    # inner: (1, 5) turned twice is (-1, -5); the outer's own link: (1, 5) turned once is (-5, 1)
    np.testing.assert_allclose(centres(path), [[99, -5, 0], [95, 1, 0]], atol=1e-12)


def test_an_included_model_stands_where_the_include_says_or_else_where_it_says_itself(
    world: Callable, model: Callable
) -> None:
    model("crate", BOX, own="<pose>0 0 7 0 0 0</pose>")
    uri = "<uri>model://crate</uri>"
    path = world(f"<include>{uri}</include><include>{uri}<name>b</name><pose>1 2 3 0 0 0</pose></include>")
    np.testing.assert_allclose(centres(path), [[0, 0, 7], [1, 2, 3]])


def test_an_include_within_a_model_stands_relative_to_it(world: Callable, model: Callable) -> None:
    model("crate", BOX)
    include = "<include><uri>model://crate</uri><pose>1 0 0 0 0 0</pose></include>"
    path = world(f"<model name='m'><pose>0 0 5 0 0 {HALF_PI}</pose>{include}</model>")
    np.testing.assert_allclose(centres(path), [[0, 1, 5]], atol=1e-12)


def test_the_saved_state_moves_models(world: Callable, model: Callable) -> None:
    model("crate", BOX)
    saved = "".join(f"<model name='{name}'><pose>{x} 0 0 0 0 0</pose></model>" for name, x in (("m", 8), ("crate", 9)))
    link = f"<link name='l'>{visual()}</link>"
    path = world(
        f"<model name='m'><pose>1 0 0 0 0 0</pose>{link}</model><include><uri>model://crate</uri></include>"
        f"<state world_name='w'>{saved}</state>"
    )
    np.testing.assert_allclose(centres(path), [[8, 0, 0], [9, 0, 0]])


@pytest.mark.parametrize(
    ("contents", "remark"),
    [
        ("<actor name='walker'/>", "<actor> 'walker' is not shown"),
        ("<light name='lamp' type='spot'/>", "<light> 'lamp' is not shown"),
        ("<road name='r'/>", "<road> 'r' is not shown"),
        ("<scene><sky><time>10</time></sky></scene>", "<sky> is not shown"),
        ("<model name='m'><link name='l'><light name='torch'/></link></model>", "<light> 'torch' is not shown"),
        ("<population name='p'/>", "<population> 'p' is not shown"),
        ("<include><uri>model://sun</uri></include>", "model 'model://sun' is not in "),
        ("<state><model name='m'><scale>2 1 1</scale></model></state>", "the saved <scale> of model 'm'"),
        ("<state><insertions/></state>", "insertions and deletions of the saved <state> are not applied"),
        (
            f"<model name='m'><link name='l'><pose relative_to='frame'>1 0 0 0 0 0</pose>{visual()}</link></model>",
            "<pose relative_to='frame'> of link 'l' is not supported",
        ),
        (
            f"<model name='m'><link name='l'>{visual('<transparency>0.5</transparency>')}</link></model>",
            "<transparency> of visual 'v' of model 'm' is not supported",
        ),
    ],
)
def test_what_is_not_supported_names_itself(world: Callable, contents: str, remark: str) -> None:
    remarks = Remarks()
    path = world(contents)
    centres(path, remarks)
    assert len(remarks.lines) == 1
    assert remarks.lines[0].startswith(f"{path}: {remark}")


def test_what_a_camera_does_not_see_is_passed_over(world: Callable) -> None:
    unseen = f"<collision name='c'>{BOX}</collision><inertial/><sensor name='s' type='camera'/>"
    remarks = Remarks()
    path = world(f"<physics/><gui/><model name='m'><static>1</static><link name='l'>{unseen}</link></model>")
    assert len(centres(path, remarks)) == 0
    assert remarks.lines == ()


def test_the_latest_version_of_a_model_counts(world: Callable, model: Callable) -> None:
    folder = model("crate", BOX, own="<pose>0 0 1 0 0 0</pose>")
    (folder / "old.sdf").write_text("<sdf/>")
    versions = "".join(
        f"<sdf version='1.{v}'>{name}</sdf>" for v, name in ((9, "old.sdf"), (10, "model.sdf"), (4, "old.sdf"))
    )
    (folder / "model.config").write_text(f"<model>{versions}</model>")
    np.testing.assert_allclose(centres(world("<include><uri>model://crate</uri></include>")), [[0, 0, 1]])


@pytest.mark.parametrize(
    ("contents", "message"),
    [
        ("<model name='m'>\n<link></model>", "test.world:4: malformed XML (mismatched tag), expected well-formed XML"),
        ("<model name='m'><pose>1 2 3</pose></model>", "test.world: <pose> '1 2 3', expected 6 finite numbers"),
        ("<model name='m'><pose>1 2 3 0 0 nan</pose></model>", "expected 6 finite numbers"),
        (
            "<model name='m'><pose rotation_format='quat_xyzw'>1 2 3 0 0 0 0</pose></model>",
            "expected a non-zero quaternion",
        ),
        (
            "<model name='m'><link name='l'><visual name='v'/></link></model>",
            "visual 'v' of model 'm' with 0 geometries, expected one in its <geometry>",
        ),
    ],
)
def test_what_is_malformed_is_one_line(world: Callable, contents: str, message: str) -> None:
    with pytest.raises(DataError) as caught:
        centres(world(contents))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_are_no_worlds_are_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"missing\.world: no such file, expected an XML file"):
        centres(tmp_path / "missing.world")
    (tmp_path / "other.xml").write_text("<robot/>")
    with pytest.raises(DataError, match=r"other\.xml: <robot> without world or model"):
        centres(tmp_path / "other.xml")


def test_models_that_include_themselves_are_refused(world: Callable, model: Callable) -> None:
    model("crate", BOX, own="<include><uri>model://crate</uri></include>")
    with pytest.raises(DataError, match="model://crate includes itself"):
        centres(world("<include><uri>model://crate</uri></include>"))


def test_models_that_include_themselves_by_another_path_are_refused(world: Callable, model: Callable) -> None:
    model("crate", BOX, own="<include><uri>../crate</uri></include>")
    with pytest.raises(DataError, match=r"\.\./crate includes itself"):
        centres(world("<include><uri>model://crate</uri></include>"))


@pytest.mark.parametrize("encoding", ["shift_jis", "klingon"])
def test_an_encoding_that_cannot_be_read_is_one_line(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "test.world"
    path.write_text(f'<?xml version="1.0" encoding="{encoding}"?><sdf/>')
    with pytest.raises(DataError) as caught:
        centres(path)
    assert str(caught.value).startswith(f"{path}: an encoding that cannot be read (")
    assert "\n" not in str(caught.value)
