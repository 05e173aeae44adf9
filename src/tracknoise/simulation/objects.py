"""A world of large objects in two rows: vehicles in front, buildings behind.

The camera stays south of the rows and looks north, on the paths ``linear``, ``arvr`` and ``sideways`` of
`tracknoise.simulation.motion`. The objects are built from boxes, or are models in Gazebo's format.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError
from tracknoise.printable import significant
from tracknoise.simulation.fittings import block, ground, paint_plain_textures, paint_textures, sky
from tracknoise.simulation.quad import Quad, assemble
from tracknoise.simulation.scenery import Scenery, joined, moved
from tracknoise.simulation.sdf.library import model_names
from tracknoise.simulation.sdf.load import load_model
from tracknoise.simulation.world import World

_TALL_M = 4.5  # taller objects are placed in the back row
_LOWEST_M, _WIDEST_M = 0.3, 40.0  # limits of an object: no ground planes and no cities
_HORIZON_HALF_M, _HORIZON_Y_M = 80.0, (56.0, 68.0)
_GROUND_X_M, _GROUND_Y_M = (-84.0, 84.0), (-20.0, 78.0)

_Textures = tuple[NDArray[np.float32], ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Object:
    """An object on the ground at the origin."""

    name: str
    world: World


@dataclass(slots=True)
class _Row:
    """Objects in a row along x from -half to half; their near sides lie between two values of y (metres)."""

    half_m: float
    near_m: tuple[float, float]
    gap_m: tuple[float, float]
    objects: list[_Object] = field(default_factory=list)
    filled_m: float = 0.0

    @property
    def has_room(self) -> bool:
        return self.filled_m < 2.0 * self.half_m

    def put(self, thing: _Object, rng: np.random.Generator) -> None:
        """Place an object next to the last one, rotated by about 0, 90, 180 or 270 degrees."""
        turn = np.eye(4)
        angle_deg = 90.0 * rng.integers(4) + rng.uniform(-8.0, 8.0)
        turn[:3, :3] = Rotation.from_euler("z", angle_deg, degrees=True).as_matrix()
        turned = moved(thing.world, turn)
        low, high = turned.vertices.min(axis=0), turned.vertices.max(axis=0)
        shift = np.eye(4)
        shift[0, 3] = self.filled_m - self.half_m - low[0]
        shift[1, 3] = rng.uniform(*self.near_m) - low[1]
        self.objects.append(_Object(thing.name, moved(turned, shift)))
        self.filled_m += float(high[0] - low[0]) + rng.uniform(*self.gap_m)


def plain_world(rng: np.random.Generator, models: Path | None = None) -> Scenery:
    """Build a world with plain ground and sky, whose objects of boxes have walls with windows.

    Parameters, return value and errors are those of `objects_world`.
    """
    return _world(rng, models, paint_plain_textures(rng))


def objects_world(rng: np.random.Generator, models: Path | None = None) -> Scenery:
    """Build a world.

    Parameters
    ----------
    rng
        Random generator of everything that differs between worlds.
    models
        Folder of Gazebo models to choose the objects from; objects made of boxes if None.

    Returns
    -------
    Scenery
        The notes name the models in it, and the differences from Gazebo's rendering.

    Raises
    ------
    DataError
        If no model in the folder can be used.
    """
    return _world(rng, models, paint_textures(rng))


def _world(rng: np.random.Generator, models: Path | None, textures: _Textures) -> Scenery:
    """A world with these textures."""
    stage = assemble([*sky(), *ground(rng, _GROUND_X_M, _GROUND_Y_M), *_horizon(rng)], textures)
    shelf = None if models is None else _Shelf(models, rng)
    objects = _rows((lambda: _boxes(textures, rng)) if shelf is None else shelf.one_of_each, rng)
    if shelf is not None and not objects:
        raise DataError(shelf.folder, "; ".join(("no usable model", *shelf.remarks)), "models of objects")
    notes = () if shelf is None else (_used(objects, shelf.folder), *shelf.remarks)
    return Scenery(joined([stage, *(thing.world for thing in objects)]), notes)


def _used(objects: Sequence[_Object], folder: Path) -> str:
    names = ", ".join(sorted({thing.name for thing in objects}))
    return f"its objects are the Gazebo models {names} of {folder}"


def _rows(supply: Callable[[], Iterable[_Object]], rng: np.random.Generator) -> list[_Object]:
    """Objects at their positions, in two rows that are filled as far as there are objects."""
    front = _Row(half_m=24.0, near_m=(2.0, 4.5), gap_m=(1.5, 5.0))
    back = _Row(half_m=36.0, near_m=(13.0, 18.0), gap_m=(0.5, 3.0))
    placed = -1
    while placed < len(front.objects) + len(back.objects):
        placed = len(front.objects) + len(back.objects)
        for thing in supply():
            row = back if np.ptp(thing.world.vertices[:, 2]) > _TALL_M else front
            if row.has_room:
                row.put(thing, rng)
            if not (front.has_room or back.has_room):
                break
    return [*front.objects, *back.objects]


class _Shelf:
    """Models of a folder, each read on first use.

    Parameters
    ----------
    folder
        Gazebo models, each in its own folder.
    rng
        Random generator of the order.
    """

    def __init__(self, folder: Path, rng: np.random.Generator) -> None:
        self.folder, self._rng, self._names = folder, rng, model_names(folder)
        self._read: dict[str, World | None] = {}
        self._remarks: dict[str, None] = {}

    @property
    def remarks(self) -> tuple[str, ...]:
        """The models that are left out, and the differences of the others from Gazebo's rendering."""
        return tuple(self._remarks)

    def one_of_each(self) -> Iterator[_Object]:
        """Every usable model once, in a new random order."""
        for name in self._rng.permutation(self._names).tolist():
            if name not in self._read:
                self._read[name] = self._take_down(name)
            world = self._read[name]
            if world is not None:
                yield _Object(name, world)

    def _take_down(self, name: str) -> World | None:
        try:
            scenery = load_model(self.folder / name)
        except DataError as error:
            self._remarks[f"model {name} is left out: {error}"] = None
            return None
        self._remarks |= dict.fromkeys(scenery.notes)
        width, depth, height = np.ptp(scenery.world.vertices, axis=0)
        if height < _LOWEST_M or max(width, depth) > _WIDEST_M:
            size = " x ".join(significant(side, 3) for side in (width, depth, height))
            self._remarks[f"model {name} is left out: {size} m is not the size of an object"] = None
            return None
        return scenery.world


def _boxes(textures: _Textures, rng: np.random.Generator) -> Iterator[_Object]:
    """A vehicle and a building."""
    yield _Object("vehicle", assemble(list(_vehicle(rng)), textures))
    yield _Object("building", assemble(list(_building(rng)), textures))


def _vehicle(rng: np.random.Generator) -> Iterator[Quad]:
    """A body with a cabin at one end."""
    length, width, height = rng.uniform((3.5, 1.8, 0.9), (9.0, 2.6, 2.6))
    cabin = rng.uniform((0.25, 0.8, 0.4), (0.5, 1.0, 1.2)) * (length, width, 1.0)
    yield from block(rng, (0.0, 0.0, height / 2), (length, width, height), repeat_m=5.0)
    x = (length - cabin[0]) / 2 * rng.uniform(-1.0, 1.0)
    yield from block(rng, (x, 0.0, height + cabin[2] / 2), cabin, repeat_m=4.0)


def _building(rng: np.random.Generator) -> Iterator[Quad]:
    """A main house, a lower wing next to it, and a structure on the roof."""
    size, wing = rng.uniform((7.0, 6.0, 5.0), (14.0, 11.0, 14.0)), rng.uniform((2.0, 4.0, 2.5), (6.0, 8.0, 4.5))
    roof = rng.uniform((0.2, 0.2, 0.8), (0.6, 0.6, 2.5)) * (size[0], size[1], 1.0)
    yield from block(rng, (0.0, 0.0, size[2] / 2), size, repeat_m=8.0)
    yield from block(rng, ((size[0] + wing[0]) / 2, 0.0, wing[2] / 2), wing, repeat_m=6.0)
    yield from block(rng, (0.0, 0.0, size[2] + roof[2] / 2), roof, repeat_m=5.0)


def _horizon(rng: np.random.Generator) -> Iterator[Quad]:
    """Tall houses far behind the rows, without gaps."""
    x = -_HORIZON_HALF_M
    while x < _HORIZON_HALF_M:
        width, height, y = rng.uniform((9.0, 8.0, _HORIZON_Y_M[0]), (15.0, 24.0, _HORIZON_Y_M[1]))
        yield from block(rng, (x + width / 2, y, height / 2), (width, 6.0, height), repeat_m=12.0)
        x += width
