"""How wrong depth from the images of other frames is, and what that does to the errors of tracks.

    python -m benchmarks.validity.swept_depth [--motions NAME ...] [--frames N] [--width N]
        [--recordings READER:PATH ...] [--truth KIND]

Exact recordings are measured twice by the same trackers: with their exact truth, and as if they had no depth
(`swept`). Printed are, for each recording:

- of the depths of all tracks that have one: median and robust standard deviation of the relative error, the share
  beyond 5 %, the median of the error over its stated standard deviation (0.67 is right), the share within two of them
  (0.95), and the share of tracks that have a depth;
- by tracker and age: core (robust standard deviation) and RMS (of errors up to 5 px), in u and v, by the exact truth of
  all tracks, by the exact truth of those that have a swept depth, and by the swept truth, and the share of observations
  that have one. The second against the first is what selection does, the third against the second what depth does;
- the sigma to set in the estimator `openvins` by both truths, of all simulated recordings together.
"""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import polars as pl
from numpy.typing import NDArray

import tracknoise as tn
from tracknoise.experiments.measure import Measurement, measure
from tracknoise.sequences.sequence import SWEPT
from tracknoise.sequences.sequence import Sequence as Recording
from tracknoise.sequences.simulated import Simulated
from tracknoise.sequences.views import View

TRACKERS = ("lucas-kanade", "correspondence")
AGES = (1, 3, 10, 24)
LARGEST_PX = 5.0
KEY = ("tracker", "speed", "track")


@dataclass(frozen=True, slots=True, eq=False)
class Kept(View):
    """A sequence whose images are rendered once."""

    images: dict[int, NDArray[np.uint8]] = field(default_factory=dict)

    def image(self, index: int) -> NDArray[np.uint8]:
        """That of the sequence shown."""
        if index not in self.images:
            self.images[index] = self.sequence.image(index)
        return self.images[index]


def recordings(motions: Sequence[str], size: tuple[int, int, int], others: Sequence[str]) -> Iterator[Recording]:
    """Simulated ones of each motion, and others."""
    width, height, frames = size
    for motion in motions:
        reader = Simulated(motions=(motion,), frames=frames, width=width, height=height)
        yield from (Kept(reader.open(one)) for one in reader.sequences())
    for other in others:
        name, _, path = other.partition(":")
        yield from map(Kept, tn.open_sequences(name, path))


def of_depths(exact: Measurement, swept: Measurement) -> str:
    """Errors of depth."""
    both = exact.tracks.join(swept.tracks, on=KEY, suffix="_swept").filter(pl.col("depth_m").is_not_null())
    known = both.drop_nulls("depth_m_swept")
    error = (known["depth_m_swept"] / known["depth_m"] - 1.0).to_numpy()
    median = float(np.median(error))
    robust = 1.4826 * float(np.median(np.abs(error - median)))
    beyond = float(np.mean(np.abs(error) > 0.05))
    return (
        f"relative error median {median:+.4f}, robust sd {robust:.4f}, beyond 5 % {beyond:.3f}; "
        f"tracks with a depth {known.height / both.height:.3f}"
    )


def of_positions(exact: Measurement, swept: Measurement) -> Iterator[str]:
    """Core and RMS by tracker and age."""
    names = [*KEY, "frame"]
    truths = [one.observations.select(*names, "age", "truth", "du_px", "dv_px") for one in (exact, swept)]
    both = truths[0].join(truths[1], on=names, suffix="_swept")
    shown = both.filter(pl.col("truth") == "valid", pl.col("du_px").is_not_null())
    for tracker in TRACKERS:
        for age in AGES:
            here = shown.filter(tracker=tracker, age=age)
            known = here.filter(pl.col("truth_swept") == "valid")
            if known.height < 50:
                continue
            exact_px, of_known_px = (one.select("du_px", "dv_px").to_numpy() for one in (here, known))
            swept_px = known.select("du_px_swept", "dv_px_swept").to_numpy()
            cells = "   ".join(f"{_cell(px)}" for px in (exact_px, of_known_px, swept_px))
            yield f"  {tracker:<15}{age:>3}  {cells}   {known.height / here.height:.3f}  n {here.height}"


def _cell(error_px: NDArray[np.float64]) -> str:
    core = 1.4826 * np.median(np.abs(error_px - np.median(error_px, axis=0)), axis=0)
    rms = np.sqrt(np.mean(np.square(error_px[np.hypot(*error_px.T) < LARGEST_PX]), axis=0))
    return f"{core[0]:.3f} {core[1]:.3f} / {rms[0]:.3f} {rms[1]:.3f}"


def of_floors(exact: Measurement, swept: Measurement) -> str:
    """Whether the stated covariances of true positions are right: squared differences over their variances."""
    names = [*KEY, "frame"]
    true = [one.observations.drop_nulls("u_true_px").filter(pl.col("age") > 0) for one in (exact, swept)]
    both = (
        true[0].select(*names, "u_true_px", "v_true_px").join(true[1].drop("u_px", "v_px"), on=names, suffix="_swept")
    )
    moved = both.select(
        pl.col("u_true_px_swept") - pl.col("u_true_px"), pl.col("v_true_px_swept") - pl.col("v_true_px")
    )
    stated = both.select(pl.col("cov_true_uu") + pl.col("cov_true_vv")).to_series()
    ratio = np.sqrt(np.square(moved.to_numpy()).sum(axis=1) / np.maximum(stated.to_numpy(), 1e-12))
    return f"moved true positions over stated: median {np.median(ratio):.2f} (0.67), within 2 {np.mean(ratio < 2):.3f}"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--motions", nargs="*", default=["sideways", "fixating", "forward", "arvr"])
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--width", type=int, default=480)
    parser.add_argument("--recordings", nargs="*", default=[])
    parser.add_argument("--truth", help="kind of the exact truth: birth leaves out features at depth edges")
    chosen = parser.parse_args()
    size = (chosen.width, chosen.width * 3 // 4, chosen.frames)
    runs: dict[str, list[Measurement]] = {"exact": [], "swept": []}
    for recording in recordings(chosen.motions, size, chosen.recordings):
        for index in range(len(recording)):
            recording.image(index)
        times = [time.monotonic()]
        pair = []
        for kind in (chosen.truth, SWEPT):
            pair.append(measure(recording, TRACKERS, truth=kind))
            times.append(time.monotonic())
        exact, swept = pair
        births = swept.tracks.height
        print(f"{recording.id.key}: {times[1] - times[0]:.1f} s, swept {times[2] - times[1]:.1f} s, {births} tracks")
        print(f"  {of_depths(exact, swept)}\n  {of_floors(exact, swept)}")
        print("\n".join(of_positions(exact, swept)), flush=True)
        for name, one in zip(runs, pair, strict=True):
            runs[name].append(one)
    if len(runs["exact"]) < 2:
        sys.exit()
    found = {name: tn.analyse(measured).sigma("openvins") for name, measured in runs.items()}
    for tracker in TRACKERS:
        pair = [found[name][tracker].sigma_px if tracker in found[name] else float("nan") for name in runs]
        print(f"sigma to set, {tracker}: exact {pair[0]:.3f}, swept {pair[1]:.3f} px")


if __name__ == "__main__":
    main()
