"""Simulated scenes in the layout of the full release."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert
from tracknoise.paper.dtu import CALIBRATION, FULL, LEDS, POSITIONS, SCANS, scan_name, write_mat
from tracknoise.paper.light_stage import KEY_FRAME, LightStage
from tracknoise.sequences.writing import new_folder

IMAGE_FORMATS = ("png", "bmp")

Progress = Callable[[int, int], None]


def write_dtu(
    out: Path,
    *,
    scenes: int = 1,
    stage: Callable[[int], LightStage] = LightStage,
    image_format: str = "png",
    progress: Progress | None = None,
) -> None:
    """Write scenes to a folder that `tracknoise.paper.dtu.Dtu` reads; all appears at once, when complete.

    Parameters
    ----------
    out
        Folder to write, new or empty.
    scenes
        Count of scenes: SET001, SET002 and so on.
    stage
        Makes the stage of a scene from its number, with the same camera, positions and LEDs for all.
    image_format
        One of `IMAGE_FORMATS`. A BMP file is larger, and faster to write and read.
    progress
        Called after each position with the count of positions done and of all.

    Raises
    ------
    DataError
        If the folder is neither new nor empty, or cannot be written.
    ValueError
        If there is no such format.
    """
    if image_format not in IMAGE_FORMATS:
        raise ValueError(f"image_format must be one of {', '.join(IMAGE_FORMATS)}, not {image_format!r}")
    with new_folder(out) as unfinished:
        (unfinished / SCANS).mkdir()
        for scene in range(1, scenes + 1):
            scene_stage, folder = stage(scene), unfinished / f"SET{scene:03d}"
            folder.mkdir()
            if scene == 1:
                _write_shared(scene_stage, unfinished)
            _write_scan(scene_stage, unfinished / SCANS / scan_name(folder))
            for frame in range(len(POSITIONS)):
                _write_images(scene_stage, frame, folder, image_format)
                if progress is not None:
                    progress((scene - 1) * len(POSITIONS) + frame + 1, scenes * len(POSITIONS))


def _write_shared(stage: LightStage, folder: Path) -> None:
    """Calibration and LEDs, of all scenes alike."""
    write_mat(folder / CALIBRATION, calibration_variables(stage.camera, stage.world_from_camera))
    np.savetxt(folder / LEDS, stage.leds_m, fmt="%.6f", delimiter=",", header="x,y,z", comments="")


def calibration_variables(camera: Camera, world_from_camera: NDArray[np.float64]) -> dict[str, ArrayLike]:
    """What the calibration file holds: see `tracknoise.paper.dtu.read_calibration`."""
    variables: dict[str, ArrayLike] = {
        "fc": np.array([[camera.fx], [camera.fy]]),
        "cc": np.array([[camera.cx], [camera.cy]]),
        "kc": np.array(camera.distortion or (0.0,) * 5)[:, None],
        "alpha_c": 0.0,
        "nx": float(camera.width),
        "ny": float(camera.height),
    }
    for position, camera_from_world in zip(POSITIONS, invert(world_from_camera), strict=True):
        variables[f"Rc_{position}"] = camera_from_world[:3, :3]
        variables[f"Tc_{position}"] = camera_from_world[:3, 3:]
    return variables


def _write_scan(stage: LightStage, path: Path) -> None:
    """The scan in two parts, float32: nearer to the camera than half of all points, and farther."""
    points = stage.scan()
    depth_m = (points - stage.world_from_camera[KEY_FRAME, :3, 3]) @ stage.world_from_camera[KEY_FRAME, :3, 2]
    near = depth_m <= np.median(depth_m)
    parts = {"pts3D_near": points[near], "pts3D_far": points[~near]}
    write_mat(path, {name: part.T.astype(np.float32) for name, part in parts.items()})


def _write_images(stage: LightStage, frame: int, scene: Path, image_format: str) -> None:
    for number, image in enumerate(stage.images(frame)):
        name = FULL.image.format(position=POSITIONS[frame], number=number)
        _, encoded = cv2.imencode(f".{image_format}", image)
        (scene / f"{name}.{image_format}").write_bytes(encoded.tobytes())
