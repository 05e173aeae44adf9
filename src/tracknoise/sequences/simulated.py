"""Sequences of rendered images, with exact poses, depth and surface."""

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Gt, Le, Lt
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.checks import NotNegative, require, require_bounds, require_finite
from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.foreign_files import is_regular_file
from tracknoise.geometry.accuracy import EXACT_DEPTH, EXACT_POSE, DepthAccuracy, PoseAccuracy
from tracknoise.geometry.cameras import LENSES, KnownCamera, make_camera
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.pose import from_rotation
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.faults import NO_FAULTS, Faults, with_faults
from tracknoise.sequences.sequence import SecondCamera, Sequence, TruthKind, facts_of
from tracknoise.simulation.built_worlds import PLACES
from tracknoise.simulation.imaging import NO_EFFECTS, CameraPath, Imaging, Sensor, Stream, generator
from tracknoise.simulation.light import LIGHTINGS
from tracknoise.simulation.motion import MOTIONS
from tracknoise.simulation.ray_casting import surface_points
from tracknoise.simulation.render import Optics, Quality, RenderedWorld
from tracknoise.simulation.sdf_files import model_names
from tracknoise.simulation.sdf_worlds import load_world
from tracknoise.simulation.world import Scenery
from tracknoise.tables.identity import DEFAULT_LIGHTING, SequenceId, readable
from tracknoise.text import html_card, one_line


@dataclass(frozen=True, eq=False)
class SimulatedSequence:
    """A `tracknoise.sequences.sequence.Sequence` that renders each frame when asked for it."""

    id: SequenceId  # which sequence
    camera: KnownCamera  # intrinsics of all its images
    world_from_camera: NDArray[np.float64]  # (n, 4, 4) float64
    settings: "Simulated"  # the reader's settings
    world: RenderedWorld  # the world of the scene

    def __len__(self) -> int:
        return len(self.world_from_camera)

    def __repr__(self) -> str:
        return one_line("Sequence", readable(self.id.key), facts_of(self))

    def _repr_html_(self) -> str:
        return html_card(f"Sequence {readable(self.id.key)}", facts_of(self))

    def __getstate__(self) -> dict[str, Any]:
        """Only the fields: a copy in another process builds its world again."""
        return {name: self.__dict__[name] for name in self.__dataclass_fields__}

    @property
    def source(self) -> str:
        """Name of the simulated scene and of its world file."""
        file = self.settings.world_file
        return f"simulated scene {self.id.scene}" + ("" if file is None else f" in {file}")

    @property
    def timestamps_s(self) -> NDArray[np.float64] | None:
        """(n,) float64, seconds, from 0; None without a rate: such a path has no speed in metres per second."""
        rate_hz = self.settings.imaging.rate_hz
        return np.arange(len(self)) / rate_hz if rate_hz else None

    @property
    def time_unit_stated(self) -> bool:
        """True: the rate is a setting."""
        return True

    @property
    def shutter(self) -> RollingShutter | None:
        """The rolling shutter; None for a global shutter."""
        return self.settings.imaging.shutter

    @property
    def pose_accuracy(self) -> PoseAccuracy:
        """Poses are exact."""
        return EXACT_POSE

    @property
    def depth_accuracy(self) -> DepthAccuracy:
        """Depths are exact."""
        return EXACT_DEPTH

    @property
    def z_depth_from(self) -> str:
        """Depths are along z: rays are cast through the surfaces of the world."""
        return "the surfaces of a simulated world"

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
        return self.world.notes

    def image(self, index: int) -> NDArray[np.uint8]:
        """(height, width) uint8: one frame. It does not depend on the order in which frames are read."""
        irradiance = self.world.irradiance(self._optics, self._path.during_exposure(index, self.camera))
        return self._sensor(Stream.pattern).image(irradiance, index, self._noise(Stream.noise, index))

    @property
    def second(self) -> SecondCamera | None:
        """A camera on the right of the first; None where the settings have none."""
        if not self.settings.baseline_m:
            return None
        first_from_second = from_rotation(np.eye(3), (self.settings.baseline_m, 0.0, 0.0))
        return SecondCamera(self.settings.camera_beside, first_from_second, self._second_image)

    def depth(self, index: int) -> DepthMap:
        """Exact depth of one frame at the pixel centres, float64.

        With a rolling shutter, each depth is along z of the camera at the time of its row.
        """
        return self.depth_at(index)

    def depth_at(self, frame: float) -> DepthMap:
        """Exact depth at a time between frames, counted in frames: see `depth`."""
        return self.world.depth(self.camera, self._path.of_rows(frame, self.camera))

    @property
    def surface(self) -> "SimulatedSequence":
        """The exact surface: the sequence itself, through `cast`."""
        return self

    @property
    def scan(self) -> None:
        """None: the surface itself is known."""
        return None

    def cast(self, index: int, uv: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """First surface points on the rays through pixels of one frame, at the time of each row.

        Shapes: uv (n, 2) px; returns points_world (n, 3) m in the world frame, hit (n,). `points_world`: the camera's
        position where nothing is hit.
        """
        return surface_points(self.world.raycaster, self.camera, self._path.of_pixels(index, self.camera, uv), uv)

    def _second_image(self, index: int) -> NDArray[np.uint8]:
        camera, at = self.settings.camera_beside, index + self.settings.second_delay_frames
        shots = map(self._beside, self._path.during_exposure(at, camera))
        irradiance = self.world.irradiance(replace(self._optics, camera=camera), shots)
        return self._sensor(Stream.second_pattern).image(irradiance, index, self._noise(Stream.second_noise, index))

    def _beside(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Poses of the second camera from those of the first."""
        moved = poses.copy()
        moved[..., :3, 3] += self.settings.baseline_m * moved[..., :3, 0]
        return moved

    def _noise(self, stream: Stream, index: int) -> np.random.Generator:
        return generator(self.settings.seed, stream, f"{self.id.scene} {self._lighting}", index)

    @property
    def _lighting(self) -> str:
        """Its lighting: that of the settings, because its name may be that of an effect."""
        (lighting,) = self.settings.lightings
        return lighting

    def _sensor(self, stream: Stream) -> Sensor:
        """The sensor with the fixed pattern of a stream: that of one camera in all scenes."""
        if stream not in self._sensors:
            pattern, settings = generator(self.settings.seed, stream, ""), self.settings
            camera = settings.camera_beside if stream is Stream.second_pattern else self.camera
            self._sensors[stream] = Sensor(camera, settings.imaging, noise_sigma=settings.noise_sigma, pattern=pattern)
        return self._sensors[stream]

    @cached_property
    def _sensors(self) -> dict[Stream, Sensor]:
        return {}

    @cached_property
    def _path(self) -> CameraPath:
        return CameraPath(self.world_from_camera, self.settings.imaging)

    @property
    def _optics(self) -> Optics:
        quality = Quality(self.settings.supersampling, self.settings.shadows)
        return Optics(self.camera, LIGHTINGS[self._lighting], quality)


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """A way to take the images of every scene.

    Parameters
    ----------
    name
        Of the effect. It is the lighting of its sequences.
    imaging
        How images are taken.
    """

    name: str
    imaging: Imaging = NO_EFFECTS


@dataclass(frozen=True, slots=True)
class _Lens:
    """What options state of the lens of a camera."""

    named: str  # with what their names begin
    model: str
    distortion: tuple[float, ...]
    hfov_deg: float

    def require(self) -> None:
        """Refuse a lens that there is not."""
        if self.model not in LENSES:
            raise UnknownNameError(f"{self.named}lens", self.model, LENSES)
        field, given = f"{self.named}distortion", [*self.distortion]
        require(all(map(math.isfinite, given)), field, given, "finite numbers")
        try:
            edge = self._edge()
        except ValueError as error:
            raise ValueError(f"{self.named}{error}") from error
        require(math.isfinite(edge), field, given, f"a lens that shows the ray at half of {self.named}hfov_deg")

    def camera(self, width: int, height: int) -> KnownCamera:
        """Its camera, whose principal point is the image's centre."""
        focal = width / 2.0 / self._edge()
        centre = (width - 1) / 2.0, (height - 1) / 2.0
        return make_camera(self.model, (width, height), (focal, focal, *centre), self.distortion)

    def _edge(self) -> float:
        """Where a lens of focal length 1 shows the ray at half of the field of view; NaN where it does not."""
        ray = np.array([float(np.tan(np.deg2rad(self.hfov_deg) / 2.0)), 0.0, 1.0])
        u, _ = make_camera(self.model, (1, 1), (1.0, 1.0, 0.0, 0.0), self.distortion).project(ray)
        return float(u) if u > 0.0 else math.nan


_DEFAULT_WORLD = "plaza"
_Side = Annotated[int, Ge(2), Le(8192)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulated:
    """Renders worlds that are made from a seed, or one from a file.

    Parameters
    ----------
    motions
        How the camera moves: names in `tracknoise.simulation.motion.MOTIONS`.
    world
        Kind of world: a name in `tracknoise.simulation.built_worlds.PLACES`, which says what motions suit it.
    models
        Folder of Gazebo models: objects of the worlds, or models that `world_file` includes.
    world_file
        Gazebo world (SDF) to move through instead. Any motion is allowed, but it may pass through surfaces.
    origin, yaw_deg
        Where in the file's frame the frame of the motion has its origin (x, y, z, metres), and by how much it is turned
        about z, counter-clockwise seen from above: see docs/simulation.md.
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
        Model of the lens: a name in `tracknoise.geometry.cameras.LENSES`. Each ray of the image is that of the
        model; pixels without a ray are black.
    distortion
        Coefficients of the lens, as the model has them; for double_sphere, xi and alpha.
    baseline_m
        Distance to a second camera on the right, for depth from stereo, metres; 0 for a single camera.
    second_lens, second_distortion, second_hfov_deg
        Lens of the second camera; by default those of the first.
    second_delay_frames
        By how many frames its images are taken later than stated.
    supersampling
        Rays along each side of a pixel.
    noise_sigma
        Standard deviation of the sensor noise, grey levels.
    shadows
        Whether surfaces block the light.
    lightings
        Names in `tracknoise.simulation.light.LIGHTINGS`.
    seed
        Of worlds, paths, noise and faults.
    imaging
        Shutter, exposure, gain, fixed pattern and compression: see docs/simulation.md. The truth stays exact.
    effects
        Ways to take images, in place of `imaging`: each scene is seen in every one, so that they are a factor of the
        experiment. They need a single lighting.
    faults
        What is wrong with the stated poses, camera and depth: see docs/simulation.md. Images stay as they are.

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
    worlds: Annotated[int, Ge(1), Le(100_000)] = 1
    frames: Annotated[int, Ge(1), Le(1_000_000)] = 60
    width: _Side = 800
    height: _Side = 600
    hfov_deg: Annotated[float, Gt(0), Lt(180)] = 60.0
    lens: str = "pinhole"
    distortion: tuple[float, ...] = ()
    baseline_m: NotNegative = 0.0
    second_lens: str | None = None
    second_distortion: tuple[float, ...] | None = None
    second_hfov_deg: Annotated[float, Gt(0), Lt(180)] | None = None
    second_delay_frames: Annotated[float, Ge(-1_000), Le(1_000)] = 0.0
    supersampling: Annotated[int, Ge(1), Le(16)] = 2
    noise_sigma: Annotated[float, Ge(0), Le(10_000)] = 2.0
    shadows: bool = False
    lightings: tuple[str, ...] = (DEFAULT_LIGHTING,)
    seed: Annotated[int, Ge(0)] = 0
    imaging: Imaging = NO_EFFECTS
    effects: tuple[Effect, ...] = ()
    faults: Faults = NO_FAULTS

    def __post_init__(self) -> None:
        object.__setattr__(self, "motions", _names("motion", self.motions, MOTIONS))
        object.__setattr__(self, "lightings", _names("lighting", self.lightings, LIGHTINGS))
        require_bounds(self)
        self._first_lens.require()
        self._require_second()
        require(all(map(math.isfinite, self.origin)), "origin", self.origin, "three finite numbers (x, y, z in metres)")
        require_finite("yaw_deg", self.yaw_deg)
        self._require_that_world_and_motions_fit()
        self._require_effects()
        timed = any(imaging.readout_s or imaging.exposure_s for imaging in self._ways.values())
        timed = timed or self.second_delay_frames != 0.0
        expected = "at least 2, with a readout_s, exposure_s or second_delay_frames"
        require(self.frames > 1 or not timed, "frames", self.frames, expected)

    def _require_effects(self) -> None:
        if not self.effects:
            return
        names = [effect.name for effect in self.effects]
        require(len({*names}) == len(names), "effects", names, "different names")
        require(all(names), "effects", names, "names that are not empty")
        if self.imaging != NO_EFFECTS or len(self.lightings) > 1:
            raise ValueError("effects exclude imaging, and several lightings")

    @property
    def _ways(self) -> dict[str, Imaging]:
        """How images of each sequence of a scene are taken, by its lighting."""
        return {effect.name: effect.imaging for effect in self.effects} or dict.fromkeys(self.lightings, self.imaging)

    def _require_second(self) -> None:
        names = ("second_lens", "second_distortion", "second_hfov_deg", "second_delay_frames")
        stated = [name for name in names if getattr(self, name)]
        if stated and not self.baseline_m:
            raise ValueError(f"{stated[0]} needs a baseline_m")
        self._second_lens.require()

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
        return self._first_lens.camera(self.width, self.height)

    @property
    def camera_beside(self) -> KnownCamera:
        """The second camera, if there is one."""
        return self._second_lens.camera(self.width, self.height)

    @property
    def _first_lens(self) -> "_Lens":
        return _Lens("", self.lens, self.distortion, self.hfov_deg)

    @property
    def _second_lens(self) -> "_Lens":
        given = self.distortion if self.second_lens is None else ()
        distortion = given if self.second_distortion is None else self.second_distortion
        return _Lens("second_", self.second_lens or self.lens, distortion, self.second_hfov_deg or self.hfov_deg)

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
            for lighting in self._ways
        )

    def open(self, sequence: SequenceId) -> Sequence:
        """Make the camera path of one sequence. Its world is built when it is first used.

        Raises
        ------
        UnknownNameError
            If there is no such scene or lighting.
        DataError
            As `sequences`.
        SettingsError
            If the faults do not suit the sequence.
        """
        return self.open_in(RenderedWorld(self.scenery_of(sequence.scene)), sequence)

    def scenery_of(self, scene: str) -> Callable[[], Scenery]:
        """What makes or reads the world of a scene. It raises DataError if a world file or a model cannot be used."""
        if self.world_file is not None:
            return partial(load_world, self.world_file, models=self.models)
        if self.models is None:
            return partial(_kept, self.world, self.seed, scene)
        return partial(_built, self.world, self.seed, scene, self.models)

    def open_in(self, world: RenderedWorld, sequence: SequenceId) -> Sequence:
        """As `open`, in a world that several sequences share: those of one scene with other imaging or faults."""
        self._require_listed(sequence)
        motion = MOTIONS[sequence.scene.rpartition("-")[0]]
        poses = motion(self.frames, generator(self.seed, Stream.path, sequence.scene))
        if self.world_file is not None:
            poses = self._world_from_motion() @ poses
        lighting = self.lightings[0] if self.effects else sequence.lighting
        settings = replace(self, effects=(), lightings=(lighting,), imaging=self._ways[sequence.lighting])
        opened = SimulatedSequence(sequence, self.camera, poses, settings, world)
        return with_faults(opened, self.faults, seed=self.seed)

    def _require_listed(self, sequence: SequenceId) -> None:
        listed = self.sequences()
        if sequence not in listed:
            lightings = {item.lighting for item in listed if item.scene == sequence.scene}
            if lightings:
                raise UnknownNameError("lighting", sequence.lighting, lightings)
            raise UnknownNameError("scene", sequence.scene, {item.scene for item in listed})

    def _world_from_motion(self) -> NDArray[np.float64]:
        """(4, 4) float64: from the frame of the motion to that of the world file."""
        return from_rotation(Rotation.from_euler("z", self.yaw_deg, degrees=True).as_matrix(), self.origin)


def _built(place: str, seed: int, scene: str, models: Path) -> Scenery:
    return PLACES[place].build(generator(seed, Stream.world, scene), models)


@lru_cache(maxsize=2)
def _kept(place: str, seed: int, scene: str) -> Scenery:
    """A world that depends on no file, for further sequences of its scene: its textures take a second to make."""
    return PLACES[place].build(generator(seed, Stream.world, scene), None)


def _names(kind: str, names: tuple[str, ...], known: Collection[str]) -> tuple[str, ...]:
    """The names, each once."""
    require(bool(names), f"{kind}s", list(names), "at least one name")
    for name in names:
        if name not in known:
            raise UnknownNameError(kind, name, known)
    return tuple(dict.fromkeys(names))
