"""What a run was made with: versions, machine and settings."""

import os
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version

from tracknoise.exceptions import SettingsError
from tracknoise.experiments.settings import Experiment
from tracknoise.sequences.registry import READERS
from tracknoise.tables.manifest import Manifest
from tracknoise.trackers.registry import TRACKERS
from tracknoise.truth.registry import TRUTHS

_PYTHON = "python"
LIBRARIES = ("tracknoise", "numpy", "scipy", "opencv-contrib-python-headless", "polars", "embreex")
"""Distributions that results depend on."""


def new_manifest(experiment: Experiment) -> Manifest:
    """Begin a manifest that names everything the numbers of an experiment depend on."""
    return Manifest(
        settings_hash=experiment.digest(),
        versions={_PYTHON: platform.python_version(), **_versions(experiment)},
        machine={
            "system": f"{platform.system()} {platform.release()}",
            "processor": platform.machine(),
            "cores": str(os.cpu_count()),
        },
        seed=experiment.seed,
    )


def require_versions(recorded: Mapping[str, str], *, place: str) -> None:
    """Refuse to measure with other versions than those that a run was begun with.

    Parameters
    ----------
    recorded
        Versions by name, as in the manifest: of the libraries, and of the packages that offer the trackers and the
        reader.
    place
        The run folder or worker, for the error.

    Raises
    ------
    SettingsError
        Naming the first library or package that differs.
    """
    for name in dict.fromkeys([*LIBRARIES, *recorded]):
        found, expected = _installed(name), recorded.get(name, "none")
        if name != _PYTHON and found != expected:
            raise SettingsError(f"{place}: {name} {found} is installed, expected {expected} as the run was begun with")


def _versions(experiment: Experiment) -> dict[str, str]:
    versions = {name: version(name) for name in LIBRARIES} | READERS.versions(experiment.dataset.reader)
    for choice in experiment.trackers:
        versions |= TRACKERS.versions(choice.kind)
    return versions | (TRUTHS.versions(experiment.truth.kind) if experiment.truth.kind else {})


def _installed(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
