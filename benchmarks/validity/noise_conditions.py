"""What each covariate gains in the noise models of a run: python -m benchmarks.validity.noise_conditions RUN."""

import sys
from pathlib import Path

from tracknoise.findings.sampling.units import units_of
from tracknoise.noise_models.fitting.components import fit_components
from tracknoise.noise_models.fitting.conditions import candidates
from tracknoise.noise_models.fitting.equations import COLUMNS
from tracknoise.noise_models.fitting.training_tables import conditions, training_tables
from tracknoise.tables.defaults import LEVEL
from tracknoise.tables.store import RunFolder


def main(run: str) -> None:
    folder = RunFolder(Path(run))
    for tracker, speed in conditions(folder):
        read = training_tables(folder, tracker=tracker, speed=speed)
        sums = read["noise_sums"]
        units = units_of(sums.drop("block"), sums, points=["product", "age"], columns=COLUMNS, groups=read.groups)
        fitted = fit_components(units, level=LEVEL)
        for factor in candidates(read["noise_covariates"], fitted, level=LEVEL):
            gain = factor.gain
            print(f"{tracker} {speed} {factor.of}: {gain.value:.4f} ({gain.low:.4f} to {gain.high:.4f}) nat per change")


if __name__ == "__main__":
    main(sys.argv[1])
