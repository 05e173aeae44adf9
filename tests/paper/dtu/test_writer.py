import cv2
import numpy as np
import pytest
from scipy.io import loadmat

from tracknoise.exceptions import DataError
from tracknoise.paper.dtu import read_leds, write_mat
from tracknoise.paper.dtu_writer import write_dtu


class Blank:
    """A stage without a scene, of 2x2 px, which is quick to photograph."""

    def __init__(self, stage, scene: int) -> None:
        self.camera, self.world_from_camera, self.leds_m = stage.camera, stage.world_from_camera, stage.leds_m
        self._scene = scene

    def images(self, index):
        yield from (np.full((2, 2), 50 * self._scene + index + led, np.uint8) for led in range(19))

    def scan(self):
        return self.world_from_camera[24, :3, 3] + self.world_from_camera[24, :3, 2] * np.arange(1.0, 6.0)[:, None]


def test_the_layout_is_that_of_the_full_release(simulated) -> None:
    names = sorted(path.name for path in simulated.iterdir())
    assert names == ["Calib_Results_11.mat", "CleanRecon_2009_11_16", "SET001", "leds.csv"]
    images = sorted(path.name for path in (simulated / "SET001").iterdir())
    assert images == [f"Img{position:03d}_{led:02d}.bmp" for position in range(1, 50) for led in range(19)]


def test_the_images_are_those_of_the_stage(simulated, stage) -> None:
    for led, image in enumerate(stage.images(7)):
        written = cv2.imread(str(simulated / "SET001" / f"Img008_{led:02d}.bmp"), cv2.IMREAD_GRAYSCALE)
        np.testing.assert_array_equal(written, image)


def test_the_calibration_has_the_toolbox_names(simulated, stage) -> None:
    variables = loadmat(simulated / "Calib_Results_11.mat")
    centre = stage.world_from_camera[11, :3, 3]
    np.testing.assert_allclose(variables["Rc_12"] @ centre + variables["Tc_12"].ravel(), 0.0, atol=1e-12)
    np.testing.assert_allclose(variables["Rc_12"][2], stage.world_from_camera[11, :3, 2])  # the axis, in the world
    assert [variables[name].shape for name in ("fc", "cc", "kc")] == [(2, 1), (2, 1), (5, 1)]
    np.testing.assert_allclose(read_leds(simulated / "leds.csv"), stage.leds_m, atol=1e-6)


def test_the_scan_is_in_two_parts_by_depth(tmp_path, stage) -> None:
    write_dtu(tmp_path / "x", stage=lambda scene: Blank(stage, scene))
    variables = loadmat(tmp_path / "x" / "CleanRecon_2009_11_16" / "Clean_Reconstruction_01.mat")
    far = np.linalg.norm(variables["pts3D_far"].T - stage.world_from_camera[24, :3, 3], axis=1)
    near = np.linalg.norm(variables["pts3D_near"].T - stage.world_from_camera[24, :3, 3], axis=1)
    np.testing.assert_allclose((near, np.append(far, 3.0)), ((1, 2, 3), (4, 5, 3)), rtol=1e-6)


def test_scenes_and_progress(tmp_path, stage) -> None:
    told = []
    write_dtu(
        tmp_path / "x", scenes=2, stage=lambda scene: Blank(stage, scene), progress=lambda *done: told.append(done)
    )
    assert told == [(done + 1, 98) for done in range(98)]
    second = cv2.imread(str(tmp_path / "x" / "SET002" / "Img003_04.png"), cv2.IMREAD_GRAYSCALE)
    assert (second == 100 + 2 + 4).all()
    assert (tmp_path / "x" / "CleanRecon_2009_11_16" / "Clean_Reconstruction_02.mat").exists()


def test_what_is_there_already_is_not_overwritten(tmp_path, stage) -> None:
    (tmp_path / "mine").touch()
    with pytest.raises(DataError, match="already exists, expected a new or empty folder"):
        write_dtu(tmp_path, stage=lambda scene: Blank(stage, scene))
    with pytest.raises(ValueError, match="image_format must be one of png, bmp, not 'jpg'"):
        write_dtu(tmp_path / "x", stage=lambda scene: Blank(stage, scene), image_format="jpg")
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_matlab_files_do_not_depend_on_the_time(tmp_path) -> None:
    write_mat(tmp_path / "x.mat", {"a": 1.5, "b": np.eye(2)})
    assert (tmp_path / "x.mat").read_bytes().startswith(b"MATLAB 5.0 MAT-file" + b" " * 97)
    np.testing.assert_array_equal(loadmat(tmp_path / "x.mat")["b"], np.eye(2))
