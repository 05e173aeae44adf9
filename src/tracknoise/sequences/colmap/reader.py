"""The reader of reconstructions of COLMAP: see docs/formats/colmap.md."""

import os
from dataclasses import KW_ONLY, dataclass
from enum import StrEnum
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.foreign.files import is_folder, is_regular_file
from tracknoise.foreign.natural_order import natural_order
from tracknoise.geometry.camera_model import CameraModel
from tracknoise.options import DataPath
from tracknoise.sequences.camera_files import CameraFile
from tracknoise.sequences.colmap import binary, text
from tracknoise.sequences.colmap.depth_maps import read_depth_map
from tracknoise.sequences.colmap.model import Reconstruction, camera_of, poses_of, reconstruction
from tracknoise.sequences.frame_files import ImageFiles, depth_files, depth_notes
from tracknoise.sequences.image_names import folders_of, image_names
from tracknoise.sequences.option_text import with_option
from tracknoise.sequences.poses import pose_notes
from tracknoise.sequences.recorded import RecordedSequence
from tracknoise.sequences.scenes import find_scenes, scene_folder
from tracknoise.tables.identity import SequenceId

_IMAGES, _DEPTHS = "images", Path("stereo") / "depth_maps"
_LEVELS = 4
"""How far above a reconstruction the folder of its images may be."""
_SCALE = "COLMAP does not know the scale: its unit of length stands where metres are meant"


class DepthMaps(StrEnum):
    """Which dense depth maps of COLMAP are read."""

    geometric = "geometric"
    photometric = "photometric"
    none = "none"


@dataclass(frozen=True, slots=True)
class Colmap:
    """Reader of reconstructions of COLMAP.

    Parameters
    ----------
    root
        Folder of a reconstruction (cameras and images, as .bin or .txt), or a folder with several at any depth.
    image_folder
        Folder of the images, from `root`; by default ``images`` beside or above the reconstruction.
    folder
        Which folder below it, where the reconstruction has images of several.
    depth_maps
        Which dense depth maps are read, where there are any.
    """

    name: ClassVar[str] = "colmap"
    description: ClassVar[str] = "COLMAP reconstructions: cameras and images (text or binary), dense depth if there is"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    image_folder: DataPath | None = None
    folder: str | None = None
    depth_maps: DepthMaps = DepthMaps.geometric

    def sequences(self) -> list[SequenceId]:
        """All reconstructions, sorted.

        Raises
        ------
        DataError
            If there is none.
        """
        return [SequenceId(self.name, scene) for scene in self._scenes()]

    def open(self, sequence: SequenceId) -> RecordedSequence:
        """Read and check one reconstruction, except for its images and depths.

        Raises
        ------
        DataError
            If a file is missing or damaged, a camera model is not supported, or the images have several sizes.
        UnknownNameError
            If there is no such scene or lighting, or no such folder of images.
        """
        folder = scene_folder(self._scenes(), sequence)
        model = _read(folder)
        images = self._images(folder)
        names = self._names(images, model)
        cameras = _cameras(folder, names, model)
        poses = _poses(names, model)
        depths = self._depths(folder, names)
        return RecordedSequence(
            id=sequence,
            source=str(images),
            camera=cameras[0],
            world_from_camera=poses,
            images=ImageFiles(tuple(images / name for name in names), cameras[0], as_stored=True),
            depths=depth_files(depths, cameras[0], read_depth_map),
            notes=(
                *CameraFile(cameras[0]).notes,
                *(depth_notes(depths) if any(depths) else ()),
                *pose_notes(poses),
                "images are in the order of their names",
                _SCALE,
            ),
            cameras=cameras if len(set(cameras)) > 1 else None,
            group=Path(os.path.relpath(images, self.root)).as_posix(),
        )

    def _scenes(self) -> dict[str, Path]:
        return find_scenes(
            self.root,
            lambda _, files: any({f"cameras{kind}", f"images{kind}"} <= {*files} for kind in (".bin", ".txt")),
            expected="folders with cameras.bin and images.bin, or cameras.txt and images.txt",
        )

    def _images(self, folder: Path) -> Path:
        """The folder of images."""
        if self.image_folder is not None:
            return self.root / self.image_folder
        levels = (level / _IMAGES for level in (folder, *folder.absolute().parents[:_LEVELS]))
        found = next((level for level in levels if is_folder(level)), None)
        if found is None:
            raise DataError(
                folder,
                "no folder of images",
                f"{_IMAGES} beside it or above, or {with_option('image_folder', 'FOLDER')}",
            )
        return found

    def _names(self, images: Path, model: Reconstruction) -> list[str]:
        """Images in natural order: those of the model, and those beside them, which are not registered."""
        folders = folders_of(model.images)
        if self.folder is not None and self.folder not in folders:
            raise UnknownNameError("folder of images", self.folder, folders)
        if self.folder is None and len(folders) > 1:
            raise DataError(
                images,
                f"images of several folders: {', '.join(folders)}",
                f"one; choose it with {with_option('folder', folders[0])}",
            )
        chosen = folders[0] if self.folder is None else self.folder
        registered = [name for name in model.images if folders_of([name]) == [chosen]]
        return natural_order({*registered, *image_names(images, chosen)})

    def _depths(self, folder: Path, names: list[str]) -> tuple[Path | None, ...]:
        """Dense depth map of each image; None for one without."""
        levels = (level / _DEPTHS for level in (folder, *folder.absolute().parents[:_LEVELS]))
        found = next((level for level in levels if is_folder(level)), None)
        if self.depth_maps is DepthMaps.none or found is None:
            return (None,) * len(names)
        paths = (found / f"{name}.{self.depth_maps}.bin" for name in names)
        return tuple(path if is_regular_file(path) else None for path in paths)


def _read(folder: Path) -> Reconstruction:
    """The reconstruction from binary files, or from text files where there are none."""
    binaries = [folder / "cameras.bin", folder / "images.bin"]
    if all(map(is_regular_file, binaries)):
        return reconstruction(binaries[1], binary.read_cameras(binaries[0]), binary.read_images(binaries[1]))
    cameras, images = folder / "cameras.txt", folder / "images.txt"
    return reconstruction(images, text.read_cameras(cameras), text.read_images(images))


def _cameras(folder: Path, names: list[str], model: Reconstruction) -> tuple[CameraModel, ...]:
    """Camera of each image; one that is not registered has that of the image before it.

    Raises
    ------
    DataError
        If they have several sizes.
    """
    used = {model.images[name].camera_id: name for name in reversed(names) if name in model.images}
    made = {number: camera_of(model.cameras[number]) for number in used}
    sizes = {(made[number].width, made[number].height): name for number, name in sorted(used.items())}
    if len(sizes) > 1:
        found = ", ".join(f"{width}x{height} ({name})" for (width, height), name in sizes.items())
        raise DataError(folder, f"images of several sizes: {found}", "one size; choose a folder of images with folder")
    cameras, current = [], next(model.images[name].camera_id for name in names if name in model.images)
    for name in names:
        current = model.images[name].camera_id if name in model.images else current
        cameras.append(made[current])
    return tuple(cameras)


def _poses(names: list[str], model: Reconstruction) -> NDArray[np.float64]:
    """(n, 4, 4) float64: world_from_camera, NaN for images that are not registered."""
    registered = [index for index, name in enumerate(names) if name in model.images]
    poses = np.full((len(names), 4, 4), np.nan)
    poses[registered] = poses_of([model.images[names[index]] for index in registered])
    return poses
