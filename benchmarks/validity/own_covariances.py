"""How often verdicts on covariances that a tracker predicts are right.

    python -m benchmarks.validity.own_covariances [--runs N] [--scenes N] [--seed N]

Errors have variances of their own, from 0.01 to 1 px^2 along each axis, times one of their scene. Predicted are these
variances, a quarter of them, those of other errors, the mean for all, or what is 1.3 times too small in sigma. Printed
is how often `right` and `of use` are answered yes and no, and how often the interval of NEES holds the true factor.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Mapping

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.covariance_verdicts import own_covariances
from tracknoise.statistics.own_covariances import LEVELS
from tracknoise.tables.schema import COVARIANCE_SUMS

Array = NDArray[np.float64]
ERRORS = 600
LEAST, MOST = 0.01, 1.0
MEAN = (MOST - LEAST) / np.log(MOST / LEAST)
SHAPE = 2.5
"""Of the gamma distribution of precisions of heavy tails: Student's t with 5 degrees of freedom."""
Claim = Callable[[Array, np.random.Generator], Array]
CLAIMS: Mapping[str, tuple[Claim, float | None]] = {
    "right": (lambda variance, rng: variance, 1.0),
    "a quarter": (lambda variance, rng: variance / 4.0, 4.0),
    "of other errors": (lambda variance, rng: rng.permutation(variance), None),
    "the mean for all": (lambda variance, rng: np.full_like(variance, MEAN), 1.0),
    "sigma / 1.3": (lambda variance, rng: variance / 1.69, 1.69),
}
"""What is predicted, and the factor that would make it right; None where it is not known."""
COLUMNS = ("right: yes", "right: no", "of use: yes", "of use: no", "factor held")


def sums(rng: np.random.Generator, scene: int, claim: Claim, spread: float, *, heavy: bool) -> dict[str, object]:
    """A row of `COVARIANCE_SUMS` of one scene; `spread`: standard deviation of the logarithm of its variance."""
    variance = np.exp(rng.uniform(np.log(LEAST), np.log(MOST), (ERRORS, 2)))
    error = rng.standard_normal((ERRORS, 2)) * np.sqrt(variance * np.exp(spread * rng.standard_normal()))
    if heavy:
        error /= np.sqrt(rng.gamma(SHAPE, 1.0 / SHAPE, (ERRORS, 1))) * np.sqrt(SHAPE / (SHAPE - 1.0))
    predicted = claim(variance, rng)
    squared = np.sum(error**2 / predicted, axis=1)
    row: dict[str, object] = {"dataset": "planted", "scene": f"{scene:02}", "lighting": "default", "rotation": 0}
    row |= {"direction": "forward", "camera": "", "tracker": "tracker", "speed": 1, "block": 0, "covariance": "cov"}
    row |= {"trimming": "untrimmed", "axis": "age", "n": ERRORS, "impossible": 0.0, "px2": np.sum(error**2)}
    row |= {f"inside_{100 * level:.0f}": float(np.sum(squared <= -2.0 * np.log1p(-level))) for level in LEVELS}
    return row | {"squares": squared.sum(), "log_det": np.log(predicted).sum()}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--scenes", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    print(f"{'predicted':<18}{'scenes':<8}{'tails':<7}" + "".join(f"{name:>14}" for name in COLUMNS))
    for spread in (0.0, 0.2):
        for heavy in (False, True):
            for name, (claim, factor) in CLAIMS.items():
                right, use, held = Counter[str](), Counter[str](), []
                for _ in range(given.runs):
                    rows = [sums(rng, scene, claim, spread, heavy=heavy) for scene in range(given.scenes)]
                    table = own_covariances([pl.DataFrame(rows, schema=dict(COVARIANCE_SUMS))])
                    found = {row["quantity"]: row for row in table.to_dicts()}
                    nees = found["nees"]
                    right[nees["verdict"]] += 1
                    use[found["gain"]["verdict"]] += 1
                    true = None if factor is None else factor * np.exp(spread**2 / 2.0)
                    held.append(np.nan if true is None else float(nees["low"] <= true <= nees["high"]))
                counts = [right["yes"], right["no"], use["yes"], use["no"]]
                shares = [*(count / given.runs for count in counts), np.mean(held)]
                told = "".join(f"{share:>14.3f}" for share in shares)
                kind = "alike" if spread == 0.0 else "differ"
                print(f"{name:<18}{kind:<8}{'t5' if heavy else '':<7}{told}", flush=True)


if __name__ == "__main__":
    main()
