"""Sequences of rendered images, with exact poses, depth and surface."""

import math
from collections.abc import Collection
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Gt, Le, Lt
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.checks import NotNegative, require, require_bounds, require_finite
from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.foreign.files import is_regular_file
from tracknoise.geometry.lenses import COEFFICIENTS, KnownCamera, make_camera
from tracknoise.sequences.fault_options import NO_FAULTS, Faults
from tracknoise.sequences.faults import with_faults
from tracknoise.sequences.sequence import Sequence
from tracknoise.sequences.simulated_sequence import SimulatedSequence
from tracknoise.simulation.imaging import NO_EFFECTS, Imaging
from tracknoise.simulation.light import LIGHTINGS
from tracknoise.simulation.motion import MOTIONS
from tracknoise.simulation.places import PLACES
from tracknoise.simulation.rendered_world import RenderedWorld
from tracknoise.simulation.scenery import Scenery
from tracknoise.simulation.sdf.library import model_names
from tracknoise.simulation.sdf.load import load_world
from tracknoise.simulation.streams import Stream, generator
from tracknoise.tables.identity import DEFAULT_LIGHTING, SequenceId

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
        Of worlds, paths, noise and faults.
    imaging
        Shutter, exposure, gain, fixed pattern and compression: see docs/effects.md. The truth stays exact.
    faults
        What is wrong with the stated poses, camera and depth: see docs/effects.md. Images stay as they are.

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
    supersampling: Annotated[int, Ge(1), Le(16)] = 2
    noise_sigma: NotNegative = 2.0
    shadows: bool = False
    lightings: tuple[str, ...] = (DEFAULT_LIGHTING,)
    seed: Annotated[int, Ge(0)] = 0
    imaging: Imaging = NO_EFFECTS
    faults: Faults = NO_FAULTS

    def __post_init__(self) -> None:
        object.__setattr__(self, "motions", _names("motion", self.motions, MOTIONS))
        object.__setattr__(self, "lightings", _names("lighting", self.lightings, LIGHTINGS))
        require_bounds(self)
        self._require_lens()
        require(all(map(math.isfinite, self.origin)), "origin", self.origin, "three finite numbers (x, y, z in metres)")
        require_finite("yaw_deg", self.yaw_deg)
        self._require_that_world_and_motions_fit()
        timed = self.imaging.readout_s or self.imaging.exposure_s
        require(self.frames > 1 or not timed, "frames", self.frames, "at least 2, with a readout_s or exposure_s")

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
        return self.open_in(self.world_of(sequence.scene), sequence)

    def world_of(self, scene: str) -> RenderedWorld:
        """The world of a scene, for `open_in`. It is built when it is first used."""
        return RenderedWorld(partial(self.build, scene))

    def open_in(self, world: RenderedWorld, sequence: SequenceId) -> Sequence:
        """As `open`, in a world that several sequences share: those of one scene with other imaging or faults."""
        self._require_listed(sequence)
        motion = MOTIONS[sequence.scene.rpartition("-")[0]]
        poses = motion(self.frames, generator(self.seed, Stream.path, sequence.scene))
        if self.world_file is not None:
            poses = self._world_from_motion() @ poses
        opened = SimulatedSequence(sequence, self.camera, poses, self, world)
        return with_faults(opened, self.faults, seed=self.seed)

    def _require_listed(self, sequence: SequenceId) -> None:
        listed = self.sequences()
        if sequence not in listed:
            known = {item.lighting for item in listed if item.scene == sequence.scene}
            if known:
                raise UnknownNameError("lighting", sequence.lighting, known)
            raise UnknownNameError("scene", sequence.scene, {item.scene for item in listed})

    def build(self, scene: str) -> Scenery:
        """Make or read the world of a scene.

        Raises
        ------
        DataError
            If a world file or a model cannot be used.
        """
        if self.world_file is not None:
            return load_world(self.world_file, models=self.models)
        if self.models is None:
            return _kept(self.world, self.seed, scene)
        return _built(self.world, self.seed, scene, self.models)

    def _world_from_motion(self) -> NDArray[np.float64]:
        """(4, 4) float64: from the frame of the motion to that of the world file."""
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_euler("z", self.yaw_deg, degrees=True).as_matrix()
        pose[:3, 3] = self.origin
        return pose


def _built(place: str, seed: int, scene: str, models: Path | None = None) -> Scenery:
    return PLACES[place].build(generator(seed, Stream.world, scene), models)


_kept = lru_cache(maxsize=2)(_built)
"""Worlds that depend on no file, for further sequences of their scene: the textures of one take a second to make."""


def _names(kind: str, names: tuple[str, ...], known: Collection[str]) -> tuple[str, ...]:
    """The names, each once."""
    require(bool(names), f"{kind}s", list(names), "at least one name")
    for name in names:
        if name not in known:
            raise UnknownNameError(kind, name, known)
    return tuple(dict.fromkeys(names))
