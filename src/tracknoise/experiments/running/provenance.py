"""What a run was made with: versions, machine and settings."""

import os
import platform
from collections.abc import Mapping
from importlib.metadata import version

from tracknoise.exceptions import SettingsError
from tracknoise.experiments.settings import Experiment
from tracknoise.tables.manifest import Manifest

_LIBRARIES = ("tracknoise", "numpy", "scipy", "opencv-contrib-python-headless", "polars", "embreex")


def new_manifest(experiment: Experiment) -> Manifest:
    """Begin a manifest that names everything the numbers of an experiment depend on."""
    return Manifest(
        settings_hash=experiment.digest(),
        versions={"python": platform.python_version(), **_versions()},
        machine={
            "system": f"{platform.system()} {platform.release()}",
            "processor": platform.machine(),
            "cores": str(os.cpu_count()),
        },
        seed=experiment.seed,
    )


def require_versions(recorded: Mapping[str, str], *, place: str) -> None:
    """Refuse to measure with other libraries than a run was begun with: its numbers would not be of one kind.

    Parameters
    ----------
    recorded
        Versions by name, as in the manifest.
    place
        What lies here, for the error.

    Raises
    ------
    SettingsError
        Naming the first library that differs.
    """
    for name, found in _versions().items():
        if recorded.get(name) != found:
            raise SettingsError(
                f"{place}: {name} {found} is installed, expected {recorded.get(name, 'none')} as the run was begun with"
            )


def _versions() -> dict[str, str]:
    return {name: version(name) for name in _LIBRARIES}
