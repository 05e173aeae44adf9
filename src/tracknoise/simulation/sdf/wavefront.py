"""Wavefront meshes (.obj) and their materials (.mtl)."""

import re
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.foreign.files import is_regular_file, read_any_text
from tracknoise.simulation.sdf.library import Library
from tracknoise.simulation.sdf.part import NUMBER, Look, Part, even
from tracknoise.simulation.sdf.remarks import Remarks

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
    """Triangles of an OBJ file, one part per material.

    Parameters
    ----------
    path
        The file.
    library
        Where to search for its textures.
    remarks
        Collects what is not supported.
    """
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
