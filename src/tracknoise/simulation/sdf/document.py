"""The visible parts of an SDF file, with the resolved poses of its models and links."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.foreign.xml_file import Element, read_xml
from tracknoise.simulation.sdf.library import Library, model_file
from tracknoise.simulation.sdf.remarks import Remarks
from tracknoise.simulation.sdf.xml import child_numbers, numbers, pose_of, text_of

MOST_INCLUDE_LEVELS, MOST_INCLUDES = 8, 1000
"""How deep files include each other, and how many includes a world has in all."""
_NOT_SHOWN = ("actor", "light", "road", "population", "particle_emitter", "projector", "sky", "fog")


@dataclass(frozen=True, slots=True, eq=False)
class Visual:
    """A visible part.

    Parameters
    ----------
    name
        Name of the visual and of its model, for messages.
    file
        The SDF file that contains it.
    world_from_visual
        (4, 4) float64.
    geometry
        The only child of its ``<geometry>``.
    material
        Its ``<material>``.
    """

    name: str
    file: Path
    world_from_visual: NDArray[np.float64]
    geometry: Element
    material: Element | None


def read_visuals(path: Path, library: Library, remarks: Remarks) -> list[Visual]:
    """Everything visible in an SDF file and the models that it includes, in order.

    Parameters
    ----------
    path
        File of a world or a model.
    library
        Where to search for included models.
    remarks
        Collects what is not supported.

    Raises
    ------
    DataError
        If a file is missing or malformed, or has neither world nor model.
    """
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
        found = self._world(worlds[0], scope) if worlds else []
        for model in models:
            found += self._model(model, scope, placed)
        return found

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
        found: list[Visual] = []
        for child in parent:
            if child.tag == "model":
                found += self._model(child, scope, saved.get(child.get("name")))
            elif child.tag == "include":
                found += self._include(child, scope, saved)
        return found

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
        own = saved.get(text_of(include, "name") or place.name)
        placed = include.find("pose") if own is None else own
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
        found = self._models(model, inner, {})
        for link in model.findall("link"):
            in_link = self._inner(link, inner, link.find("pose"))
            self._name_what_is_not_shown(link, in_link)
            found += [self._visual(item, model, in_link) for item in link.findall("visual")]
        return found

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
