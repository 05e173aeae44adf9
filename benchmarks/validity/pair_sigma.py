"""How often the interval of the sigma to set for two cameras holds the one that is right for windows of such scenes.

    python -m benchmarks.validity.pair_sigma [--runs N] [--scenes 6 12 28] [--worlds NAME ...] [--shared 0 .9]

As `benchmarks.validity.sigma_to_set`, with a second camera 12 cm beside the first, whose errors have a correlation with
those in the first. Right is the root of the mean NEES of the newest pose of an estimator that assumes 1 px in both
cameras. A run knows the first errors of each track in both. Printed are the shares of 95 % intervals that hold the
right sigma, in brackets those that lie below it; the mean of the squared estimates over the square of the right one;
and the same where sigma is that of the second camera alone.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from benchmarks.validity.sigma_to_set import LENGTH, WINDOWS
from benchmarks.validity.sigma_worlds import (
    FOCAL,
    FRAMES,
    HEIGHT,
    WIDTH,
    WORLDS,
    Pair,
    Scene,
    World,
    scene,
    squared_sigma,
)
from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators.components import COLUMNS, fit_components
from tracknoise.estimators.equivalents import MeanSquares
from tracknoise.estimators.linear_window import EXACT, LinearTracks, Rig
from tracknoise.estimators.model import Equivalent, Interval, Landmark, Purpose
from tracknoise.estimators.training import Windows, windows_of
from tracknoise.estimators.two_cameras import TwoCameras
from tracknoise.geometry.cameras import Camera
from tracknoise.inference.units import NO_GROUPS
from tracknoise.statistics.windows import MOST_OF_PAIR

PLACE = np.eye(4)
PLACE[0, 3] = 0.12
RIG = Rig(Camera(WIDTH, HEIGHT, FOCAL, FOCAL, 319.5, 239.5), PLACE)


@dataclass(frozen=True)
class Member:
    """A scene: what a run knows of it, and its mean squared sigma, px^2; NaN without windows."""

    window: Sequence[LinearTracks] | None
    sums: pl.DataFrame
    tracks: pl.DataFrame
    square: float


def sampled(own: Scene, errors: Sequence[np.ndarray]) -> pl.DataFrame:
    """Sampled tracks with errors in both cameras, as a run stores them."""
    parts = [one[:, :MOST_OF_PAIR] for one in errors]
    both = np.concatenate([np.concatenate([*one], axis=1) for one in parts])
    names = ("first_du_px", "first_dv_px", "du_px", "dv_px")
    values = {
        "track": np.repeat(np.arange(len(parts)), [one.shape[1] for one in parts]),
        "age": np.concatenate([np.arange(one.shape[1]) for one in parts]),
        **dict(zip(names, both.T, strict=True)),
    }
    labels = {"dataset": "made", "lighting": "default", "camera": "", "stands_for": 1.0}
    return pl.DataFrame(values).with_columns(**{key: pl.lit(value) for key, value in labels.items()})


def population(world: World, pair: Pair, size: int, random: np.random.Generator) -> Iterator[Member]:
    """Scenes, with what is right for each."""
    for number in range(size):
        own, name = scene(world, random), f"{number:04}"
        starts = random.integers(0, FRAMES - LENGTH + 1, WINDOWS).tolist()
        squares = [one for start in starts if (one := squared_sigma(own, start, LENGTH, pair)) is not None]
        recording = replace(own.recording(name), rig=RIG)
        window = next(windows_of(recording, speed=1, length=LENGTH, count=1), None)
        errors = [pair.drawn(own, one, random) for one in own.tracks]
        sums = own.sums_of(name, np.concatenate([one[1] for one in errors]))
        yield Member(window, sums, sampled(own, errors), float(np.mean(squares)) if squares else np.nan)


def sigmas(members: Sequence[Member]) -> tuple[Interval, Interval]:
    """For both cameras, and for the second alone, as a run of these scenes says."""
    names = [f"{place:02}" for place in range(len(members))]
    pairs = list(zip(names, members, strict=True))
    table = pl.concat([one.sums.with_columns(scene=pl.lit(name)) for name, one in pairs])
    units = units_of(table.drop("block"), table, points=["product", "age"], columns=COLUMNS)
    windows = Windows(*zip(*((one.window, name) for name, one in pairs if one.window is not None), strict=True))
    found = MeanSquares.of(fit_components(units, level=0.95), windows, 1)
    known = {Landmark.FREE: found.sigmas(None), Landmark.EXACT: found.sigmas(EXACT)}
    alone = [
        Equivalent(landmark=landmark, purpose=purpose, window=LENGTH, sigma=sigma, gate_95=1.0, gate_99=1.0)
        for landmark, own in known.items()
        for purpose, sigma in own.items()
    ]
    tracks = pl.concat([one.tracks.with_columns(scene=pl.lit(name)) for name, one in pairs])
    pair = TwoCameras.of(tracks, {LENGTH: windows}, np.inf)
    assert pair is not None, "there are tracks"
    known_both = {(one.landmark, one.purpose): one for one in pair.equivalents(alone, NO_GROUPS, 0.95)}
    both = known_both[Landmark.FREE, Purpose.NEWEST_POSE]
    return both.sigma, known[Landmark.FREE][Purpose.NEWEST_POSE]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=80)
    parser.add_argument("--scenes", type=int, nargs="+", default=[6, 12, 28])
    parser.add_argument("--worlds", nargs="+", choices=WORLDS, default=["white", "walk", "both", "detection"])
    parser.add_argument("--shared", type=float, nargs="+", default=[0.0, 0.9])
    parser.add_argument("--population", type=int, default=150)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for name, shared in [(name, shared) for name in given.worlds for shared in given.shared]:
        random = np.random.default_rng([given.seed, list(WORLDS).index(name), round(100 * shared)])
        members = [*population(WORLDS[name], Pair(PLACE, shared), given.population, random)]
        right = float(np.sqrt(np.nanmean([one.square for one in members])))
        print(f"{name}, correlation {shared:g}: right is {right:.4f} px", flush=True)
        for n_scenes in given.scenes:
            chosen = [random.choice(len(members), n_scenes) for _ in range(given.runs)]
            both, alone = zip(*(sigmas([members[place] for place in places]) for places in chosen), strict=True)
            shown = []
            for found in (both, alone):
                low, high, value = (np.array([getattr(one, key) for one in found]) for key in ("low", "high", "value"))
                held, below = np.mean((low <= right) & (right <= high)), np.mean(high < right)
                shown.append(f"{100 * held:5.1f} ({100 * below:.1f}), squares {np.mean(value**2) / right**2:.3f}")
            print(f"  {n_scenes:2} scenes {shown[0]}; of the second alone {shown[1]}", flush=True)


if __name__ == "__main__":
    main()
