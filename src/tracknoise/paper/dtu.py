"""DTU Point Features: objects on a light stage, photographed from an arc of positions, and scanned. See docs/paper.md.

The module reads both releases of the data set, which name files and folders differently. It begins with numbers in
MATLAB files, the shares of the LEDs in each lighting, and the names of files and folders. The calibration and the scan
of a scene follow, then its images under several lightings, which are read from files once for all of them, and the
scene under one lighting.

Light adds up: an image in the light of several lamps is the sum of the images in the light of each. Images of other
lightings therefore contain a share of each LED's image.

A frame is a position of arc 1 (frame 0 is position 1, the key frame 24 is position 25). The camera was calibrated with
images of 1600x1200; they are used at half that size, in grayscale. The calibration file is what the camera calibration
toolbox for MATLAB saves. The toolbox counts pixels from the centre of the first, as everywhere here.
"""

import csv
import math
import re
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.foreign_files import damage_reported, read_text, require_regular
from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert
from tracknoise.paper.light_stage import led_positions
from tracknoise.parsing_child import LostError, call_in_child
from tracknoise.sequences.images import image_size, read_gray
from tracknoise.sequences.poses import checked_poses
from tracknoise.sequences.scenes import find_scenes
from tracknoise.sequences.sequence import Scan, Sequence, TruthKind
from tracknoise.tables.identity import SequenceId
from tracknoise.text import counted, counted_of

Variable = NDArray[np.generic] | None
"""None for what is no array of real numbers."""

_EXPECTED = "a MATLAB file"
_MAX_BYTES, _MAX_ARRAY_BYTES = 1 << 31, 1 << 29
"""Of a file, and of an array: more than ten times the largest scan of the data set."""
_NUMERIC = {"double", "single", "logical", *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))}
_REMARK = b"MATLAB 5.0 MAT-file".ljust(116)


def read_mat(path: Path, names: list[str]) -> dict[str, Variable]:
    """Read those variables of a MATLAB file (version 4 to 7.2) that it has. Those that are not asked for are skipped.

    SciPy reads it in the child process, which it ends at some damaged files. Of objects, function handles, cells and
    structures only the headers are read.
    """
    size = require_regular(path, _EXPECTED, most=_MAX_BYTES)
    try:
        return call_in_child(_read, path, names, size=size)
    except LostError as error:
        found = f"a damaged file, or not a MATLAB file ({error})"
        raise DataError(path, found, "a MATLAB file of version 4 to 7.2") from error


def _read(path: Path, names: list[str]) -> dict[str, Variable]:
    from scipy.io import loadmat, whosmat

    try:
        entries = [entry for entry in whosmat(str(path), appendmat=False) if entry[0] in names]
    except NotImplementedError as error:
        raise DataError(path, "a MATLAB 7.3 file", "an earlier version (in MATLAB: save with -v7)") from error
    variables: dict[str, Variable] = {name: None for name, _, _ in entries}
    numeric = variables.keys() - {name for name, _, kind in entries if kind not in _NUMERIC}
    for name, shape, _ in entries:
        if name in numeric and not 0 <= 8 * math.prod(shape) <= _MAX_ARRAY_BYTES:
            raise ValueError(f"{name} is too large")
    loaded = loadmat(str(path), appendmat=False, variable_names=sorted(numeric)) if numeric else {}
    for name in numeric:
        value = loaded[name]
        if not isinstance(value, np.ndarray):
            raise ValueError(f"{name} is damaged")
        variables[name] = value if value.dtype.kind in "fiu" else None
    return variables


def numbers(
    path: Path, variables: Mapping[str, Variable], name: str, *, count: int | None = None
) -> NDArray[np.float64]:
    """One variable as float64, with the shape that it has in MATLAB. `count`: None for any count and any numbers."""
    expected = "numbers" if count is None else counted(count, "finite number")
    if name not in variables:
        raise DataError(path, f"no {name}", f"{name}: {expected}")
    array = variables[name]
    if array is None:
        raise DataError(path, f"{name} that is not an array of real numbers", f"{name}: {expected}")
    if count is not None and array.size != count:
        raise DataError(path, f"{name} of {counted(array.size, 'number')}", expected)
    if count is not None and not np.isfinite(array).all():
        raise DataError(path, f"NaN or infinity in {name}", expected)
    return array.astype(np.float64)


def write_mat(path: Path, variables: Mapping[str, ArrayLike]) -> None:
    """Write a MATLAB file (version 5) that is the same whenever it is written: without the date."""
    from scipy.io import savemat

    buffer = BytesIO()
    savemat(buffer, dict(variables))  # type: ignore[arg-type]  # the stubs know paths only
    path.write_bytes(_REMARK + buffer.getvalue()[len(_REMARK) :])


LED_COUNT = 19
SIGMA_M = 0.20
"""Standard deviation of the Gaussian by which LEDs share in directional light, metres."""
BACK_TO_FRONT, LEFT_TO_RIGHT = 8, 10
"""Counts of directional lightings."""
WEIGHT_STEPS = 1 << 14
"""Weights are multiples of 1 / 16384: then float32 holds every sum of weighted grey levels exactly."""

LIGHTINGS = (
    "diffuse",
    *(f"BF{step}" for step in range(BACK_TO_FRONT)),
    *(f"LR{step}" for step in range(LEFT_TO_RIGHT)),
)
"""Names of the lightings, in the order of `weights`."""

_WIDEST_M = 10.0


def weights(leds_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """The share of each LED in each lighting.

    In diffuse light all have the same. Directional light comes from a place in the plane of x and y that moves in equal
    steps through the middle of the LEDs, from the one at the very back to the one in front, or from left to right; the
    shares fall with the distance d from there as exp(-d^2 / (2 sigma^2)). Shapes: leds_m (19, 3); returns
    (19 lightings, 19 LEDs). Not negative. The sum of each row is 1, so that all lightings are about as bright.
    Multiples of 1 / `WEIGHT_STEPS`, for which a share is changed by less than one step.
    """
    (left, front), (right, back) = leds_m[:, :2].min(axis=0), leds_m[:, :2].max(axis=0)
    centre_x, centre_y = (left + right) / 2.0, (front + back) / 2.0
    places = [(centre_x, y) for y in np.linspace(back, front, BACK_TO_FRONT)]
    places += [(x, centre_y) for x in np.linspace(left, right, LEFT_TO_RIGHT)]
    d2 = ((np.array(places)[:, None] - leds_m[:, :2]) ** 2).sum(axis=2)
    d2 -= d2.min(axis=1, keepdims=True)  # a factor common to all, which keeps far LEDs from vanishing altogether
    gaussian = np.exp(-d2 / (2.0 * SIGMA_M**2))
    return _in_steps(np.concatenate([np.ones((1, len(leds_m))), gaussian]))


def read_leds(path: Path) -> NDArray[np.float64]:
    """Read the positions of the LEDs from a CSV file: one row per LED of x, y, z in metres, with a header or without.

    Returns (19, 3).
    """
    expected = f"{LED_COUNT} rows of x,y,z in metres"
    lines = read_text(path, expected).splitlines()
    with damage_reported(path, "unreadable file", expected):
        rows = [(number, row) for number, row in enumerate(csv.reader(lines), start=1) if any(map(str.strip, row))]
    if rows and not any(map(_is_number, rows[0][1])):
        rows = rows[1:]
    leds = np.array([_position(f"{path}:{number}", row) for number, row in rows]).reshape(-1, 3)
    if len(leds) != LED_COUNT:
        raise DataError(path, f"{len(leds)} LEDs", expected)
    extent = float(np.ptp(leds, axis=0).max())
    if not 0.0 < extent <= _WIDEST_M:
        raise DataError(path, f"LEDs {extent:g} apart", f"{expected}, up to {_WIDEST_M:g} m apart")
    return leds


def _position(place: str, row: list[str]) -> list[float]:
    if len(row) != 3 or not all(map(_is_number, row)):
        raise DataError(place, ",".join(row), "x,y,z in metres")
    return [float(field) for field in row]


def _is_number(field: str) -> bool:
    try:
        return bool(np.isfinite(float(field)))
    except ValueError:
        return False


def _in_steps(shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows of shares as multiples of 1 / `WEIGHT_STEPS` whose sum is 1: the largest remainders are rounded up."""
    exact = shares / shares.sum(axis=1, keepdims=True) * WEIGHT_STEPS
    steps = np.floor(exact)
    order = np.argsort(steps - exact, axis=1, kind="stable")
    missing = WEIGHT_STEPS - steps.sum(axis=1, keepdims=True)
    np.put_along_axis(
        steps, order, np.take_along_axis(steps, order, axis=1) + (np.arange(steps.shape[1]) < missing), axis=1
    )
    rounded: NDArray[np.float64] = steps / WEIGHT_STEPS
    return rounded


CALIBRATION = "Calib_Results_11.mat"
SCANS = "CleanRecon_2009_11_16"
LEDS = "leds.csv"

POSITIONS = range(1, 50)
"""Numbers of the camera positions of arc 1."""
KEY_POSITION = 25
"""From where the scan was made."""

_FOLDERS_ABOVE = 2


@dataclass(frozen=True, slots=True)
class Release:
    """How one of the two releases names its images."""

    image: str  # format of a file's name, without extension, from ``position`` and ``number``
    pattern: re.Pattern[str]  # matches a file's name; its groups are position and number
    numbers: range  # numbers of the files of each position that are needed
    # for images that are relit already, the number of each lighting's file; empty where they are those of the LEDs
    lightings: Mapping[str, int]

    @property
    def names(self) -> tuple[str, ...]:
        """The lightings that there are."""
        return tuple(self.lightings) or LIGHTINGS


FULL = Release(
    image="Img{position:03d}_{number:02d}",
    pattern=re.compile(r"Img(\d{3})_(\d{2})\.(?:bmp|png)"),
    numbers=range(19),
    lightings=MappingProxyType({}),
)
"""An image for each LED, numbered from 0."""
CONDENSED = Release(
    image="{position:03d}_{number:02d}",
    pattern=re.compile(r"(\d{3})_(\d{2})\.(?:bmp|png)"),
    numbers=range(36),
    lightings=MappingProxyType(
        {"diffuse": 0, **{f"LR{k}": 20 + k for k in range(9)}, **{f"BF{k}": 29 + k for k in range(7)}}
    ),
)
"""Diffuse light first, then an image for each LED, then those from left to right and from back to front."""


def dtu_scenes(root: Path) -> dict[str, Path]:
    """Folder of each scene, by its path below the root, sorted."""
    return find_scenes(
        root,
        lambda _, files: _release(files) is not None,
        expected="folders such as SET001 with Img001_00.bmp (or .png), or scene001 with 001_00.png",
    )


def release_of(folder: Path) -> Release:
    """The release that a scene's folder belongs to, by the names of its files."""
    release = _release([path.name for path in folder.iterdir()])
    assert release is not None, "only a folder with images is a scene"
    return release


def image_files(folder: Path, release: Release) -> dict[tuple[int, int], Path]:
    """The images of arc 1 that a scene needs, by position and number."""
    files: dict[tuple[int, int], Path] = {}
    for path in sorted(folder.iterdir()):
        if match := release.pattern.fullmatch(path.name):
            key = int(match[1]), int(match[2])
            if key in files:
                raise DataError(path, f"the number of {files[key].name} again", "one file for each image")
            files[key] = path
    needed = [(position, number) for position in POSITIONS for number in release.numbers]
    for position, number in needed:
        if (position, number) not in files:
            name = release.image.format(position=position, number=number)
            suffix = next(iter(files.values())).suffix
            expected = f"{len(release.numbers)} images (numbers {release.numbers[0]:02d} to {release.numbers[-1]:02d})"
            expected += f" of each of positions {POSITIONS[0]} to {POSITIONS[-1]}"
            raise DataError(folder / f"{name}{suffix}", "missing image", expected)
    return {key: files[key] for key in needed}


def scan_name(scene: Path) -> str:
    """Name of the file with a scene's scan, from the number at the end of the name of the scene's folder."""
    match = re.search(r"(\d+)$", scene.resolve().name)
    if match is None:
        raise DataError(scene, "a folder without a number", "one such as SET001, whose number is that of its scan")
    return f"Clean_Reconstruction_{int(match[1]):02d}.mat"


def find_beside(root: Path, name: str) -> Path:
    """Find what belongs to all scenes: in the data set's folder or one within it, or up to two folders above."""
    above = root.resolve().parents[:_FOLDERS_ABOVE]
    within = sorted(path for path in root.iterdir() if path.is_dir())
    for folder in (root, *within, *above):
        if (folder / name).exists():
            return folder / name
    raise DataError(root / name, "no such file or folder", "it here, in a folder within, or up to two folders above")


def _release(files: list[str]) -> Release | None:
    for release in (FULL, CONDENSED):
        if any(release.pattern.fullmatch(name) for name in files):
            return release
    return None


_SIZE = (1600, 1200)
_SKEW = 1e-6
_INTRINSICS = {"fc": 2, "cc": 2, "kc": 5}


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Where the camera of all scenes was, and what it was like.

    Parameters
    ----------
    camera
        Of the images that it was calibrated with.
    world_from_camera
        (49, 4, 4) float64: poses of the positions of arc 1.
    notes
        What was corrected.
    """

    camera: Camera
    world_from_camera: NDArray[np.float64]
    notes: tuple[str, ...]


def read_calibration(path: Path) -> Calibration:
    """Read ``fc``, ``cc``, ``kc`` and, for each position i, ``Rc_i`` and ``Tc_i`` (world to camera, metres).

    ``kc`` is k1, k2, p1, p2, k3 in OpenCV's order. ``nx``, ``ny``, the size of the images, is 1600x1200 unless the file
    has another. ``alpha_c``, the skew, may be missing, but must be 0.
    """
    poses = [f"{kind}_{position}" for kind in ("Rc", "Tc") for position in POSITIONS]
    variables = read_mat(path, [*_INTRINSICS, "nx", "ny", "alpha_c", *poses])
    camera = _camera(path, variables)
    camera_from_world = np.broadcast_to(np.eye(4), (len(POSITIONS), 4, 4)).copy()
    for index, position in enumerate(POSITIONS):
        rotation = numbers(path, variables, f"Rc_{position}", count=9)
        if rotation.shape != (3, 3):
            raise DataError(path, f"Rc_{position} of shape {'x'.join(map(str, rotation.shape))}", "a 3x3 matrix")
        camera_from_world[index, :3, :3] = rotation
        camera_from_world[index, :3, 3] = numbers(path, variables, f"Tc_{position}", count=3).ravel()
    rigid, notes = checked_poses(camera_from_world, [f"{path}: Rc_{position}" for position in POSITIONS])
    return Calibration(camera, invert(rigid), notes)


def _camera(path: Path, variables: Mapping[str, Variable]) -> Camera:
    (fx, fy), (cx, cy), distortion = (
        numbers(path, variables, name, count=count).ravel().tolist() for name, count in _INTRINSICS.items()
    )
    if "alpha_c" in variables and abs(skew := float(numbers(path, variables, "alpha_c", count=1).item())) > _SKEW:
        raise DataError(path, f"a skew of alpha_c = {skew:g}", "0: pixels with right angles")
    width, height = _size(path, variables)
    if not (fx > 0.0 and fy > 0.0):
        raise DataError(path, f"fc = {fx:g}, {fy:g}", "focal lengths above 0")
    if not (0.0 <= cx <= width - 1 and 0.0 <= cy <= height - 1):
        raise DataError(path, f"cc = {cx:g}, {cy:g}", f"a principal point within the image of {width}x{height}")
    camera = Camera(width, height, fx, fy, cx, cy, tuple(distortion) if any(distortion) else ())
    if not camera.is_invertible:
        raise DataError(path, "kc that cannot be inverted over the whole image", "a ray of its own for every pixel")
    return camera


def _size(path: Path, variables: Mapping[str, Variable]) -> tuple[int, int]:
    """Width and height; both even, so that the images can be halved."""
    if "nx" not in variables and "ny" not in variables:
        return _SIZE
    width, height = (float(numbers(path, variables, name, count=1).item()) for name in ("nx", "ny"))
    if min(width, height) < 2 or width % 2 or height % 2:
        raise DataError(path, f"nx = {width:g}, ny = {height:g}", "even numbers of pixels")
    return int(width), int(height)


_PARTS = ("pts3D_near", "pts3D_far")


def read_scan(path: Path) -> tuple[Scan, tuple[str, ...]]:
    """Read ``pts3D_near`` and ``pts3D_far``: each column is a point, its first three rows are x, y, z in metres.

    `notes`: a sentence if points with NaN or infinity are ignored.
    """
    variables = read_mat(path, list(_PARTS))
    with np.errstate(invalid="ignore"):  # a signalling NaN becomes a quiet one
        points = np.concatenate([_points(path, name, numbers(path, variables, name)) for name in _PARTS])
    finite = np.isfinite(points).all(axis=1)
    if not finite.any():
        raise DataError(path, "a scan without points", f"columns of x, y, z in {' and '.join(_PARTS)}")
    broken = len(points) - int(np.count_nonzero(finite))
    predicates = ("is not finite and is ignored", "are not finite and are ignored")
    ignored = counted_of(broken, len(points), "scan point", *predicates)
    notes = (f"{path.name}: {ignored}",) if broken else ()
    return Scan(points[finite], POSITIONS.index(KEY_POSITION)), notes


def _points(path: Path, name: str, columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) float64."""
    if not columns.size:
        return np.empty((0, 3))
    if columns.ndim != 2 or columns.shape[0] < 3:
        found = f"{name} of shape {'x'.join(map(str, columns.shape))}"
        raise DataError(path, found, "a column a point, with at least the rows x, y, z")
    return np.ascontiguousarray(columns[:3].T)


_PIXELS_AT_ONCE, _ROWS_AT_ONCE = 2048, 64  # so that what is worked on stays in the processor's cache


class Shots(Protocol):
    """Images of one scene by frame and lighting."""

    def image(self, index: int, lighting: int) -> NDArray[np.uint8]:
        """(height, width) uint8: one frame, in one of the lightings by its index.

        Raises
        ------
        DataError
            If a file is missing, truncated or of another size than the camera's.
        """
        ...


class Taken:
    """Images that were taken, or relit, in each lighting: a file for each."""

    def __init__(self, paths: list[list[Path]], camera: Camera, *, halve: bool) -> None:
        self._paths, self._camera, self._halve = paths, camera, halve

    def image(self, index: int, lighting: int) -> NDArray[np.uint8]:
        """(height, width) uint8: see `Shots.image`."""
        image = read_gray(self._paths[index][lighting], self._camera)
        if not self._halve:
            return image
        sums = np.empty(_halved_shape(self._camera), np.float32)
        sums_of_four(image, out=sums)
        halved: NDArray[np.uint8] = np.rint(sums / np.float32(4.0)).astype(np.uint8)
        return halved


class Relit:
    """Images in lightings that are mixed from those of the LEDs; all of the latest frame are kept.

    Shapes: weights (lightings, LEDs). `weights`: not negative: the share of each LED in each lighting, multiples of
    1/16384 whose sum is 1 for each lighting.
    """

    def __init__(self, paths: list[list[Path]], weights: NDArray[np.float64], camera: Camera, *, halve: bool) -> None:
        self._paths, self._weights, self._camera, self._halve = paths, weights, camera, halve
        self._index: int | None = None
        self._images: list[NDArray[np.uint8]] = []
        self._light: NDArray[np.float32] | None = None  # kept, since new memory costs as much time as the arithmetic

    def __getstate__(self) -> dict[str, Any]:
        """Without the images: a copy in another process reads them again."""
        return {**self.__dict__, "_index": None, "_images": [], "_light": None}

    def image(self, index: int, lighting: int) -> NDArray[np.uint8]:
        """(height, width) uint8, read-only: see `Shots.image`."""
        if index != self._index:
            self._images, self._index = self._relit(index), index
        return self._images[lighting]

    def _relit(self, index: int) -> list[NDArray[np.uint8]]:
        if self._light is None:
            shape = _halved_shape(self._camera) if self._halve else (self._camera.height, self._camera.width)
            self._light = np.empty((len(self._paths[index]), *shape), np.float32)
        for path, light in zip(self._paths[index], self._light, strict=True):
            image = read_gray(path, self._camera)
            if self._halve:
                sums_of_four(image, out=light)
            else:
                light[:] = image
        relit = mix(self._light, (self._weights / (4 if self._halve else 1)).astype(np.float32))
        relit.flags.writeable = False
        return list(relit)


def mix(light: NDArray[np.float32], weights: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Weighted sums of images, rounded to the nearest grey level.

    Shapes: light (LEDs, height, width), weights (lightings, LEDs); returns (lightings, height, width).
    """
    pixels = light.reshape(len(light), -1)
    mixed = np.empty((len(weights), pixels.shape[1]), np.uint8)
    for start in range(0, pixels.shape[1], _PIXELS_AT_ONCE):
        part = weights @ pixels[:, start : start + _PIXELS_AT_ONCE]
        mixed[:, start : start + _PIXELS_AT_ONCE] = np.rint(part, out=part)
    return mixed.reshape(-1, *light.shape[1:])


def sums_of_four(image: NDArray[np.uint8], *, out: NDArray[np.float32]) -> None:
    """Sums of 2x2 pixels. Shapes: out (height / 2, width / 2)."""
    pairs = np.ascontiguousarray(image).view(np.uint16)  # two neighbours in a row, whichever byte is the first
    for top in range(0, len(out), _ROWS_AT_ONCE):
        band = pairs[2 * top : 2 * (top + _ROWS_AT_ONCE)]
        band = (band & 0xFF) + (band >> 8)
        np.add(band[0::2], band[1::2], out=out[top : top + _ROWS_AT_ONCE])


def _halved_shape(camera: Camera) -> tuple[int, int]:
    return camera.height // 2, camera.width // 2


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LitSequence:
    """A `tracknoise.sequences.sequence.Sequence` that shares its images with others, and whose truth is a scan."""

    id: SequenceId  # which sequence
    source: str  # folder of its scene
    camera: Camera  # intrinsics of all images
    world_from_camera: NDArray[np.float64]  # (n, 4, 4) float64, rigid: one pose per frame
    scan: Scan  # of its scene
    shots: Shots  # the images, one object for all sequences that were opened together
    lighting: int  # index of its lighting in `shots`
    notes: tuple[str, ...] = ()  # what was corrected or assumed while reading, one sentence each

    def __len__(self) -> int:
        return len(self.world_from_camera)

    @property
    def timestamps_s(self) -> None:
        """None: the data set does not give the times of the images."""
        return None

    @property
    def pose_accuracy(self) -> None:
        """None: the data set does not state it."""
        return None

    @property
    def depth_accuracy(self) -> None:
        """None: there are no depths."""
        return None

    @property
    def z_depth_from(self) -> str:
        """Features get the depths along z of points that are known in the world."""
        return "the points of a scan"

    @property
    def truths(self) -> tuple[TruthKind, ...]:
        """The scan."""
        return (TruthKind.scan,)

    @property
    def surface(self) -> None:
        """None: a scan is not an exact surface."""
        return None

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8, read-only: one frame in 8-bit grayscale."""
        return self.shots.image(index, self.lighting)

    def depth(self, index: int) -> None:
        """None: only one frame was scanned."""


_NOMINAL_NOTE = "relit with the nominal positions of the LEDs, because no file gives their measured positions"


@dataclass(frozen=True, slots=True)
class Dtu:
    """Reader of DTU Point Features.

    Parameters
    ----------
    root
        Folder of the scenes' folders, or a scene itself. The calibration and the scans are there, in a folder within,
        or up to two folders above.
    leds
        CSV file of the LEDs' positions, 19 rows of x, y, z in metres (see `tracknoise.paper.dtu`); by
        default ``leds.csv`` beside the calibration, or a nominal grid where there is none.
    """

    name: ClassVar[str] = "dtu"
    description: ClassVar[str] = "DTU Point Features: objects on a light stage, 19 lightings, a scan of the key frame"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    leds: Path | None = None

    def sequences(self) -> list[SequenceId]:
        """All sequences, sorted: every scene in every lighting.

        Raises
        ------
        DataError
            If there is no scene.
        """
        return sorted(
            SequenceId(self.name, scene, lighting)
            for scene, folder in dtu_scenes(self.root).items()
            for lighting in release_of(folder).names
        )

    def open(self, sequence: SequenceId) -> LitSequence:
        """Read and check one sequence, except for its images.

        Raises
        ------
        DataError
            If an image, the calibration, the scan or the file of the LEDs is missing or damaged.
        UnknownNameError
            If there is no such scene or lighting.
        """
        return self._open([sequence])[0]

    def open_together(self, sequences: list[SequenceId]) -> list[Sequence]:
        """Open several sequences of one scene, which share the scan and decode the images of each position once.

        Raises
        ------
        DataError, UnknownNameError
            As `open`.
        ValueError
            If they are not of one scene.
        """
        return list(self._open(sequences))

    def _open(self, sequences: list[SequenceId]) -> list[LitSequence]:
        (scene,) = {sequence.scene for sequence in sequences}
        scenes = dtu_scenes(self.root)
        if scene not in scenes:
            raise UnknownNameError("scene", scene, scenes)
        folder = scenes[scene]
        release = release_of(folder)
        for sequence in sequences:
            if sequence.lighting not in release.names:
                raise UnknownNameError("lighting", sequence.lighting, release.names)
        calibration = read_calibration(find_beside(self.root, CALIBRATION))
        scan, scan_notes = read_scan(find_beside(self.root, SCANS) / scan_name(folder))
        files = image_files(folder, release)
        halve, size_notes = _halve(next(iter(files.values())), calibration.camera)
        lightings = [sequence.lighting for sequence in sequences]
        on_disk = calibration.camera if halve else calibration.camera.halved()
        shots, light_notes = self._shots(files, release, lightings, on_disk, halve=halve)
        return [
            LitSequence(
                id=sequence,
                source=str(folder),
                camera=calibration.camera.halved(),
                world_from_camera=calibration.world_from_camera,
                scan=scan,
                shots=shots,
                lighting=index,
                notes=(*calibration.notes, *size_notes, *light_notes, *scan_notes),
            )
            for index, sequence in enumerate(sequences)
        ]

    def _shots(
        self,
        files: dict[tuple[int, int], Path],
        release: Release,
        lightings: list[str],
        camera: Camera,
        *,
        halve: bool,
    ) -> tuple[Shots, tuple[str, ...]]:
        """The images in some lightings, and notes on them."""
        if release.lightings:
            numbers = [release.lightings[lighting] for lighting in lightings]
            taken = [[files[position, number] for number in numbers] for position in POSITIONS]
            return Taken(taken, camera, halve=halve), ()
        leds_m, notes = self._leds()
        chosen = weights(leds_m)[[LIGHTINGS.index(lighting) for lighting in lightings]]
        by_led = [[files[position, number] for number in release.numbers] for position in POSITIONS]
        return Relit(by_led, chosen, camera, halve=halve), notes

    def _leds(self) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        """(19, 3) float64: positions of the LEDs, and notes on them."""
        if self.leds is not None:
            return read_leds(self.leds), ()
        beside = find_beside(self.root, CALIBRATION).parent / LEDS
        return (read_leds(beside), ()) if beside.exists() else (led_positions(), (_NOMINAL_NOTE,))


def _halve(image: Path, calibrated: Camera) -> tuple[bool, tuple[str, ...]]:
    """Whether the images on disk must be halved, from the size of one of them, and notes on it."""
    size, used = image_size(image), calibrated.halved()
    if size == (calibrated.width, calibrated.height):
        return True, ()
    if size == (used.width, used.height):
        return False, (f"the images on disk have half the size of the calibration's: {size[0]}x{size[1]}",)
    expected = f"the calibration's {calibrated.width}x{calibrated.height}, or half of it"
    raise DataError(image, f"size {size[0]}x{size[1]}", expected)
