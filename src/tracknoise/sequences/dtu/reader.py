"""DTU Point Features, in both releases: see docs/dtu.md.

A frame is a position of arc 1 (frame 0 is position 1, the key frame 24 is position 25). The camera was calibrated with
images of 1600x1200; they are used at half that size, in grayscale.
"""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.geometry.camera import Camera
from tracknoise.sequences.dtu.calibration import read_calibration
from tracknoise.sequences.dtu.layout import (
    CALIBRATION,
    LEDS,
    POSITIONS,
    SCANS,
    Release,
    dtu_scenes,
    find_beside,
    image_files,
    release_of,
    scan_name,
)
from tracknoise.sequences.dtu.relighting import LIGHTINGS, read_leds, weights
from tracknoise.sequences.dtu.scan import read_scan
from tracknoise.sequences.dtu.sequence import LitSequence
from tracknoise.sequences.dtu.shots import Relit, Shots, Taken
from tracknoise.sequences.images import image_size
from tracknoise.sequences.sequence import Sequence
from tracknoise.simulation.light_stage.leds import led_positions
from tracknoise.tables.identity import SequenceId

_NOMINAL_NOTE = "relit with the nominal positions of the LEDs, because no file gives their measured positions"


@dataclass(frozen=True, slots=True)
class Dtu:
    """Reader of DTU Point Features.

    Parameters
    ----------
    root
        Folder of the scenes' folders, or a scene itself. The calibration and the scans are there, in a folder within,
        or up to two folders above.
    leds
        CSV file of the LEDs' positions, 19 rows of x, y, z in metres (see `tracknoise.sequences.dtu.relighting`); by
        default ``leds.csv`` beside the calibration, or a nominal grid where there is none.
    """

    name: ClassVar[str] = "dtu"
    description: ClassVar[str] = "DTU Point Features: objects on a light stage, 19 lightings, a scan of the key frame"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    leds: Path | None = None

    def sequences(self) -> list[SequenceId]:
        """All sequences, sorted: every scene in every lighting.

        Raises
        ------
        DataError
            If there is no scene.
        """
        return sorted(
            SequenceId(self.name, scene, lighting)
            for scene, folder in dtu_scenes(self.root).items()
            for lighting in release_of(folder).names
        )

    def open(self, sequence: SequenceId) -> LitSequence:
        """Read and check one sequence, except for its images.

        Raises
        ------
        DataError
            If an image, the calibration, the scan or the file of the LEDs is missing or damaged.
        UnknownNameError
            If there is no such scene or lighting.
        """
        return self._open([sequence])[0]

    def open_together(self, sequences: list[SequenceId]) -> list[Sequence]:
        """Open several sequences of one scene, which share the scan and decode the images of each position once.

        Raises
        ------
        DataError, UnknownNameError
            As `open`.
        ValueError
            If they are not of one scene.
        """
        return list(self._open(sequences))

    def _open(self, sequences: list[SequenceId]) -> list[LitSequence]:
        (scene,) = {sequence.scene for sequence in sequences}
        scenes = dtu_scenes(self.root)
        if scene not in scenes:
            raise UnknownNameError("scene", scene, scenes)
        folder = scenes[scene]
        release = release_of(folder)
        for sequence in sequences:
            if sequence.lighting not in release.names:
                raise UnknownNameError("lighting", sequence.lighting, release.names)
        calibration = read_calibration(find_beside(self.root, CALIBRATION))
        scan, scan_notes = read_scan(find_beside(self.root, SCANS) / scan_name(folder))
        files = image_files(folder, release)
        halve, size_notes = _halve(next(iter(files.values())), calibration.camera)
        lightings = [sequence.lighting for sequence in sequences]
        on_disk = calibration.camera if halve else calibration.camera.halved()
        shots, light_notes = self._shots(files, release, lightings, on_disk, halve=halve)
        return [
            LitSequence(
                id=sequence,
                source=str(folder),
                camera=calibration.camera.halved(),
                world_from_camera=calibration.world_from_camera,
                scan=scan,
                shots=shots,
                lighting=index,
                notes=(*calibration.notes, *size_notes, *light_notes, *scan_notes),
            )
            for index, sequence in enumerate(sequences)
        ]

    def _shots(
        self,
        files: dict[tuple[int, int], Path],
        release: Release,
        lightings: list[str],
        camera: Camera,
        *,
        halve: bool,
    ) -> tuple[Shots, tuple[str, ...]]:
        """The images in some lightings, and notes on them."""
        if release.lightings:
            numbers = [release.lightings[lighting] for lighting in lightings]
            taken = [[files[position, number] for number in numbers] for position in POSITIONS]
            return Taken(taken, camera, halve=halve), ()
        leds_m, notes = self._leds()
        chosen = weights(leds_m)[[LIGHTINGS.index(lighting) for lighting in lightings]]
        by_led = [[files[position, number] for number in release.numbers] for position in POSITIONS]
        return Relit(by_led, chosen, camera, halve=halve), notes

    def _leds(self) -> tuple[NDArray[np.float64], tuple[str, ...]]:
        """(19, 3) float64: positions of the LEDs, and notes on them."""
        if self.leds is not None:
            return read_leds(self.leds), ()
        beside = find_beside(self.root, CALIBRATION).parent / LEDS
        return (read_leds(beside), ()) if beside.exists() else (led_positions(), (_NOMINAL_NOTE,))


def _halve(image: Path, calibrated: Camera) -> tuple[bool, tuple[str, ...]]:
    """Whether the images on disk must be halved, from the size of one of them, and notes on it."""
    size, used = image_size(image), calibrated.halved()
    if size == (calibrated.width, calibrated.height):
        return True, ()
    if size == (used.width, used.height):
        return False, (f"the images on disk have half the size of the calibration's: {size[0]}x{size[1]}",)
    expected = f"the calibration's {calibrated.width}x{calibrated.height}, or half of it"
    raise DataError(image, f"size {size[0]}x{size[1]}", expected)
