"""Load Gazebo worlds and models as `tracknoise.simulation.world.World`."""

import warnings
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, DataWarning
from tracknoise.foreign_files import is_regular_file, read_bytes, require_whole_image
from tracknoise.simulation.sdf_files import (
    MODEL_CONFIG,
    Library,
    Remarks,
    Visual,
    child_numbers,
    model_file,
    read_visuals,
    text_of,
)
from tracknoise.simulation.sdf_meshes import PLAIN, SHAPES, Look, Part, own_look, read_mesh, set_apart
from tracknoise.simulation.world import Scenery, World

_LARGEST_SIDE = 1024
_FARTHEST_M, _MOST_REPEATS = 1e9, 1e6
_MOST_TRIANGLES = 4_000_000
_THINNEST = 1e-7  # sine of the smallest angle of a valid triangle
_SUPPORTED = "a mesh, box, sphere, cylinder or plane that can be rendered"


def load_world(path: Path, *, models: Path | None = None) -> Scenery:
    """Read a world, or a single model.

    Parameters
    ----------
    path
        A ``.world`` or ``.sdf`` file.
    models
        Folder in which ``model://`` URIs are searched for first. The folder of the file follows, then its subfolder
        ``models``, and for the file of a model the folder that contains the model.

    Returns
    -------
    Scenery
        In the frame of the file, which has z up. The notes name all differences from Gazebo's rendering; each is also a
        `DataWarning`.

    Raises
    ------
    DataError
        If a file is missing or malformed, or nothing is visible.
    """
    folder = path.parent
    above = (folder.parent,) if (folder / MODEL_CONFIG).exists() else ()
    library = Library((*(() if models is None else (models,)), folder, folder / "models", *above))
    remarks = Remarks()
    with np.errstate(over="ignore", invalid="ignore"):  # of meshes whose numbers are too large to be used
        world = _assemble(_all_parts(path, library, remarks), remarks)
    if world is None:
        found = "; ".join(("nothing visible", *remarks.lines))
        raise DataError(path, found, _SUPPORTED)
    for line in remarks.lines:
        warnings.warn(line, DataWarning, stacklevel=2)
    return Scenery(world, remarks.lines)


def load_model(folder: Path) -> Scenery:
    """Read a model from its folder in a folder of models; see `load_world`."""
    return load_world(model_file(folder), models=folder.parent)


def _all_parts(path: Path, library: Library, remarks: Remarks) -> list[Part]:
    """Triangles of all visuals, in the world frame."""
    all_parts: list[Part] = []
    triangles = 0
    for visual in read_visuals(path, library, remarks):
        parts = _parts(visual, library, remarks)
        triangles += sum(len(part.corners) for part in parts)
        if triangles > _MOST_TRIANGLES:
            raise DataError(path, f"more than {_MOST_TRIANGLES} triangles", "fewer or smaller meshes")
        all_parts += parts
    return all_parts


def _parts(visual: Visual, library: Library, remarks: Remarks) -> list[Part]:
    """Triangles of a visual, in the world frame, with their materials."""
    parts = _shaped(visual, library, remarks)
    look = own_look(visual.material, visual.file, library, remarks) if parts else None
    rotation, centre = visual.world_from_visual[:3, :3], visual.world_from_visual[:3, 3]
    return [Part(part.corners @ rotation.T + centre, part.corner_uv, look or part.look) for part in parts]


def _shaped(visual: Visual, library: Library, remarks: Remarks) -> list[Part]:
    """Triangles of the geometry of a visual, in its own frame."""
    geometry = visual.geometry
    if geometry.tag == "mesh":
        return _mesh(visual, library, remarks)
    if geometry.tag in SHAPES:
        return [SHAPES[geometry.tag](geometry, f"{visual.file}: {visual.name}")]
    if geometry.tag != "empty":
        remarks.add(visual.file, f"<{geometry.tag}> of {visual.name} is not supported; it is left out")
    return []


def _mesh(visual: Visual, library: Library, remarks: Remarks) -> list[Part]:
    uri = text_of(visual.geometry, "uri")
    path = library.find(uri, visual.file.parent) if uri else None
    if path is None or not is_regular_file(path):
        remarks.add(visual.file, f"mesh {uri!r} of {visual.name} is not found; it is left out")
        return []
    if visual.geometry.find("submesh") is not None:
        remarks.add(visual.file, f"<submesh> of {visual.name} is not supported; it is left out")
        return []
    scale = child_numbers(visual.geometry, "scale", (1.0, 1.0, 1.0), visual.file)
    return [Part(part.corners * scale, part.corner_uv, part.look) for part in read_mesh(path, library, remarks)]


def _assemble(parts: list[Part], remarks: Remarks) -> World | None:
    """A world of all triangles that have an area; None if there is none."""
    looks: dict[Look, int] = {}
    kept = [(part, _has_area(part.corners) & _has_usable_uv(part)) for part in parts]
    kept = [(part, keep) for part, keep in kept if keep.any()]
    if not kept:
        return None
    corners = set_apart(np.concatenate([part.corners[keep] for part, keep in kept]))
    texture = [looks.setdefault(_worn(part, remarks), len(looks)) for part, _ in kept]
    uv = [np.zeros((len(part.corners), 3, 2)) if part.corner_uv is None else part.corner_uv for part, _ in kept]
    return World(
        vertices=corners.reshape(-1, 3),
        faces=np.arange(3 * len(corners)).reshape(-1, 3),
        corner_uv=np.concatenate([part_uv[keep] for part_uv, (_, keep) in zip(uv, kept, strict=True)]),
        texture=np.repeat(texture, [keep.sum() for _, keep in kept]),
        textures=tuple(_texture(look, remarks) for look in looks),
        blocks_light=np.ones(len(corners), np.bool_),
    )


def _worn(part: Part, remarks: Remarks) -> Look:
    """Material of a part. A texture requires texture coordinates."""
    look = part.look or PLAIN
    if look.texture is None or part.corner_uv is not None:
        return look
    remarks.add(look.texture, "used by a mesh without texture coordinates; plain grey is shown instead")
    return PLAIN


def _has_area(corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(t,) bool: whether triangles are neither infinite nor far away, and their corners do not lie on a line."""
    usable = np.all(np.abs(corners) <= _FARTHEST_M, axis=(1, 2))  # not of NaN
    corners = np.where(usable[:, None, None], corners, 0.0)
    edges = corners[:, 1:] - corners[:, :1]
    double_area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    longest = np.linalg.norm(edges, axis=2).max(axis=1, initial=0.0)
    return np.asarray(usable & (double_area > _THINNEST * longest**2) & (longest > 0.0), np.bool_)


def _has_usable_uv(part: Part) -> NDArray[np.bool_]:
    """(t,) bool: whether the texture coordinates of triangles, if there are any, are finite and not too large."""
    if part.corner_uv is None:
        return np.ones(len(part.corners), np.bool_)
    return np.asarray(np.all(np.abs(part.corner_uv) <= _MOST_REPEATS, axis=(1, 2)), np.bool_)


def _texture(look: Look, remarks: Remarks) -> NDArray[np.float32]:
    """Reflectance as a square whose side is the power of two nearest to the image's longer side, at most 1024."""
    if look.texture is None:
        return np.full((1, 1), look.reflectance, np.float32)
    image = _decoded(look.texture)
    if image is None:
        remarks.add(look.texture, "cannot be read as an image; plain grey is shown instead")
        return np.full((1, 1), PLAIN.reflectance, np.float32)
    side = min(1 << round(float(np.log2(max(image.shape)))), _LARGEST_SIDE)
    wide = _resized(image.astype(np.float32) / np.float32(255.0), side)
    return np.ascontiguousarray(_resized(wide.T, side).T)


def _decoded(path: Path) -> NDArray[np.uint8] | None:
    """(height, width) uint8: an image in grey; None if it cannot be read or is too large."""
    try:
        data = read_bytes(path, "an image")
        require_whole_image(path, data)
        as_stored = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION
        image = cv2.imdecode(np.frombuffer(data, np.uint8), as_stored)
    except (DataError, cv2.error):
        return None
    return None if image is None else np.asarray(image, np.uint8)


def _resized(image: NDArray[np.float32], width: int) -> NDArray[np.float32]:
    """Resize an image along its width: area means to shrink, linear interpolation to enlarge."""
    how = cv2.INTER_AREA if width < image.shape[1] else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, (width, image.shape[0]), interpolation=how), np.float32)
