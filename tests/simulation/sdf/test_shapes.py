from xml.etree import ElementTree as ET

import numpy as np
import pytest

from tracknoise.exceptions import DataError
from tracknoise.simulation.sdf_meshes import SHAPES, Part


def shape(text: str) -> Part:
    element = ET.fromstring(text)
    return SHAPES[element.tag](element, "test.world")


def area(part: Part) -> float:
    edges = part.corners[:, 1:] - part.corners[:, :1]
    return float(np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum() / 2)


def volume(part: Part) -> float:
    """Of a closed surface that faces out; negative if it faces in."""
    return float(np.linalg.det(part.corners).sum() / 6)


def uv_at(part: Part, point: list[float]) -> np.ndarray:
    """Texture coordinates of the corners at a point, each different one once."""
    at = np.linalg.norm(part.corners - point, axis=2) < 1e-9
    return np.unique(part.corner_uv[at].round(9), axis=0)


def test_a_box_has_its_size_about_its_origin() -> None:
    part = shape("<box><size>2 4 6</size></box>")
    np.testing.assert_allclose(np.abs(part.corners).reshape(-1, 3), np.tile([1.0, 2.0, 3.0], (36, 1)))
    assert volume(part) == pytest.approx(48.0)
    assert area(part) == pytest.approx(2 * (8 + 12 + 24))


def test_each_face_of_a_box_wears_the_whole_texture() -> None:
    part = shape("<box><size>2 4 6</size></box>")
    south = np.all(part.corners[..., 1] == -2.0, axis=1)
    face = Part(part.corners[south], part.corner_uv[south])
    np.testing.assert_allclose(uv_at(face, [-1, -2, 3]), [[0, 0]])  # upper left of who looks north
    np.testing.assert_allclose(uv_at(face, [1, -2, -3]), [[1, 1]])


def test_a_sphere_has_its_radius() -> None:
    part = shape("<sphere><radius>2</radius></sphere>")
    np.testing.assert_allclose(np.linalg.norm(part.corners, axis=2), 2.0)
    assert volume(part) == pytest.approx(4 / 3 * np.pi * 8, rel=0.02)
    assert np.ptp(part.corners[..., 2]) == pytest.approx(4.0)


def test_a_cylinder_has_its_radius_length_and_ends() -> None:
    part = shape("<cylinder><radius>0.5</radius><length>3</length></cylinder>")
    assert volume(part) == pytest.approx(np.pi * 0.25 * 3, rel=0.01)
    assert area(part) == pytest.approx(np.pi * 3 + 2 * np.pi * 0.25, rel=0.01)
    np.testing.assert_allclose(np.abs(part.corners[..., 2]), 1.5)


def test_the_texture_of_round_shapes_is_not_mirrored() -> None:
    """Seen from outside, columns go to the right: from azimuth 0 counter-clockwise seen from above."""
    side = shape("<cylinder><radius>1</radius><length>2</length></cylinder>")
    assert [0.25, 0.0] in uv_at(side, [0, 1, 1]).tolist()
    assert [0.25, 1.0] in uv_at(side, [0, 1, -1]).tolist()
    ball = shape("<sphere><radius>1</radius></sphere>")
    np.testing.assert_allclose(uv_at(ball, [0, -1, 0]), [[0.75, 0.5]])


def test_a_plane_lies_flat_and_shows_its_texture_to_who_looks_down_with_north_up() -> None:
    part = shape("<plane><size>4 2</size></plane>")
    assert area(part) == pytest.approx(8.0)
    assert np.all(np.cross(*np.swapaxes(np.diff(part.corners, axis=1), 0, 1))[:, 2] > 0.0)
    np.testing.assert_allclose(uv_at(part, [-2, 1, 0]), [[0, 0]])
    np.testing.assert_allclose(uv_at(part, [2, -1, 0]), [[1, 1]])


@pytest.mark.parametrize("normal", [[0, 0, -1], [1, 0, 0], [0, -2, 0], [1, 2, 3]])
def test_a_plane_faces_along_its_normal(normal: list[int]) -> None:
    part = shape(f"<plane><normal>{' '.join(map(str, normal))}</normal><size>4 2</size></plane>")
    cross = np.cross(part.corners[:, 1] - part.corners[:, 0], part.corners[:, 2] - part.corners[:, 0])
    unit = np.array(normal) / np.linalg.norm(normal)
    np.testing.assert_allclose(
        cross / np.linalg.norm(cross, axis=1, keepdims=True), np.tile(unit, (len(cross), 1)), atol=1e-12
    )
    assert area(part) == pytest.approx(8.0)


def test_the_plane_is_turned_by_the_shortest_way() -> None:
    part = shape("<plane><normal>1 0 0</normal><size>4 2</size></plane>")  # about y: x goes down
    np.testing.assert_allclose(uv_at(part, [0, 1, 2]), [[0, 0]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<box><size>1 0 1</size></box>", "test.world: <size> 1 0 1, expected lengths above 0"),
        ("<box><size>1 1</size></box>", "test.world: <size> '1 1', expected 3 finite numbers"),
        ("<sphere><radius>-1</radius></sphere>", "<radius> -1, expected lengths above 0"),
        ("<cylinder><length>big</length></cylinder>", "<length> 'big', expected 1 finite number"),
        ("<plane><normal>0 0 0</normal></plane>", "<normal> 0 0 0, expected a direction"),
    ],
)
def test_impossible_sizes_are_named(text: str, message: str) -> None:
    with pytest.raises(DataError) as caught:
        shape(text)
    assert message in str(caught.value)
