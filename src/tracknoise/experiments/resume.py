"""Start or resume a run: what it was made with, and which sequences are still to be measured."""

import os
import platform
from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version

from tracknoise.exceptions import SettingsError, StoreError
from tracknoise.experiments.inputs import InputCheck
from tracknoise.experiments.load import with_tracker_defaults
from tracknoise.experiments.plan import Task
from tracknoise.experiments.settings import Experiment, parse_experiment
from tracknoise.sequences.reader_registry import READERS
from tracknoise.tables.files import digest
from tracknoise.tables.identity import readable
from tracknoise.tables.manifest import Manifest
from tracknoise.tables.store import RunFolder
from tracknoise.text import dotted
from tracknoise.trackers.tracker_registry import TRACKERS
from tracknoise.truth.truth_registry import TRUTHS

_PYTHON = "python"
LIBRARIES = ("tracknoise", "numpy", "scipy", "opencv-contrib-python-headless", "polars", "embreex")
"""Distributions that results depend on."""


def new_manifest(experiment: Experiment) -> Manifest:
    """Begin a manifest that names everything the numbers of an experiment depend on."""
    return Manifest(
        settings_hash=experiment.digest(),
        versions=_versions(experiment),
        machine=_machine(),
        seed=experiment.seed,
    )


def _machine() -> dict[str, str]:
    return {
        "system": f"{platform.system()} {platform.release()}",
        "processor": platform.machine(),
        "cores": str(os.cpu_count()),
    }


def require_versions(recorded: Mapping[str, str], *, place: str) -> None:
    """Refuse to measure with other versions than those that a run was begun with."""
    for name in dict.fromkeys([*LIBRARIES, *recorded]):
        installed, expected = _installed(name), recorded.get(name, "none")
        if name != _PYTHON and installed != expected:
            raise SettingsError(
                f"{place}: {name} {installed} is installed, expected {expected} as the run was begun with"
            )


def _versions(experiment: Experiment) -> dict[str, str]:
    versions = {_PYTHON: platform.python_version(), **{name: version(name) for name in LIBRARIES}}
    versions |= READERS.versions(experiment.dataset.reader)
    for choice in experiment.trackers:
        versions |= TRACKERS.versions(choice.kind)
    return versions | (TRUTHS.versions(experiment.truth.kind) if experiment.truth.kind else {})


def _installed(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"


def begin(
    experiment: Experiment, run: RunFolder, *, fresh: bool, remark: Callable[[str], None]
) -> tuple[Manifest, bool]:
    """Manifest of the run to resume, or of a new run, and whether the settings file must be rewritten.

    A run that has not measured anything is replaced, such as one that failed because of a wrong setting.
    """
    if not fresh and (run.has_measured or run.has_parts):
        return _resume(experiment, run, remark)
    if run.exists:
        run.clear()
    else:
        run.require_empty()
    run.discard_unfinished()
    run.create(experiment.to_toml(), new_manifest(experiment))
    return run.manifest(), False


def due(
    tasks: list[Task], run: RunFolder, manifest: Manifest, *, verify: bool, remark: Callable[[str], None]
) -> list[Task]:
    """Tasks that are not measured, whose tables are missing or damaged, or whose input files have changed."""
    check = InputCheck(run, verify=verify)

    def is_measured(task: Task) -> bool:
        entry = manifest.sequences.get(task.key)
        if entry is None or not run.has_sequence(entry):
            return False
        change = check.change(task, entry)
        if change is not None:
            remark(f"{readable(task.key)} is measured again: {change}")
        return change is None

    return [task for task in tasks if not is_measured(task)]


def forget_outdated(todo: list[Task], run: RunFolder, manifest: Manifest, experiment: Experiment) -> None:
    """Remove from the manifest the sequences to be measured, earlier failures, and statistics that become outdated.

    Statistics are outdated if they include a sequence that is measured again. A new sequence makes them outdated when
    it has been measured (`ManifestWriter.measured`). Nothing is written: a start that is refused leaves the run
    unchanged.
    """
    manifest.failures.clear()
    # An outdated measurement must not remain if the new one fails.
    outdated = [manifest.sequences.pop(task.key) for task in todo if task.key in manifest.sequences]
    if outdated:
        manifest.statistics.clear()
    if not manifest.sequences:
        manifest.versions, manifest.machine = _versions(experiment), _machine()
    elif todo:
        require_versions(manifest.versions, place=str(run.path))


def _resume(experiment: Experiment, run: RunFolder, remark: Callable[[str], None]) -> tuple[Manifest, bool]:
    manifest = run.manifest()
    there = _settings_of(run, manifest, experiment, remark)
    adapted = (there or experiment).with_findings_of(experiment)  # computed from tables that are kept
    adapted = adapted.with_groups(experiment.dataset.groups)
    if _has_grown(adapted, experiment):
        adapted = adapted.with_scenes(experiment.dataset.max_scenes)
    _check_same(experiment, adapted, run)
    run.discard_unfinished()
    manifest.settings_hash = experiment.digest()
    if there is not None and there != there.with_findings_of(experiment):
        manifest.statistics.clear()
    return manifest, adapted != there


def _settings_of(
    run: RunFolder, manifest: Manifest, experiment: Experiment, remark: Callable[[str], None]
) -> Experiment | None:
    """Settings of the run; None if their file is damaged and `experiment` has the same hash without doubt."""
    try:
        text = run.experiment_toml()
    except StoreError as error:
        if manifest.settings_hash != experiment.digest():
            raise
        remark(f"{error}. They are written again: the manifest has the hash of this experiment")
        return None
    manifest.experiment_sha256 = [digest(text.encode())]  # a process killed while it replaced them leaves two
    return with_tracker_defaults(parse_experiment(text, place=str(run.path / "experiment.toml")))


def _has_grown(there: Experiment, wanted: Experiment) -> bool:
    """Whether more scenes are requested. They include all measured ones, because scenes are taken by name."""
    before, now = there.dataset.max_scenes, wanted.dataset.max_scenes
    return before is not None and (now is None or now > before)


def _check_same(experiment: Experiment, there: Experiment, run: RunFolder) -> None:
    if _has_moved(there, experiment):
        there = there.with_root(experiment.dataset.root)
    written, wanted = dict(dotted(there.model_dump(mode="json"))), dict(dotted(experiment.model_dump(mode="json")))
    for key in [*wanted, *written]:
        if written.get(key) != wanted.get(key):
            raise StoreError(
                f"{run.path}: holds a run with {key} = {written.get(key)!r}, expected {wanted.get(key)!r}; "
                "choose another folder, or use --fresh to replace that run"
            )


def _has_moved(there: Experiment, wanted: Experiment) -> bool:
    """Whether the data folder of an earlier start no longer exists: the data may have been moved."""
    return there.dataset.root is not None and wanted.dataset.root is not None and not there.dataset.root.exists()
