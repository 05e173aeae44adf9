"""Whether the share of errors that the features of a frame have in common is within its interval.

    python -m benchmarks.validity.common_share [RUNS [SCENES [FEATURES]]]

Tracks of random points of a camera in the hand, with white noise of .5 px. The stated poses are turned by white angles
or by the steps of a walk, which moves all features of a frame, by a share of about 0, 2 and 5 % of the second moment.
The true share is that of all runs together, with the images of the true points by both poses. Prints it, the mean of
what is found, and how many 95 % intervals hold the true one.
"""

import sys
from collections.abc import Sequence

import numpy as np
import polars as pl

from benchmarks.validity.rigid import CAMERA, NOISE_PX, Seen, by_hand, observed, pose_noise, prepared, tables
from tracknoise.estimators.errors_in_common import CommonErrors
from tracknoise.inference.units import NO_GROUPS
from tracknoise.tables.enumerations import FittedTo

_FRAMES = 40
_DEG = np.rad2deg(NOISE_PX / CAMERA.fx)
KINDS = {
    "none": ("white", 0.0),
    "white, 2 %": ("white", _DEG * 0.1),
    "white, 5 %": ("white", _DEG * 0.16),
    "walk, 2 %": ("walk", _DEG * 0.056),
    "walk, 5 %": ("walk", _DEG * 0.09),
}
"""Law of the errors of poses, and their size, degrees in each frame."""
_SUMS = ("n", "common", "squares")


def scene(kind: str, features: int, seed: int) -> tuple[pl.DataFrame, pl.DataFrame, pl.DataFrame]:
    """Tables of errors in common and of squares of errors, and true sums by age."""
    law, degrees = KINDS[kind]
    random = np.random.default_rng(seed)
    poses = by_hand(_FRAMES)
    stated = poses @ pose_noise(law, degrees, 0.0, _FRAMES, random)
    seen = observed(poses, random, features=features)
    rigid = tables([seen], stated)["rigid"].filter(fitted_to=FittedTo.own)
    errors = prepared([seen], stated).observations.filter(pl.col("age") > 0, pl.col("du_px").is_not_null())
    squares = errors.group_by("age").agg(
        n=pl.len().cast(pl.Int64), uu=pl.col("du_px").pow(2).sum(), vv=pl.col("dv_px").pow(2).sum()
    )
    name = f"{seed:06}"
    label = {"dataset": pl.lit("made"), "scene": pl.lit(name)}
    sums = squares.with_columns(**label, product=pl.lit("error"), block=pl.lit(0, pl.UInt8))
    return rigid.with_columns(scene=pl.lit(name)), sums, _true_sums(seen, poses, stated)


def _true_sums(seen: Seen, poses: np.ndarray, stated: np.ndarray) -> pl.DataFrame:
    moved = np.square(seen.true_uv(stated) - seen.true_uv(poses)).sum(axis=1)
    table = pl.DataFrame({"age": seen.frame - seen.first, "common": moved}).filter(pl.col("age") > 0)
    return table.group_by("age").agg(n=pl.len().cast(pl.Int64), common=pl.col("common").sum())


def true_share(truths: Sequence[pl.DataFrame], found: Sequence[pl.DataFrame]) -> float:
    """That of all runs together, over ages as often as they are predicted."""
    of_age = pl.concat(truths).group_by("age").agg(pl.col("n", "common").sum())
    predicted = pl.concat(found).group_by(pl.col("age").cast(pl.Int64)).agg(predictions=pl.col("n").sum())
    rows = of_age.join(predicted, on="age").with_columns(mean=pl.col("common") / pl.col("n"))
    common = (rows["mean"] * rows["predictions"]).sum()
    return float(common / (common + 2.0 * NOISE_PX**2 * rows["predictions"].sum()))


def main(runs: int = 60, scenes: int = 8, features: int = 60) -> None:
    for number, kind in enumerate(KINDS):
        made = [
            [scene(kind, features, 10_000_000 * number + 1000 * run + one) for one in range(scenes)]
            for run in range(runs)
        ]
        pairs = [
            tuple(pl.concat(parts) for parts in zip(*((one[0], one[1]) for one in own), strict=True)) for own in made
        ]
        found = [CommonErrors.of(*pair, groups=NO_GROUPS, level=0.95) for pair in pairs]
        shares = [one.share for one in found if one is not None]
        true = true_share([one[2] for own in made for one in own], [rigid for rigid, _ in pairs])
        held = np.mean([(one.low or 0.0) <= true <= (one.high or 1.0) for one in shares])
        mean = np.mean([one.value for one in shares])
        print(f"{kind:12} true {100 * true:6.2f} %  mean {100 * mean:6.2f} %  held {100 * held:5.1f} %", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
