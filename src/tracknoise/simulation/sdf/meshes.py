"""Mesh files, by their suffix.

The package `trimesh` (5.2) is not used: it rounds colours to 8 bits, opens textures itself instead of naming their
files, and does not say which line of a file is wrong. It takes 0.5 s to import, and reads COLLADA by `pycollada`, as
this package does.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from tracknoise.simulation.sdf.collada import read_collada
from tracknoise.simulation.sdf.library import Library
from tracknoise.simulation.sdf.part import Part
from tracknoise.simulation.sdf.remarks import Remarks
from tracknoise.simulation.sdf.stl import read_stl
from tracknoise.simulation.sdf.wavefront import read_wavefront

MeshReader = Callable[[Path, Library, Remarks], list[Part]]


def read_mesh(path: Path, library: Library, remarks: Remarks) -> list[Part]:
    """Triangles of a mesh file; none if it cannot be used.

    Parameters
    ----------
    path
        A .dae, .obj or .stl file.
    library
        Where to search for its textures.
    remarks
        Collects what is not supported.

    Returns
    -------
    list of Part
        In the unit of the file; for COLLADA, which states its unit, in metres.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        remarks.add(path, f"mesh format {path.suffix!r} is not supported ({', '.join(_READERS)} are); it is left out")
        return []
    return reader(path, library, remarks)


_READERS: Mapping[str, MeshReader] = MappingProxyType({".dae": read_collada, ".obj": read_wavefront, ".stl": read_stl})
