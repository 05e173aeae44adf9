import pytest

from tracknoise.exceptions import DataError
from tracknoise.paper.dtu import CONDENSED, FULL, dtu_scenes, find_beside, image_files, release_of, scan_name


def touch(folder, release, *, suffix="bmp", numbers=None, positions=range(1, 120)):
    folder.mkdir(parents=True)
    for position in positions:
        for number in numbers or release.numbers:
            (folder / f"{release.image.format(position=position, number=number)}.{suffix}").touch()
    return folder


def test_scenes_of_both_releases_at_any_depth(tmp_path) -> None:
    touch(tmp_path / "SET002", FULL, positions=[1])
    touch(tmp_path / "half" / "SET001", FULL, suffix="png", positions=[1])
    touch(tmp_path / "scene010", CONDENSED, suffix="png", positions=[1])
    (tmp_path / "CleanRecon_2009_11_16").mkdir()
    (tmp_path / "CleanRecon_2009_11_16" / "Clean_Reconstruction_01.mat").touch()
    scenes = dtu_scenes(tmp_path)
    assert list(scenes) == ["SET002", "half/SET001", "scene010"]
    assert [release_of(folder) for folder in scenes.values()] == [FULL, FULL, CONDENSED]
    assert list(dtu_scenes(tmp_path / "SET002")) == ["SET002"]


def test_no_scene_is_one_line_that_says_what_makes_one(tmp_path) -> None:
    with pytest.raises(DataError) as caught:
        dtu_scenes(tmp_path)
    expected = "folders such as SET001 with Img001_00.bmp (or .png), or scene001 with 001_00.png"
    assert str(caught.value) == f"{tmp_path}: no scene, expected {expected}"


@pytest.mark.parametrize(("release", "count"), [(FULL, 19), (CONDENSED, 36)])
def test_the_images_of_arc_1_are_found_by_position_and_number(tmp_path, release, count) -> None:
    folder = touch(tmp_path / "SET001", release)
    files = image_files(folder, release)
    assert len(files) == 49 * count
    assert files[25, 7] == folder / f"{release.image.format(position=25, number=7)}.bmp"
    assert release.image.format(position=25, number=7).endswith("025_07")


@pytest.mark.parametrize("missing", ["Img001_00.bmp", "Img025_18.bmp", "Img049_03.bmp"])
def test_the_first_image_that_is_missing_is_named(tmp_path, missing) -> None:
    folder = touch(tmp_path / "SET001", FULL)
    (folder / missing).unlink()
    with pytest.raises(DataError) as caught:
        image_files(folder, FULL)
    expected = "19 images (numbers 00 to 18) of each of positions 1 to 49"
    assert str(caught.value) == f"{folder / missing}: missing image, expected {expected}"


def test_images_of_18_leds_only(tmp_path) -> None:
    folder = touch(tmp_path / "SET001", FULL, numbers=range(18))
    with pytest.raises(DataError, match=r"Img001_18\.bmp: missing image, expected 19 images \(numbers 00 to 18\)"):
        image_files(folder, FULL)


def test_an_image_in_two_formats_is_refused(tmp_path) -> None:
    folder = touch(tmp_path / "SET001", FULL)
    (folder / "Img003_04.png").touch()
    with pytest.raises(DataError, match=r"Img003_04\.png: the number of Img003_04\.bmp again"):
        image_files(folder, FULL)


@pytest.mark.parametrize(("folder", "name"), [("SET001", "01"), ("scene010", "10"), ("half/SET060", "60")])
def test_a_scenes_number_is_that_of_its_scan(tmp_path, folder, name) -> None:
    assert scan_name(tmp_path / folder) == f"Clean_Reconstruction_{name}.mat"


def test_a_scene_without_a_number_has_no_scan(tmp_path) -> None:
    with pytest.raises(DataError, match="a folder without a number, expected one such as SET001"):
        scan_name(tmp_path / "mine")


@pytest.mark.parametrize("place", ["a/b/root", "a/b/root/within", "a/b", "a"])
def test_what_belongs_to_all_scenes_is_found_nearby(tmp_path, place) -> None:
    root = tmp_path / "a" / "b" / "root"
    root.mkdir(parents=True)
    (tmp_path / place).mkdir(exist_ok=True)
    (tmp_path / place / "calib.mat").touch()
    assert find_beside(root, "calib.mat") == tmp_path / place / "calib.mat"


def test_what_is_farther_away_is_not(tmp_path) -> None:
    root = tmp_path / "a" / "b" / "root"
    for place in (tmp_path, tmp_path / "a" / "other"):
        (root).mkdir(parents=True, exist_ok=True)
        place.mkdir(exist_ok=True)
        (place / "calib.mat").touch()
    with pytest.raises(DataError) as caught:
        find_beside(root, "calib.mat")
    expected = "it here, in a folder within, or up to two folders above"
    assert str(caught.value) == f"{root / 'calib.mat'}: no such file or folder, expected {expected}"
