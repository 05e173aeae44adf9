"""How often the tests of a zero mean reject one that is true, and one that is not.

    python -m benchmarks.validity.zero_mean [--scenes 8 11 28 60] [--runs N] [--seed N]

Scene means walk at random from age to age, so that ages depend on each other, and differ between scenes by far more
than the features of a scene do: by a Gaussian, by Student's distribution of 3 degrees of freedom, or by a skewed one (a
centred chi-squared of 4 degrees of freedom). Printed are the shares of runs that reject a true zero at 5 %: at one age
by Hotelling's test and by flips, all ages together (which is any age after adjustment by the flips), any age after
Holm's adjustment, and by the test that takes every feature for independent. Then the power at one age, beside that of
theory, the non-central F distribution.

Then six conditions of the same scenes are asked at once, whose scene means have a correlation of 0.7: how often any of
them is called different from zero, with the p-value of each condition alone, and with that of the family. Last come
scenes in groups, whose means have a correlation of 0.8: with every scene taken for independent, and with the groups
given.
How often the bounds of the mean at one age hold the true means of both coordinates is printed at the end.
"""

import argparse

import numpy as np
from scipy import stats

from tracknoise.analysis.zero_mean import ALPHA, mean_bounds
from tracknoise.inference.multiple_tests import holm
from tracknoise.inference.sign_flips import Chance, family_p, flip_test
from tracknoise.inference.units import MIN_SCENES

AGES, FEATURES = 20, 200
SCENE_PX, FEATURE_PX = 0.3, 1.0
"""Standard deviations of scene means and of features within a scene."""
CONDITIONS = 6
GROUPS = ((4, 2), (4, 4), (8, 2), (12, 3))
SHAPES = ("Gaussian", "Student, 3", "skewed")


def steps(rng: np.random.Generator, shape: str, size: tuple[int, ...]) -> np.ndarray:
    """Changes of scene means with mean 0 and standard deviation 1."""
    if shape == "Gaussian":
        return rng.normal(size=size)
    return rng.standard_t(3, size) / np.sqrt(3) if shape == "Student, 3" else (rng.chisquare(4, size) - 4) / np.sqrt(8)


def scene_means(rng: np.random.Generator, shape: str, n_scenes: int) -> np.ndarray:
    """Scene means at every age, px, (scenes, ages, 2)."""
    walk = steps(rng, shape, (n_scenes, AGES, 2)).cumsum(axis=1) / np.sqrt(np.arange(1, AGES + 1))[:, None]
    return SCENE_PX * walk + FEATURE_PX / np.sqrt(FEATURES) * rng.normal(size=walk.shape)


def level(rng: np.random.Generator, shape: str, n_scenes: int, runs: int) -> dict[str, float]:
    """Share of runs in which each test rejects a true zero."""
    rejected = np.zeros(5)
    for run in range(runs):
        means = scene_means(rng, shape, n_scenes)
        found = flip_test(means, seed=run)
        by_holm = np.min(holm(found.sign_flip_p))
        p = [found.hotelling_p[-1], found.sign_flip_p[-1], found.overall_p, by_holm, _iid_p(means[:, -1])]
        rejected += np.array(p) <= ALPHA
    names = ("Hotelling, one age", "flips, one age", "flips, all ages", "flips, any age by Holm", "features, one age")
    return dict(zip(names, rejected / runs, strict=True))


def _iid_p(means: np.ndarray) -> float:
    """P-value of a test that takes every feature of every scene for independent."""
    n = len(means) * FEATURES
    covariance = np.cov(means.T) + FEATURE_PX**2 * np.eye(2)
    middle = means.mean(axis=0)
    t2 = n * middle @ np.linalg.solve(covariance, middle)
    return float(stats.f.sf(t2 * (n - 2) / (2 * (n - 1)), 2, n - 2))


def six_conditions(rng: np.random.Generator, shape: str, n_scenes: int, runs: int) -> tuple[float, float]:
    """Share of runs in which any of six conditions is rejected: each alone, and as a family."""
    rejected = np.zeros(2)
    for run in range(runs):
        chance = Chance.of([str(scene) for scene in range(n_scenes)], seed=run)
        common = scene_means(rng, shape, n_scenes)
        each = [np.sqrt(0.7) * common + np.sqrt(0.3) * scene_means(rng, shape, n_scenes) for _ in range(CONDITIONS)]
        found = [flip_test(means, chance=chance) for means in each]
        rejected += [min(test.overall_p for test in found) <= ALPHA, np.min(family_p(found)) <= ALPHA]
    return tuple(rejected / runs)


def in_groups(rng: np.random.Generator, groups: int, each: int, runs: int) -> tuple[float, float]:
    """Share of runs that reject a true zero: scenes taken for independent, and with groups given.

    With too few groups their true means are fixed, and zero on average over these groups.
    """
    group = np.repeat(np.arange(groups), each)
    rejected = np.zeros(2)
    for run in range(runs):
        own = np.sqrt(0.8) * scene_means(rng, "Gaussian", groups)
        centred = own - own.mean(axis=0) if groups < MIN_SCENES else own
        means = centred[group] + np.sqrt(0.2) * scene_means(rng, "Gaussian", len(group))
        names = [str(scene) for scene in range(len(group))]
        tests = [flip_test(means, seed=run), flip_test(means, chance=Chance.of(names, group, seed=run))]
        rejected += [test.overall_p <= ALPHA for test in tests]
    return tuple(rejected / runs)


def held(rng: np.random.Generator, shape: str, n_scenes: int, bias: float, runs: int) -> float:
    """Share of runs in which the bounds at one age hold the true means of u and of v, with a bias in u."""
    chance = Chance.of([str(scene) for scene in range(n_scenes)])
    true, both = np.array([bias, 0.0]), 0
    for _ in range(runs):
        bounds = mean_bounds((true + steps(rng, shape, (n_scenes, 2)))[:, None], chance)
        low, high = (np.array([bounds[f"mean_{axis}_{end}_px"][0] for axis in "uv"]) for end in ("low", "high"))
        both += bool(((low <= true) & (true <= high)).all())
    return both / runs


def power(rng: np.random.Generator, n_scenes: int, bias: float, runs: int) -> tuple[float, float, float]:
    """Of Hotelling's test, of flips and of theory, with a bias in standard deviations of scene means."""
    batches = -(-runs // 500)  # runs stand in the place of ages
    found = [flip_test(rng.normal(size=(n_scenes, 500, 2)) + bias * np.sqrt([0.36, 0.64])) for _ in range(batches)]
    rejected = [
        float(np.mean([getattr(t, f"{name}_p") <= ALPHA for t in found])) for name in ("hotelling", "sign_flip")
    ]
    least = stats.f.ppf(1 - ALPHA, 2, n_scenes - 2)
    theory = float(stats.ncf.sf(least, 2, n_scenes - 2, n_scenes * bias**2))
    return rejected[0], rejected[1], theory


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, nargs="+", default=[6, 8, 11, 28, 60])
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    print(f"rejected of {arguments.runs} true zeros at {ALPHA:.0%}")
    for n_scenes in arguments.scenes:
        for shape in SHAPES:
            shares = level(rng, shape, n_scenes, arguments.runs)
            print(
                f"{n_scenes:>4} scenes, {shape:<11}",
                *(f"{k} {v:.1%}" for k, v in shares.items()),
                sep="   ",
                flush=True,
            )
    print("power at one age: Hotelling, flips, theory (standard error)")
    for n_scenes in arguments.scenes:
        for bias in (0.3, 0.6):
            hotelling, flips, theory = power(rng, n_scenes, bias, 2 * arguments.runs)
            error = np.sqrt(theory * (1 - theory) / (2 * arguments.runs))
            print(f"{n_scenes:>4} scenes, {bias} sd   {hotelling:.1%}   {flips:.1%}   {theory:.1%} ({error:.1%})")
    runs = arguments.runs // 4
    print(f"\nany of {CONDITIONS} conditions rejected, {runs} runs: each alone, as a family")
    for n_scenes in arguments.scenes:
        for shape in SHAPES:
            alone, family = six_conditions(rng, shape, n_scenes, runs)
            print(f"{n_scenes:>4} scenes, {shape:<11}   {alone:.1%}   {family:.1%}", flush=True)
    print(f"\nscenes in groups, {runs} runs: taken for independent, with groups")
    for groups, each in GROUPS:
        independent, grouped = in_groups(rng, groups, each, runs)
        print(f"{groups:>4} groups of {each}   {independent:.1%}   {grouped:.1%}", flush=True)
    print(f"\nbounds at one age that hold the true means of u and v, {runs} runs: no bias, one of 3 sd")
    rng = np.random.default_rng([arguments.seed, 1])
    for n_scenes in arguments.scenes:
        for shape in SHAPES:
            none, large = (held(rng, shape, n_scenes, bias, runs) for bias in (0.0, 3.0))
            print(f"{n_scenes:>4} scenes, {shape:<11}   {none:.1%}   {large:.1%}", flush=True)


if __name__ == "__main__":
    main()
