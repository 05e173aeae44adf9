"""Planted components of noise and their intervals.

    python -m benchmarks.validity.noise_components [SEEDS [SCENES [FIRST]]]

For white noise, detection noise, walks and both, with sideways and forward motion: the share of seeds whose 95 %
intervals contain the planted standard deviation, and the mean of the estimates. With fewer than six scenes, blocks of
tracks are resampled.
"""

import sys

import numpy as np
from tests.estimators.simulated_tracks import MOTIONS, units

from tracknoise.estimators.components import NAMES, fit_components

PLANTED = {
    "white": {"white": 0.3},
    "detection": {"first": 0.3, "white": 0.3},
    "walk": {"walk": 0.1},
    "both": {"white": 0.3, "walk": 0.1},
    "all": {"first": 0.2, "white": 0.2, "walk": 0.08},
}
_SEEDS, _SCENES = 400, 20


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


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
