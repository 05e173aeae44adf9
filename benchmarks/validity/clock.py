"""How often the interval of the offset between clocks holds the true one.

    python -m benchmarks.validity.clock [--runs N] [--seed N]

Printed are the mean error of the offset, frames, its standard deviation over the runs and the median of the stated one,
and how often offset +- 1.96 standard deviations holds the true offset. `known` is how often the standard deviation is
at most 0.25 frames, without which the check states none; only these count. `agree` is how often both halves of a
recording agree: their difference is at most 1.96 standard deviations.

Rotation rates are those of three motions: `shaken` (0.5 to 4 Hz at 30 frames per second), `slow` (0.2 to 1 Hz) and `one
axis`, where two axes turn a tenth as fast. The rate from images has noise that is independent, or correlated from step
to step (0.7). `lags` are offsets that every axis has of its own (standard deviation 0.1 frames), as recordings have.
"""

import argparse
from itertools import product

import numpy as np
from scipy.signal import lfilter

from tracknoise.truth_faults.clock_check import MOST_SD_FRAMES, ClockOffset, Rates, estimate_offset

_HERTZ = {"shaken": (0.5, 4.0), "slow": (0.2, 1.0), "one axis": (0.5, 4.0)}
_FRAMES_PER_S, _WAVES = 30.0, 6
_RATE, _NOISE = 0.004, 0.001
"""Standard deviations of the rates and of their noise, radians per frame: 2 and 0.5 px at a focal length of 525 px."""
_CORRELATION, _LAG_FRAMES = 0.7, 0.1
_WORLDS = [
    *product(_HERTZ, (119,), (0.3,), (False, True), (False, True)),
    *product(("shaken",), (49,), (0.3,), (True,), (False, True)),
    ("shaken", 119, 0.0, True, True),
]
"""Motion, steps, offset, whether noise is correlated, and whether axes have lags."""


def rates(rng: np.random.Generator, motion: str, steps: int, offset: float, *, correlated: bool, lags: bool) -> Rates:
    """Rates of one recording whose poses are an offset late."""
    waves = rng.uniform(*_HERTZ[motion], (_WAVES, 3)) * 2 * np.pi / _FRAMES_PER_S
    phases, sizes = rng.uniform(0, 2 * np.pi, (_WAVES, 3)), rng.uniform(0.5, 1.5, (_WAVES, 3)) * _RATE
    sizes *= np.where(motion == "one axis", [0.1, 1.0, 0.1], 1.0) / np.sqrt(_WAVES / 2)
    at = np.arange(steps, dtype=np.float64)
    late = offset + (_LAG_FRAMES * rng.standard_normal(3) if lags else np.zeros(3))
    noise = _NOISE * rng.standard_normal((steps + 50, 3))
    if correlated:
        noise = np.sqrt(1 - _CORRELATION**2) * lfilter([1.0], [1.0, -_CORRELATION], noise, axis=0)

    def rate(times: np.ndarray) -> np.ndarray:
        return np.asarray((sizes * np.sin(waves * times[:, None, :] + phases)).sum(axis=1))

    every = np.broadcast_to(at[:, None], (steps, 3))
    by_poses = np.stack([rate(every[:, [axis]] - late[axis])[:, axis] for axis in range(3)], axis=1)
    return Rates(at, rate(every) + noise[50:], by_poses)


def part(of: Rates, chosen: slice) -> Rates:
    """Some of the steps."""
    return Rates(of.steps[chosen], of.by_image[chosen], of.by_poses[chosen])


def is_known(found: ClockOffset | None) -> bool:
    """Whether the check states the offset."""
    return found is not None and found.sd_frames <= MOST_SD_FRAMES


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    columns = ("known", "error", "sd", "stated", "covers", "agree")
    print(
        f"{'motion':<10}{'steps':>6}{'offset':>8}  {'noise':<12}{'lags':<6}" + "".join(f"{one:>8}" for one in columns)
    )
    for place, (motion, steps, offset, correlated, lags) in enumerate(_WORLDS):
        rng = np.random.default_rng([arguments.seed, place])
        errors, stated, agree = [], [], []
        for _ in range(arguments.runs):
            made = rates(rng, motion, steps, offset, correlated=correlated, lags=lags)
            found = estimate_offset(made)
            if is_known(found):
                errors.append(found.frames - offset)
                stated.append(found.sd_frames)
            halves = [estimate_offset(part(made, chosen)) for chosen in (slice(steps // 2), slice(steps // 2, None))]
            if all(map(is_known, halves)):
                apart = halves[0].frames - halves[1].frames
                agree.append(abs(apart) <= 1.96 * np.hypot(halves[0].sd_frames, halves[1].sd_frames))
        covers = np.mean(np.abs(errors) <= 1.96 * np.array(stated))
        numbers = (len(errors) / arguments.runs, np.mean(errors), np.std(errors), np.median(stated), covers)
        noise = "correlated" if correlated else "independent"
        start = f"{motion:<10}{steps:>6}{offset:>8.1f}  {noise:<12}{'yes' if lags else 'no':<6}"
        shares = [*numbers, np.mean(agree) if agree else np.nan]
        print(start + "".join(f"{number:>8.3f}" for number in shares), flush=True)


if __name__ == "__main__":
    main()
