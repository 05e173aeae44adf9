"""Simulated sequences in the ASL layout of EuRoC MAV, with inertial readings for filters."""

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import position_rows
from tracknoise.sequences.images import encode_png
from tracknoise.sequences.second_camera import Beside
from tracknoise.sequences.sequence import Sequence, second_of, times_of
from tracknoise.sequences.writing import new_folder, pinhole_of
from tracknoise.simulation.imaging import Stream, generator
from tracknoise.simulation.inertial import RATE_HZ, InertialNoise, InertialReadings, SmoothPath, inertial_readings

_NS = 1_000_000_000
_START_NS = _NS
"""Time of the first frame: some programs take 0 for no time."""
_AT_BODY: NDArray[np.float64] = np.eye(4)
"""The body is the camera, and the inertial sensor is at its centre."""
_AXES = "xyz"
_BEYOND = 20
"""Readings after the last frame, which some filters wait for."""


def write_euroc(
    sequence: Sequence, path: Path, *, seed: int = 0, progress: Callable[[int, int], None] | None = None
) -> None:
    """Write a simulated sequence to a folder that `Euroc` reads; all of it appears at once, when it is complete.

    Inertial readings, true poses, velocities and biases are of the same times, 200 per second, on a smooth path through
    the poses of the frames (`tracknoise.simulation.inertial`). They go on until the last frame or just after it.

    Parameters
    ----------
    sequence
        With times, a pose of each of at least 2 frames, a pinhole camera without distortion, and z up in the world. The
        images of a second camera, which is one too, are those of ``cam1``.
    path
        Folder to write, new or empty.
    seed
        Of the noise and the biases of the inertial sensor.
    progress
        Called after each frame with the count of frames done and of all.

    Raises
    ------
    DataError
        If the sequence has no times, fewer than 2 frames or another camera, or the folder is neither new nor empty, or
        cannot be written.
    """
    camera, times_s = pinhole_of(sequence), times_of(sequence)
    if camera.distortion:
        raise DataError(sequence.source, "a camera with distortion", "one without")
    if times_s is None or len(times_s) < 2:
        found = "no times" if times_s is None else "1 frame"
        raise DataError(sequence.source, found, "at least 2 frames with times, which inertial readings need")
    poses, noise = SmoothPath(times_s, sequence.world_from_camera), InertialNoise()
    count = int(np.ceil((times_s[-1] - times_s[0]) * RATE_HZ - 1e-6)) + 1 + _BEYOND
    read_s = times_s[0] + np.arange(count) / RATE_HZ
    readings = inertial_readings(poses, read_s, generator(seed, Stream.inertial, sequence.id.scene), noise=noise)
    with new_folder(path) as unfinished:
        device = unfinished / "mav0"
        _write_inertial(device / "imu0", readings, noise)
        _write_truth(device / "state_groundtruth_estimate0", poses, readings)
        rate_hz, times_ns = float(1.0 / np.diff(times_s).mean()), _nanoseconds(times_s)
        _write_camera(device / "cam0", camera, rate_hz, np.eye(4))
        second = second_of(sequence)
        if second is not None:
            _write_camera(
                device / "cam1", pinhole_of(beside := Beside(sequence, second)), rate_hz, second.first_from_second
            )
            _write_images(device / "cam1", beside, times_ns, None)
        _write_images(device / "cam0", sequence, times_ns, progress)


def _nanoseconds(times_s: NDArray[np.float64]) -> list[int]:
    return [_START_NS + round(time * _NS) for time in times_s.tolist()]


def _write_inertial(folder: Path, readings: InertialReadings, noise: InertialNoise) -> None:
    header = [f"w_RS_S_{axis} [rad s^-1]" for axis in _AXES] + [f"a_RS_S_{axis} [m s^-2]" for axis in _AXES]
    _write_table(folder, header, readings.times_s, np.hstack([readings.gyro, readings.accelerometer]))
    _write_sensor(
        folder,
        "imu",
        f"rate_hz: {RATE_HZ:g}",
        f"gyroscope_noise_density: {noise.gyro!r}",
        f"gyroscope_random_walk: {noise.gyro_walk!r}",
        f"accelerometer_noise_density: {noise.accelerometer!r}",
        f"accelerometer_random_walk: {noise.accelerometer_walk!r}",
    )


def _write_truth(folder: Path, path: SmoothPath, readings: InertialReadings) -> None:
    names = (("p_RS_R", "xyz", "m"), ("q_RS", "wxyz", ""), ("v_RS_R", "xyz", "m s^-1"))
    biases = (("b_w_RS_S", "xyz", "rad s^-1"), ("b_a_RS_S", "xyz", "m s^-2"))
    header = [f"{name}_{axis} [{unit}]" for name, axes, unit in (*names, *biases) for axis in axes]
    at_s = readings.times_s
    rows = position_rows(path.poses(at_s))[:, [0, 1, 2, 6, 3, 4, 5]]
    values = (rows, path.velocities(at_s), readings.gyro_bias, readings.accelerometer_bias)
    _write_table(folder, header, at_s, np.hstack(values))
    _write_sensor(folder, "visual-inertial")


def _write_camera(folder: Path, camera: Camera, rate_hz: float, place: NDArray[np.float64]) -> None:
    _write_sensor(
        folder,
        "camera",
        f"rate_hz: {rate_hz:.9g}",
        f"resolution: [{camera.width}, {camera.height}]",
        "camera_model: pinhole",
        f"intrinsics: [{', '.join(map(repr, (camera.fx, camera.fy, camera.cx, camera.cy)))}]",
        "distortion_model: radial-tangential",
        "distortion_coefficients: [0.0, 0.0, 0.0, 0.0]",
        place=place,
    )


def _write_images(
    folder: Path, sequence: Sequence, times_ns: list[int], progress: Callable[[int, int], None] | None
) -> None:
    (folder / "data").mkdir()
    names = [f"{time}.png" for time in times_ns]
    for index, name in enumerate(names):
        (folder / "data" / name).write_bytes(encode_png(sequence.image(index)))
        if progress is not None:
            progress(index + 1, len(sequence))
    _write_lines(folder / "data.csv", ["#timestamp [ns],filename", *map("{},{}".format, times_ns, names)])


def _write_table(folder: Path, header: list[str], times_s: NDArray[np.float64], values: NDArray[np.float64]) -> None:
    folder.mkdir(parents=True)
    rows = (",".join(map(repr, row)) for row in values.tolist())
    lines = (f"{time},{row}" for time, row in zip(_nanoseconds(times_s), rows, strict=True))
    _write_lines(folder / "data.csv", [",".join(["#timestamp [ns]", *header]), *lines])


def _write_sensor(folder: Path, kind: str, *entries: str, place: NDArray[np.float64] = _AT_BODY) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    data = ", ".join(f"{number:.17g}" for number in place.ravel().tolist())
    matrix = ["T_BS:", "  cols: 4", "  rows: 4", f"  data: [{data}]"]
    _write_lines(folder / "sensor.yaml", [f"sensor_type: {kind}", *matrix, *entries])


def _write_lines(path: Path, lines: Iterable[str]) -> None:
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
