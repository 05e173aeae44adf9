"""From measurements in memory to their findings, by the code that makes those of a run."""

import shutil
import tempfile
import weakref
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import polars as pl
import tomlkit

from tracknoise.api.finished_run import Run
from tracknoise.exceptions import SettingsError
from tracknoise.experiments.measure import Measurement, require_measurement
from tracknoise.experiments.run_findings import compute_findings
from tracknoise.experiments.run_statistics import compute_statistics
from tracknoise.experiments.settings import Experiment, parse_experiment
from tracknoise.experiments.task import write_measurement, write_settings
from tracknoise.tables.identity import readable
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import RunFolder


def analyse(
    measurements: Measurement | Iterable[Measurement],
    *,
    min_features: int | None = None,
    margin: float | None = None,
    level: float | None = None,
    intervals: str | None = None,
) -> Run:
    """Work out statistics, intervals and findings of measurements.

    Everything is written to a temporary run folder, which is removed with the result. Findings need several scenes:
    with fewer than six, tests are undecided.

    Parameters
    ----------
    measurements
        What `tracknoise.measure` returned, one of each sequence. They are taken one after the other, so that those of a
        generator need not be held in memory together.
    min_features
        Curves are cut where fewer features than this remain.
    margin
        Largest relative effect of a factor that does not matter.
    level
        Confidence level of intervals.
    intervals
        Kind of intervals: ``student``, ``percentile`` or ``bca``.

    Returns
    -------
    Run
        As `tracknoise.open_run` returns it. Settings that are not given have the defaults of an experiment file.

    Raises
    ------
    SettingsError
        If a setting is wrong, there is no measurement, a sequence was measured twice, or populations differ.
    """
    overrides = {
        "statistics": _given(min_features=min_features),
        "findings": _given(margin=margin, level=level, intervals=intervals),
    }
    run = Run(RunFolder(Path(tempfile.mkdtemp(prefix="tracknoise-"))))
    weakref.finalize(run, shutil.rmtree, run.path, ignore_errors=True)
    all_measurements = measurements if isinstance(measurements, Iterable) else [measurements]
    folder = RunFolder(run.path)
    experiment = write_run(folder, all_measurements, overrides)
    compute_findings(folder, experiment, compute_statistics(folder, experiment))
    return run


class _Written(NamedTuple):
    """What is still to be known of a measurement when its tables are written."""

    entry: SequenceEntry
    conditions: pl.DataFrame
    population: str


def _given(**settings: object) -> dict[str, object]:
    return {name: value for name, value in settings.items() if value is not None}


def write_run(
    folder: RunFolder, measurements: Iterable[Measurement], overrides: Mapping[str, object] = MappingProxyType({})
) -> Experiment:
    """Write the run folder of measurements without its findings, and return the experiment that it is the run of."""
    written = [_write(folder, measurement, overrides) for measurement in measurements]
    _check(written)
    experiment = _experiment(pl.concat(part.conditions for part in written), written[0].population, overrides)
    write_settings(folder, experiment, [part.entry for part in written])
    return experiment


def _write(folder: RunFolder, measurement: Measurement, overrides: Mapping[str, object]) -> _Written:
    require_measurement(measurement)
    conditions = measurement.frames.select("dataset", "tracker", "speed").unique(maintain_order=True)
    experiment = _experiment(conditions, measurement.population, overrides)
    return _Written(write_measurement(folder, experiment, measurement), conditions, measurement.population)


def _check(written: Sequence[_Written]) -> None:
    if not written:
        raise SettingsError("no measurements, expected at least one")
    for key, times in Counter(part.entry.key for part in written).items():
        if times > 1:
            raise SettingsError(
                f"{readable(key)}: found {times} measurements, expected one with all trackers and speeds"
            )
    populations = sorted({part.population for part in written})
    if len(populations) > 1:
        raise SettingsError(f"found populations {' and '.join(populations)}, expected measurements of one")


def _experiment(conditions: pl.DataFrame, population: str, overrides: Mapping[str, object]) -> Experiment:
    """The experiment whose run the measurements would be."""
    settings = {
        "name": "analysis",
        "dataset": {"reader": conditions["dataset"][0]},
        "trackers": [{"kind": tracker} for tracker in conditions["tracker"].unique(maintain_order=True)],
        "speeds": conditions["speed"].unique().sort().to_list(),
        "truth": {"population": population},
        **overrides,
    }
    return parse_experiment(tomlkit.dumps(settings), place="analyse")
