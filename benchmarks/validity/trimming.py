"""How the size of errors depends on trimming, where the errors of all tracks are alike at every age.

    python -m benchmarks.validity.trimming [--tracks N] [--seed N]

At every age but 0 the errors of all tracks are independent and have the same distribution: a tenth of them are four
times as large as the others. Tracks are born all along sequences of a given length, and lost at a given rate, whatever
their errors are. The true root mean square is therefore the same at any age, for any rate and length. Printed is what
is measured at age 10: untrimmed, as core, and trimmed at the 90th percentile of the largest errors of all tracks
(`all`) or of those that were seen more than once (`followed`).
"""

import argparse
from collections.abc import Sequence

import numpy as np

from benchmarks.validity.simulated import tables_of_tracks
from tracknoise.statistics.moments import scene_moments
from tracknoise.statistics.scales import scales
from tracknoise.statistics.trimming import trim

RMS_PX, AGE, PERCENTILE = 0.332, 10, 90.0
SHARE, RATIO = 0.1, 4.0
"""Of larger errors, and how many times larger they are."""
LOSSES, LENGTHS = (0.02, 0.1, 0.3), (15, 30, 120)
COLUMNS = ("untrimmed", "core", "trimmed: all", "trimmed: followed")


def sizes(loss: float, frames: int, *, n_tracks: int, seed: int) -> dict[str, float]:
    """Size of the errors in u at age 10, px, by the names of `COLUMNS`."""
    rng = np.random.default_rng([seed, frames])
    lives = np.minimum(rng.geometric(loss, n_tracks), frames - rng.integers(0, frames, n_tracks))
    usual_px = RMS_PX / np.sqrt(1 - SHARE + SHARE * RATIO**2)
    sigma_px = usual_px * np.where(rng.random(lives.sum()) < SHARE, RATIO, 1.0)
    errors = sigma_px[:, None] * rng.standard_normal((lives.sum(), 2))
    errors[np.cumsum(lives) - lives] = 0.0
    observations, tracks = tables_of_tracks(errors, lives)
    found = {}
    for among in ("all", "followed"):
        prepared = trim(observations, tracks, percentile=PERCENTILE, among=among).sequence
        moments = scene_moments(prepared.seen).filter(population="visible", at=AGE)
        rms = (moments["m_uu"] / moments["n"] + moments["mean_u"] ** 2).sqrt()
        found |= dict(zip(moments["trimming"].to_list(), rms, strict=True))
        found[f"trimmed: {among}"] = found.pop("trimmed", np.nan)
        core = scales(prepared).filter(population="visible", trimming="untrimmed", at=AGE)["core_u_px"]
        found["core"] = core.item()
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tracks", type=int, default=30_000)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args(arguments)
    print(f"{chosen.tracks} tracks, true rms {RMS_PX} px at every age; at age {AGE}, px")
    print(f"{'loss':>6}{'frames':>8}" + "".join(f"{name:>20}" for name in COLUMNS))
    for loss in LOSSES:
        for frames in LENGTHS:
            found = sizes(loss, frames, n_tracks=chosen.tracks, seed=chosen.seed)
            print(f"{loss:>6}{frames:>8}" + "".join(f"{found[name]:>20.3f}" for name in COLUMNS), flush=True)


if __name__ == "__main__":
    main()
