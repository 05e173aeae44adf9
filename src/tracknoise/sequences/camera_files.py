"""Cameras from the files of calibration programs: see docs/data.md.

What kind a file is follows from its contents. YAML is of bounded size, depth and number of values, without objects.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, UnknownNameError, first_line
from tracknoise.foreign_files import Element, damage_reported, read_json_object, read_text, read_xml
from tracknoise.geometry.cameras import LENSES, CameraModel, KnownCamera, described, make_camera
from tracknoise.geometry.pose import invert
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.entries import Entries
from tracknoise.sequences.scenes import with_option
from tracknoise.sequences.sequence import Body
from tracknoise.sequences.system_cameras import camera_names, read_system_camera, system_of

_POSITIONS = 65
_ROUND_TRIP_PX = 1e-6
_SHORTEST_PX, _LONGEST_PX = 1e-3, 1e6
_LEAST_SHARE = 0.5
"""A lens that gives less of the image a ray is not the lens of these images."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraFile:
    """One camera of a calibration file."""

    camera: CameraModel
    # (4, 4) float64, metres: X_body = body_from_camera X_camera, where the body is what the file relates the camera to,
    # usually the IMU. None where the file does not say.
    body_from_camera: NDArray[np.float64] | None = None
    # to be added to the time of an image to get the time of the body's clock, seconds; None where unknown
    time_shift_s: float | None = None
    rate_hz: float | None = None  # frames per second; None where unknown
    depth_unit_m: float | None = None  # depth of the integer 1 in depth images, metres; None where unknown
    # rolling shutter of the camera; None where all rows are exposed together, or the file does not say
    shutter: RollingShutter | None = None
    unused: tuple[str, ...] = ()  # sentences about what the file says and is not used

    @property
    def body(self) -> Body | None:
        """What the camera is mounted on; None where the file does not say."""
        return None if self.body_from_camera is None else Body(self.body_from_camera, self.time_shift_s or 0.0)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is not used, and a sentence where the lens gives a part of the image no ray."""
        share = share_with_ray(self.camera)
        if share == 1.0:
            return self.unused
        missing = max(round(100.0 * (1.0 - share)), 1)
        without = f"the camera model gives about {missing} % of the image no ray; features there have no truth"
        return (*self.unused, without)


def share_with_ray(camera: CameraModel) -> float:
    """Share of the image whose pixels have a ray that leads back to them within 1e-6 px, 0 to 1."""
    u = np.linspace(-0.5, camera.width - 0.5, _POSITIONS)
    v = np.linspace(-0.5, camera.height - 0.5, _POSITIONS)
    uv = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    with np.errstate(all="ignore"):
        back = np.abs(camera.project(camera.bearings(uv)) - uv).max(axis=1)
        return float(np.mean(back <= _ROUND_TRIP_PX))


def checked_camera(
    place: str | Path,
    model: str,
    size: tuple[int, int],
    intrinsics: Sequence[float],
    coefficients: tuple[float, ...],
) -> KnownCamera:
    """Make a camera that sees something in at least half of its image."""
    _require_focal_lengths(place, intrinsics)
    try:
        camera = make_camera(model, size, intrinsics, coefficients)
    except ValueError as error:
        raise DataError(place, f"an impossible camera ({first_line(error)})", f"a {model} camera") from error
    share = share_with_ray(camera)
    if share < _LEAST_SHARE:
        found = f"intrinsics and distortion that give only {share:.0%} of the image a ray"
        raise DataError(place, found, "those of this image size")
    return camera


def _require_focal_lengths(place: str | Path, intrinsics: Sequence[float]) -> None:
    for name, length_px in zip(("fx", "fy"), intrinsics, strict=False):
        if length_px > _LONGEST_PX or 0.0 < length_px < _SHORTEST_PX:
            expected = f"a focal length from {_SHORTEST_PX:g} to {_LONGEST_PX:g} px"
            raise DataError(place, f"{name} = {length_px:g}", expected)


_NAMES = {
    "none": "pinhole",
    "": "radtan",
    "radtan": "radtan",
    "radial-tangential": "radtan",
    "plumb_bob": "radtan",
    "rational_polynomial": "radtan",
    "equidistant": "equidistant",
    "equi": "equidistant",
    "fisheye": "equidistant",
    "kannala_brandt": "equidistant",
    "fov": "fov",
}
_MOST_RADTAN = 8
"""OpenCV's further coefficients are those of thin prisms and of a tilted sensor."""


def lens_at(entries: Entries, name: str) -> str:
    """Model of the lens that a key names, as `tracknoise.geometry.cameras.LENSES` has it."""
    model = _NAMES.get(entries.text(name))
    if model is None:
        raise entries.error(name, f"one of {', '.join(filter(None, _NAMES))}")
    return model


def coefficients_at(entries: Entries, name: str | None, model: str) -> tuple[float, ...]:
    """Coefficients of the lens; none where there is no key, or where all of radial-tangential distortion are 0."""
    coefficients = () if name is None else entries.numbers(name)
    if model != "radtan":
        return coefficients
    if any(coefficients[_MOST_RADTAN:]):
        found = f"{name} with coefficients of thin prisms or a tilted sensor"
        raise DataError(entries.place, found, "the first 8 alone (k1, k2, p1, p2, k3, k4, k5, k6)")
    return coefficients[:_MOST_RADTAN] if any(coefficients) else ()


READOUT = "readout_s"
"""Time from the upper edge of the first row to the lower edge of the last, seconds; 0 for a global shutter."""


def shutter_at(entries: Entries) -> RollingShutter | None:
    """The rolling shutter of a camera; None where the file states none."""
    readout_s = entries.number(READOUT) if entries.name(READOUT) else 0.0
    try:
        return RollingShutter(readout_s) if readout_s else None
    except ValueError as error:
        raise entries.error(READOUT, "seconds between -1 and 1") from error


_MOST_BYTES = 1 << 18
_MOST_LEVELS, _MOST_YAML_VALUES = 16, 20_000
_OPENCV_HEADER = "%YAML:"
_TAB = re.compile(r"(?<=\S)[ ]*\t[ \t]*")
"""White space with a tab behind something: YAML allows it, and the parser does not. Indentation must have no tabs."""
_EXPECTED_YAML = "a YAML file of keys and values"


class _Loader(yaml.SafeLoader):
    """Plain values, and OpenCV's matrices as the mapping of their rows, columns and data."""


def _opencv_matrix(loader: yaml.SafeLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    return loader.construct_mapping(node, deep=True)


_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", _opencv_matrix)


def read_yaml(path: Path) -> dict[str, Any]:
    """Read the first document of a YAML file, or of one that OpenCV's FileStorage wrote.

    Returns: the document's keys and values: plain lists, mappings, numbers and texts.
    """
    text = read_text(path, _EXPECTED_YAML, most=_MOST_BYTES)
    with damage_reported(path, "no YAML", _EXPECTED_YAML, with_reason=True):
        try:
            document = _first_document(_TAB.sub(" ", _without_opencv_header(text)))
        except yaml.MarkedYAMLError as error:
            line = 1 if error.problem_mark is None else error.problem_mark.line + 1
            raise DataError(f"{path}:{line}", f"no YAML ({error.problem})", _EXPECTED_YAML) from error
    if not isinstance(document, dict):
        raise DataError(path, "YAML without keys", _EXPECTED_YAML)
    return {str(key): value for key, value in document.items()}


def _without_opencv_header(text: str) -> str:
    """OpenCV's first line is not YAML: it has a colon in place of a space. It is left empty, so that lines keep."""
    return text.partition("\n")[2].join(("\n", "")) if text.startswith(_OPENCV_HEADER) else text


def _first_document(text: str) -> object:
    _require_bounded(text)
    loader = _Loader(text)
    try:
        document: object = loader.get_data()
    finally:
        loader.dispose()
    return document


def _require_bounded(text: str) -> None:
    """Count values, those behind an alias each time, before any is made: few lines of aliases stand for billions."""
    values, sizes = 0, dict[str, int]()
    opened: list[tuple[str | None, int]] = []
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.DocumentEndEvent):
            return
        if isinstance(event, yaml.AliasEvent):
            values += sizes.get(event.anchor or "", _MOST_YAML_VALUES)
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = opened.pop()
            sizes |= {anchor: values - before} if anchor else {}
        elif isinstance(event, yaml.NodeEvent):
            values += 1
            if isinstance(event, yaml.CollectionStartEvent):
                opened.append((event.anchor, values - 1))
        if values > _MOST_YAML_VALUES or len(opened) > _MOST_LEVELS:
            raise ValueError(f"more than {_MOST_YAML_VALUES} values or {_MOST_LEVELS} levels")


_ROOT = "opencv_storage"
_MOST_XML_VALUES = 100_000


def read_opencv_xml(path: Path) -> dict[str, Any]:
    """Keys and values of such a file: numbers, texts, lists of numbers, and matrices as rows, columns and data."""
    root = read_xml(path)
    if root.tag != _ROOT:
        raise DataError(path, f"XML of <{root.tag}>", f"<{_ROOT}>, as OpenCV writes it")
    return {child.tag: _value(child) for child in root}


def _value(element: Element) -> Any:
    """A matrix's parts by name; otherwise one word, or a list of several."""
    if len(element):
        return {child.tag: _words(child) for child in element}
    words = _words(element)
    return words[0] if len(words) == 1 else words


def _words(element: Element) -> list[float | int | str]:
    return [_word(word) for word in (element.text or "").split()[:_MOST_XML_VALUES]]


def _word(word: str) -> float | int | str:
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return word


REQUIRED = ("width", "height", "fx", "fy", "cx", "cy")
"""Keys that every such file has."""

_UNIT, _SCALE = "depth_unit_m", "depth_scale"
_OWN = {name: lens.numbers for name, lens in LENSES.items() if lens.numbers}
"""Numbers of a model that have keys of their own."""
_OWN_KEYS = tuple(dict.fromkeys(key for keys in _OWN.values() for key in keys))
SECOND = "second"
"""Key of the camera beside the first: see `tracknoise.sequences.camera_pairs`."""
_OPTIONAL = ("model", "distortion", *_OWN_KEYS, _UNIT, _SCALE, READOUT, "source", SECOND)
_ROUNDED = 1e-3
"""Largest relative difference between two that mean the same, such as 0.000192 and 5208."""
_WHOLE = ("pinhole", "radtan")
"""Models whose rays cover the whole image."""
_KALIBR = {
    "pinhole-radtan": "radtan",
    "pinhole-equi": "equidistant",
    "pinhole-fov": "fov",
    "omni-none": "omni",
    "omni-radtan": "omni",
    "eucm-none": "eucm",
    "ds-none": "double_sphere",
}
"""How Kalibr calls the models on its command line."""


def read_plain(entries: Entries) -> CameraFile:
    """Camera, depth unit and readout of a file with the keys `REQUIRED`."""
    _require_keys(entries)
    return CameraFile(_camera(entries), depth_unit_m=_depth_unit_m(entries), shutter=shutter_at(entries))


def _camera(entries: Entries) -> KnownCamera:
    width, height = (int(entries.number(key, whole=True, positive=True)) for key in ("width", "height"))
    focal = [entries.number(key, positive=True) for key in ("fx", "fy")]
    intrinsics = [*focal, *(entries.number(key) for key in ("cx", "cy"))]
    model = _plain_model(entries)
    coefficients = _coefficients(entries, model)
    if model not in _WHOLE:
        return checked_camera(entries.place, model, (width, height), intrinsics, coefficients)
    _require_focal_lengths(entries.place, intrinsics)
    camera = make_camera(model, (width, height), intrinsics, coefficients)
    if not camera.is_invertible:
        found = "fx, fy, cx, cy and distortion that cannot be inverted over the whole image"
        raise DataError(entries.place, found, "a ray of its own for every pixel")
    return camera


def _plain_model(entries: Entries) -> str:
    model = entries.text("model") if entries.name("model") else "radtan"
    model = _KALIBR.get(model, model)
    if model not in LENSES:
        raise entries.error("model", f"one of {', '.join(LENSES)}")
    return model


def _coefficients(entries: Entries, model: str) -> tuple[float, ...]:
    own_keys = _OWN.get(model, ())
    for key in _OWN_KEYS:
        if (key in own_keys) is not (key in entries.values):
            found = f"no {key}" if key in own_keys else f"{key} for the model {model}"
            needed = ", ".join(f"{' and '.join(keys)} for {name}" for name, keys in _OWN.items())
            raise DataError(entries.place, found, f"{needed}, and none of them for other models")
    return (*(entries.number(key) for key in own_keys), *_distortion(entries, model))


def _distortion(entries: Entries, model: str) -> tuple[float, ...]:
    listed, lens = entries.values.get("distortion", []), LENSES[model]
    counts = lens.counts or (0,)
    if not isinstance(listed, list) or len(listed) not in counts:
        shown = entries if "distortion" in entries.values else Entries(entries.place, {"distortion": []})
        raise shown.error("distortion", f"a list of {described(counts, lens.names)}")
    return entries.numbers("distortion") if listed else ()


def _depth_unit_m(entries: Entries) -> float | None:
    """Metres per unit; files of the TUM RGB-D benchmark give units per metre."""
    stated = {name: entries.number(name, positive=True) for name in (_UNIT, _SCALE) if entries.name(name)}
    if len(stated) == 2 and not math.isclose(stated[_UNIT] * stated[_SCALE], 1.0, rel_tol=_ROUNDED):
        found = f"{_UNIT} {stated[_UNIT]:g} and {_SCALE} {stated[_SCALE]:g}, whose product is not 1"
        raise DataError(entries.place, found, "one of them")
    return stated.get(_UNIT) or (1.0 / stated[_SCALE] if _SCALE in stated else None)


def _require_keys(entries: Entries) -> None:
    expected = f"{', '.join(REQUIRED)} and, if need be, {', '.join(_OPTIONAL)}"
    for key in REQUIRED:
        if key not in entries.values:
            raise DataError(entries.place, f"no {key}", expected)
    for key in entries.values:
        if key not in (*REQUIRED, *_OPTIONAL):
            raise DataError(entries.place, f"unknown key {key!r}", expected)


_MATRIX = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "k", "M")
_DISTORTION = (
    "distortion_coefficients",
    "Distortion_Coefficients",
    "distCoeffs",
    "dist_coeffs",
    "distortion_coeffs",
    "distortion",
    "D",
    "d",
)
_WIDTH, _HEIGHT = ("image_width", "image_Width", "width"), ("image_height", "image_Height", "height")
_SIZE = ("image_size", "imageSize", "image_Size", "resolution", "size")
_MODEL, _OTHER_WORDS = "distortion_model", ("distortion_type", "camera_model", "lens_model", "model")
_FISHEYE, _XI = "fisheye_model", "xi"
_AMBIGUOUS = 4
"""So many coefficients can be k1, k2, p1, p2 of a pinhole camera, or k1, k2, k3, k4 of a fisheye."""


class Lens(StrEnum):
    """The lens of a file of OpenCV that does not say."""

    radtan = "radtan"
    equidistant = "equidistant"


_MOST_SKEW = 1e-3
"""Largest skew that is rounding, relative to the focal length."""


def has_matrix(entries: Entries, camera: str | None) -> bool:
    """Whether there is a camera matrix: that of the file's only camera, or of the one named, such as ``1``."""
    return entries.name(*_numbered(_MATRIX, camera)) is not None


def read_matrices(entries: Entries, camera: str | None, size: tuple[int, int] | None, lens: Lens | None) -> CameraFile:
    """The camera of a file that `has_matrix`; where OpenCV calibrated a pair, the one named, by default ``1``.

    `lens`: that of four coefficients, where the file does not say.
    """
    name = entries.required(*_numbered(_MATRIX, camera))
    matrix = entries.matrix(name, 3, 3)
    (fx, skew, cx), (below, fy, cy), last = matrix
    if fx <= 0.0 or fy <= 0.0 or abs(skew) > _MOST_SKEW * fx or below or not np.array_equal(last, (0.0, 0.0, 1.0)):
        raise entries.error(name, "fx 0 cx, 0 fy cy, 0 0 1 with focal lengths above 0")
    distortion = entries.name(*_numbered(_DISTORTION, camera))
    model = _matrix_model(entries, distortion, lens)
    coefficients = coefficients_at(entries, distortion, model)
    if (xi := entries.name(*_numbered((_XI,), camera))) is not None:
        model, coefficients = "omni", (*_numbers_of(entries, xi), *coefficients)
    camera_model = checked_camera(entries.place, model, _size(entries, size), (fx, fy, cx, cy), coefficients)
    return CameraFile(camera_model, shutter=shutter_at(entries))


def _numbered(names: tuple[str, ...], camera: str | None) -> tuple[str, ...]:
    """Names of the keys of one camera: without a number where none is asked for, otherwise with it."""
    ending = "1" if camera is None else camera
    numbered = tuple(f"{name}{between}{ending}" for name in names for between in ("", "_"))
    return (*names, *numbered) if camera is None else numbered


def _matrix_model(entries: Entries, distortion: str | None, lens: Lens | None) -> str:
    """The model of the lens that the file names, that is asked for, or that the coefficients can be of."""
    stated = _stated_lens(entries)
    if lens is not None and stated not in (None, lens):
        raise DataError(entries.place, f"lens = {lens} for a camera whose file states {stated}", "no option lens")
    if stated is not None or lens is not None:
        return stated or str(lens)
    coefficients = () if distortion is None else entries.numbers(distortion)
    if len(coefficients) == _AMBIGUOUS and any(coefficients) and entries.name(_XI) is None:
        found = f"{distortion} of 4 numbers, which can be k1, k2, p1, p2 of a pinhole or k1 to k4 of a fisheye"
        expected = f"its lens, {' or '.join(Lens)}: {with_option('lens', Lens.radtan)}"
        raise DataError(entries.place, found, expected)
    return "radtan"


def _stated_lens(entries: Entries) -> str | None:
    """The model that the file names; None where it has no word for it."""
    if entries.name(_MODEL) and entries.values[_MODEL] != "":
        return lens_at(entries, _MODEL)
    words = [entries.text(word) for word in _OTHER_WORDS if isinstance(entries.values.get(word), str)]
    lenses = _NAMES | _KALIBR | {"pinhole": "radtan", "": None}  # a model may also be that of the device
    stated = next(filter(None, map(lenses.get, words)), None)
    if stated is None and entries.name(_FISHEYE):
        return "equidistant" if entries.number(_FISHEYE) else "radtan"
    return stated


def _numbers_of(entries: Entries, name: str) -> tuple[float, ...]:
    """One number, or that of a 1x1 matrix."""
    return (entries.number(name),) if isinstance(entries.values[name], int | float) else entries.numbers(name, 1)


def _size(entries: Entries, size: tuple[int, int] | None) -> tuple[int, int]:
    width, height, both = entries.name(*_WIDTH), entries.name(*_HEIGHT), entries.name(*_SIZE)
    if width is not None and height is not None:
        wide, high = (entries.number(name, whole=True, positive=True) for name in (width, height))
        return int(wide), int(high)
    if both is not None:
        return entries.size(both)
    if size is None:
        raise DataError(entries.place, "no size of the image", "image_width and image_height")
    return size


_NAME = re.compile(r"cam\d+")
_FROM_BODY, _TO_BODY = "T_cam_imu", ("T_BS", "T_imu_cam")
FROM_PREVIOUS = "T_cn_cnm1"
"""Maps points of the camera before into those of a camera."""


def cameras_of(entries: Entries) -> list[str]:
    """Names of the cameras of a chain of Kalibr's, ``cam0`` first; empty for other files."""
    return sorted(filter(_NAME.fullmatch, entries.values), key=lambda name: int(name[3:]))


def read_chain(entries: Entries, camera: str | None) -> CameraFile:
    """One camera of a chain of Kalibr's, by default the first."""
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

    Shapes: body_from_camera (4, 4).
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


_SPHERES = {"ds": "double_sphere", "double_sphere": "double_sphere", "eucm": "eucm"}
"""Models whose two numbers come first among the intrinsics, and which have no distortion."""


def _lens(entries: Entries) -> tuple[str, tuple[float, ...], tuple[float, ...]]:
    """Model, then fx, fy, cx, cy, then coefficients."""
    key = entries.name("camera_model")
    kind, _, joined = ("pinhole" if key is None else entries.text(key)).partition("-")
    if kind in _SPHERES:
        first, second, *intrinsics = entries.numbers("intrinsics", 6)
        return _SPHERES[kind], tuple(intrinsics), (first, second)
    if kind not in ("pinhole", "omni"):
        raise entries.error("camera_model", "pinhole, omni, eucm or ds")
    named = (
        entries if entries.name("distortion_model") or not joined else Entries(entries.place, {"camera_model": joined})
    )
    model = lens_at(named, "distortion_model" if named is entries else "camera_model")
    coefficients = coefficients_at(entries, entries.name("distortion_coeffs", "distortion_coefficients"), model)
    coefficients = () if model == "pinhole" else coefficients
    if kind == "pinhole":
        return model, entries.numbers("intrinsics", 4), coefficients
    if model not in _WHOLE:
        raise entries.error("distortion_model", "none or radtan for the camera model omni")
    xi, *intrinsics = entries.numbers("intrinsics", 5)
    return "omni", tuple(intrinsics), (xi, *coefficients)


def _body_from_camera(entries: Entries) -> NDArray[np.float64] | None:
    if entries.name(_FROM_BODY):
        return invert(entries.rigid(_FROM_BODY))
    to_body = entries.name(*_TO_BODY)
    return None if to_body is None else entries.rigid(to_body)


def _along_chain(entries: Entries, names: list[str]) -> NDArray[np.float64] | None:
    """Pose of the last camera in the body: its own, or that of the camera before and how the two are related."""
    previous = None
    for name in names:
        part = entries.part(name)
        body_from_camera = _body_from_camera(part)
        if body_from_camera is None and previous is not None and part.name(FROM_PREVIOUS):
            body_from_camera = previous @ invert(part.rigid(FROM_PREVIOUS))
        previous = body_from_camera
    return previous


_JSON = ".json"
_EXPECTED_CAMERA = (
    "a camera file of Kalibr (cam0: ...), EuRoC (intrinsics), OpenCV or ROS (camera_matrix), "
    "VINS, ORB-SLAM, OKVIS, SVO, Basalt or OpenSfM, or width, height, fx, fy, cx and cy"
)


def read_camera_file(
    path: Path, *, camera: str | None = None, size: tuple[int, int] | None = None, lens: Lens | None = None
) -> CameraFile:
    """Read a camera from a file of Kalibr, EuRoC, TUM-VI, OpenCV, ROS, a SLAM system, OpenSfM or tracknoise.

    Positions have (0, 0) at the centre of the first pixel.

    `camera`: which camera, where the file has several: ``cam0`` of Kalibr's chains and SLAM systems, ``1`` of OpenCV's
    pairs; by default the first; `size`: width and height of the images, px, for a file that does not say; `lens`: that
    of a file of OpenCV with 4 coefficients, which does not say.
    """
    entries = read_entries(path)
    if lens is not None and not has_matrix(entries, camera):
        raise DataError(path, f"lens = {lens} for a file that states the model of its camera", "no option lens")
    if cameras_of(entries):
        return read_chain(entries, camera)
    if system_of(entries):
        return _of_system(entries, camera, size)
    if has_matrix(entries, camera):
        return read_matrices(entries, camera, size, lens)
    if camera is not None:
        raise DataError(path, f"no camera {camera}", "a file that names its cameras, or no name")
    if entries.name("intrinsics"):
        return read_calibrated(entries, size)
    if path.suffix == _JSON or entries.name(*REQUIRED):
        return read_plain(entries)
    raise DataError(path, "no camera", _EXPECTED_CAMERA)


def cameras_in(path: Path) -> list[str]:
    """Names of the cameras of a file that numbers them, ``cam0`` first; empty for other files."""
    entries = read_entries(path)
    return cameras_of(entries) or camera_names(entries)


def read_entries(path: Path) -> Entries:
    """Keys and values of a camera file of any kind."""
    return Entries(path, _values(path))


def _of_system(entries: Entries, camera: str | None, size: tuple[int, int] | None) -> CameraFile:
    stated = read_system_camera(entries, camera, size)
    return CameraFile(
        checked_camera(stated.place, stated.model, stated.size, stated.intrinsics, stated.coefficients),
        stated.body_from_camera,
        stated.time_shift_s,
        stated.rate_hz,
        stated.depth_unit_m,
        shutter_at(entries),
        stated.notes,
    )


def _values(path: Path) -> dict[str, Any]:
    if path.suffix == _JSON:
        return read_json_object(path, "the camera's width, height, fx, fy, cx and cy in JSON")
    if read_text(path, "a camera file").lstrip().startswith("<"):
        return read_opencv_xml(path)
    return read_yaml(path)
