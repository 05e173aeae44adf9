"""How often verdicts on covariances that a tracker predicts are right.

    python -m benchmarks.validity.own_covariances [--runs N] [--scenes N ...] [--errors N] [--seed N]

Errors have covariances of their own: standard deviations from 0.1 to 1 px, twice as large along one axis as across, in
directions that lie around that of u or anywhere. All are multiplied by a factor of their scene. Predicted is what is
named in each row. Printed is how often size, shape and ranking are answered yes and no, and how often one sigma is
called better, as good or worse.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.analysis.covariance_verdicts import LEAST_GAIN, own_covariances
from tracknoise.statistics.own_covariances import sums_of_covariances
from tracknoise.tables.schema import COVARIANCE_SUMS

Array = NDArray[np.float64]
RATIO = 2.0
"""Of standard deviations along and across."""
SHAPE = 2.5
"""Of the gamma distribution of precisions of heavy tails: Student's t with 5 degrees of freedom."""


def ellipses(variance: Array, angle: Array, ratio: float) -> Array:
    """(n, 3): uu, uv and vv of covariances with these mean variances, and axes at these angles."""
    share = (ratio**2 - 1.0) / (ratio**2 + 1.0)
    along, turned = share * np.cos(2.0 * angle), share * np.sin(2.0 * angle)
    return variance[:, None] * np.stack([1.0 + along, turned, 1.0 - along], axis=1)


Claim = Callable[[Array, Array, np.random.Generator], Array]
CLAIMS: Mapping[str, Claim] = {
    "right": lambda variance, angle, rng: ellipses(variance, angle, RATIO),
    "twice too large": lambda variance, angle, rng: ellipses(2.0 * variance, angle, RATIO),
    "a quarter": lambda variance, angle, rng: ellipses(variance / 4.0, angle, RATIO),
    "circles": lambda variance, angle, rng: ellipses(variance, angle, 1.0),
    "turned by 90 degrees": lambda variance, angle, rng: ellipses(variance, angle + np.pi / 2.0, RATIO),
    "turned by 45 degrees": lambda variance, angle, rng: ellipses(variance, angle + np.pi / 4.0, RATIO),
    "all of the mean size": lambda variance, angle, rng: ellipses(
        np.full_like(variance, variance.mean()), angle, RATIO
    ),
    "of other errors": lambda variance, angle, rng: ellipses(rng.permutation(variance), angle, RATIO),
    "one circle": lambda variance, angle, rng: ellipses(np.full_like(variance, variance.mean()), angle, 1.0),
}
"""What is predicted."""
COLUMNS = ("size", "shape", "ranking")
ONE_SIGMA = ("better", "as good", "worse")


def sums(
    rng: np.random.Generator, scene: int, claim: Claim, *, spread: float, heavy: bool, scattered: bool, n_errors: int
) -> dict[str, object]:
    """A row of `COVARIANCE_SUMS` of one scene; `spread`: standard deviation of the logarithm of its variance."""
    variance = np.exp(rng.uniform(np.log(0.01), 0.0, n_errors))
    angle = rng.uniform(0.0, np.pi, n_errors) if scattered else 0.2 * rng.standard_normal(n_errors)
    uu, uv, vv = ellipses(variance, angle, RATIO).T
    first, second = rng.standard_normal((2, n_errors))
    error = np.stack([np.sqrt(uu) * first, uv / np.sqrt(uu) * first + np.sqrt(vv - uv**2 / uu) * second], axis=1)
    error *= np.exp(0.5 * spread * rng.standard_normal())
    if heavy:
        error /= np.sqrt(rng.gamma(SHAPE, 1.0 / SHAPE, (n_errors, 1))) * np.sqrt(SHAPE / (SHAPE - 1.0))
    predicted = claim(variance, angle, rng)
    row: dict[str, object] = {"dataset": "planted", "scene": f"{scene:02}", "lighting": "default", "rotation": 0}
    row |= {"direction": "forward", "camera": "", "tracker": "tracker", "speed": 1, "block": 0, "covariance": "cov"}
    return row | {"trimming": "untrimmed", "axis": "age", "impossible": 0.0, **sums_of_covariances(predicted, error)}


def answers(rows: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Verdicts by name, and what is said of one sigma."""
    names = {"size": "nees", "shape": "shape", "ranking": "ranking"}
    found = {name: str(rows[quantity]["verdict"]) for name, quantity in names.items()}
    gain = rows["gain"]
    said = {"yes": "worse", "no": "better" if gain["high"] < -LEAST_GAIN else "as good"}
    return {**found, "one sigma": said.get(gain["verdict"], "undecided")}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--scenes", type=int, nargs="+", default=[8, 28])
    parser.add_argument("--errors", type=int, default=600)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    heads = [*(f"{name}: yes no" for name in COLUMNS), "one sigma: better, as good, worse"]
    for scattered in (False, True):
        for heavy in (False, True):
            for n_scenes in given.scenes:
                tails, axes = (
                    "Student's errors" if heavy else "Gaussian errors",
                    "anywhere" if scattered else "around u",
                )
                print(f"\n{n_scenes} scenes, {tails}, axes {axes}: " + "; ".join(heads))
                for name, claim in CLAIMS.items():
                    rng, counts = np.random.default_rng(given.seed), Counter[tuple[str, str]]()
                    for _ in range(given.runs):
                        rows = [
                            sums(rng, scene, claim, spread=0.2, heavy=heavy, scattered=scattered, n_errors=given.errors)
                            for scene in range(n_scenes)
                        ]
                        table = own_covariances([pl.DataFrame(rows, schema=dict(COVARIANCE_SUMS))])
                        counts.update(answers({row["quantity"]: row for row in table.to_dicts()}).items())
                    asked = [[(one, "yes"), (one, "no")] for one in COLUMNS] + [
                        [("one sigma", one) for one in ONE_SIGMA]
                    ]
                    told = (" ".join(f"{100.0 * counts[key] / given.runs:4.0f}" for key in keys) for keys in asked)
                    print(f"{name:<22}" + " | ".join(told), flush=True)


if __name__ == "__main__":
    main()
