"""Why the outlier ratio of correspondence is high: parallax under one homography, or wrong matches.

    python -m benchmarks.validity.outlier_ratio [--worlds N] [--frames N] [--width N] [--seed N]

The preset compares the first position of each track with its present one, and rejects what one homography does not
explain to 3 px. Between two views of a plane a homography explains every correct match. With several depths it cannot,
once the camera has moved. Three worlds are therefore compared, each seen from the same kind of flight: one wall that
fills the image, the boxes of `objects`, and those of `objects-plain`. A fundamental matrix explains correct matches at
any depth, so that what it rejects are wrong matches. `arvr` hardly translates. Printed are outliers per feature that
was carried into a frame: the mean over worlds, and the range.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from tracknoise.sequences.simulated import Simulated
from tracknoise.simulation.built_worlds import block, paint_textures
from tracknoise.simulation.world import Scenery, assemble
from tracknoise.trackers.correspondence import Correspondence, CorrespondenceTracker
from tracknoise.trackers.rejection import Consensus, Model, ReferencePosition, Rejection
from tracknoise.trackers.tracker import Frame

REJECTIONS = {
    f"{model}, {reference}": Rejection(model=model, consensus=Consensus.hypothesis, reference=reference)
    for model in (Model.homography, Model.fundamental)
    for reference in (ReferencePosition.first, ReferencePosition.previous)
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Wall(Simulated):
    """One wall that fills the image."""

    def scenery_of(self, scene: str) -> Callable[[], Scenery]:
        """What makes the world of a scene."""
        return partial(_wall, [self.seed, int(scene.rpartition("-")[2])])


def _wall(seed: list[int]) -> Scenery:
    rng = np.random.default_rng(seed)
    wall = [*block(rng, (0.0, 8.0, 0.0), (200.0, 2.0, 200.0), repeat_m=7.0)]
    return Scenery(assemble(wall, paint_textures(rng)))


def ratios(reader: Simulated) -> Iterator[list[float]]:
    """Outlier ratio by each rejection, world by world."""
    for scene in reader.sequences():
        sequence = reader.open(scene)
        frames = [Frame(index, sequence.image(index)) for index in range(len(sequence))]
        yield [_ratio(rejection, frames) for rejection in REJECTIONS.values()]


def _ratio(rejection: Rejection, frames: Sequence[Frame]) -> float:
    settings = Correspondence(rejection=rejection)
    tracker = CorrespondenceTracker(settings, rejection.inliers)
    steps = [tracker.step(frame) for frame in frames]
    return sum(step.outliers or 0 for step in steps) / sum(step.offered for step in steps)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=int, default=6)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--seed", type=int, default=2026)
    chosen = parser.parse_args(arguments)
    size = {"width": chosen.width, "height": chosen.width * 3 // 4}
    options = {"worlds": chosen.worlds, "frames": chosen.frames, "seed": chosen.seed, **size}
    readers = {
        "wall, linear": Wall(world="objects", motions=("linear",), **options),
        "objects, linear": Simulated(world="objects", motions=("linear",), **options),
        "objects-plain, linear": Simulated(world="objects-plain", motions=("linear",), **options),
        "objects, arvr": Simulated(world="objects", motions=("arvr",), **options),
    }
    print(f"{'':<24}" + "".join(f"{name:>26}" for name in REJECTIONS))
    for name, reader in readers.items():
        found = np.array(list(ratios(reader)))
        cells = [f"{column.mean():.3f} ({column.min():.3f}-{column.max():.3f})" for column in found.T]
        print(f"{name:<24}" + "".join(f"{cell:>26}" for cell in cells), flush=True)


if __name__ == "__main__":
    main()
