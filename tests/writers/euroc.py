"""Writes recordings in the ASL layout of EuRoC MAV. It shares no code with the reader."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

START_NS = 1_403_636_579_763_555_584
BODY_FROM_CAMERA = np.array(
    [
        [0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975],
        [0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768],
        [-0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
BODY_FROM_CAMERA[:3, :3] = Rotation.from_matrix(BODY_FROM_CAMERA[:3, :3]).as_matrix()
HEADER = (
    "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
    "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1]"
)


def numbers(values: np.ndarray) -> str:
    return ", ".join(f"{value:.17g}" for value in np.asarray(values).ravel())


def matrix(name: str, values: np.ndarray) -> str:
    return f"{name}:\n  cols: 4\n  rows: 4\n  data: [{numbers(values)}]\n"


def write_sensor(
    path: Path,
    size: tuple[int, int],
    intrinsics: Sequence[float],
    *,
    distortion: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
    body_from_camera: np.ndarray = BODY_FROM_CAMERA,
) -> None:
    """A camera's ``sensor.yaml``."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        "# General sensor definitions.\nsensor_type: camera\ncomment: VI-Sensor cam0 (MT9M034)\n\n"
        "# Sensor extrinsics wrt. the body-frame.\n" + matrix("T_BS", body_from_camera) + "\nrate_hz: 20\n"
        f"resolution: [{size[0]}, {size[1]}]\ncamera_model: pinhole\n"
        f"intrinsics: [{numbers(np.array(intrinsics))}] #fu, fv, cu, cv\n"
        f"distortion_model: radial-tangential\ndistortion_coefficients: [{numbers(np.array(distortion))}]\n"
    )


def write_images(device: Path, camera: str, times_ns: Sequence[int], images: Sequence[np.ndarray]) -> None:
    (device / camera / "data").mkdir(parents=True, exist_ok=True)
    lines = ["#timestamp [ns],filename"]
    for time, image in zip(times_ns, images, strict=True):
        assert cv2.imwrite(str(device / camera / "data" / f"{time}.png"), image)
        lines.append(f"{time},{time}.png")
    (device / camera / "data.csv").write_text("\r\n".join(lines) + "\r\n")


def write_poses(path: Path, times_ns: Sequence[int], poses: np.ndarray, *, header: str = HEADER) -> None:
    """Position, quaternion with the scalar first, and a velocity of zero."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [header] if header else []
    for time, pose in zip(times_ns, poses, strict=True):
        x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
        lines.append(f"{time},{numbers(np.array([*pose[:3, 3], w, x, y, z, 0.0, 0.0, 0.0]))}".replace(" ", ""))
    path.write_text("\n".join(lines) + "\n")


def write_euroc(
    folder: Path,
    images: Sequence[np.ndarray],
    poses: np.ndarray,
    *,
    intrinsics: Sequence[float],
    distortion: Sequence[float] = (0.0, 0.0, 0.0, 0.0),
) -> np.ndarray:
    """Write one recording whose poses are those of its images. Returns the times of the images, ns."""
    times_ns = START_NS + np.arange(len(images)) * 50_000_000
    device = folder / "mav0"
    write_images(device, "cam0", times_ns.tolist(), images)
    height, width = images[0].shape
    write_sensor(device / "cam0" / "sensor.yaml", (width, height), intrinsics, distortion=distortion)
    bodies = poses @ np.linalg.inv(BODY_FROM_CAMERA)
    write_poses(device / "state_groundtruth_estimate0" / "data.csv", times_ns.tolist(), bodies)
    (device / "state_groundtruth_estimate0" / "sensor.yaml").write_text(
        "sensor_type: visual-inertial\n" + matrix("T_BS", np.eye(4))
    )
    return times_ns
