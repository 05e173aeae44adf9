"""Camera files of SLAM systems and of OpenSfM: see docs/data.md.

Each of them is known by its keys. The files of all but SVO's older ones and OpenSfM put (0, 0) at the centre of the
first pixel; those two state positions in units of the image's sides, which are converted.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.geometry.pose import from_rotation
from tracknoise.sequences.entries import Entries
from tracknoise.sequences.poses import checked_poses, quaternion_poses
from tracknoise.sequences.scenes import with_option

Size = tuple[int, int]
"""Width and height, px."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class StatedCamera:
    """What a file says about one camera."""

    place: str | Path
    model: str  # as `tracknoise.geometry.cameras.LENSES` has it
    size: Size
    intrinsics: Sequence[float]  # fx, fy, cx, cy, px
    coefficients: tuple[float, ...]
    body_from_camera: NDArray[np.float64] | None = None  # (4, 4) float64, metres; None where the file does not say
    # to be added to the time of an image to get the time of the body's clock, seconds; None where unknown
    time_shift_s: float | None = None
    rate_hz: float | None = None
    depth_unit_m: float | None = None
    notes: tuple[str, ...] = ()  # what the file says, and is not used


@dataclass(frozen=True, slots=True)
class _System:
    """How the files of one system are known, and what is read from them."""

    name: str
    is_of: Callable[[Entries], bool]
    names: Callable[[Entries], list[str]]  # of the cameras, where a file may have several
    read: Callable[[Entries, str, Size | None], StatedCamera]
    # whether one of them must be named, because the first is not better than the others
    must_name: Callable[[Entries], bool] = lambda _: False


def system_of(entries: Entries) -> str | None:
    """Name of the system that wrote a file; None where no system is known by its keys."""
    system = _system(entries)
    return None if system is None else system.name


def camera_names(entries: Entries) -> list[str]:
    """Names of the cameras of a file of such a system: ``cam0``, ``cam1``; empty where it can have only one."""
    system = _system(entries)
    return [] if system is None else system.names(entries)


def read_system_camera(entries: Entries, camera: str | None, size: Size | None) -> StatedCamera:
    """One camera of a file that `system_of` knows, by default the first.

    `size`: width and height of the images, px, for a file that does not say.
    """
    system = _system(entries)
    assert system is not None, "the file is of a known system"
    names = system.names(entries)
    if camera is not None and not names:
        raise DataError(entries.place, f"no camera {camera}", f"no name: a file of {system.name} has one camera")
    if camera is not None and camera not in names:
        raise UnknownNameError("camera", camera, names)
    if camera is None and len(names) > 1 and system.must_name(entries):
        raise DataError(entries.place, f"the cameras {', '.join(names)}", with_option("camera", names[-1]))
    return system.read(entries, camera or next(iter(names), "cam0"), size)


def _system(entries: Entries) -> _System | None:
    return next((system for system in _SYSTEMS if system.is_of(entries)), None)


def _refused(place: str | Path, system: str, model: str, supported: Sequence[str]) -> DataError:
    return DataError(place, f"a camera of {system} with the model {model}", f"one of {', '.join(supported)}")


def _numbered(count: int) -> list[str]:
    return [f"cam{index}" for index in range(count)]


def _each(entries: Entries, *names: str) -> tuple[float, ...]:
    return tuple(entries.number(name) for name in names)


def _whole(entries: Entries, width: str, height: str) -> Size:
    wide, high = (int(entries.number(name, whole=True, positive=True)) for name in (width, height))
    return wide, high


def _bent(coefficients: tuple[float, ...]) -> tuple[float, ...]:
    """Radial-tangential coefficients; none where all are 0."""
    return coefficients if any(coefficients) else ()


def _stated(entries: Entries, name: str) -> bool:
    """Whether a key is there and not 0."""
    return entries.name(name) is not None and entries.number(name) != 0.0


_BROWN = ("k1", "k2", "p1", "p2")
_RATIONAL = (*_BROWN, "k3", "k4", "k5", "k6")
_KANNALA = ("k1", "k2", "k3", "k4")
_PINHOLE = ("fx", "fy", "cx", "cy")


_VINS_MODELS = ("PINHOLE", "PINHOLE_FULL", "KANNALA_BRANDT", "MEI")


def _vins(entries: Entries, _: str, __: Size | None) -> StatedCamera:
    """A file of VINS-Mono or VINS-Fusion, whose cameras are camodocal's."""
    if entries.name("cam0_calib"):
        found = "a configuration of VINS-Fusion, whose cameras are in files of their own"
        raise DataError(entries.place, found, f"the file that it names: {entries.values['cam0_calib']}")
    kind, projection = entries.text("model_type").upper(), "projection_parameters"
    if kind not in _VINS_MODELS:
        raise _refused(entries.place, "VINS (camodocal)", kind, _VINS_MODELS)
    lens = "distortion_parameters"
    if kind == "KANNALA_BRANDT":
        model, coefficients = "equidistant", _each(entries.part(projection), "k2", "k3", "k4", "k5")
        intrinsics = _each(entries.part(projection), "mu", "mv", "u0", "v0")
    else:
        names = _RATIONAL if kind == "PINHOLE_FULL" else _BROWN
        coefficients = _bent(_each(entries.part(lens), *names) if entries.name(lens) else ())
        model = "radtan"
        if kind == "MEI":
            model, coefficients = "omni", (entries.part("mirror_parameters").number("xi"), *coefficients)
        names = ("gamma1", "gamma2", "u0", "v0") if kind == "MEI" else _PINHOLE
        intrinsics = _each(entries.part(projection), *names)
    return StatedCamera(
        place=entries.place,
        model=model,
        size=_whole(entries, "image_width", "image_height"),
        intrinsics=intrinsics,
        coefficients=coefficients,
        body_from_camera=_vins_body(entries),
        time_shift_s=entries.number("td") if entries.name("td") and not _stated(entries, "estimate_td") else None,
        notes=_unused_shutter("rolling_shutter_tr") if _stated(entries, "rolling_shutter") else (),
    )


def _vins_body(entries: Entries) -> NDArray[np.float64] | None:
    """Place of the camera on the IMU; None where it is only a first guess."""
    if not entries.name("extrinsicRotation") or _stated(entries, "estimate_extrinsic"):
        return None
    pose = from_rotation(entries.matrix("extrinsicRotation", 3, 3), entries.numbers("extrinsicTranslation", 3))
    (rigid,), _ = checked_poses(pose[None], [f"{entries.place}: extrinsicRotation"])
    return np.asarray(rigid)


def _unused_shutter(name: str) -> tuple[str, ...]:
    return (f"the camera file states a rolling shutter ({name}), which is not used: readout_s states one",)


_ORB_MODELS = ("PinHole", "KannalaBrandt8", "Rectified")
_SIDES = ("LEFT", "RIGHT")


def _orb_names(entries: Entries) -> list[str]:
    numbered = _numbered(2 if entries.name("Camera2.fx") else 1)
    return [*numbered, *(side for side in _SIDES if entries.name(f"{side}.K"))]


def _orb(entries: Entries, camera: str, size: Size | None) -> StatedCamera:
    """A file of ORB-SLAM3 (``Camera1.fx``) or of earlier versions (``Camera.fx``)."""
    if camera in _SIDES:
        return _orb_side(entries, camera, size)
    number = int(camera[3:]) + 1
    prefix = "Camera" if number == 1 and not entries.name("Camera1.fx") else f"Camera{number}"
    kind = entries.text("Camera.type") if entries.name("Camera.type") else "pinhole"
    if kind not in map(str.lower, _ORB_MODELS):
        raise _refused(entries.place, "ORB-SLAM", str(entries.values["Camera.type"]), _ORB_MODELS)
    model, coefficients = "radtan", tuple[float, ...]()
    if kind == "kannalabrandt8":
        model, coefficients = "equidistant", _each(entries, *(f"{prefix}.{name}" for name in _KANNALA))
    elif kind == "pinhole" and entries.name(f"{prefix}.k1"):
        names = (*_BROWN, "k3") if entries.name(f"{prefix}.k3") else _BROWN
        coefficients = _bent(_each(entries, *(f"{prefix}.{name}" for name in names)))
    factor = entries.name("RGBD.DepthMapFactor", "DepthMapFactor")
    return StatedCamera(
        place=entries.place,
        model=model,
        size=_orb_size(entries, "Camera", size),
        intrinsics=_each(entries, *(f"{prefix}.{name}" for name in _PINHOLE)),
        coefficients=coefficients,
        body_from_camera=_orb_body(entries, number),
        rate_hz=entries.number("Camera.fps", positive=True) if entries.name("Camera.fps") else None,
        depth_unit_m=1.0 / entries.number(factor, positive=True) if factor else None,
    )


def _orb_side(entries: Entries, side: str, size: Size | None) -> StatedCamera:
    """The camera of recorded images, where ``Camera.fx`` is that of rectified ones."""
    (fx, _, cx), (_, fy, cy), _ = entries.matrix(f"{side}.K", 3, 3)
    return StatedCamera(
        place=entries.place,
        model="radtan",
        size=_orb_size(entries, side, size),
        intrinsics=(fx, fy, cx, cy),
        coefficients=_bent(entries.numbers(f"{side}.D", 4, 5, 8)),
    )


def _orb_size(entries: Entries, prefix: str, size: Size | None) -> Size:
    if entries.name(f"{prefix}.width") or size is None:
        return _whole(entries, f"{prefix}.width", f"{prefix}.height")
    return size


def _orb_body(entries: Entries, number: int) -> NDArray[np.float64] | None:
    to_body, beside = entries.name("IMU.T_b_c1", "Tbc"), entries.name("Stereo.T_c1_c2", "Tlr")
    if to_body is None or (number == 2 and beside is None):
        return None
    first = entries.rigid(to_body)
    return first if number == 1 or beside is None else np.asarray(first @ entries.rigid(beside))


def _listed(entries: Entries, name: str) -> list[dict[str, Any]]:
    """A list of keys and values; empty where there is none."""
    values = entries.values.get(name)
    return values if isinstance(values, list) and all(isinstance(value, dict) for value in values) else []


def _one_of(entries: Entries, name: str, camera: str) -> Entries:
    return Entries(f"{entries.place} ({camera})", _listed(entries, name)[int(camera[3:])])


_OKVIS_MODELS = {
    "radialtangential": ("radtan", 4),
    "radialtangential8": ("radtan", 8),
    "equidistant": ("equidistant", 4),
}


def _okvis(entries: Entries, camera: str, _: Size | None) -> StatedCamera:
    """A file of OKVIS or OKVIS2."""
    part = _one_of(entries, "cameras", camera)
    kind = part.text("distortion_type")
    if kind not in _OKVIS_MODELS:
        raise _refused(part.place, "OKVIS", kind, [*_OKVIS_MODELS])
    model, count = _OKVIS_MODELS[kind]
    coefficients = part.numbers("distortion_coefficients", count)
    return StatedCamera(
        place=part.place,
        model=model,
        size=part.size("image_dimension"),
        intrinsics=(*part.numbers("focal_length", 2), *part.numbers("principal_point", 2)),
        coefficients=coefficients if model == "equidistant" else _bent(coefficients),
        body_from_camera=part.rigid("T_SC") if part.name("T_SC") else None,
    )


_SVO_LENSES = {
    "none": ("radtan", (0,)),
    "no": ("radtan", (0,)),
    "radial-tangential": ("radtan", (4, 5, 8)),
    "radtan": ("radtan", (4, 5, 8)),
    "equidistant": ("equidistant", (4,)),
    "fisheye": ("fov", (1,)),
}
"""What SVO and maplab call fisheye is the field-of-view model."""


def _svo(entries: Entries, camera: str, _: Size | None) -> StatedCamera:
    """A file of SVO Pro or maplab."""
    outer = _one_of(entries, "cameras", camera)
    part = outer.part("camera")
    kind = part.text("type")
    lens = part.part("distortion") if part.name("distortion") else Entries(part.place, {"type": "none"})
    word = lens.text("type")
    if kind not in ("pinhole", "unified-projection") or word not in _SVO_LENSES:
        supported = [f"pinhole with {', '.join(_SVO_LENSES)}", "unified-projection with none, radial-tangential"]
        raise _refused(part.place, "SVO (vikit)", f"{kind}, {word}", supported)
    model, counts = _SVO_LENSES[word]
    coefficients = lens.numbers("parameters", *counts) if counts != (0,) else ()
    coefficients = coefficients if model in ("equidistant", "fov") else _bent(coefficients)
    intrinsics = part.numbers("intrinsics", 4 if kind == "pinhole" else 5)
    if kind != "pinhole":
        if model != "radtan":
            raise _refused(part.place, "SVO (vikit)", f"{kind}, {word}", ["none", "radial-tangential"])
        model, coefficients, intrinsics = "omni", (intrinsics[0], *coefficients), intrinsics[1:]
    delay = "line-delay-nanoseconds"
    return StatedCamera(
        place=part.place,
        model=model,
        size=_whole(part, "image_width", "image_height"),
        intrinsics=intrinsics,
        coefficients=coefficients,
        body_from_camera=outer.rigid("T_B_C") if outer.name("T_B_C") else None,
        notes=_unused_shutter(delay) if _stated(part, delay) else (),
    )


_VIKIT_MODELS = {"pinhole": "radtan", "atan": "fov", "equidistant": "equidistant"}


def _vikit(entries: Entries, _: str, __: Size | None) -> StatedCamera:
    """A file of the first SVO (``cam_fx``). Its ATAN camera has units of the image's sides, with (0, 0) at a corner."""
    kind = entries.text("cam_model")
    if kind not in _VIKIT_MODELS:
        supported = ["Pinhole", "ATAN", "Equidistant"]
        raise _refused(entries.place, "SVO (vikit)", str(entries.values["cam_model"]), supported)
    model = _VIKIT_MODELS[kind]
    width, height = size = _whole(entries, "cam_width", "cam_height")
    fx, fy, cx, cy = _each(entries, "cam_fx", "cam_fy", "cam_cx", "cam_cy")
    if model == "fov":
        fx, fy, cx, cy = fx * width, fy * height, cx * width - 0.5, cy * height - 0.5
        coefficients = _each(entries, "cam_d0")
    elif entries.name("cam_d0"):
        last = ("cam_d4",) if entries.name("cam_d4") and model == "radtan" else ()
        coefficients = _each(entries, "cam_d0", "cam_d1", "cam_d2", "cam_d3", *last)
    else:
        coefficients = ()
    coefficients = _bent(coefficients) if model == "radtan" else coefficients
    return StatedCamera(
        place=entries.place, model=model, size=size, intrinsics=(fx, fy, cx, cy), coefficients=coefficients
    )


_BASALT_MODELS = {
    "pinhole": ("pinhole", ()),
    "pinhole-radtan8": ("radtan", _RATIONAL),
    "kb4": ("equidistant", _KANNALA),
    "ds": ("double_sphere", ("xi", "alpha")),
    "eucm": ("eucm", ("alpha", "beta")),
    "ucm": ("eucm", ("alpha",)),
    "fov": ("fov", ("w",)),
}


def _basalt(entries: Entries, camera: str, _: Size | None) -> StatedCamera:
    """A calibration of Basalt. Its unified camera is the enhanced one with beta = 1."""
    whole, index = entries.part("value0"), int(camera[3:])
    part = _one_of(whole, "intrinsics", camera)
    kind = part.text("camera_type")
    if kind not in _BASALT_MODELS:
        raise _refused(part.place, "Basalt", kind, [*_BASALT_MODELS])
    model, names = _BASALT_MODELS[kind]
    numbers = part.part("intrinsics")
    coefficients = (*_each(numbers, *names), *((1.0,) if kind == "ucm" else ()))
    sizes, poses = whole.values.get("resolution"), _listed(whole, "T_imu_cam")
    if not isinstance(sizes, list) or len(sizes) <= index:
        raise DataError(whole.place, f"no resolution of {camera}", "width and height")
    return StatedCamera(
        place=part.place,
        model=model,
        size=Entries(whole.place, {"resolution": sizes[index]}).size("resolution"),
        intrinsics=_each(numbers, *_PINHOLE),
        coefficients=_bent(coefficients) if model == "radtan" else coefficients,
        body_from_camera=_basalt_pose(_one_of(whole, "T_imu_cam", camera)) if len(poses) > index else None,
        time_shift_s=whole.number("cam_time_offset_ns") * 1e-9 if whole.name("cam_time_offset_ns") else None,
    )


def _basalt_pose(entries: Entries) -> NDArray[np.float64]:
    position, quaternion = _each(entries, "px", "py", "pz"), _each(entries, "qx", "qy", "qz", "qw")
    (pose,) = quaternion_poses(np.array([position]), np.array([quaternion]), [f"{entries.place}: T_imu_cam"])
    return np.asarray(pose)


_OPENSFM_MODELS = {
    "perspective": ("radtan", ("k1", "k2")),
    "simple_radial": ("radtan", ("k1",)),
    "radial": ("radtan", ("k1", "k2")),
    "brown": ("radtan", (*_BROWN, "k3")),
    "fisheye": ("equidistant", ("k1", "k2")),
    "fisheye_opencv": ("equidistant", _KANNALA),
}
_COEFFICIENTS = {"radtan": 4, "equidistant": 4}


def _is_opensfm(entries: Entries) -> bool:
    values = entries.values.values()
    return bool(entries.values) and all(isinstance(value, dict) and "projection_type" in value for value in values)


def _opensfm(entries: Entries, camera: str, _: Size | None) -> StatedCamera:
    """A camera of OpenSfM's ``camera_models.json``. Its unit is the larger side, and its origin the image's centre."""
    part = entries.part(camera)
    kind = part.text("projection_type")
    if kind not in _OPENSFM_MODELS:
        raise _refused(part.place, "OpenSfM", kind, [*_OPENSFM_MODELS])
    model, names = _OPENSFM_MODELS[kind]
    width, height = size = _whole(part, "width", "height")
    side = max(size)
    across = part.number(part.required("focal_x", "focal"), positive=True)
    down = part.number("focal_y", positive=True) if part.name("focal_y") else across
    u, v = (part.number(name) if part.name(name) else 0.0 for name in ("c_x", "c_y"))
    numbers = _each(part, *names)
    coefficients = (*numbers, *[0.0] * (_COEFFICIENTS[model] - len(numbers)))
    return StatedCamera(
        place=part.place,
        model=model,
        size=size,
        intrinsics=(across * side, down * side, u * side + width / 2 - 0.5, v * side + height / 2 - 0.5),
        coefficients=coefficients if model == "equidistant" else _bent(coefficients),
    )


def _only(_: Entries) -> list[str]:
    return []


def _all_listed(name: str) -> Callable[[Entries], list[str]]:
    return lambda entries: _numbered(len(_listed(entries, name)))


_SYSTEMS = (
    _System("VINS", lambda entries: entries.name("model_type", "cam0_calib") is not None, _only, _vins),
    _System(
        "ORB-SLAM",
        lambda entries: entries.name("Camera1.fx", "Camera.fx", "Camera.type") is not None,
        _orb_names,
        _orb,
        must_name=lambda entries: entries.name("LEFT.K") is not None,
    ),
    _System(
        "OKVIS",
        lambda entries: any("focal_length" in part or "T_SC" in part for part in _listed(entries, "cameras")),
        _all_listed("cameras"),
        _okvis,
    ),
    _System(
        "SVO",
        lambda entries: any("camera" in part for part in _listed(entries, "cameras")),
        _all_listed("cameras"),
        _svo,
    ),
    _System("SVO", lambda entries: entries.name("cam_model") is not None, _only, _vikit),
    _System(
        "Basalt",
        lambda entries: isinstance(entries.values.get("value0"), dict) and "intrinsics" in entries.values["value0"],
        lambda entries: _all_listed("intrinsics")(entries.part("value0")),
        _basalt,
    ),
    _System("OpenSfM", _is_opensfm, lambda entries: list(entries.values), _opensfm, must_name=lambda _: True),
)
