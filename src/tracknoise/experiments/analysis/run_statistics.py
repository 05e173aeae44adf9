"""From the tables of single sequences to the statistics of the whole run."""

from functools import partial

import polars as pl

from tracknoise.experiments.analysis.reference_condition import reference_condition
from tracknoise.experiments.blas import one_blas_thread
from tracknoise.experiments.settings import Experiment
from tracknoise.statistics.errors.cores import cores
from tracknoise.statistics.errors.curves import CURVE_COLUMNS, curves
from tracknoise.statistics.errors.histogram import merge_errors
from tracknoise.statistics.factors.effects import effects
from tracknoise.statistics.summary import summary
from tracknoise.statistics.tracks.counts import merge_counts
from tracknoise.statistics.tracks.lifetimes import lifetimes_of_ends
from tracknoise.statistics.tracks.outliers import outlier_ratios
from tracknoise.statistics.truth.floor import truth_floor
from tracknoise.tables.store import RunFolder


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
