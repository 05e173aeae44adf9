"""How often the interval of the offset between clocks holds the true one.

    python -m benchmarks.validity.clock [--runs N] [--recordings N] [--seed N]

Printed are the mean error of the offset, frames, its standard deviation over the runs and the median of the stated
one, and how often offset +- 1.96 standard deviations holds the true offset. `known` is how often the standard
deviation is at most 0.25 frames, without which the check states none; only these count. `agree` is how often both
halves of a recording agree: their difference is at most 1.96 standard deviations.

Rotation rates are those of three motions: `shaken` (0.5 to 4 Hz at 30 frames per second), `slow` (0.2 to 1 Hz) and
`one axis`, where two axes turn a tenth as fast. The rate from images has noise that is independent, or correlated
from step to step (0.7). `lags` are offsets that every axis has of its own (standard deviation 0.1 frames), as
recordings have.

The second table has recordings of 100 frames (`--recordings` of each kind): positions of features with depths, from
which the check estimates the rates itself. Poses are 0.3 frames late. Features are `exact`, or err by 0.5 px,
correlated from frame to frame (0.8) in all other kinds. `depth` has depths that are 10 % too long, `readout` a
rolling shutter that reads for 0.9 frames, `mounting` poses of a sensor that is turned by 2 degrees and 25 mm away.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from tracknoise.geometry.cameras import Camera
from tracknoise.geometry.pose import invert, transform
from tracknoise.truth_faults.clock_check import MOST_SD_FRAMES, ClockOffset, Rates, estimate_offset, measured_offset
from tracknoise.truth_faults.image_evidence import Evidence, Flow, Pair

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


@dataclass(frozen=True)
class Kind:
    """What is wrong with a recording."""

    noise_px: float = 0.5
    depth: float = 1.0
    readout: float = 0.0
    mounting: tuple[float, ...] = (0.0,) * 6
    """Rotation vector, radians, and position, metres."""


KINDS = {
    "exact": Kind(noise_px=0.0),
    "noise": Kind(),
    "depth": Kind(depth=1.1),
    "readout": Kind(readout=0.9),
    "mounting": Kind(mounting=(0.02, 0.015, 0.02, 0.025, 0.0, 0.0)),
}
_CAMERA = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)
_FRAMES, _LATE_FRAMES, _POINTS, _FOLLOWED, _OF_FEATURES = 100, 0.3, 3000, 150, 0.8


def recording(rng: np.random.Generator, kind: Kind) -> Evidence:
    """Features of a camera that is shaken (0.4 to 2.5 Hz), and poses that are late."""
    waves, phases = rng.uniform(0.4, 2.5, (5, 6)) * 2 * np.pi / _FRAMES_PER_S, rng.uniform(0, 2 * np.pi, (5, 6))
    sizes = rng.uniform(0.5, 1.5, (5, 6)) * np.repeat([0.02, 0.03], 3)

    def poses(times: np.ndarray) -> np.ndarray:
        motion = (sizes * np.sin(waves * times[:, None, None] + phases)).sum(axis=1)
        found = np.tile(np.eye(4), (len(times), 1, 1))
        found[:, :3, :3], found[:, :3, 3] = Rotation.from_rotvec(motion[:, :3]).as_matrix(), motion[:, 3:]
        return found

    points = rng.uniform([-3.0, -2.5, 1.5], [3.0, 2.5, 4.0], (_POINTS, 3))
    error = kind.noise_px * rng.standard_normal((_POINTS, 2))
    steps: list[Pair] = []
    before: tuple[np.ndarray, np.ndarray] | None = None
    for frame in range(_FRAMES):
        row = np.full(_POINTS, (_CAMERA.height - 1) / 2)
        for _ in range(3 if kind.readout else 1):
            seen_from = poses(frame + kind.readout * (row / _CAMERA.height - 0.5))
            local = transform(invert(seen_from), points)
            uv = _CAMERA.project(local)
            row = np.nan_to_num(uv[:, 1], nan=(_CAMERA.height - 1) / 2)
        error = _OF_FEATURES * error + np.sqrt(1 - _OF_FEATURES**2) * kind.noise_px * rng.standard_normal(error.shape)
        now = np.where(_CAMERA.contains(uv)[:, None], uv + error, np.nan), kind.depth * local[:, 2]
        if before is not None:
            both = rng.permutation(np.flatnonzero(np.isfinite(before[0] + now[0]).all(axis=1)))[:_FOLLOWED]
            steps.append(Pair(frame - 1, frame, before[0][both], now[0][both], before[1][both], now[1][both]))
        before = now
    mounted = poses(np.zeros(1))[0]
    mounted[:3, :3], mounted[:3, 3] = Rotation.from_rotvec(kind.mounting[:3]).as_matrix(), kind.mounting[3:]
    return Evidence.of(Flow(tuple(steps), ()), poses(np.arange(_FRAMES) - _LATE_FRAMES) @ mounted, _CAMERA)


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
    parser.add_argument("--recordings", type=int, default=20)
    arguments = parser.parse_args()
    columns = ("known", "error", "sd", "stated", "covers", "agree")
    print(
        f"{'motion':<10}{'steps':>6}{'offset':>8}  {'noise':<12}{'lags':<6}" + "".join(f"{one:>8}" for one in columns)
    )
    for place, (motion, steps, offset, correlated, lags) in enumerate(_WORLDS if arguments.runs else ()):
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
        numbers = _summary(errors, stated, arguments.runs)
        noise = "correlated" if correlated else "independent"
        start = f"{motion:<10}{steps:>6}{offset:>8.1f}  {noise:<12}{'yes' if lags else 'no':<6}"
        shares = [*numbers, np.mean(agree) if agree else np.nan]
        print(start + "".join(f"{number:>8.3f}" for number in shares), flush=True)
    for place, (name, kind) in enumerate(KINDS.items() if arguments.recordings else ()):
        rng = np.random.default_rng([arguments.seed, 1, place])
        every = [measured_offset(recording(rng, kind)) for _ in range(arguments.recordings)]
        known = [one for one in every if is_known(one)]
        numbers = _summary([one.frames - _LATE_FRAMES for one in known], [one.sd_frames for one in known], len(every))
        print(f"{name:<44}" + "".join(f"{number:>8.3f}" for number in numbers), flush=True)


def _summary(errors: Sequence[float], stated: Sequence[float], runs: int) -> tuple[float, ...]:
    """The columns but the last."""
    covers = np.mean(np.abs(errors) <= 1.96 * np.array(stated))
    return len(errors) / runs, np.mean(errors), np.std(errors), np.median(stated), covers


if __name__ == "__main__":
    main()
