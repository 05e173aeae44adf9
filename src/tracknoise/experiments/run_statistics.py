"""From the tables of single sequences to the statistics of the whole run."""

from collections.abc import Collection
from functools import partial

import polars as pl

from tracknoise.experiments.machine import one_blas_thread
from tracknoise.experiments.settings import Experiment
from tracknoise.statistics.curves import CURVE_COLUMNS, curves
from tracknoise.statistics.definitions import lightings_in_order
from tracknoise.statistics.histograms import merge_errors
from tracknoise.statistics.lifetimes import lifetimes_of_ends
from tracknoise.statistics.scales import cores
from tracknoise.statistics.summary import summary
from tracknoise.statistics.track_counts import merge_counts, outlier_ratios
from tracknoise.statistics.truth_errors import truth_floor
from tracknoise.statistics.yardstick import ReferenceCondition, effects
from tracknoise.tables.manifest import Manifest
from tracknoise.tables.store import RunFolder


def first_lighting(lightings: Collection[str], experiment: Experiment) -> str:
    """The reference lighting: the first in the order of `lightings_in_order`.

    Parameters
    ----------
    lightings
        At least one, those that there are.
    experiment
        Which may name lightings.
    """
    return lightings_in_order(lightings, experiment.dataset.lightings)[0]


def reference_condition(manifest: Manifest, experiment: Experiment, outliers: pl.DataFrame) -> ReferenceCondition:
    """The first view of a run: forward, upright, under the first lighting, of the first camera, at the lowest speed."""
    entries = list(manifest.sequences.values())
    sequences = [entry.sequence for entry in entries]
    return ReferenceCondition(
        lighting=first_lighting({sequence.lighting for sequence in sequences}, experiment),
        rotation=min(sequence.rotation for sequence in sequences),
        direction=str(max(sequence.direction for sequence in sequences)),
        speed=int(outliers["speed"].min()),  # type: ignore[arg-type]
        key_frames={str(entry.sequence.direction): entry.key_frame for entry in entries if entry.key_frame is not None},
        camera=min(sequence.camera for sequence in sequences),
    )


@one_blas_thread()
def compute_statistics(run: RunFolder, experiment: Experiment) -> dict[str, pl.DataFrame]:
    """Compute the statistics of a run from its sequences' tables, a few sequences at a time.

    None of the tables that are read grows with the count of observations, and what is held grows with neither that nor
    the count of sequences, but for a few rows each. The order of the sequences is that of their keys, so that the
    result does not depend on which was measured first.

    Parameters
    ----------
    run
        With at least one measured sequence.
    experiment
        Says where curves are cut, and which population the summary is of.

    Returns
    -------
    dict
        The tables of `STATISTICS_TABLES`, by name.

    Raises
    ------
    StoreError, SchemaError
        If a table is damaged.
    """
    manifest = run.manifest()
    several = partial(run.stacked_tables, keys=sorted(manifest.sequences))
    pooled = curves(several("moments", only=CURVE_COLUMNS), min_features=experiment.statistics.min_features)
    tables = {
        "curves": pooled,
        "cores": cores(several("scales"), pooled),
        "floor": truth_floor(several("floors")),
        "lifetimes": lifetimes_of_ends(several("ends")),
        "outliers": outlier_ratios(several("frames")),
        "trims": pl.concat(several("trims")),
        "errors": merge_errors(several("errors")),
        "counts": merge_counts(several("counts")),
    }
    reference = reference_condition(manifest, experiment, tables["outliers"])
    tables["summary"] = summary(
        tables["curves"],
        tables["lifetimes"],
        tables["outliers"],
        cores=tables["cores"],
        floor=tables["floor"],
        key_frame=reference.key_frames,
        population=experiment.truth.population,
    )
    tables["effects"] = effects(
        tables["curves"],
        tables["lifetimes"],
        tables["outliers"],
        reference=reference,
        population=experiment.truth.population,
        trimming=experiment.findings.trimming,
        margin=experiment.findings.margin,
    )
    return tables
