import pytest

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.sequences.scenes import find_scenes, numbered_files, require_unbroken, scene_folder
from tracknoise.tables.identity import SequenceId


def has_marker(_folders: list[str], files: list[str]) -> bool:
    return "marker" in files


@pytest.fixture
def tree(tmp_path):
    for scene in ("b/seq-02", "b/seq-01", "a", "a/below a scene"):
        (tmp_path / scene).mkdir(parents=True)
        (tmp_path / scene / "marker").touch()
    (tmp_path / "empty").mkdir()
    return tmp_path


def test_scenes_are_named_by_their_path_and_sorted(tree):
    scenes = find_scenes(tree, has_marker, expected="markers")
    assert list(scenes.items()) == [(name, tree / name) for name in ("a", "b/seq-01", "b/seq-02")]


def test_a_root_that_is_a_scene_has_its_own_name(tree, monkeypatch):
    assert find_scenes(tree / "b" / "seq-01", has_marker, expected="") == {"seq-01": tree / "b" / "seq-01"}
    monkeypatch.chdir(tree / "a")
    assert list(find_scenes(type(tree)("."), has_marker, expected="")) == ["a"]


def test_links_are_followed_and_cycles_end(tree):
    (tree / "b" / "cycle").symlink_to(tree)
    (tree / "empty" / "link").symlink_to(tree / "b" / "seq-01")
    (tree / "elsewhere").mkdir()
    scenes = find_scenes(tree, has_marker, expected="")
    assert len(scenes) == len({folder.resolve() for folder in scenes.values()}) == 3


def test_no_scene_and_no_folder(tree):
    with pytest.raises(DataError) as caught:
        find_scenes(tree / "empty", has_marker, expected="folders with a marker")
    assert str(caught.value) == f"{tree / 'empty'}: no scene, expected folders with a marker"
    with pytest.raises(DataError, match="no such directory, expected a data set's folder"):
        find_scenes(tree / "absent", has_marker, expected="")


def test_unknown_scene_and_lighting(tree):
    scenes = find_scenes(tree, has_marker, expected="")
    assert scene_folder(scenes, SequenceId("x", "b/seq-01")) == tree / "b/seq-01"
    with pytest.raises(UnknownNameError) as caught:
        scene_folder(scenes, SequenceId("x", "b/seq-03"))
    assert "unknown scene 'b/seq-03'" in str(caught.value)
    assert "known: a, b/seq-01, b/seq-02" in str(caught.value)
    with pytest.raises(UnknownNameError, match="unknown lighting 'dim'; known: default"):
        scene_folder(scenes, SequenceId("x", "a", "dim"))


def test_numbered_files_in_order_of_their_numbers(tmp_path):
    for name in ("10.png", "2.png", "._3.png", "4.txt", "5.png.bak"):
        (tmp_path / name).touch()
    assert list(numbered_files(tmp_path, r"(\d+)\.png")) == [2, 10]


def test_frames_without_a_gap(tmp_path):
    assert require_unbroken({3, 4, 5}, {4}, lambda number: tmp_path / f"{number}.png") == range(3, 6)


def test_a_number_used_twice_is_named(tmp_path):
    for name in ("4.png", "5.png", "000004.png"):
        (tmp_path / name).touch()
    with pytest.raises(DataError) as caught:
        numbered_files(tmp_path, r"(\d+)\.png")
    expected = f"{tmp_path / '4.png'}: the number of 000004.png again, expected one file for each frame"
    assert str(caught.value) == expected


@pytest.mark.parametrize(("images", "others", "missing"), [({0, 1, 3}, (), 2), ({0, 1}, {0, 1, 2}, 2), ({1}, {0}, 0)])
def test_a_gap_is_named(tmp_path, images, others, missing):
    with pytest.raises(DataError) as caught:
        require_unbroken(images, others, lambda number: tmp_path / f"{number}.png")
    assert str(caught.value).startswith(f"{tmp_path / f'{missing}.png'}: missing image, expected images ")


def test_no_images(tmp_path):
    with pytest.raises(DataError) as caught:
        require_unbroken((), {0}, lambda number: tmp_path / f"{number}.png")
    assert str(caught.value) == f"{tmp_path}: no images, expected files such as 0.png"
    (tmp_path / "0.PNG").touch()
    with pytest.raises(DataError) as caught:
        require_unbroken((), {0}, lambda number: tmp_path / f"{number}.png")
    assert str(caught.value) == f"{tmp_path}: no images, but files such as 0.PNG, expected files such as 0.png"
