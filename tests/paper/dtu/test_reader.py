import pickle
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracknoise.exceptions import DataError, SettingsError, UnknownNameError
from tracknoise.paper.dtu import LIGHTINGS, Dtu, weights, write_mat
from tracknoise.paper.light_stage import led_positions
from tracknoise.sequences.reader_registry import READERS, make_reader, open_sequence, open_together
from tracknoise.sequences.sequence import Sequence, SharingReader, TruthKind
from tracknoise.tables.identity import SequenceId

NOMINAL = "relit with the nominal positions of the LEDs, because no file gives their measured positions"
CONDENSED = {"name": "{:03d}_{:02d}.png", "numbers": 36}


def leds_csv(path, leds):
    path.write_text("\n".join(",".join(map(str, row)) for row in leds))
    return path


def greys(position: int) -> np.ndarray:
    """Of the LEDs, in the sets made by hand."""
    return 10 * np.arange(19) % 200 + position


def test_every_scene_has_nineteen_lightings(write_set) -> None:
    listed = Dtu(write_set()).sequences()
    assert listed == sorted(listed)
    assert {item.lighting for item in listed} == set(LIGHTINGS)
    assert {(item.dataset, item.scene) for item in listed} == {("dtu", "SET001")}


def test_a_sequence_is_an_arc_at_half_resolution(write_set, calibration) -> None:
    sequence = open_sequence("dtu", write_set(), lighting="diffuse")
    assert isinstance(sequence, Sequence)
    assert len(sequence) == 49
    assert sequence.truths == (TruthKind.scan,)
    assert sequence.depth(0) is None
    assert sequence.surface is None
    camera, (fx, fy), (cx, cy) = sequence.camera, calibration["fc"].ravel(), calibration["cc"].ravel()
    assert (camera.width, camera.height) == (16, 12)
    np.testing.assert_allclose((camera.fx, camera.fy), (fx / 2, fy / 2))
    np.testing.assert_allclose((camera.cx, camera.cy), (cx / 2 - 0.25, cy / 2 - 0.25))
    assert sequence.scan.key_frame == 24
    assert len(sequence.scan.points_world) == 8
    assert sequence.image(0).shape == (12, 16)
    assert sequence.source.endswith("SET001")


@pytest.mark.parametrize("lighting", ["diffuse", "BF3", "LR9"])
@pytest.mark.parametrize("index", [0, 24, 48])
def test_frames_are_positions_and_lightings_are_mixed_from_the_leds(write_set, lighting, index) -> None:
    sequence = open_sequence("dtu", write_set(), lighting=lighting)
    share = dict(zip(LIGHTINGS, weights(led_positions()), strict=True))[lighting]
    np.testing.assert_array_equal(sequence.image(index), np.rint(share @ greys(index + 1)))


def test_nominal_positions_of_the_leds_are_noted(write_set, tmp_path) -> None:
    root, leds = write_set(), led_positions()
    assert open_sequence("dtu", root).notes == (NOMINAL,)
    turned = leds_csv(tmp_path / "mine.csv", leds[::-1])
    mine = open_sequence("dtu", root, lighting="LR0", leds=str(turned))
    assert mine.notes == ()
    share = dict(zip(LIGHTINGS, weights(leds[::-1]), strict=True))["LR0"]
    assert (mine.image(0) == np.rint(share @ greys(1))).all()
    leds_csv(root / "leds.csv", leds)
    beside = open_sequence("dtu", root, lighting="LR0")
    assert beside.notes == ()
    assert not np.array_equal(beside.image(0), mine.image(0))


def test_sequences_opened_together_share_their_images_and_the_scan(write_set) -> None:
    reader = make_reader("dtu", write_set())
    assert isinstance(reader, SharingReader)
    together = open_together(reader, reader.sequences())
    assert [sequence.id for sequence in together] == reader.sequences()
    assert len({id(sequence.shots) for sequence in together}) == 1
    assert len({id(sequence.scan.points_world) for sequence in together}) == 1
    for sequence in together[::6]:
        np.testing.assert_array_equal(sequence.image(30), reader.open(sequence.id).image(30))


def test_only_the_lightings_asked_for_are_relit(write_set) -> None:
    reader = make_reader("dtu", write_set())
    chosen = [SequenceId("dtu", "SET001", lighting) for lighting in ("LR4", "diffuse")]
    lr4, diffuse = open_together(reader, chosen)
    assert (lr4.id.lighting, diffuse.id.lighting) == ("LR4", "diffuse")
    np.testing.assert_array_equal(lr4.image(3), reader.open(chosen[0]).image(3))
    np.testing.assert_array_equal(diffuse.image(3), reader.open(chosen[1]).image(3))


def test_a_sequence_can_be_pickled(write_set) -> None:
    sequence = open_sequence("dtu", write_set(), lighting="BF1")
    image = sequence.image(5)
    copy = pickle.loads(pickle.dumps(sequence))
    np.testing.assert_array_equal(copy.image(5), image)
    np.testing.assert_array_equal(copy.scan.points_world, sequence.scan.points_world)


def test_the_condensed_release_is_relit_already(write_set) -> None:
    root = write_set("scene001", **CONDENSED)
    reader = make_reader("dtu", root)
    names = [item.lighting for item in reader.sequences()]
    assert names == [*(f"BF{k}" for k in range(7)), *(f"LR{k}" for k in range(9)), "diffuse"]
    for lighting, number in {"diffuse": 0, "LR0": 20, "LR8": 28, "BF0": 29, "BF6": 35}.items():
        sequence = open_sequence("dtu", root, lighting=lighting)
        assert sequence.notes == ()
        assert (sequence.image(2) == 10 * number % 200 + 3).all()


def test_images_of_half_the_size_are_used_as_they_are(write_set) -> None:
    root = write_set(size=(16, 12))
    sequence = open_sequence("dtu", root, lighting="BF2")
    assert (sequence.camera.width, sequence.camera.height) == (16, 12)
    assert sequence.image(0).shape == (12, 16)
    assert sequence.notes[0] == "the images on disk have half the size of the calibration's: 16x12"


def test_images_of_another_size_are_refused(write_set) -> None:
    root = write_set(size=(20, 12))
    with pytest.raises(DataError) as caught:
        open_sequence("dtu", root)
    expected = "the calibration's 32x24, or half of it"
    assert str(caught.value) == f"{root / 'SET001/Img001_00.png'}: size 20x12, expected {expected}"


def test_one_image_of_another_size_is_found_when_it_is_read(write_set) -> None:
    root = write_set()
    cv2.imwrite(str(root / "SET001" / "Img009_07.png"), np.zeros((12, 16), np.uint8))
    sequence = open_sequence("dtu", root)
    assert sequence.image(7).shape == (12, 16)
    with pytest.raises(DataError, match=r"Img009_07\.png: size 16x12, expected the camera's 32x24"):
        sequence.image(8)


def test_images_of_eighteen_leds_are_one_clear_line(write_set) -> None:
    with pytest.raises(DataError, match=r"Img001_18\.png: missing image, expected 19 images"):
        open_sequence("dtu", write_set(numbers=18))


def test_eighteen_positions_in_the_file_of_the_leds(write_set, tmp_path) -> None:
    leds = leds_csv(tmp_path / "x.csv", led_positions()[:18])
    with pytest.raises(DataError) as caught:
        open_sequence("dtu", write_set(), leds=leds)
    assert str(caught.value) == f"{leds}: 18 LEDs, expected 19 rows of x,y,z in metres"


@pytest.mark.parametrize("missing", ["Calib_Results_11.mat", "CleanRecon_2009_11_16"])
def test_what_belongs_to_all_scenes_is_missed(write_set, missing) -> None:
    root = write_set()
    (root / missing).rename(root / "hidden")
    with pytest.raises(DataError, match=f"{missing}: no such file or folder, expected it here, in a folder within"):
        open_sequence("dtu", root)


def test_a_scene_without_its_scan(write_set) -> None:
    root = write_set("SET002")
    with pytest.raises(DataError, match=r"Clean_Reconstruction_02\.mat: no such file, expected a MATLAB file"):
        open_sequence("dtu", root)


def test_points_that_the_scan_lacks_are_noted(write_set) -> None:
    root = write_set()
    points = np.array([[np.nan, 1.0], [0.0, 1.0], [0.0, 1.0]])
    variables = {"pts3D_near": points, "pts3D_far": points}
    write_mat(root / "CleanRecon_2009_11_16" / "Clean_Reconstruction_01.mat", variables)
    assert any("2 of 4 scan points are not finite" in note for note in open_sequence("dtu", root).notes)


def test_unknown_names(write_set) -> None:
    root = write_set()
    with pytest.raises(UnknownNameError, match=r"unknown scene 'SET009' .*; known: SET001"):
        Dtu(root).open(SequenceId("dtu", "SET009", "diffuse"))
    with pytest.raises(UnknownNameError, match="unknown lighting 'BF8'"):
        Dtu(root).open(SequenceId("dtu", "SET001", "BF8"))
    with pytest.raises(SettingsError, match=r"reader 'dtu': leds: expected a valid string, found 19$"):
        make_reader("dtu", root, {"leds": 19})
    assert READERS.paths("dtu", {"leds": "leds.csv"}) == [Path("leds.csv")]
