"""tracknoise's own camera file: one key for each number, in JSON or YAML. See docs/folder-layout.md."""

from tracknoise.exceptions import DataError
from tracknoise.geometry.lenses import COEFFICIENTS, KnownCamera, make_camera
from tracknoise.sequences.camera_files.camera_file import CameraFile, checked_camera
from tracknoise.sequences.camera_files.entries import Entries
from tracknoise.sequences.camera_files.readout import READOUT, shutter_at

REQUIRED = ("width", "height", "fx", "fy", "cx", "cy")
"""Keys that every such file has."""

_OPTIONAL = ("model", "distortion", "xi", "alpha", "depth_unit_m", "depth_scale", READOUT, "source")
_SPHERES = ("xi", "alpha")
_SYMMETRIC = ("equidistant", "double_sphere")


def read_plain(entries: Entries) -> CameraFile:
    """Camera, depth unit and readout of a file with the keys `REQUIRED`.

    Raises
    ------
    DataError
        If a key is missing or unknown, a value is impossible, or a camera with radial-tangential distortion cannot be
        inverted over the whole image.
    """
    _require_keys(entries)
    return CameraFile(_camera(entries), depth_unit_m=_depth_unit_m(entries), shutter=shutter_at(entries))


def _camera(entries: Entries) -> KnownCamera:
    width, height = (int(entries.number(key, whole=True, positive=True)) for key in ("width", "height"))
    focal = [entries.number(key, positive=True) for key in ("fx", "fy")]
    intrinsics = [*focal, *(entries.number(key) for key in ("cx", "cy"))]
    model = _model(entries)
    coefficients = _coefficients(entries, model)
    if model in _SYMMETRIC:
        return checked_camera(entries.place, model, (width, height), intrinsics, coefficients)
    camera = make_camera(model, (width, height), intrinsics, coefficients)
    if not camera.is_invertible:
        found = "fx, fy, cx, cy and distortion that cannot be inverted over the whole image"
        raise DataError(entries.place, found, "a ray of its own for every pixel")
    return camera


def _model(entries: Entries) -> str:
    model = entries.text("model") if entries.name("model") else "radtan"
    if model not in COEFFICIENTS:
        raise entries.error("model", f"one of {', '.join(COEFFICIENTS)}")
    return model


def _coefficients(entries: Entries, model: str) -> tuple[float, ...]:
    spheres = model == "double_sphere"
    for key in _SPHERES:
        if spheres is not (key in entries.values):
            found = f"no {key}" if spheres else f"{key} for the model {model}"
            raise DataError(entries.place, found, "xi and alpha for the model double_sphere, and for no other")
    if spheres:
        return tuple(entries.number(key) for key in _SPHERES)
    return _distortion(entries, model)


def _distortion(entries: Entries, model: str) -> tuple[float, ...]:
    listed = entries.values.get("distortion", [])
    counts = {"pinhole": (0,), "radtan": (0, 4, 5, 8), "equidistant": (4,)}[model]
    if not isinstance(listed, list) or len(listed) not in counts:
        shown = entries if "distortion" in entries.values else Entries(entries.place, {"distortion": []})
        raise shown.error("distortion", f"a list of {COEFFICIENTS[model]}")
    return entries.numbers("distortion") if listed else ()


def _depth_unit_m(entries: Entries) -> float | None:
    """Metres per unit; files of the TUM RGB-D benchmark give units per metre."""
    if entries.name("depth_unit_m"):
        return entries.number("depth_unit_m", positive=True)
    return 1.0 / entries.number("depth_scale", positive=True) if entries.name("depth_scale") else None


def _require_keys(entries: Entries) -> None:
    expected = f"{', '.join(REQUIRED)} and, if need be, {', '.join(_OPTIONAL)}"
    for key in REQUIRED:
        if key not in entries.values:
            raise DataError(entries.place, f"no {key}", expected)
    for key in entries.values:
        if key not in (*REQUIRED, *_OPTIONAL):
            raise DataError(entries.place, f"unknown key {key!r}", expected)
