"""Begin a run, or go on with one: which sequences are still to be measured, and whether the folder is the right one."""

from collections.abc import Iterator
from typing import Any

from tracknoise.exceptions import StoreError
from tracknoise.experiments.running.plan import Task
from tracknoise.experiments.running.provenance import new_manifest, require_versions
from tracknoise.experiments.settings import Experiment, parse_experiment
from tracknoise.tables.store import Manifest, RunFolder


def begin(experiment: Experiment, run: RunFolder, *, fresh: bool) -> tuple[Manifest, bool]:
    """The manifest of the run to go on with, or of a new one; and whether its settings are to be written anew.

    Parameters
    ----------
    experiment
        What is to be run, every option written out.
    run
        Where.
    fresh
        Remove the run that is there.

    Raises
    ------
    StoreError
        If the folder holds another experiment's run, naming the first setting that differs, or no run at all. A run of
        fewer scenes of the same experiment is one to go on with, and so is one of which other findings are asked.
    """
    if run.exists and not fresh and not run.is_stillborn:
        return _go_on(experiment, run)
    if run.exists:
        run.clear()
    else:
        run.require_empty()
    run.discard_unfinished()
    run.create(experiment.to_toml(), new_manifest(experiment))
    return run.manifest(), False


def due(tasks: list[Task], run: RunFolder, manifest: Manifest) -> list[Task]:
    """The tasks not measured yet, or whose tables are gone or damaged, or whose input files have changed since."""

    def is_measured(task: Task) -> bool:
        entry = manifest.sequences.get(task.key)
        return entry is not None and entry.inputs == task.inputs and run.has_sequence(entry)

    return [task for task in tasks if not is_measured(task)]


def set_out(todo: list[Task], run: RunFolder, manifest: Manifest, experiment: Experiment, *, changed: bool) -> None:
    """Strike from the manifest what is to be measured, and what failed or was derived before.

    Nothing is written: a start that is refused leaves the run as it was.

    Raises
    ------
    SettingsError
        If something that is kept was measured with other libraries than those installed.
    """
    manifest.failures.clear()
    for task in todo:  # an earlier measurement that is stale must not stand in for one that fails
        manifest.sequences.pop(task.key, None)
    if todo or changed:
        manifest.statistics.clear()
    if not manifest.sequences:
        now = new_manifest(experiment)
        manifest.versions, manifest.machine = now.versions, now.machine
    elif todo:
        require_versions(manifest.versions, place=str(run.path))


def _go_on(experiment: Experiment, run: RunFolder) -> tuple[Manifest, bool]:
    there = parse_experiment(run.experiment_toml(), place=str(run.path / "experiment.toml"))
    adapted = there.with_findings(experiment.findings)  # which are made of what is kept
    if _has_grown(there, experiment):
        adapted = adapted.with_scenes(experiment.dataset.max_scenes)
    _check_same(experiment, adapted, run)
    run.discard_unfinished()
    manifest = run.manifest()
    manifest.settings_hash = experiment.digest()
    return manifest, adapted != there


def _has_grown(there: Experiment, wanted: Experiment) -> bool:
    """Whether more scenes are wanted: all that were measured are among them, for they are the first by name."""
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
                "choose another folder, or --fresh to replace that run"
            )


def _has_moved(there: Experiment, wanted: Experiment) -> bool:
    """Whether the data of an earlier start are no longer where they were, so that they may be those found now."""
    return there.dataset.root is not None and wanted.dataset.root is not None and not there.dataset.root.exists()


def _flat(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Every single setting with its dotted name."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _flat(inner, f"{key}.{name}".lstrip("."))
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        for position, inner in enumerate(value):
            yield from _flat(inner, f"{key}[{position}]")
    else:
        yield key, value
