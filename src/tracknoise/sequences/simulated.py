"""Sequences of rendered images, with exact poses, depth and surface."""

import math
import zlib
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.checks import require, require_at_least, require_at_most
from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.foreign.files import is_regular_file
from tracknoise.geometry.accuracy import EXACT_DEPTH, EXACT_POSE, DepthAccuracy, PoseAccuracy
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.lenses import COEFFICIENTS, KnownCamera, make_camera
from tracknoise.sequences.sequence import SecondCamera, TruthKind
from tracknoise.simulation.light import LIGHTINGS
from tracknoise.simulation.motion import MOTIONS
from tracknoise.simulation.places import PLACES
from tracknoise.simulation.raycast import Raycaster, depth_map, surface_points
from tracknoise.simulation.render import Quality, Renderer
from tracknoise.simulation.scenery import Scenery
from tracknoise.simulation.sdf.library import model_names
from tracknoise.simulation.sdf.load import load_world
from tracknoise.simulation.sensor import expose
from tracknoise.tables.identity import DEFAULT_LIGHTING, SequenceId

_WORLD, _PATH, _NOISE, _SECOND_NOISE = range(4)  # independent streams of random numbers
_DEFAULT_WORLD = "plaza"
_LIMITS = {
    "worlds": (1, 100_000),
    "frames": (1, 1_000_000),
    "width": (2, 8192),
    "height": (2, 8192),
    "supersampling": (1, 16),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulated:
    """Renders worlds that are made from a seed, or one from a file.

    Parameters
    ----------
    motions
        How the camera moves: names in `tracknoise.simulation.motion.MOTIONS`.
    world
        Kind of world: a name in `tracknoise.simulation.places.PLACES`, which says what motions suit it.
    models
        Folder of Gazebo models: objects of the worlds, or models that `world_file` includes.
    world_file
        Gazebo world (SDF) to move through instead. Any motion is allowed, but it may pass through surfaces.
    origin, yaw_deg
        Where in the file's frame the frame of the motion has its origin (x, y, z, metres), and by how much it is turned
        about z, counter-clockwise seen from above: see docs/worlds.md.
    worlds
        Number of scenes for each motion. Each has its own world, so that scenes are independent; with `world_file`,
        only its own path.
    frames
        Count of frames of each sequence.
    width, height
        Size of the images, px.
    hfov_deg
        Horizontal field of view through the principal point, degrees.
    lens
        Model of the lens: a name in `tracknoise.geometry.lenses.COEFFICIENTS`. Each ray of the image is that of the
        model; pixels without a ray are black.
    distortion
        Coefficients of the lens, as the model has them; for double_sphere, xi and alpha.
    baseline_m
        Distance to a second camera on the right, for depth from stereo, metres; 0 for a single camera.
    supersampling
        Rays along each side of a pixel.
    noise_sigma
        Standard deviation of the sensor noise, grey levels.
    shadows
        Whether surfaces block the light.
    lightings
        Names in `tracknoise.simulation.light.LIGHTINGS`.
    seed
        Of worlds, paths and noise.

    Raises
    ------
    ValueError
        If an option has an impossible value, or two options contradict each other.
    UnknownNameError
        If there is no such motion, world or lighting.
    """

    name: ClassVar[str] = "simulated"
    description: ClassVar[str] = "rendered worlds with exact poses, depth and surface; needs no files"
    needs_root: ClassVar[bool] = False

    motions: tuple[str, ...] = ("sideways", "fixating", "forward", "arvr")
    world: str = _DEFAULT_WORLD
    models: Path | None = None
    world_file: Path | None = None
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_deg: float = 0.0
    worlds: int = 1
    frames: int = 60
    width: int = 800
    height: int = 600
    hfov_deg: float = 60.0
    lens: str = "pinhole"
    distortion: tuple[float, ...] = ()
    baseline_m: float = 0.0
    supersampling: int = 2
    noise_sigma: float = 2.0
    shadows: bool = False
    lightings: tuple[str, ...] = (DEFAULT_LIGHTING,)
    seed: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "motions", _names("motion", self.motions, MOTIONS))
        object.__setattr__(self, "lightings", _names("lighting", self.lightings, LIGHTINGS))
        for name, (least, most) in _LIMITS.items():
            require_at_least(name, getattr(self, name), least)
            require_at_most(name, getattr(self, name), most)
        require_at_least("seed", self.seed, 0)
        require(0.0 < self.hfov_deg < 180.0, "hfov_deg", self.hfov_deg, "a number between 0 and 180")
        self._require_lens()
        require_at_least("baseline_m", self.baseline_m, 0)
        require_at_least("noise_sigma", self.noise_sigma, 0)
        require(all(map(math.isfinite, self.origin)), "origin", self.origin, "three finite numbers (x, y, z in metres)")
        require(math.isfinite(self.yaw_deg), "yaw_deg", self.yaw_deg, "a finite number")
        self._require_that_world_and_motions_fit()

    def _require_lens(self) -> None:
        if self.lens not in COEFFICIENTS:
            raise UnknownNameError("lens", self.lens, COEFFICIENTS)
        require(all(map(math.isfinite, self.distortion)), "distortion", [*self.distortion], "finite numbers")
        expected = "a lens that shows the ray at half of hfov_deg"
        require(math.isfinite(self._edge()), "distortion", [*self.distortion], expected)

    def _edge(self) -> float:
        """Where a lens of focal length 1 shows the ray at half of the field of view; NaN where it does not."""
        ray = np.array([float(np.tan(np.deg2rad(self.hfov_deg) / 2.0)), 0.0, 1.0])
        u, _ = make_camera(self.lens, (1, 1), (1.0, 1.0, 0.0, 0.0), self.distortion).project(ray)
        return float(u) if u > 0.0 else math.nan

    def _require_that_world_and_motions_fit(self) -> None:
        if self.world not in PLACES:
            raise UnknownNameError("world", self.world, PLACES)
        if self.world_file is not None:
            if self.world != _DEFAULT_WORLD:
                raise ValueError("world and world_file exclude each other")
            return
        if any(self.origin) or self.yaw_deg:
            raise ValueError("origin and yaw_deg need a world_file")
        place = PLACES[self.world]
        if self.models is not None and not place.takes_models:
            raise ValueError(f"world {self.world!r} takes no models")
        for motion in self.motions:
            if motion not in place.motions:
                fitting = ", ".join(place.motions)
                raise ValueError(f"motion {motion!r} does not suit world {self.world!r}; {fitting} do")

    @property
    def camera(self) -> KnownCamera:
        """The camera of all sequences; its principal point is the image's centre."""
        focal = self.width / 2.0 / self._edge()
        centre = (self.width - 1) / 2.0, (self.height - 1) / 2.0
        return make_camera(self.lens, (self.width, self.height), (focal, focal, *centre), self.distortion)

    def sequences(self) -> list[SequenceId]:
        """All sequences, sorted: scenes are named ``<motion>-<index of the world>``.

        Raises
        ------
        DataError
            If there is no such world file, or no model in the folder of models.
        """
        if self.world_file is not None and not is_regular_file(self.world_file):
            raise DataError(self.world_file, "no such file", "a Gazebo world (.world or .sdf)")
        if self.models is not None:
            model_names(self.models)
        return sorted(
            SequenceId(self.name, f"{motion}-{world:02d}", lighting)
            for motion in self.motions
            for world in range(self.worlds)
            for lighting in self.lightings
        )

    def open(self, sequence: SequenceId) -> "SimulatedSequence":
        """Make the camera path of one sequence. Its world is built when it is first used.

        Raises
        ------
        UnknownNameError
            If there is no such scene or lighting.
        DataError
            As `sequences`.
        """
        listed = self.sequences()
        if sequence not in listed:
            known = {item.lighting for item in listed if item.scene == sequence.scene}
            if known:
                raise UnknownNameError("lighting", sequence.lighting, known)
            raise UnknownNameError("scene", sequence.scene, {item.scene for item in listed})
        motion = MOTIONS[sequence.scene.rpartition("-")[0]]
        poses = motion(self.frames, _generator(self.seed, _PATH, sequence.scene))
        if self.world_file is not None:
            poses = self._world_from_motion() @ poses
        return SimulatedSequence(sequence, self.camera, poses, self)

    def build(self, scene: str) -> Scenery:
        """Make or read the world of a scene.

        Raises
        ------
        DataError
            If a world file or a model cannot be used.
        """
        if self.world_file is not None:
            return load_world(self.world_file, models=self.models)
        return PLACES[self.world].build(_generator(self.seed, _WORLD, scene), self.models)

    def _world_from_motion(self) -> NDArray[np.float64]:
        """(4, 4) float64: from the frame of the motion to that of the world file."""
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_euler("z", self.yaw_deg, degrees=True).as_matrix()
        pose[:3, 3] = self.origin
        return pose


@dataclass(frozen=True, eq=False)
class SimulatedSequence:
    """A `tracknoise.sequences.sequence.Sequence` that renders each frame when asked for it.

    Parameters
    ----------
    id
        Which sequence.
    camera
        Intrinsics of all its images.
    world_from_camera
        (n, 4, 4) float64.
    settings
        The reader's settings.
    """

    id: SequenceId
    camera: KnownCamera
    world_from_camera: NDArray[np.float64]
    settings: Simulated

    def __len__(self) -> int:
        return len(self.world_from_camera)

    def __getstate__(self) -> dict[str, Any]:
        """Only the fields: a copy in another process builds its world again."""
        return {name: self.__dict__[name] for name in self.__dataclass_fields__}

    @property
    def source(self) -> str:
        """Name of the simulated scene and of its world file."""
        file = self.settings.world_file
        return f"simulated scene {self.id.scene}" + ("" if file is None else f" in {file}")

    @property
    def timestamps_s(self) -> None:
        """None: a simulated camera path has no speed in metres per second."""
        return None

    @property
    def pose_accuracy(self) -> PoseAccuracy:
        """Poses are exact."""
        return EXACT_POSE

    @property
    def depth_accuracy(self) -> DepthAccuracy:
        """Depths are exact."""
        return EXACT_DEPTH

    @property
    def truths(self) -> tuple[TruthKind, ...]:
        """Ray cast first: it needs no interpolation."""
        return (TruthKind.raycast, TruthKind.birth)

    @property
    def group(self) -> str:
        """The motion: scenes of one motion have similar errors."""
        return self.id.scene.rpartition("-")[0]

    @property
    def notes(self) -> tuple[str, ...]:
        """Which models are in the world, and which of their parts are not rendered as in Gazebo."""
        return self._scenery.notes

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: one frame. It does not depend on the order in which frames are read."""
        return self._exposed(self.world_from_camera[index], _NOISE, index)

    @property
    def second(self) -> SecondCamera | None:
        """A camera of the same model, on the right of the first; None where the settings have none."""
        if not self.settings.baseline_m:
            return None
        first_from_second = np.eye(4)
        first_from_second[0, 3] = self.settings.baseline_m
        return SecondCamera(self.camera, first_from_second, self._second_image)

    def depth(self, index: int) -> DepthMap:
        """Exact depth of one frame at the pixel centres, float64."""
        return depth_map(self._raycaster, self.camera, self.world_from_camera[index])

    @property
    def surface(self) -> "SimulatedSequence":
        """The exact surface: the sequence itself, through `cast`."""
        return self

    @property
    def scan(self) -> None:
        """None: the surface itself is known."""
        return None

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points on the rays through pixels of one frame (truth.raycast).

        Parameters
        ----------
        index
            Frame.
        uv
            (n, 2) float64, px.

        Returns
        -------
        points_world : (n, 3) float64
            Metres, world frame; the camera's position where nothing is hit.
        hit : (n,) bool
        """
        return surface_points(self._raycaster, self.camera, self.world_from_camera[index], uv)

    def _second_image(self, index: int) -> NDArray[np.uint8]:
        pose = self.world_from_camera[index].copy()
        pose[:3, 3] += self.settings.baseline_m * pose[:3, 0]
        return self._exposed(pose, _SECOND_NOISE, index)

    def _exposed(self, world_from_camera: NDArray[np.float64], stream: int, index: int) -> NDArray[np.uint8]:
        noise = _generator(self.settings.seed, stream, f"{self.id.scene} {self.id.lighting}", index)
        return expose(self._renderer.image(world_from_camera), self.settings.noise_sigma, noise)

    @cached_property
    def _scenery(self) -> Scenery:
        return self.settings.build(self.id.scene)

    @cached_property
    def _raycaster(self) -> Raycaster:
        return Raycaster(self._scenery.world)

    @cached_property
    def _renderer(self) -> Renderer:
        quality = Quality(self.settings.supersampling, self.settings.shadows)
        lighting = LIGHTINGS[self.id.lighting]
        world = self._scenery.world
        return Renderer(world, self._raycaster, camera=self.camera, lighting=lighting, quality=quality)


def _generator(seed: int, stream: int, name: str, index: int = 0) -> np.random.Generator:
    """A generator that depends only on its arguments, so that frames can be rendered in any order."""
    return np.random.default_rng([seed, stream, zlib.crc32(name.encode()), index])


def _names(kind: str, names: tuple[str, ...], known: Collection[str]) -> tuple[str, ...]:
    """The names, each once."""
    require(bool(names), f"{kind}s", list(names), "at least one name")
    for name in names:
        if name not in known:
            raise UnknownNameError(kind, name, known)
    return tuple(dict.fromkeys(names))
