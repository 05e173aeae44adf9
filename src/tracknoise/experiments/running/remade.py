"""A run with another trimming, from the observations that a run keeps: no image is read and no tracker runs."""

import warnings
from collections.abc import Iterator
from dataclasses import replace

import polars as pl

from tracknoise.exceptions import DataWarning, SettingsError
from tracknoise.experiments.analysis.run_findings import compute_findings
from tracknoise.experiments.analysis.run_statistics import compute_statistics
from tracknoise.experiments.blas import one_blas_thread
from tracknoise.experiments.running.geometry_tables import geometry_tables
from tracknoise.experiments.running.lock import hold
from tracknoise.experiments.running.plan import batches, open_batch, plan
from tracknoise.experiments.running.resume import begin
from tracknoise.experiments.settings import Experiment, parse_experiment
from tracknoise.sequences.sequence import Sequence
from tracknoise.statistics.summarise import STATISTICS, statistics_of
from tracknoise.statistics.trimming import trim
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import OBSERVED, RunFolder


@one_blas_thread()
def remake(run: RunFolder, experiment: Experiment, into: RunFolder) -> None:
    """Write the run that an experiment would have measured, if it differs from that of a run in its trimming only.

    Parameters
    ----------
    run
        With at least one measured sequence. It keeps observations, or is trimmed as the experiment wants.
    experiment
        That of the run with other `statistics`, `findings` or `keep`, and all options resolved.
    into
        Folder of the new run. A run that it holds is replaced.

    Raises
    ------
    SettingsError
        If the experiment has several random seeds, whose observations are not kept.
    TracknoiseError
        If the run keeps no observations, its data are no longer there, or the folder cannot be written.
    """
    if experiment.seeds > 1:
        raise SettingsError(f"seeds = {experiment.seeds}: observations of one seed are kept, expected 1")
    trimmed_alike = parse_experiment(run.experiment_toml(), place=str(run.path)).statistics == experiment.statistics
    tables_of = _stored if trimmed_alike else _trimmed_again
    with hold(into) as claim, claim.explained():
        manifest, _ = begin(experiment, into, fresh=True, remark=lambda _: None)
        for sequence, entry in _opened(run, experiment):
            tables = tables_of(run, experiment, sequence, entry)
            hashes = into.write_sequence(entry.key, tables, run.snapshot(entry.key))
            manifest.sequences[entry.key] = replace(entry, sha256=hashes)
        manifest.excluded_scenes = run.manifest().excluded_scenes
        into.write_manifest(manifest)
        compute_findings(into, experiment, compute_statistics(into, experiment))


def _is_kept(name: str, experiment: Experiment) -> bool:
    return name not in OBSERVED or experiment.keep == "observations"


def _opened(run: RunFolder, experiment: Experiment) -> Iterator[tuple[Sequence, SequenceEntry]]:
    """The sequences that were measured, opened again. Nothing but their poses and cameras is needed."""
    entries = run.manifest().sequences
    for batch in batches([task for task in plan(experiment) if task.key in entries]):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DataWarning)  # the notes of the run contain the same text
            sequences = open_batch(batch)
        yield from zip(sequences, (entries[task.key] for task in batch), strict=True)


def _stored(
    run: RunFolder, experiment: Experiment, sequence: Sequence, entry: SequenceEntry
) -> dict[str, pl.DataFrame]:
    """All tables of a sequence that the experiment keeps, as they are."""
    names = [name for name in run.names_of_tables(entry.key) if _is_kept(name, experiment)]
    return {name: run.sequence_table(name, entry.key) for name in names}


def _trimmed_again(
    run: RunFolder, experiment: Experiment, sequence: Sequence, entry: SequenceEntry
) -> dict[str, pl.DataFrame]:
    """The same with all that depends on trimming computed again from the observations."""
    asked, population = experiment.statistics, experiment.truth.population
    slowest = min(experiment.speeds)
    trimmed = trim(
        *(run.sequence_table(name, entry.key) for name in OBSERVED),
        percentile=asked.trim_percentile,
        population=population,
        among=asked.trim_among,
        key_frame=entry.key_frame,
    )
    prepared = replace(trimmed.sequence, slowest=slowest)
    observed = {"observations": trimmed.observations, "tracks": trimmed.tracks}
    return {
        **_stored(run, experiment, sequence, entry),
        **{name: table for name, table in observed.items() if _is_kept(name, experiment)},
        "trims": trimmed.trims,
        **statistics_of(trimmed.sequence, tuple(STATISTICS), population=population, slowest=slowest),
        **geometry_tables(experiment, sequence, prepared, entry.n_frames, entry.truth),
    }
