"""A reader: NumPy archives NAME.npz with images, poses, K and depths, one sequence each."""

from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from tracknoise.exceptions import DataError, UnknownNameError
from tracknoise.sequences.arrays import Sequence
from tracknoise.tables.identity import SequenceId


@dataclass(frozen=True)
class Archive:
    """Settings. `root` is the folder of the data; each field after it is an option."""

    name: ClassVar[str] = "archive"
    description: ClassVar[str] = "NumPy archives NAME.npz with images, poses, K and depths"
    needs_root: ClassVar[bool] = True

    root: Path
    _: KW_ONLY
    metres_per_unit: float = 1.0

    def sequences(self) -> list[SequenceId]:
        """All sequences, from file names alone."""
        found = sorted(path.stem for path in self.root.glob("*.npz"))
        if not found:
            raise DataError(self.root, "no archive", "files such as office.npz")
        return [SequenceId(self.name, scene) for scene in found]

    def open(self, sequence: SequenceId) -> Sequence:
        """Read one sequence."""
        if sequence not in self.sequences():
            raise UnknownNameError("scene", sequence.scene, [item.scene for item in self.sequences()])
        with np.load(self.root / f"{sequence.scene}.npz", allow_pickle=False) as data:
            depths = data["depths"] * self.metres_per_unit
            return Sequence.from_arrays(
                data["images"], data["poses"], data["K"], depths, dataset=self.name, scene=sequence.scene
            )
