"""Cameras as Kalibr and the ASL layout of EuRoC and TUM-VI describe them: ``intrinsics`` and a 4x4 matrix."""

import re

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import UnknownNameError
from tracknoise.geometry.pose import invert
from tracknoise.sequences.camera_files.camera_file import CameraFile, checked_camera
from tracknoise.sequences.camera_files.entries import Entries
from tracknoise.sequences.camera_files.lens_names import coefficients_at, lens_at
from tracknoise.sequences.camera_files.readout import shutter_at
from tracknoise.sequences.poses import checked_poses

_NAME = re.compile(r"cam\d+")
_FROM_BODY, _TO_BODY = "T_cam_imu", ("T_BS", "T_imu_cam")
_FROM_PREVIOUS = "T_cn_cnm1"


def cameras_of(entries: Entries) -> list[str]:
    """Names of the cameras of a chain of Kalibr's, ``cam0`` first; empty for other files."""
    return sorted(filter(_NAME.fullmatch, entries.values), key=lambda name: int(name[3:]))


def read_chain(entries: Entries, camera: str | None) -> CameraFile:
    """One camera of a chain of Kalibr's, by default the first.

    Raises
    ------
    DataError
        If something is missing or impossible, or a model is not supported.
    UnknownNameError
        If there is no camera of that name.
    """
    names = cameras_of(entries)
    if camera not in (None, *names):
        raise UnknownNameError("camera", str(camera), names)
    chosen = names[0] if camera is None else camera
    body_from_camera = _along_chain(entries, names[: names.index(chosen) + 1])
    return read_calibrated(entries.part(chosen), None, body_from_camera)


def read_calibrated(
    entries: Entries, size: tuple[int, int] | None, body_from_camera: NDArray[np.float64] | None = None
) -> CameraFile:
    """A camera with the keys ``camera_model``, ``intrinsics``, ``distortion_model`` and ``resolution``.

    Parameters
    ----------
    entries
        Of the camera.
    size
        Width and height of the images where the file does not say, px.
    body_from_camera
        (4, 4) float64 from elsewhere; by default from the entries.

    Raises
    ------
    DataError
        If something is missing or impossible, or a model is not supported.
    """
    model, intrinsics, coefficients = _lens(entries)
    if size is None or entries.name("resolution"):
        size = entries.size("resolution")
    shift, rate = entries.name("timeshift_cam_imu"), entries.name("rate_hz")
    return CameraFile(
        checked_camera(entries.place, model, size, intrinsics, coefficients),
        _body_from_camera(entries) if body_from_camera is None else body_from_camera,
        None if shift is None else entries.number(shift),
        None if rate is None else entries.number(rate, positive=True),
        shutter=shutter_at(entries),
    )


def _lens(entries: Entries) -> tuple[str, tuple[float, ...], tuple[float, ...]]:
    """Model, then fx, fy, cx, cy, then coefficients."""
    key = entries.name("camera_model")
    kind = "pinhole" if key is None else entries.text(key)
    if kind in ("ds", "double_sphere"):
        xi, alpha, *intrinsics = entries.numbers("intrinsics", 6)
        return "double_sphere", tuple(intrinsics), (xi, alpha)
    if kind != "pinhole":
        raise entries.error("camera_model", "pinhole or ds")
    model = lens_at(entries, "distortion_model")
    coefficients = coefficients_at(entries, entries.name("distortion_coeffs", "distortion_coefficients"), model)
    return model, entries.numbers("intrinsics", 4), () if model == "pinhole" else coefficients


def _body_from_camera(entries: Entries) -> NDArray[np.float64] | None:
    if entries.name(_FROM_BODY):
        return invert(_rigid(entries, _FROM_BODY))
    to_body = entries.name(*_TO_BODY)
    return None if to_body is None else _rigid(entries, to_body)


def _along_chain(entries: Entries, names: list[str]) -> NDArray[np.float64] | None:
    """Pose of the last camera in the body: its own, or that of the camera before and how the two are related."""
    previous = None
    for name in names:
        part = entries.part(name)
        own = _body_from_camera(part)
        if own is None and previous is not None and part.name(_FROM_PREVIOUS):
            own = previous @ invert(_rigid(part, _FROM_PREVIOUS))
        previous = own
    return previous


def _rigid(entries: Entries, name: str) -> NDArray[np.float64]:
    (rigid,), _ = checked_poses(entries.matrix(name, 4, 4)[None], [f"{entries.place}: {name}"])
    return np.asarray(rigid)
