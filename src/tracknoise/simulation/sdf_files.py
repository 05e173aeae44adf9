"""Files in Gazebo's format (SDF): where they lie, their numbers and poses, and their visible parts."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError, one_line
from tracknoise.foreign_files import Element, absolute, is_folder, is_regular_file, read_xml
from tracknoise.geometry.pose import from_rotation
from tracknoise.text import counted


class Remarks:
    """Collects one sentence for each thing that is left out or replaced, in order, without repetitions."""

    def __init__(self) -> None:
        self._lines: dict[str, None] = {}

    def add(self, place: str | Path, what: str) -> None:
        """Add a remark."""
        self.add_line(f"{place}: {what}")

    def add_line(self, line: str) -> None:
        """Add a remark that another collection has."""
        self._lines[one_line(line)] = None

    @property
    def lines(self) -> tuple[str, ...]:
        """All remarks."""
        return tuple(self._lines)


_MODEL = "model://"
MODEL_CONFIG = "model.config"
_MOST_DIGITS = 9


@dataclass(frozen=True, slots=True)
class Library:
    """Folders that contain models, each in its own folder."""

    roots: tuple[Path, ...]  # in order of precedence

    def find(self, uri: str, beside: Path) -> Path | None:
        """File or folder of a URI. Returns: None if there is no regular file or folder."""
        if uri.startswith(_MODEL):
            paths = (_existing(root / uri.removeprefix(_MODEL), (root,)) for root in self.roots)
            return next((path for path in paths if path), None)
        path = uri.removeprefix("file://")
        return None if "://" in path else _existing(beside / path, (beside, *self.roots))

    def find_texture(self, name: str, beside: Path) -> Path | None:
        """Image file that a mesh or a material script names."""
        name = unquote(name).replace("\\", "/")
        last = name.rsplit("/", 1)[-1]
        folders = [beside / folder for folder in ("", "../materials/textures", "../textures", "textures")]
        named = (_existing(folder / last, (folder, *self.roots)) for folder in folders)
        candidates = [self.find(name, beside), *named]
        return next((path for path in candidates if path and is_regular_file(path)), None)


def model_file(folder: Path) -> Path:
    """The SDF file of a model: the latest version that its ``model.config`` names."""
    config = folder / MODEL_CONFIG
    if not is_regular_file(config):
        path = folder / "model.sdf"
    else:
        named = [(_version(entry.get("version")), (entry.text or "").strip()) for entry in read_xml(config).iter("sdf")]
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
    existing = _any_case(path)
    if existing is None or not (is_folder(existing) or is_regular_file(existing)):
        return None
    return existing if any(existing.resolve().is_relative_to(root.resolve()) for root in roots) else None


def _any_case(path: Path) -> Path | None:
    """The path, or an existing one that differs only in the case of its last name."""
    try:
        if path.exists():
            return path
        name, siblings = path.name.casefold(), sorted(path.parent.iterdir())
    except (OSError, ValueError, RuntimeError):  # no folder, no valid name of a file, or links in a circle
        return None
    return next((sibling for sibling in siblings if sibling.name.casefold() == name), None)


def _within(folder: Path, name: str, place: Path) -> Path:
    """A file of a folder, whose name comes from a file."""
    path = absolute(folder, Path(name))
    if not path.is_relative_to(folder.resolve()):
        raise DataError(place, f"the file {name!r}", "one in the folder of the model")
    return folder / name


def _version(text: str | None) -> tuple[int, ...]:
    """The parts of a version, for comparison; those that are no numbers, or very long, are left out."""
    return tuple(int(part) for part in (text or "").split(".") if part.isdecimal() and len(part) <= _MOST_DIGITS)


_LARGEST, _SHORTEST = 1e9, 1e-9
"""Largest number in a file, and smallest length of a quaternion that has a direction."""


def text_of(element: Element | None, tag: str) -> str | None:
    """Text of a child without surrounding spaces; None if there is no child or no text."""
    text = None if element is None else element.findtext(tag)
    return (text or "").strip() or None


def numbers(element: Element, count: int, place: str | Path) -> NDArray[np.float64]:
    """(count,) float64: the numbers in an element."""
    text = (element.text or "").strip()
    words = text.split()
    try:
        values = np.array([float(word) for word in words if len(words) == count], np.float64)
    except ValueError:
        values = np.empty(0)
    if len(values) != count or not np.isfinite(values).all():
        raise DataError(place, f"<{element.tag}> {text!r}", counted(count, "finite number"))
    if np.any(np.abs(values) > _LARGEST):
        raise DataError(place, f"<{element.tag}> {text!r}", f"numbers up to {_LARGEST:g}")
    return values


def child_numbers(element: Element, tag: str, default: tuple[float, ...], place: str | Path) -> NDArray[np.float64]:
    """Numbers in a child, as many as in the default. The default is used if there is no such child."""
    child = element.find(tag)
    return np.array(default) if child is None else numbers(child, len(default), place)


def pose_of(element: Element | None, place: str | Path) -> NDArray[np.float64]:
    """(4, 4) float64: parent_from_child of a ``<pose>``; the identity if there is none.

    The six numbers are x, y, z (metres) and roll, pitch, yaw (radians; degrees if ``degrees="true"``) about the
    parent's fixed axes in this order: R = Rz(yaw) Ry(pitch) Rx(roll). With ``rotation_format="quat_xyzw"`` the last
    three are a quaternion instead.
    """
    if element is None or not (element.text or "").strip():
        return np.eye(4)
    if element.get("rotation_format") == "quat_xyzw":
        values = numbers(element, 7, place)
        if np.linalg.norm(values[3:]) < _SHORTEST:
            raise DataError(place, f"<pose> {(element.text or '').strip()!r}", "a non-zero quaternion")
        rotation = Rotation.from_quat(values[3:])
    else:
        values = numbers(element, 6, place)
        rotation = Rotation.from_euler("xyz", values[3:], degrees=element.get("degrees") in ("true", "1"))
    return from_rotation(rotation.as_matrix(), values[:3])


MOST_INCLUDE_LEVELS, MOST_INCLUDES = 8, 1000
"""How deep files include each other, and how many includes a world has in all."""
_NOT_SHOWN = ("actor", "light", "road", "population", "particle_emitter", "projector", "sky", "fog")


@dataclass(frozen=True, slots=True, eq=False)
class Visual:
    """A visible part."""

    name: str  # name of the visual and of its model, for messages
    file: Path  # the SDF file that contains it
    world_from_visual: NDArray[np.float64]  # (4, 4) float64
    geometry: Element  # the only child of its ``<geometry>``
    material: Element | None  # its ``<material>``


def read_visuals(path: Path, library: Library, remarks: Remarks) -> list[Visual]:
    """Everything visible in an SDF file and the models that it includes, in order."""
    return _Walk(library, remarks).file(_Scope((path,), np.eye(4)), None)


@dataclass(frozen=True, slots=True, eq=False)
class _Scope:
    """Current position in the tree: the files that include each other, innermost last, and the pose of the parent."""

    files: tuple[Path, ...]
    world_from_parent: NDArray[np.float64]
    name: str = "world"

    @property
    def file(self) -> Path:
        return self.files[-1]


@dataclass(slots=True)
class _Walk:
    library: Library
    remarks: Remarks
    includes: int = 0

    def file(self, scope: _Scope, placed: Element | None) -> list[Visual]:
        """The first world and all models of a file, with the pose given by the including file."""
        root = read_xml(scope.file)
        worlds, models = root.findall("world"), root.findall("model")
        if not worlds and not models:
            raise DataError(scope.file, f"<{root.tag}> without world or model", "an SDF file of a world or a model")
        if len(worlds) > 1:
            self.remarks.add(scope.file, f"{len(worlds)} worlds; only the first is used")
        visuals = self._world(worlds[0], scope) if worlds else []
        for model in models:
            visuals += self._model(model, scope, placed)
        return visuals

    def _world(self, world: Element, scope: _Scope) -> list[Visual]:
        """Models of a world. Poses in its saved state take precedence, as in Gazebo."""
        state = world.find("state")
        saved: dict[str | None, Element | None] = {}
        for model in () if state is None else state.iter("model"):
            saved[model.get("name")] = model.find("pose")
            scale = model.find("scale")
            if scale is not None and np.any(numbers(scale, 3, scope.file) != 1.0):
                self.remarks.add(scope.file, f"the saved <scale> of model {model.get('name')!r} is not applied")
        if state is not None and any(state.find(tag) is not None for tag in ("insertions", "deletions")):
            self.remarks.add(scope.file, "insertions and deletions of the saved <state> are not applied")
        for parent in (world, *world.findall("scene")):
            self._name_what_is_not_shown(parent, scope)
        return self._models(world, scope, saved)

    def _models(self, parent: Element, scope: _Scope, saved: Mapping[str | None, Element | None]) -> list[Visual]:
        """The direct child models of a world or a model."""
        visuals: list[Visual] = []
        for child in parent:
            if child.tag == "model":
                visuals += self._model(child, scope, saved.get(child.get("name")))
            elif child.tag == "include":
                visuals += self._include(child, scope, saved)
        return visuals

    def _include(self, include: Element, scope: _Scope, saved: Mapping[str | None, Element | None]) -> list[Visual]:
        uri = text_of(include, "uri")
        place = self.library.find(uri, scope.file.parent) if uri else None
        if place is None:
            searched = " or ".join(map(str, self.library.roots))
            self.remarks.add(scope.file, f"model {uri!r} is not in {searched}; it is left out")
            return []
        if include.find("placement_frame") is not None:
            self.remarks.add(
                scope.file, f"<placement_frame> of {uri!r} is not supported; the model's own frame is used"
            )
        file = model_file(place) if place.is_dir() else place
        self._count_include(file, uri or "", scope)
        saved_pose = saved.get(text_of(include, "name") or place.name)
        placed = include.find("pose") if saved_pose is None else saved_pose
        return self.file(replace(scope, files=(*scope.files, file)), placed)

    def _count_include(self, file: Path, uri: str, scope: _Scope) -> None:
        """Refuse a circle, and more includes than a world can need: they can grow exponentially with their depth."""
        self.includes += 1
        if file.resolve() in map(Path.resolve, scope.files):
            raise DataError(scope.file, f"{uri} includes itself", "models that do not include themselves")
        if len(scope.files) > MOST_INCLUDE_LEVELS:
            found = f"{uri} is included at level {len(scope.files)}"
            raise DataError(scope.file, found, f"at most {MOST_INCLUDE_LEVELS} levels of includes")
        if self.includes > MOST_INCLUDES:
            raise DataError(scope.files[0], f"more than {MOST_INCLUDES} includes", "fewer models")

    def _model(self, model: Element, scope: _Scope, placed: Element | None) -> list[Visual]:
        """A model, at its own pose unless another pose is given."""
        inner = self._inner(model, scope, model.find("pose") if placed is None else placed)
        self._name_what_is_not_shown(model, inner)
        visuals = self._models(model, inner, {})
        for link in model.findall("link"):
            in_link = self._inner(link, inner, link.find("pose"))
            self._name_what_is_not_shown(link, in_link)
            visuals += [self._visual(visual, model, in_link) for visual in link.findall("visual")]
        return visuals

    def _visual(self, visual: Element, model: Element, scope: _Scope) -> Visual:
        inner = self._inner(visual, scope, visual.find("pose"))
        name = f"visual {visual.get('name')!r} of model {model.get('name')!r}"
        shapes = visual.findall("geometry/*")
        if len(shapes) != 1:
            raise DataError(scope.file, f"{name} with {len(shapes)} geometries", "one in its <geometry>")
        if np.any(child_numbers(visual, "transparency", (0.0,), scope.file)):
            self.remarks.add(scope.file, f"<transparency> of {name} is not supported; it is opaque")
        return Visual(name, scope.file, inner.world_from_parent, shapes[0], visual.find("material"))

    def _inner(self, element: Element, scope: _Scope, pose: Element | None) -> _Scope:
        """The scope of the children of an element at a given pose."""
        frame = "" if pose is None else pose.get("relative_to", "")
        if frame not in ("", "__model__", scope.name):
            what = f"<pose relative_to={frame!r}> of {element.tag} {element.get('name')!r}"
            self.remarks.add(scope.file, f"{what} is not supported; it is taken relative to its parent")
        world_from_child = scope.world_from_parent @ pose_of(pose, scope.file)
        return _Scope(scope.files, world_from_child, element.get("name") or "")

    def _name_what_is_not_shown(self, parent: Element, scope: _Scope) -> None:
        for child in parent:
            if child.tag in _NOT_SHOWN:
                name = child.get("name")
                self.remarks.add(scope.file, f"<{child.tag}>{f' {name!r}' if name else ''} is not shown")
