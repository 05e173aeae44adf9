"""Shapes, mesh files and materials of models in Gazebo's format.

Some programs write faces twice, once for each side. Gazebo shows the face of each pair that faces the camera. A ray
hits both at the same distance, and float32 rounding would select one of them. Each face is therefore moved slightly to
its own side.

The package `trimesh` (5.2) is not used: it rounds colours to 8 bits, opens textures itself instead of naming their
files, and does not say which line of a file is wrong. It takes 0.5 s to import, and reads COLLADA by `pycollada`, as
this package does.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from collada import Collada
from collada.common import DaeError
from collada.lineset import LineSet
from collada.material import Map
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError
from tracknoise.foreign_files import (
    Element,
    damage_reported,
    is_regular_file,
    read_any_text,
    read_bytes,
    require_regular,
)
from tracknoise.parsing_child import call_in_child
from tracknoise.simulation.sdf_files import Library, Remarks, child_numbers, numbers, text_of
from tracknoise.simulation.world import box
from tracknoise.text import counted

NUMBER = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?"
"""Pattern of a non-negative number, such as a colour channel."""
_LUMA = np.array([0.299, 0.587, 0.114])  # weights of red, green and blue, as in grey images of colour files


@dataclass(frozen=True, slots=True)
class Look:
    """Material of a surface."""

    texture: Path | None = None  # image file; None for a uniform colour
    reflectance: float = 0.7  # reflectance of the uniform colour, 0 to 1


PLAIN = Look()
"""Material of surfaces without colour and texture: light grey."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Triangles with one material."""

    corners: NDArray[np.float64]  # (t, 3, 3) float64, metres
    # (t, 3, 2) float64, repeats of the texture, row 0 first; None if there are no texture coordinates
    corner_uv: NDArray[np.float64] | None
    look: Look | None = None  # their material; None if none is defined


def even(red: float, green: float, blue: float) -> Look:
    """Material of a uniform colour, with channels from 0 to 1. Infinite ones count as bright, NaN as dark."""
    channels = np.nan_to_num([red, green, blue], nan=0.0, posinf=1.0, neginf=0.0)
    return Look(reflectance=float(np.clip(_LUMA @ channels, 0.0, 1.0)))


HAIR_M = 1e-4
_SAME_M = 1e-5


def set_apart(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Move triangles that share all three corners with another one to the side that they face.

    Shapes: corners (t, 3, 3) m; returns (t, 3, 3). All other triangles are unchanged.
    """
    places = np.rint(corners.reshape(-1, 3) / _SAME_M).astype(np.int64)
    _, vertex = np.unique(places, axis=0, return_inverse=True)
    _, group, count = np.unique(np.sort(vertex.reshape(-1, 3), axis=1), axis=0, return_inverse=True, return_counts=True)
    twice = count[group.reshape(-1)] > 1
    apart = corners.copy()
    normals = np.cross(corners[twice, 1] - corners[twice, 0], corners[twice, 2] - corners[twice, 0])
    apart[twice] += HAIR_M * (normals / np.linalg.norm(normals, axis=1, keepdims=True))[:, None]
    return apart


_AROUND = 32  # number of segments, as in Gazebo
_UPWARDS = 16
_PIECES = 16  # along each side of a plane: a few huge triangles would slow down ray casting


def _box(element: Element, place: str) -> Part:
    """Each face has the whole texture once, upright on vertical faces."""
    half_m = _lengths(element, "size", 3, place) / 2.0
    once = np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]])
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    faces = [face.corners[halves] for face in box(np.zeros(3), half_m, Rotation.identity())]
    return Part(np.concatenate(faces), np.tile(once[halves], (len(faces), 1, 1)))


def _plane(element: Element, place: str) -> Part:
    """A rectangle with the whole texture once; rotated from z to its normal by the smallest angle."""
    width, depth = _lengths(element, "size", 2, place)
    normal = child_numbers(element, "normal", (0.0, 0.0, 1.0), place)
    if not np.any(normal):
        raise DataError(place, "<normal> 0 0 0", "a direction")
    s, t = _grid(_PIECES, np.linspace(0.0, 1.0, _PIECES + 1))
    flat = np.stack([(s - 0.5) * width, (0.5 - t) * depth, np.zeros_like(s)], axis=-1)
    axis = np.array([-normal[1], normal[0], 0.0])  # z cross normal
    sine = np.linalg.norm(axis)
    turn = Rotation.from_rotvec((axis / sine if sine else np.eye(3)[0]) * np.arctan2(sine, normal[2]))
    return _patch(turn.apply(flat.reshape(-1, 3)).reshape(flat.shape), s, t)


def _sphere(element: Element, place: str) -> Part:
    """The texture goes once around the vertical, and from pole to pole."""
    (radius,) = _lengths(element, "radius", 1, place)
    rows = np.linspace(0.0, 1.0, _UPWARDS + 1)
    return _revolved(radius * np.sin(np.pi * rows), radius * np.cos(np.pi * rows), rows)


def _cylinder(element: Element, place: str) -> Part:
    """The texture goes once around the side; the ends have the colours of its borders."""
    (radius,), (length,) = _lengths(element, "radius", 1, place), _lengths(element, "length", 1, place)
    z = length / 2.0
    return _revolved(np.array([0.0, radius, radius, 0.0]), np.array([z, z, -z, -z]), np.array([0.0, 0.0, 1.0, 1.0]))


SHAPES: Mapping[str, Callable[[Element, str], Part]] = MappingProxyType(
    {"box": _box, "sphere": _sphere, "cylinder": _cylinder, "plane": _plane}
)
"""Functions that make the triangles of a shape, centred on its origin, from its element and its place (for messages),
by element name."""


def _lengths(element: Element, tag: str, count: int, place: str) -> NDArray[np.float64]:
    """Sizes, metres; 1 if they are not given."""
    lengths = child_numbers(element, tag, (1.0,) * count, place)
    if np.any(lengths <= 0.0):
        raise DataError(place, f"<{tag}> {' '.join(f'{length:g}' for length in lengths)}", "lengths above 0")
    return lengths


def _revolved(radius_m: NDArray[np.float64], z_m: NDArray[np.float64], rows: NDArray[np.float64]) -> Part:
    """An outline from top to bottom, with the row of the texture at each of its points, revolved about z."""
    s, t = _grid(_AROUND, rows)
    level = radius_m[:, None, None] * np.stack([np.cos(2.0 * np.pi * s), np.sin(2.0 * np.pi * s)], axis=-1)
    return _patch(np.concatenate([level, np.broadcast_to(z_m[:, None, None], (*s.shape, 1))], axis=-1), s, t)


def _grid(columns: int, rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Texture coordinates (rows, columns + 1) of the nodes of a grid."""
    s, t = np.meshgrid(np.linspace(0.0, 1.0, columns + 1), rows)
    return s, t


def _patch(points: NDArray[np.float64], s: NDArray[np.float64], t: NDArray[np.float64]) -> Part:
    """Triangles of a grid of points (rows, columns, 3), seen from the side where columns go right and rows go down."""
    nodes = np.concatenate([points, s[..., None], t[..., None]], axis=-1)
    above, below, below_right, right = nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]
    halves = [[above, below, below_right], [above, below_right, right]]
    triangles = np.concatenate([np.stack(half, axis=-2).reshape(-1, 3, 5) for half in halves])
    return Part(triangles[..., :3], triangles[..., 3:])


_HEADER_BYTES = 84
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def read_stl(path: Path, library: Library, remarks: Remarks) -> list[Part]:
    """Triangles of an STL file, which has no textures."""
    try:
        corners = _corners(path, read_bytes(path, "an STL file"))
    except DataError as error:
        remarks.add(path, f"damaged STL file ({error.found}); it is left out")
        return []
    if not len(corners):
        remarks.add(path, "STL file without triangles")
    return [Part(corners, None)]


def _corners(path: Path, content: bytes) -> NDArray[np.float64]:
    """(t, 3, 3) float64: a binary file is one whose length fits its count of facets."""
    count = int.from_bytes(content[_HEADER_BYTES - 4 : _HEADER_BYTES], "little")
    if len(content) == _HEADER_BYTES + count * _FACET.itemsize:
        facets = np.frombuffer(content, _FACET, offset=_HEADER_BYTES)
        return facets["corners"].astype(np.float64)
    return _text_corners(path, content.decode(errors="replace"))


def _text_corners(path: Path, text: str) -> NDArray[np.float64]:
    """(t, 3, 3) float64: the numbers of all lines that begin with ``vertex``."""
    lines = (line.split() for line in text.lower().splitlines())
    with damage_reported(path, "a vertex that is not three numbers", "an STL file"):
        vertices = [[float(x), float(y), float(z)] for _, x, y, z in (line for line in lines if line[:1] == ["vertex"])]
    if len(vertices) % 3:
        raise DataError(path, counted(len(vertices), "vertex", "vertices"), "three for each triangle")
    return np.array(vertices, np.float64).reshape(-1, 3, 3)


_COLOUR = re.compile(rf"{NUMBER}(\s+{NUMBER}){{2}}")
_Corner = tuple[int, int]  # indices of position and texture coordinates; -1 for none


@dataclass(slots=True)
class _Mesh:
    """Contents of a file read so far."""

    positions: list[list[float]] = field(default_factory=list)
    uv: list[list[float]] = field(default_factory=list)
    faces: dict[str, list[_Corner]] = field(default_factory=dict)  # three corners per triangle, by material
    libraries: list[str] = field(default_factory=list)
    material: str = ""

    def take(self, line: str) -> None:
        """Read a line."""
        key, _, rest = line.strip().partition(" ")
        if key == "v":
            x, y, z = (float(word) for word in rest.split()[:3])
            if not np.isfinite([x, y, z]).all():
                raise ValueError(line)
            self.positions.append([x, y, z])
        elif key == "vt":
            u, v = (float(word) for word in [*rest.split(), "0"][:2])
            if not np.isfinite([u, v]).all():
                raise ValueError(line)
            self.uv.append([u, v])
        elif key == "f":
            corners = [self._corner(word) for word in rest.split()]
            fan = self.faces.setdefault(self.material, [])
            for second, third in pairwise(corners[1:]):
                fan += (corners[0], second, third)
        elif key == "usemtl":
            self.material = rest.strip()
        elif key == "mtllib":
            self.libraries.append(rest.strip())

    def _corner(self, word: str) -> _Corner:
        """Indices from 0 of a corner such as ``3/1/2`` or ``-1//2``: they count from 1, or from the end if negative."""
        position, uv, *_ = [*word.split("/"), ""]
        return _index(position, len(self.positions)), _index(uv, len(self.uv)) if uv else -1


def read_wavefront(path: Path, library: Library, remarks: Remarks) -> list[Part]:
    """Triangles of an OBJ file, one part per material."""
    mesh = _Mesh()
    looks: dict[str, Look] = {}
    for number, line in enumerate(read_any_text(path, "an OBJ file").splitlines(), start=1):
        try:
            mesh.take(line)
        except (ValueError, IndexError):
            remarks.add(f"{path}:{number}", f"{line.strip()!r} cannot be read; the file is left out")
            return []
    if not mesh.faces:
        remarks.add(path, "OBJ file without triangles")
    for name in mesh.libraries:
        looks |= _read_materials(path, name, library, remarks)
    return [_part(mesh, corners, looks.get(name)) for name, corners in mesh.faces.items() if corners]


def _part(mesh: _Mesh, corners: list[_Corner], look: Look | None) -> Part:
    index = np.array(corners).reshape(-1, 3, 2)
    positions = np.array(mesh.positions)[index[..., 0]]
    if np.any(index[..., 1] < 0):
        return Part(positions, None, look)
    uv: NDArray[np.float64] = np.array(mesh.uv)[index[..., 1]]
    return Part(positions, np.stack([uv[..., 0], 1.0 - uv[..., 1]], axis=-1), look)  # rows count from the bottom


def _read_materials(mesh: Path, name: str, library: Library, remarks: Remarks) -> dict[str, Look]:
    """Materials by name. A texture replaces the colour."""
    path = library.find(name, mesh.parent)
    if path is None or not is_regular_file(path):
        remarks.add(mesh, f"material file {name!r} is not found; plain grey is shown instead")
        return {}
    colours: dict[str, Look] = {}
    textured: dict[str, Look] = {}
    material = ""
    for line in read_any_text(path, "a material file").splitlines():
        key, _, rest = (part.strip() for part in line.strip().partition(" "))
        if key == "newmtl":
            material = rest
        elif key == "Kd" and _COLOUR.fullmatch(rest):
            colours[material] = even(*(float(word) for word in rest.split()))
        elif key == "Kd":
            remarks.add(path, f"colour {rest!r} cannot be read; plain grey is shown instead")
        elif key == "map_Kd" and (texture := library.find_texture(rest, path.parent)):
            textured[material] = Look(texture)
        elif key == "map_Kd":
            remarks.add(path, f"texture {rest!r} is not found; a uniform colour is shown instead")
    return colours | textured


def _index(word: str, count: int) -> int:
    index = int(word)
    index = index - 1 if index > 0 else count + index
    if not 0 <= index < count:
        raise IndexError(word)
    return index


_ZIP = b"PK"
_AS_GAZEBO = "Z_UP"


def read_collada(path: Path, library: Library, remarks: Remarks) -> list[Part]:
    """Triangles of the scene in a COLLADA file, in metres.

    A child process reads it, because parts that contain each other take exponential time, and numbers in it determine
    the sizes of arrays. As in Gazebo, ``<unit>`` is applied, and ``<up_axis>`` is not.
    """
    try:
        size = require_regular(path, "a COLLADA file")
        with damage_reported(path, "damaged COLLADA file", "one that can be read", with_reason=True):
            parts, lines = call_in_child(_read, path, library, size=size)
    except DataError as error:
        remarks.add(path, f"{error.found}; it is left out")
        return []
    for line in lines:
        remarks.add_line(line)
    return parts


def _read(path: Path, library: Library) -> tuple[list[Part], tuple[str, ...]]:
    """The parts of a file, and remarks on it."""
    remarks = Remarks()
    content = path.read_bytes()
    if content.startswith(_ZIP):
        raise ValueError("it is compressed, which is not supported")
    document = Collada(BytesIO(content), ignore=[DaeError])
    parts = [] if document.scene is None else list(_parts(document, path, library, remarks))
    if document.errors:
        remarks.add(path, f"part of the file cannot be used ({_one_line(document.errors[0])}); it is left out")
    elif not parts:
        remarks.add(path, "COLLADA file without triangles")
    if document.assetInfo.upaxis != _AS_GAZEBO:
        remarks.add(path, f"<up_axis> {document.assetInfo.upaxis} is not applied, as in Gazebo; z is up")
    return parts, remarks.lines


def _parts(document: Any, path: Path, library: Library, remarks: Remarks) -> Iterator[Part]:
    if any(True for _ in document.scene.objects("controller")):
        remarks.add(path, "animated or skinned geometry is not supported; it is left out")
    for bound in document.scene.objects("geometry"):
        for primitive in bound.original.primitives:
            if isinstance(primitive, LineSet):  # it has no surface, and Gazebo does not show it
                continue
            triangles = primitive.triangleset() if hasattr(primitive, "triangleset") else primitive
            material = bound.materialnodebysymbol.get(triangles.material)
            look = None if material is None else _collada_look(material.target.effect.diffuse, path, library, remarks)
            corners = _transformed(triangles, bound.matrix) * document.assetInfo.unitmeter
            yield Part(corners, _corner_uv(triangles), look)


def _transformed(triangles: Any, matrix: NDArray[np.float32]) -> NDArray[np.float64]:
    """(t, 3, 3) float64: corners, transformed by the matrix of their node."""
    corners = triangles.vertex[triangles.vertex_index].astype(np.float64)
    moved: NDArray[np.float64] = corners @ matrix[:3, :3].T.astype(np.float64) + matrix[:3, 3]
    return moved


def _corner_uv(triangles: Any) -> NDArray[np.float64] | None:
    """The first set of texture coordinates, with row 0 first: COLLADA counts rows from the bottom."""
    if not triangles.texcoordset:
        return None
    uv = triangles.texcoordset[0][triangles.texcoord_indexset[0]].astype(np.float64)[..., :2]
    return np.stack([uv[..., 0], 1.0 - uv[..., 1]], axis=-1)


def _collada_look(diffuse: Any, path: Path, library: Library, remarks: Remarks) -> Look | None:
    if not isinstance(diffuse, Map):
        return None if diffuse is None else even(*diffuse[:3])
    name = diffuse.sampler.surface.image.path
    texture = library.find_texture(name, path.parent)
    if texture is None:
        remarks.add(path, f"texture {name!r} is not found; plain grey is shown instead")
    return Look(texture) if texture else None


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


MeshReader = Callable[[Path, Library, Remarks], list[Part]]


def read_mesh(path: Path, library: Library, remarks: Remarks) -> list[Part]:
    """Triangles of a mesh file; none if it cannot be used."""
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        remarks.add(path, f"mesh format {path.suffix!r} is not supported ({', '.join(_READERS)} are); it is left out")
        return []
    return reader(path, library, remarks)


_READERS: Mapping[str, MeshReader] = MappingProxyType({".dae": read_collada, ".obj": read_wavefront, ".stl": read_stl})


def own_look(material: Element | None, file: Path, library: Library, remarks: Remarks) -> Look | None:
    """Material of a whole visual. Returns: None if it defines nothing, so that the materials of the mesh are used."""
    if material is None:
        return None
    script = material.find("script")
    look = None if script is None else _scripted(script, file, library, remarks)
    albedo = next((element.text for element in material.iter("albedo_map") if element.text), None)
    if look is None and albedo is not None:
        look = _textured(albedo.strip(), file.parent, file, library, remarks)
    diffuse = material.find("diffuse")
    if look is None and diffuse is not None:
        count = 4 if len((diffuse.text or "").split()) == 4 else 3
        look = even(*numbers(diffuse, count, file)[:3])
    return look


def _scripted(script: Element, file: Path, library: Library, remarks: Remarks) -> Look | None:
    """Look of an Ogre material, by its name, from the first script that has it."""
    name = text_of(script, "name") or ""
    for uri in script.findall("uri"):
        place = library.find((uri.text or "").strip(), file.parent)
        for path in () if place is None else sorted(place.glob("*.material")) if place.is_dir() else (place,):
            body = _body(read_any_text(path, "a material script"), name) if is_regular_file(path) else None
            if body is not None:
                return _material_look(body, name, path, library, remarks)
    remarks.add(file, f"material {name!r} is not found; it is ignored")
    return None


def _material_look(body: str, name: str, path: Path, library: Library, remarks: Remarks) -> Look | None:
    texture = re.search(r"^[ \t]*texture[ \t]+(\S+)", body, re.MULTILINE)
    if texture is not None:
        return _textured(texture[1], path.parent, path, library, remarks)
    diffuse = re.search(rf"^[ \t]*diffuse((?:[ \t]+{NUMBER}){{3}})", body, re.MULTILINE)
    if diffuse is not None:
        return even(*(float(word) for word in diffuse[1].split()))
    remarks.add(path, f"material {name!r} has neither texture nor diffuse colour; it is ignored")
    return None


def _textured(name: str, beside: Path, place: Path, library: Library, remarks: Remarks) -> Look | None:
    texture = library.find_texture(name, beside)
    if texture is None:
        remarks.add(place, f"texture {name!r} is not found; it is ignored")
        return None
    return Look(texture)


def _body(script: str, name: str) -> str | None:
    """Text between the braces of a material in a script. The time of the search grows with the length of the script."""
    start = re.search(rf"^[ \t]*material[ \t]+{re.escape(name)}(?:[ \t]*:[^{{\n]*+)?\s*+{{", script, re.MULTILINE)
    if start is None or not name:
        return None
    depth, end = 1, start.end()
    while depth and end < len(script):
        depth += {"{": 1, "}": -1}.get(script[end], 0)
        end += 1
    return script[start.end() : end]
