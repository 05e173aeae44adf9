"""Paths of models, meshes and textures: ``model://`` URIs and Gazebo's folders."""

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from tracknoise.exceptions import DataError
from tracknoise.simulation.sdf.xml import read_xml

_MODEL = "model://"
_CONFIG = "model.config"


@dataclass(frozen=True, slots=True)
class Library:
    """Folders that contain models, each in its own folder.

    Parameters
    ----------
    roots
        In order of precedence.
    """

    roots: tuple[Path, ...]

    def find(self, uri: str, beside: Path) -> Path | None:
        """File or folder of a URI.

        Parameters
        ----------
        uri
            ``model://name/path``, ``file://path`` or a path. Relative paths start in `beside`.
        beside
            Folder of the file that contains the URI.

        Returns
        -------
        Path or None
            None if there is nothing there. Upper and lower case in the last name are not distinguished.
        """
        if uri.startswith(_MODEL):
            found = (_existing(root / uri.removeprefix(_MODEL)) for root in self.roots)
            return next((path for path in found if path), None)
        return None if "://" in uri.removeprefix("file://") else _existing(beside / uri.removeprefix("file://"))

    def find_texture(self, name: str, beside: Path) -> Path | None:
        """Image file that a mesh or a material script names.

        Parameters
        ----------
        name
            Path or URI as in the file, with slashes or backslashes.
        beside
            Folder of the mesh or the script. If the path does not exist, its last part is searched for in this folder
            and in ``../materials/textures``, ``../textures`` and ``textures``.
        """
        name = unquote(name).replace("\\", "/")
        last = name.rsplit("/", 1)[-1]
        folders = ("", "../materials/textures", "../textures", "textures")
        candidates = [self.find(name, beside), *(_existing(beside / folder / last) for folder in folders)]
        return next((path for path in candidates if path and path.is_file()), None)


def model_file(folder: Path) -> Path:
    """The SDF file of a model: the latest version that its ``model.config`` names.

    Raises
    ------
    DataError
        If ``model.config`` is malformed or names none, or there is no such file.
    """
    config = folder / _CONFIG
    if not config.is_file():
        path = folder / "model.sdf"
    else:
        named = [(_version(item.get("version")), (item.text or "").strip()) for item in read_xml(config).iter("sdf")]
        if not any(name for _, name in named):
            raise DataError(config, "no SDF file named", "<sdf version='1.6'>model.sdf</sdf>")
        path = folder / max(named)[1]
    if not path.is_file():
        raise DataError(path, "no such file", "the model's SDF file")
    return path


def model_names(folder: Path) -> list[str]:
    """Names of the models in a folder: its subfolders with a ``model.config``, sorted.

    Raises
    ------
    DataError
        If it is not a folder, or contains no model.
    """
    if not folder.is_dir():
        raise DataError(folder, "no such folder", "a folder of Gazebo models")
    names = sorted(path.parent.name for path in folder.glob(f"*/{_CONFIG}"))
    if not names:
        raise DataError(folder, "no model", f"a folder for each model with {_CONFIG} in it")
    return names


def _existing(path: Path) -> Path | None:
    """The path, or an existing one that differs only in the case of its last name."""
    try:
        if path.exists():
            return path
        name, others = path.name.casefold(), sorted(path.parent.iterdir())
    except (OSError, ValueError):  # the folder does not exist, or the name is not a valid file name
        return None
    return next((other for other in others if other.name.casefold() == name), None)


def _version(text: str | None) -> tuple[int, ...]:
    return tuple(int(part) for part in (text or "").split(".") if part.isdecimal())
