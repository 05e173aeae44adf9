"""What each covariate gains in the noise models of a run: python -m benchmarks.validity.noise_conditions RUN."""

import sys
from pathlib import Path

from tracknoise.analysis.condition_units import units_of
from tracknoise.estimators.components import COLUMNS, fit_components
from tracknoise.estimators.model import Factor
from tracknoise.estimators.run_time_conditions import candidates, conditions_of, second_candidates
from tracknoise.estimators.training import conditions, training_tables
from tracknoise.inference.conventions import LEVEL
from tracknoise.tables.store import RunFolder


def main(run: str) -> None:
    folder = RunFolder(Path(run))
    for tracker, speed in conditions(folder):
        read = training_tables(folder, tracker=tracker, speed=speed)
        sums = read["noise_sums"]
        units = units_of(sums.drop("block"), sums, points=["product", "age"], columns=COLUMNS, groups=read.groups)
        fitted = fit_components(units, level=LEVEL)
        single, pairs = read["noise_covariates"], read["noise_pairs"]
        for factor in candidates(single, fitted, groups=read.groups, level=LEVEL):
            print(f"{tracker} {speed} {factor.of}: {_text(factor)}")
        for first in conditions_of(single, pairs, fitted, groups=read.groups, level=LEVEL)[:1]:
            for _, second in second_candidates(pairs, first, fitted, groups=read.groups, level=LEVEL):
                print(f"{tracker} {speed} {second.of} beyond {first.of}: {_text(second)}")


def _text(factor: Factor) -> str:
    gain = factor.gain
    return f"{gain.value:.4f} ({gain.low:.4f} to {gain.high:.4f}) nat per change"


if __name__ == "__main__":
    main(sys.argv[1])
