"""A sequence of rendered images, with exact poses, depth and surface."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tracknoise.geometry.accuracy import EXACT_DEPTH, EXACT_POSE, DepthAccuracy, PoseAccuracy
from tracknoise.geometry.depth import DepthMap
from tracknoise.geometry.lenses import KnownCamera
from tracknoise.geometry.shutter import RollingShutter
from tracknoise.sequences.sequence import SecondCamera, TruthKind
from tracknoise.simulation.camera_path import CameraPath
from tracknoise.simulation.light import LIGHTINGS
from tracknoise.simulation.render import Quality
from tracknoise.simulation.rendered_world import Optics, RenderedWorld
from tracknoise.simulation.sensor import Sensor
from tracknoise.simulation.streams import Stream, generator
from tracknoise.tables.identity import SequenceId

if TYPE_CHECKING:
    from tracknoise.sequences.simulated import Simulated


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
    world
        The world of the scene.
    """

    id: SequenceId
    camera: KnownCamera
    world_from_camera: NDArray[np.float64]
    settings: "Simulated"
    world: RenderedWorld

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
    def timestamps_s(self) -> NDArray[np.float64] | None:
        """(n,) float64, seconds, from 0; None without a rate: such a path has no speed in metres per second."""
        rate_hz = self.settings.imaging.rate_hz
        return np.arange(len(self)) / rate_hz if rate_hz else None

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
        """A camera of the same model, on the right of the first; None where the settings have none."""
        if not self.settings.baseline_m:
            return None
        first_from_second = np.eye(4)
        first_from_second[0, 3] = self.settings.baseline_m
        return SecondCamera(self.camera, first_from_second, self._second_image)

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
        """First surface points on the rays through pixels of one frame (truth.raycast), at the time of each row.

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
        return self.world.cast(self.camera, self._path.of_pixels(index, self.camera, uv), uv)

    def _second_image(self, index: int) -> NDArray[np.uint8]:
        shots = map(self._beside, self._path.during_exposure(index, self.camera))
        irradiance = self.world.irradiance(self._optics, shots)
        return self._sensor(Stream.second_pattern).image(irradiance, index, self._noise(Stream.second_noise, index))

    def _beside(self, poses: NDArray[np.float64]) -> NDArray[np.float64]:
        """Poses of the second camera from those of the first."""
        moved = poses.copy()
        moved[..., :3, 3] += self.settings.baseline_m * moved[..., :3, 0]
        return moved

    def _noise(self, stream: Stream, index: int) -> np.random.Generator:
        return generator(self.settings.seed, stream, f"{self.id.scene} {self.id.lighting}", index)

    def _sensor(self, stream: Stream) -> Sensor:
        """The sensor with the fixed pattern of a stream: that of one camera in all scenes."""
        if stream not in self._sensors:
            pattern, settings = generator(self.settings.seed, stream, ""), self.settings
            self._sensors[stream] = Sensor(
                self.camera, settings.imaging, noise_sigma=settings.noise_sigma, pattern=pattern
            )
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
        return Optics(self.camera, LIGHTINGS[self.id.lighting], quality)
