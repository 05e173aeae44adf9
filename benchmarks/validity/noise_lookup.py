"""How often a gain of a table of noise is established that is not there, and how often one that is.

    python -m benchmarks.validity.noise_lookup [--runs N] [--errors N] [--seed N]

Scenes have second moments that differ by chance (the spread), by tracker and by motion. Each run draws the scenes anew
and computes the gain of a table by tracker and motion over one by tracker. Printed are the mean gain over all runs,
which is what the interval should contain, the share of intervals that contain it, and the share of runs in which a gain
is established. Without an effect of motion, the mean gain is negative, as a table by motion rests on fewer scenes.
Where motion changes the second moment by so much that the mean gain is about 0, up to 2.5 % may be established.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl

from tracknoise.estimators.lookup_table import noise_lookup
from tracknoise.inference.units import SceneGroups
from tracknoise.tables.enumerations import Lookup, Product
from tracknoise.tables.schema import NOISE_SUMS

AGES, TRACKERS = (1, 2), {"lk": 0.0, "matching": 1.5}
EFFECTS = (0.0, 0.5, 1.0, 2.0)


@dataclass(frozen=True, slots=True)
class Study:
    """Motions, scenes of each, and the standard deviation of the log second moments of scenes of one motion."""

    motions: int
    scenes: int
    spread: float


STUDIES = (Study(4, 2, 0.3), Study(4, 3, 0.3), Study(4, 4, 0.3), Study(2, 6, 0.3), Study(4, 2, 0.8), Study(4, 4, 0.8))


def sums(study: Study, effect: float, errors: int, rng: np.random.Generator) -> tuple[pl.DataFrame, SceneGroups]:
    """Sums of a run, and its groups: the log second moments of motions are spread evenly over `effect`."""
    shifts = np.linspace(-effect / 2, effect / 2, study.motions)
    rows, names = [], {}
    for place in range(study.motions * study.scenes):
        motion, scene = place % study.motions, f"scene-{place:02}"
        names["made", scene] = f"motion-{motion}"
        level = shifts[motion] + rng.normal(0.0, study.spread)
        for tracker, own in TRACKERS.items():
            for age in AGES:
                size = np.exp(level + own)
                uu, vv = size * rng.chisquare(errors, 2)
                uv = size * np.sqrt(errors) * rng.normal()
                made = {"n": errors, "uu": uu, "uv": uv, "vv": vv}
                rows.append({"scene": scene, "tracker": tracker, "age": age, **made})
    fixed = {"dataset": "made", "lighting": "", "rotation": 0, "direction": "forward", "camera": "", "speed": 1}
    fixed |= {"block": 0, "product": str(Product.error)}
    empty = dict.fromkeys(NOISE_SUMS, None)
    return pl.DataFrame([{**empty, **fixed, **row} for row in rows], schema=dict(NOISE_SUMS)), SceneGroups(names)


def line(study: Study, effect: float, runs: int, errors: int, rng: np.random.Generator) -> str:
    """Mean gain, coverage and share of established gains."""
    found = []
    for _ in range(runs):
        table, groups = sums(study, effect, errors, rng)
        rows = noise_lookup([table], groups=groups).filter(lookup=Lookup.motion, against=Lookup.tracker)
        found.append(rows.select("gain_nats", "low", "high", "established").row(0))
    gain, low, high, established = np.array(found, dtype=np.float64).T
    inside = (low <= gain.mean()) & (gain.mean() <= high)
    return (
        f"{study.motions} motions of {study.scenes} scenes, spread {study.spread:g}, effect {effect:g}: mean gain "
        f"{gain.mean():+.3f} nat, contained in {inside.mean():.3f}, established in {established.mean():.3f}"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--errors", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args(arguments)
    rng = np.random.default_rng(chosen.seed)
    for study in STUDIES:
        for effect in EFFECTS:
            print(line(study, effect, chosen.runs, chosen.errors, rng), flush=True)


if __name__ == "__main__":
    main()
