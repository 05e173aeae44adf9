"""Start or resume a run: check the run folder, and find the sequences that are still to be measured."""

from collections.abc import Iterator
from typing import Any

from tracknoise.exceptions import StoreError
from tracknoise.experiments.running.plan import Task
from tracknoise.experiments.running.provenance import new_manifest, require_versions
from tracknoise.experiments.settings import Experiment, parse_experiment
from tracknoise.tables.manifest import Manifest
from tracknoise.tables.store import RunFolder


def begin(experiment: Experiment, run: RunFolder, *, fresh: bool) -> tuple[Manifest, bool]:
    """Manifest of the run to resume, or of a new run, and whether the settings file must be rewritten.

    Parameters
    ----------
    experiment
        The experiment, with all options resolved.
    run
        The run folder.
    fresh
        Delete the run that the folder holds.

    Raises
    ------
    StoreError
        If the folder holds other files, or the run of another experiment; the message names the first setting that
        differs. More scenes, other groups of them and other settings of findings are allowed: such a run is resumed.
    """
    if run.exists and not fresh and not run.is_unstarted:
        return _resume(experiment, run)
    if run.exists:
        run.clear()
    else:
        run.require_empty()
    run.discard_unfinished()
    run.create(experiment.to_toml(), new_manifest(experiment))
    return run.manifest(), False


def due(tasks: list[Task], run: RunFolder, manifest: Manifest) -> list[Task]:
    """Tasks that are not measured, whose tables are missing or damaged, or whose input files have changed."""

    def is_measured(task: Task) -> bool:
        entry = manifest.sequences.get(task.key)
        return entry is not None and entry.inputs == task.inputs and run.has_sequence(entry)

    return [task for task in tasks if not is_measured(task)]


def forget_outdated(
    todo: list[Task], run: RunFolder, manifest: Manifest, experiment: Experiment, *, changed: bool
) -> None:
    """Remove from the manifest the sequences to be measured, earlier failures, and statistics that become outdated.

    Nothing is written: a start that is refused leaves the run unchanged.

    Raises
    ------
    SettingsError
        If sequences that are kept were measured with other versions of the libraries.
    """
    manifest.failures.clear()
    for task in todo:  # an outdated measurement must not remain if the new one fails
        manifest.sequences.pop(task.key, None)
    if todo or changed:
        manifest.statistics.clear()
    if not manifest.sequences:
        now = new_manifest(experiment)
        manifest.versions, manifest.machine = now.versions, now.machine
    elif todo:
        require_versions(manifest.versions, place=str(run.path))


def _resume(experiment: Experiment, run: RunFolder) -> tuple[Manifest, bool]:
    there = parse_experiment(run.experiment_toml(), place=str(run.path / "experiment.toml"))
    adapted = there.with_findings(experiment.findings)  # computed from tables that are kept
    adapted = adapted.with_groups(experiment.dataset.groups)
    if _has_grown(there, experiment):
        adapted = adapted.with_scenes(experiment.dataset.max_scenes)
    _check_same(experiment, adapted, run)
    run.discard_unfinished()
    manifest = run.manifest()
    manifest.settings_hash = experiment.digest()
    return manifest, adapted != there


def _has_grown(there: Experiment, wanted: Experiment) -> bool:
    """Whether more scenes are requested. They include all measured ones, because scenes are taken by name."""
    before, now = there.dataset.max_scenes, wanted.dataset.max_scenes
    return before is not None and (now is None or now > before)


def _check_same(experiment: Experiment, there: Experiment, run: RunFolder) -> None:
    if _has_moved(there, experiment):
        there = there.with_root(experiment.dataset.root)
    written, wanted = dict(_flat(there.model_dump(mode="json"))), dict(_flat(experiment.model_dump(mode="json")))
    for key in [*wanted, *written]:
        if written.get(key) != wanted.get(key):
            raise StoreError(
                f"{run.path}: holds a run with {key} = {written.get(key)!r}, expected {wanted.get(key)!r}; "
                "choose another folder, or use --fresh to replace that run"
            )


def _has_moved(there: Experiment, wanted: Experiment) -> bool:
    """Whether the data folder of an earlier start no longer exists: the data may have been moved."""
    return there.dataset.root is not None and wanted.dataset.root is not None and not there.dataset.root.exists()


def _flat(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Every setting with its dotted name."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _flat(inner, f"{key}.{name}".lstrip("."))
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        for position, inner in enumerate(value):
            yield from _flat(inner, f"{key}[{position}]")
    else:
        yield key, value
