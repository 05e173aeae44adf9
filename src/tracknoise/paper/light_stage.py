"""A light stage: objects are photographed from an arc of positions, with one LED at a time.

Objects on a table, from a random seed.

World frame: x to the right and y away, as the cameras see it, z up, metres; the origin is the middle of the table.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Camera
from tracknoise.simulation.imaging import expose
from tracknoise.simulation.light import Lighting, PointLamp
from tracknoise.simulation.motion import looking
from tracknoise.simulation.ray_casting import Raycaster, surface_points
from tracknoise.simulation.render import Quality, Renderer
from tracknoise.simulation.textures import Recipe, paint
from tracknoise.simulation.world import Quad, World, assemble, box, joined

_ROWS = (3, 4, 5, 4, 3)
_PITCH_M = 0.25
_HEIGHT_M = 0.9


def led_positions() -> NDArray[np.float64]:
    """Nineteen LEDs in a level hexagon: rows of 3, 4, 5, 4 and 3, 0.25 m between neighbours, 0.9 m above the table.

    Returns (19, 3) m. x from left to right and y from front to back as the cameras see it, z up. The origin is the
    middle of the table. Rows are ordered from the back to the front, and the LEDs in a row from left to right.
    """
    places = [
        (_PITCH_M * (column - (count - 1) / 2), _PITCH_M * np.sqrt(0.75) * (len(_ROWS) // 2 - row), _HEIGHT_M)
        for row, count in enumerate(_ROWS)
        for column in range(count)
    ]
    return np.array(places)


_SEGMENTS = 72


def revolved(
    profile_m: NDArray[np.float64],
    foot: NDArray[np.float64],
    *,
    texture: int,
    textures: tuple[NDArray[np.float32], ...],
    repeat_m: float,
) -> World:
    """Revolve a profile about the vertical through a point.

    Shapes: profile_m (n, 2), foot (3,) m in the world frame.
    """
    turn = np.linspace(0.0, 1.0, _SEGMENTS + 1)
    radius, height = profile_m.T[:, :, None]
    angle = 2.0 * np.pi * turn
    vertices = np.stack(np.broadcast_arrays(radius * np.cos(angle), radius * np.sin(angle), height), axis=-1)
    repeats = max(round(2.0 * np.pi * radius.max() / repeat_m), 1)
    down = np.cumsum(np.linalg.norm(np.diff(profile_m, axis=0, prepend=profile_m[:1]), axis=1)) / repeat_m
    uv = np.stack(np.meshgrid(repeats * turn, down), axis=-1)
    faces = _faces(len(profile_m), _SEGMENTS + 1)
    corners = vertices.reshape(-1, 3)[faces]
    faces = faces[np.linalg.norm(np.cross(*np.moveaxis(np.diff(corners, axis=1), 1, 0)), axis=1) > 0.0]
    return World(
        vertices=vertices.reshape(-1, 3) + foot,
        faces=faces,
        corner_uv=uv.reshape(-1, 2)[faces],
        texture=np.full(len(faces), texture),
        textures=textures,
        blocks_light=np.ones(len(faces), np.bool_),
    )


def _faces(rows: int, columns: int) -> NDArray[np.int64]:
    """Two triangles for each cell of a grid of vertices, counter-clockwise seen from outside."""
    start = np.add.outer(np.arange(rows - 1) * columns, np.arange(columns - 1)).ravel()
    upper_left, lower_left = start, start + columns  # left is the lower angle
    halves = [
        np.stack([upper_left, lower_left, lower_left + 1], axis=-1),
        np.stack([upper_left, lower_left + 1, upper_left + 1], axis=-1),
    ]
    return np.stack(halves, axis=1).reshape(-1, 3)


_TEXTURE_SIDE = 1024
_CLOTH = Recipe(exponent=1.6, mean=0.45, contrast=0.1, shapes=40)
_PRINT = Recipe(exponent=1.5, mean=0.5, contrast=0.1, shapes=90)
_RECIPES = (_CLOTH, *(_PRINT,) * 6)  # smooth between its shapes, like manufactured objects
_TABLE, _COVERS = 0, range(1, 7)
_TABLE_M, _TABLE_REPEAT_M = 2.4, 0.24
_COVER_REPEAT_M = 0.15
_BOARDS, _BOTTLES, _THINGS = 2, 4, 7  # of seven things two are boxes, two are boards, and three are bottles
_RING_M = 0.095
"""Distance of the outer objects from the middle one."""


def tabletop(rng: np.random.Generator) -> World:
    """Build a scene of about 0.3 m: boxes, leaning boards and bottles on a table that fills the view."""
    textures = tuple(paint(recipe, _TEXTURE_SIDE, rng) for recipe in _RECIPES)
    quads: list[Quad] = list(_table(rng))
    bottles: list[World] = []
    for thing, (x, y) in zip(rng.permutation(_THINGS), _places(rng), strict=True):
        if thing < _BOARDS:
            quads += _box(rng, x, y)
        elif thing < _BOTTLES:
            quads += _board(rng, x, y)
        else:
            bottles.append(_bottle(rng, x, y, textures))
    return joined([assemble(quads, textures), *bottles])


def _places(rng: np.random.Generator) -> Iterator[tuple[float, float]]:
    """One in the middle, six around it."""
    yield float(rng.uniform(-0.015, 0.015)), float(rng.uniform(-0.015, 0.015))
    start = rng.uniform(0.0, 2.0 * np.pi)
    for sixth in range(6):
        angle = start + np.deg2rad(60.0 * sixth + rng.uniform(-10.0, 10.0))
        radius = _RING_M * rng.uniform(0.9, 1.2)
        yield radius * np.cos(angle), radius * np.sin(angle)


def _table(rng: np.random.Generator) -> Iterator[Quad]:
    half = _TABLE_M / 2.0
    top = Quad(np.array([-half, half, 0.0]), np.array([_TABLE_M, 0.0, 0.0]), np.array([0.0, -_TABLE_M, 0.0]))
    dressed = top.dressed(_TABLE, repeat_m=_TABLE_REPEAT_M, start=(rng.uniform(), rng.uniform()))
    yield from dressed.pieces(6)


def _box(rng: np.random.Generator, x: float, y: float) -> Iterator[Quad]:
    half = rng.uniform((0.02, 0.02, 0.02), (0.04, 0.04, 0.06))
    turn = Rotation.from_euler("z", rng.uniform(0.0, 360.0), degrees=True)
    yield from _dressed(rng, np.array([x, y, half[2]]), half, turn)


def _board(rng: np.random.Generator, x: float, y: float) -> Iterator[Quad]:
    """A thin box that leans back."""
    half = rng.uniform((0.03, 0.003, 0.04), (0.05, 0.008, 0.06))
    lean = np.deg2rad(rng.uniform(20.0, 55.0))
    turn = Rotation.from_euler("ZX", [np.deg2rad(rng.uniform(-40.0, 40.0)), -lean])
    rise = half[2] * np.cos(lean) + half[1] * np.sin(lean)
    yield from _dressed(rng, np.array([x, y, rise]), half, turn)


def _dressed(
    rng: np.random.Generator, centre: NDArray[np.float64], half_m: NDArray[np.float64], turn: Rotation
) -> Iterator[Quad]:
    cover = int(rng.choice(_COVERS))
    for face in box(centre, half_m, turn):
        yield face.dressed(cover, repeat_m=_COVER_REPEAT_M, start=(rng.uniform(), rng.uniform()))


def _bottle(rng: np.random.Generator, x: float, y: float, textures: tuple[NDArray[np.float32], ...]) -> World:
    """A body with a shoulder and a neck; short and wide ones look like inverted cups."""
    radius, height, neck = rng.uniform((0.018, 0.06, 0.35), (0.035, 0.12, 0.9))
    shoulder = np.linspace(0.0, np.pi / 2, 6)
    curve = np.stack([radius * (neck + (1.0 - neck) * np.sin(shoulder)), height * (0.65 + 0.2 * np.cos(shoulder))], -1)
    top = np.array([[0.0, height], [radius * neck, height]])
    profile = np.concatenate([top, curve, [[radius, 0.0]]])
    cover = int(rng.choice(_COVERS))
    return revolved(profile, np.array([x, y, 0.0]), texture=cover, textures=textures, repeat_m=_COVER_REPEAT_M)


POSITIONS = 49
"""Number of camera positions on the arc."""
KEY_FRAME = 24
"""The middle position, from which the scan is made."""
SCAN_STEP_PX = 0.75
"""Distance of neighbouring scan points in the key frame, px of the full image: about 0.15 mm on the objects."""

_ARC_DEG, _ELEVATION_DEG, _DISTANCE_M = 80.0, 30.0, 0.6
_TARGET = np.array([0.0, 0.0, 0.04])
_SCANNED_M = 0.25
_ROWS_AT_ONCE = 64
_WIDTH = 1600
_FOCAL = (2900.0, 2904.0)
_OFF_CENTRE = (12.3, -8.7)
_STRENGTH, _AMBIENT = 0.85, 0.15
_WORLD, _NOISE, _SCAN = range(3)  # independent streams of random numbers


class LightStage:
    """A scene on the stage.

    The camera moves on an arc of 80 degrees around the scene, 0.6 m from its centre and 30 degrees above it. It has 49
    positions from left to right, and always looks at the centre. At each position the scene is photographed once per
    LED, in the light of that LED and a little ambient light.

    Parameters
    ----------
    scene
        Number of the scene. Scene and seed determine the objects on the stage.
    seed
        Random seed of the scenes and the noise.
    width, height
        Size of the images, px; the focal length is proportional to the width, 2900 px at 1600.
    supersampling
        Rays along each side of a pixel.
    shadows
        Whether surfaces block the light.
    noise_sigma
        Standard deviation of the sensor noise, grey levels.
    """

    def __init__(
        self,
        scene: int,
        *,
        seed: int = 0,
        width: int = 1600,
        height: int = 1200,
        supersampling: int = 1,
        shadows: bool = False,
        noise_sigma: float = 2.0,
    ) -> None:
        self.camera = stage_camera(width, height)
        self.world_from_camera = arc()
        self.leds_m = led_positions()
        self._streams, self._noise_sigma = (seed, scene), noise_sigma
        world = tabletop(self._generator(_WORLD))
        self._raycaster = Raycaster(world)
        lamps = tuple(PointLamp((float(x), float(y), float(z)), _STRENGTH) for x, y, z in self.leds_m)
        self._renderer = Renderer(
            world,
            self._raycaster,
            camera=self.camera,
            lighting=Lighting(_AMBIENT, point_lamps=lamps),
            quality=Quality(supersampling, shadows),
        )

    def images(self, index: int) -> Iterator[NDArray[np.uint8]]:
        """The images from one position, one per LED in order.

        Yields
        ------
        (height, width) uint8
        """
        for led, irradiance in enumerate(self._renderer.images_by_lamp(self.world_from_camera[index])):
            yield expose(irradiance, self._noise_sigma, self._generator(_NOISE, index, led))

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points on the rays through pixels: see `tracknoise.sequences.sequence.Surface.cast`."""
        return surface_points(self._raycaster, self.camera, self.world_from_camera[index], uv)

    def scan(self, *, step_px: float = SCAN_STEP_PX) -> NDArray[np.float64]:
        """Points of the surface within 0.25 m of the centre of the scene that are visible in the key frame.

        Parameters
        ----------
        step_px
            Distance of neighbouring points in the key frame, px. The offset of their grid is random, so that it is not
            aligned with the pixels.

        Returns
        -------
        (n, 3) float64
            Metres, world frame.
        """
        start_u, start_v = self._generator(_SCAN).uniform(-0.5, step_px - 0.5, 2)
        columns = np.arange(start_u, self.camera.width - 0.5, step_px)
        rows = np.arange(start_v, self.camera.height - 0.5, step_px)
        parts = []
        for first in range(0, len(rows), _ROWS_AT_ONCE):
            u, v = np.meshgrid(columns, rows[first : first + _ROWS_AT_ONCE])
            points, hit = self.cast(KEY_FRAME, np.stack([u.ravel(), v.ravel()], axis=-1))
            parts.append(points[hit & (np.linalg.norm(points - _TARGET, axis=1) <= _SCANNED_M)])
        return np.concatenate(parts)

    def _generator(self, stream: int, *numbers: int) -> np.random.Generator:
        return np.random.default_rng([*self._streams, stream, *numbers])


def stage_camera(width: int, height: int) -> Camera:
    """The camera on the stage: its principal point is not in the centre, and its pixels are not exactly square."""
    scale = width / _WIDTH
    fx, fy = (focal * scale for focal in _FOCAL)
    right, down = (shift * scale for shift in _OFF_CENTRE)
    return Camera(width, height, fx, fy, (width - 1) / 2.0 + right, (height - 1) / 2.0 + down)


def arc() -> NDArray[np.float64]:
    """(49, 4, 4) float64: world_from_camera of the positions, from left to right."""
    azimuth = np.deg2rad(np.linspace(-_ARC_DEG / 2.0, _ARC_DEG / 2.0, POSITIONS))
    elevation = np.deg2rad(_ELEVATION_DEG)
    level = np.cos(elevation)
    outward = np.stack(
        [level * np.sin(azimuth), -level * np.cos(azimuth), np.full(POSITIONS, np.sin(elevation))], axis=-1
    )
    return looking(_TARGET + _DISTANCE_M * outward, -outward)
