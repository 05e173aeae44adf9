"""How often a check names a fault of a second camera, and says nothing of one that is right.

    python -m benchmarks.validity.rig_faults [--seeds N] [--first N]

Simulated pairs of 24 frames at 480 x 360 px and 30 Hz, 12 cm apart, in two worlds' motions, with and without depth maps
beside them. Each fault is planted in what is stated of the pair, or in its images. Where another fault cannot be told
from it, as one of times from one of the distance where the camera moves along the baseline, it counts as named if the
sentence names both.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tracknoise.geometry.depth import DepthMap
from tracknoise.sequences.kept_frames import KeptFrames
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.sequence import SecondCamera, Sequence, second_of
from tracknoise.sequences.views import View
from tracknoise.truth_faults.rig_check import second_camera

MOTIONS = ("arvr", "forward", "sideways")
FRAMES = 24

Change = Callable[[SecondCamera], SecondCamera]


@dataclass(frozen=True, eq=False)
class Changed(View):
    """A sequence whose second camera, or whose images, are changed."""

    change: Change
    has_depth: bool
    swaps: bool = False

    @property
    def second(self) -> SecondCamera | None:
        """The changed one."""
        second = second_of(self.sequence)
        if second is None or not self.swaps:
            return None if second is None else self.change(second)
        return replace(second, images=self.sequence.image)

    def image(self, index: int) -> NDArray[np.uint8]:
        """That of the other camera where both are swapped."""
        second = second_of(self.sequence)
        image = second.images(index) if second is not None and self.swaps else None
        return self.sequence.image(index) if image is None else image

    def depth(self, index: int) -> DepthMap | None:
        """None where there are to be no maps."""
        return self.sequence.depth(index) if self.has_depth else None


def turned(degrees: float, axis: int) -> Change:
    """The second camera is turned about an axis of its own."""
    rotation = Rotation.from_rotvec(np.radians(degrees) * np.eye(3)[axis]).as_matrix()

    def change(second: SecondCamera) -> SecondCamera:
        moved = second.first_from_second.copy()
        moved[:3, :3] = moved[:3, :3] @ rotation
        return replace(second, first_from_second=moved)

    return change


def scaled(factor: float) -> Change:
    """The baseline is longer, or points the other way."""

    def change(second: SecondCamera) -> SecondCamera:
        moved = second.first_from_second.copy()
        moved[:3, 3] *= factor
        return replace(second, first_from_second=moved)

    return change


def late(frames: int) -> Change:
    """Each image of the second camera is one of so many frames before."""

    def change(second: SecondCamera) -> SecondCamera:
        return replace(second, images=lambda index: second.images(min(max(index - frames, 0), FRAMES - 1)))

    return change


def given(second: SecondCamera) -> SecondCamera:
    """Nothing is changed."""
    return second


PLANTED: Mapping[str, tuple[Change, tuple[str, ...]]] = {
    "nothing": (given, ("agree",)),
    "turned .5 deg, x": (turned(0.5, 0), ("turned by",)),
    "turned .5 deg, y": (turned(0.5, 1), ("turned by",)),
    "turned .5 deg, z": (turned(0.5, 2), ("turned by",)),
    "baseline x 1.1": (scaled(1.1), ("too long", "another distance")),
    "baseline x .9": (scaled(0.9), ("too short", "another distance")),
    "baseline of the wrong sign": (scaled(-1.0), ("swapped", "inverted", "wrong sign")),
    "swapped": (given, ("swapped", "inverted", "wrong sign")),
    "a frame late": (late(1), ("before those of the first", "other times")),
    "a frame early": (late(-1), ("after those of the first", "other times")),
}
"""How each is planted, and what a sentence that names it says."""


def pairs(seed: int) -> Iterator[tuple[str, Sequence]]:
    """Simulated pairs of cameras."""
    for motion in MOTIONS:
        options = {"motions": [motion], "frames": FRAMES, "width": 480, "height": 360, "baseline_m": 0.12}
        yield motion, KeptFrames(open_sequence("simulated", seed=seed, imaging={"rate_hz": 30.0}, **options))


def main() -> None:
    """Count what is named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--first", type=int, default=1)
    asked = parser.parse_args()
    named: dict[str, list[bool]] = {fault: [] for fault in PLANTED}
    for seed in range(asked.first, asked.first + asked.seeds):
        for motion, pair in pairs(seed):
            for fault, (change, names) in PLANTED.items():
                for has_depth in (True, False):
                    item = second_camera(Changed(pair, change, has_depth, swaps=fault == "swapped"))
                    text = "" if item is None else item.text
                    named[fault].append(any(name in text for name in names))
                    if not named[fault][-1]:
                        print(
                            f"{motion} {seed}, {'with' if has_depth else 'without'} maps, {fault}: {text}", flush=True
                        )
    for fault, found in named.items():
        print(f"{fault}: {sum(found)} of {len(found)}")


if __name__ == "__main__":
    main()
