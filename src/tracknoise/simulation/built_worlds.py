"""Worlds that are built from a random seed or from objects, and the motions that fit them.

The module begins with parts of procedural worlds: textured boxes, ground and sky. Two kinds of worlds follow, and last
the worlds by name, with the motions that do not collide with their objects.

The plaza is a world from a random seed, with surfaces at all depths from 2 m to 300 m. A plaza with boxes is around the
origin. A street of buildings leads north from its eastern half. Panels surround both, and a box of clouds is far behind
them. No path of `tracknoise.simulation.motion` touches a surface.

The other kind is a world of large objects in two rows: vehicles in front, buildings behind. The camera stays south of
the rows and looks north, on the paths ``linear``, ``arvr`` and ``sideways`` of `tracknoise.simulation.motion`. The
objects are built from boxes, or are models in Gazebo's format.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.exceptions import DataError
from tracknoise.geometry.pose import from_rotation
from tracknoise.simulation.motion import LANE_NORTH_M, LANE_X_M, ORBIT_M
from tracknoise.simulation.sdf_files import model_names
from tracknoise.simulation.sdf_worlds import load_model
from tracknoise.simulation.textures import CLOUDS, GROUND, MASONRY, facade, paint, plain
from tracknoise.simulation.world import Quad, Scenery, World, assemble, box, joined, moved
from tracknoise.text import significant

_TEXTURE_SIDE = 1024
_RECIPES = (MASONRY,) * 5 + (GROUND,) * 2 + (CLOUDS,)
MASONRY_TEXTURES, _GROUND_TEXTURES, _CLOUDS_TEXTURE = range(5), range(5, 7), 7

_TILE_M = 7.0
_FAR_M = 300.0


def paint_textures(rng: np.random.Generator) -> tuple[NDArray[np.float32], ...]:
    """Textures that the other functions use, by index."""
    return tuple(paint(recipe, _TEXTURE_SIDE, rng) for recipe in _RECIPES)


def paint_plain_textures(rng: np.random.Generator) -> tuple[NDArray[np.float32], ...]:
    """Textures of the same places: walls with windows, plain ground and plain sky."""
    walls = [facade(_TEXTURE_SIDE, rng) for _ in MASONRY_TEXTURES]
    return (*walls, *(plain(_TEXTURE_SIDE, rng) for _ in (*_GROUND_TEXTURES, _CLOUDS_TEXTURE)))


def sky() -> Iterator[Quad]:
    """Clouds on the inside of a large box, in pieces: a few huge triangles would slow down ray casting."""
    for face in box(np.zeros(3), np.full(3, _FAR_M), Rotation.identity()):
        clouds = replace(face.reversed(), texture=_CLOUDS_TEXTURE, repeat_m=_FAR_M, blocks_light=False)
        yield from clouds.pieces(4)


def ground(rng: np.random.Generator, x_m: tuple[float, float], y_m: tuple[float, float]) -> Iterator[Quad]:
    """Slabs in a square grid over at least the given ranges, each rotated at random."""
    for x in np.arange(*x_m, _TILE_M):
        for y in np.arange(*y_m, _TILE_M):
            slab = Quad(np.array([x, y + _TILE_M, 0.0]), np.array([_TILE_M, 0.0, 0.0]), np.array([0.0, -_TILE_M, 0.0]))
            for _ in range(rng.integers(4)):
                slab = slab.turned()
            yield dressed(slab, rng, _GROUND_TEXTURES, repeat_m=7.0)


def block(
    rng: np.random.Generator,
    centre: tuple[float, float, float],
    size: tuple[float, float, float] | NDArray[np.float64],
    *,
    repeat_m: float,
    turn_deg: float = 0.0,
    tilt_deg: float = 0.0,
) -> Iterator[Quad]:
    """A box of given centre and size, rotated about the vertical and tilted about the horizontal axes within limits."""
    limits = np.array([turn_deg, tilt_deg, tilt_deg])
    rotation = Rotation.from_euler("ZYX", rng.uniform(-limits, limits), degrees=True)
    for face in box(np.array(centre), np.asarray(size) / 2, rotation):
        yield dressed(face, rng, MASONRY_TEXTURES, repeat_m=repeat_m)


def dressed(quad: Quad, rng: np.random.Generator, textures: range, *, repeat_m: float) -> Quad:
    """The quad with one of the textures, at a random offset."""
    return quad.dressed(
        textures[int(rng.integers(len(textures)))], repeat_m=repeat_m, start=(rng.uniform(), rng.uniform())
    )


_WEST, _EAST, _SOUTH, _NORTH = -22.0, 27.0, -22.0, LANE_NORTH_M + 50.0
_ORBIT_CLEARANCE_M, _LANE_CLEARANCE_M = 1.5, 2.0
_UP = np.array([0.0, 0.0, 1.0])


def plaza(rng: np.random.Generator, models: Path | None = None) -> Scenery:
    """A plaza with a lane, made from a seed; `models` are not used."""
    textures = paint_textures(rng)
    slabs = ground(rng, (_WEST - 14.0, _EAST + 14.0), (_SOUTH - 14.0, _NORTH + 14.0))
    quads = [*sky(), *slabs, *_fence(rng), *_street(rng), *_centre(rng), *_surroundings(rng)]
    return Scenery(assemble(quads, textures))


def _fence(rng: np.random.Generator) -> Iterator[Quad]:
    """Tall panels around everything, at different distances."""
    corners = np.array([[_WEST, _SOUTH], [_WEST, _NORTH], [_EAST, _NORTH], [_EAST, _SOUTH]])
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        length = float(np.linalg.norm(end - start))
        along = np.append((end - start) / length, 0.0)
        inward = np.cross(along, _UP)
        for begin in np.arange(0.0, length, 6.0):
            size = rng.uniform((5.5, 8.0), (7.5, 16.0))
            foot = np.append(start, 0.0) + begin * along - rng.uniform(0.0, 3.0) * inward
            panel = Quad(foot + size[1] * _UP, size[0] * along, -size[1] * _UP)
            yield dressed(panel, rng, MASONRY_TEXTURES, repeat_m=10.0)


def _street(rng: np.random.Generator) -> Iterator[Quad]:
    """Buildings on both sides of the lane, and crates at the kerb."""
    for side in (-1.0, 1.0):
        y = 16.0
        while y < _NORTH:
            length, depth, height = rng.uniform((4.0, 3.0, 3.0), (9.0, 5.0, 9.0))
            x = LANE_X_M + side * (rng.uniform(4.5, 6.5) + depth / 2)
            yield from block(rng, (x, y + length / 2, height / 2), (depth, length, height), repeat_m=6.5)
            crate = rng.uniform(0.4, 1.3, 3)
            kerb = LANE_X_M + side * rng.uniform(3.0, 3.8)
            yield from block(rng, (kerb, y, crate[2] / 2), crate, repeat_m=4.0, turn_deg=90.0)
            y += length + rng.uniform(0.5, 3.0)


def _centre(rng: np.random.Generator) -> Iterator[Quad]:
    """A heap of boxes on the plaza, and tilted boxes above it."""
    reach = ORBIT_M - _ORBIT_CLEARANCE_M
    for _ in range(9):
        size = rng.uniform((0.5, 0.5, 0.5), (1.4, 1.4, 2.2))
        x, y = _polar(rng.uniform(0.0, reach - 1.2), rng)
        yield from block(rng, (x, y, size[2] / 2), size, repeat_m=4.0, turn_deg=180.0)
    for _ in range(8):
        x, y = _polar(rng.uniform(0.5, reach - 0.8), rng)
        size = rng.uniform(0.25, 0.8, 3)
        yield from block(rng, (x, y, rng.uniform(1.2, 3.4)), size, repeat_m=3.0, turn_deg=180.0, tilt_deg=40.0)


def _surroundings(rng: np.random.Generator) -> Iterator[Quad]:
    """Boxes around the plaza, outside the lane."""
    placed = 0
    while placed < 36:
        x, y = _polar(rng.uniform(ORBIT_M + _ORBIT_CLEARANCE_M + 1.2, 20.0), rng)
        if abs(x - LANE_X_M) > _LANE_CLEARANCE_M + 1.6:
            placed += 1
            size = rng.uniform((0.6, 0.6, 0.8), (2.2, 2.2, 5.0))
            yield from block(rng, (x, y, size[2] / 2), size, repeat_m=5.0, turn_deg=180.0)


def _polar(radius_m: float, rng: np.random.Generator) -> tuple[float, float]:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return radius_m * np.cos(angle), radius_m * np.sin(angle)


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
        angle_deg = 90.0 * rng.integers(4) + rng.uniform(-8.0, 8.0)
        rotation = Rotation.from_euler("z", angle_deg, degrees=True).as_matrix()
        turned = moved(thing.world, from_rotation(rotation, np.zeros(3)))
        low, high = turned.vertices.min(axis=0), turned.vertices.max(axis=0)
        shift_m = (self.filled_m - self.half_m - low[0], rng.uniform(*self.near_m) - low[1], 0.0)
        self.objects.append(_Object(thing.name, moved(turned, from_rotation(np.eye(3), shift_m))))
        self.filled_m += float(high[0] - low[0]) + rng.uniform(*self.gap_m)


def plain_world(rng: np.random.Generator, models: Path | None = None) -> Scenery:
    """Build a world with plain ground and sky, whose objects of boxes have walls with windows.

    Parameters, return value and errors are those of `objects_world`.
    """
    return _world(rng, models, paint_plain_textures(rng))


def objects_world(rng: np.random.Generator, models: Path | None = None) -> Scenery:
    """Build a world."""
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
    """Models of a folder, each read on first use."""

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


@dataclass(frozen=True, slots=True)
class Place:
    """A kind of world."""

    # builds a world from a random generator and, if `takes_models`, a folder of models or None
    build: Callable[[np.random.Generator, Path | None], Scenery]
    motions: tuple[str, ...]  # names in `tracknoise.simulation.motion.MOTIONS` of paths without collisions
    takes_models: bool  # whether it can contain Gazebo models


_PAST_OBJECTS = ("sideways", "sideways-left", "linear", "linear-straight", "arvr")

PLACES: Mapping[str, Place] = MappingProxyType(
    {
        "plaza": Place(plaza, ("sideways", "sideways-left", "fixating", "forward", "arvr"), takes_models=False),
        "objects": Place(objects_world, _PAST_OBJECTS, takes_models=True),
        "objects-plain": Place(plain_world, _PAST_OBJECTS, takes_models=True),
    }
)
"""Kinds of worlds by name."""
