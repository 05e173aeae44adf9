"""Paths of models, meshes and textures: ``model://`` URIs and Gazebo's folders."""

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from tracknoise.exceptions import DataError
from tracknoise.foreign.files import absolute, is_folder, is_regular_file
from tracknoise.foreign.xml_file import read_xml

_MODEL = "model://"
MODEL_CONFIG = "model.config"
_MOST_DIGITS = 9


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
            None if there is no regular file or folder. A ``model://`` URI cannot leave its root, and other paths cannot
            leave `beside` and the roots, not by links either. Upper and lower case in the last name are not
            distinguished.
        """
        if uri.startswith(_MODEL):
            found = (_existing(root / uri.removeprefix(_MODEL), (root,)) for root in self.roots)
            return next((path for path in found if path), None)
        path = uri.removeprefix("file://")
        return None if "://" in path else _existing(beside / path, (beside, *self.roots))

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
        folders = [beside / folder for folder in ("", "../materials/textures", "../textures", "textures")]
        named = (_existing(folder / last, (folder, *self.roots)) for folder in folders)
        candidates = [self.find(name, beside), *named]
        return next((path for path in candidates if path and is_regular_file(path)), None)


def model_file(folder: Path) -> Path:
    """The SDF file of a model: the latest version that its ``model.config`` names.

    Raises
    ------
    DataError
        If ``model.config`` is malformed or names none, or there is no such file.
    """
    config = folder / MODEL_CONFIG
    if not is_regular_file(config):
        path = folder / "model.sdf"
    else:
        named = [(_version(item.get("version")), (item.text or "").strip()) for item in read_xml(config).iter("sdf")]
        if not any(name for _, name in named):
            raise DataError(config, "no SDF file named", "<sdf version='1.6'>model.sdf</sdf>")
        path = _within(folder, max(named)[1], config)
    if not is_regular_file(path):
        raise DataError(path, "no such file", "the model's SDF file")
    return path


def model_names(folder: Path) -> list[str]:
    """Names of the models in a folder: its subfolders with a ``model.config``, sorted.

    Raises
    ------
    DataError
        If it is not a folder, or contains no model.
    """
    if not is_folder(folder):
        raise DataError(folder, "no such folder", "a folder of Gazebo models")
    names = sorted(path.parent.name for path in folder.glob(f"*/{MODEL_CONFIG}"))
    if not names:
        raise DataError(folder, "no model", f"a folder for each model with {MODEL_CONFIG} in it")
    return names


def _existing(path: Path, roots: tuple[Path, ...]) -> Path | None:
    """A regular file or folder below one of the roots: the path, or one that differs only in the case of its name."""
    found = _any_case(path)
    if found is None or not (is_folder(found) or is_regular_file(found)):
        return None
    return found if any(found.resolve().is_relative_to(root.resolve()) for root in roots) else None


def _any_case(path: Path) -> Path | None:
    """The path, or an existing one that differs only in the case of its last name."""
    try:
        if path.exists():
            return path
        name, others = path.name.casefold(), sorted(path.parent.iterdir())
    except (OSError, ValueError, RuntimeError):  # no folder, no valid name of a file, or links in a circle
        return None
    return next((other for other in others if other.name.casefold() == name), None)


def _within(folder: Path, name: str, place: Path) -> Path:
    """A file of a folder, whose name comes from a file."""
    path = absolute(folder, Path(name))
    if not path.is_relative_to(folder.resolve()):
        raise DataError(place, f"the file {name!r}", "one in the folder of the model")
    return folder / name


def _version(text: str | None) -> tuple[int, ...]:
    """The parts of a version, for comparison; those that are no numbers, or very long, are left out."""
    return tuple(int(part) for part in (text or "").split(".") if part.isdecimal() and len(part) <= _MOST_DIGITS)
