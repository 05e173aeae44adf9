"""COLLADA meshes (.dae)."""

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from collada import Collada
from collada.common import DaeError
from collada.lineset import LineSet
from collada.material import Map
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.child import call_in_child
from tracknoise.foreign.files import require_regular
from tracknoise.foreign.parsing import damage_reported
from tracknoise.simulation.sdf.library import Library
from tracknoise.simulation.sdf.part import Look, Part, even
from tracknoise.simulation.sdf.remarks import Remarks

_ZIP = b"PK"
_AS_GAZEBO = "Z_UP"


def read_collada(path: Path, library: Library, remarks: Remarks) -> list[Part]:
    """Triangles of the scene in a COLLADA file, in metres.

    A child process reads it, because parts that contain each other take exponential time, and numbers in it determine
    the sizes of arrays. As in Gazebo, ``<unit>`` is applied, and ``<up_axis>`` is not.

    Parameters
    ----------
    path
        The file.
    library
        Where to search for its textures.
    remarks
        Collects what is not supported.
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
            look = None if material is None else _look(material.target.effect.diffuse, path, library, remarks)
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


def _look(diffuse: Any, path: Path, library: Library, remarks: Remarks) -> Look | None:
    if not isinstance(diffuse, Map):
        return None if diffuse is None else even(*diffuse[:3])
    name = diffuse.sampler.surface.image.path
    texture = library.find_texture(name, path.parent)
    if texture is None:
        remarks.add(path, f"texture {name!r} is not found; plain grey is shown instead")
    return Look(texture) if texture else None


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
