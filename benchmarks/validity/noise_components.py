"""Planted components of noise and their intervals.

    python -m benchmarks.validity.noise_components [SEEDS [SCENES [FIRST]]]

For white noise, detection noise, walks and both, with sideways and forward motion: the share of seeds whose 95 %
intervals contain the planted standard deviation, and the mean of the estimates. With fewer than six scenes, blocks of
tracks are resampled.

    python -m benchmarks.validity.noise_components tracks [SEEDS [SCENES [FIRST]]]

The same of the likelihood of whole tracks: with one scale of all tracks, with a scale of each track, and with a scale
of each track and a quality. Scenes of 60 tracks, with forward motion.
"""

import sys
from collections.abc import Mapping

import numpy as np
import polars as pl
from tests.estimators.simulated_tracks import MOTIONS, error_tracks, errors_of, units

from tracknoise.estimators.components import fit_components
from tracknoise.estimators.model import Interval
from tracknoise.estimators.track_likelihood import TrackLaw, with_scales
from tracknoise.estimators.track_scale import law_intervals, sample_of_tracks
from tracknoise.inference.track_noise import NAMES
from tracknoise.inference.units import NO_GROUPS

PLANTED = {
    "white": {"white": 0.3},
    "detection": {"first": 0.3, "white": 0.3},
    "walk": {"walk": 0.1},
    "both": {"white": 0.3, "walk": 0.1},
    "all": {"first": 0.2, "white": 0.2, "walk": 0.08},
}
OF_TRACKS: Mapping[str, tuple[float, float]] = {
    "one scale": (np.inf, 0.0),
    "scales": (3.0, 0.0),
    "and quality": (3.0, -0.8),
}
"""Degrees of freedom, and the power of a texture in the variances of W and Q."""
_SEEDS, _SCENES = 400, 20
_TRACKS = 60


def main(seeds: int = _SEEDS, scenes: int = _SCENES, first: int = 0) -> None:
    for motion in MOTIONS:
        for case, planted in PLANTED.items():
            inside, values = dict.fromkeys(NAMES, 0), {name: [] for name in NAMES}
            for seed in range(first, first + seeds):
                found = fit_components(units(seed, scenes=scenes, motion=motion, **planted), level=0.95).components
                for name in NAMES:
                    sigma, true = found[name].sigma, planted.get(name, 0.0)
                    inside[name] += sigma.low <= true <= sigma.high
                    values[name].append(sigma.value)
            shares = "  ".join(f"{name} {inside[name] / seeds:.3f} ({np.mean(values[name]):.4f} px)" for name in NAMES)
            print(f"{motion:9}{case:10}{shares}", flush=True)


def of_tracks(seeds: int = _SEEDS, scenes: int = _SCENES, first: int = 0) -> None:
    for case, (nu, power) in OF_TRACKS.items():
        planted = {**PLANTED["all"], **({"nu": nu} if np.isfinite(nu) else {})}
        found = [_law(seed, scenes, nu, power) for seed in range(first, first + seeds)]
        shares = (
            f"{name} {np.mean([one[name].low <= true <= one[name].high for one in found]):.3f} "
            f"({np.mean([one[name].value for one in found]):.4f})"
            for name, true in planted.items()
        )
        print(f"{case:12} {'  '.join(shares)}", flush=True)


def _law(seed: int, scenes: int, nu: float, power: float) -> dict[str, Interval]:
    """Intervals of a law of the planted form, with forward motion."""
    random = np.random.default_rng(seed)
    rows = []
    for number in range(scenes):
        texture = np.exp(random.normal(0.0, 0.7, (_TRACKS, 20)))
        tracks = error_tracks(
            random, n_tracks=_TRACKS, factor=texture**power, nu=nu, motion="forward", **PLANTED["all"]
        )
        rows.append(errors_of(f"{number:02}", tracks, texture=texture))
    table = pl.concat(rows)
    sample = sample_of_tracks(table, NO_GROUPS)
    places = [0] if power else []
    start = TrackLaw(powers=(0.0,) * len(places))
    law = sample.fitted(with_scales(start) if np.isfinite(nu) else start, places)
    return law_intervals(sample, law, places, table.filter(age=0), groups=NO_GROUPS, level=0.95)


if __name__ == "__main__":
    arguments = sys.argv[1:]
    of_tracks(*map(int, arguments[1:])) if arguments[:1] == ["tracks"] else main(*map(int, arguments))
