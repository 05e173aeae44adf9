"""What a run was made with: versions, machine and settings."""

import os
import platform
from importlib.metadata import version

from tracknoise.experiments.settings import Experiment
from tracknoise.tables.store import Manifest

_LIBRARIES = ("tracknoise", "numpy", "scipy", "opencv-contrib-python-headless", "polars", "embreex")


def new_manifest(experiment: Experiment) -> Manifest:
    """Begin a manifest that names everything the numbers of an experiment depend on."""
    return Manifest(
        settings_hash=experiment.digest(),
        versions={"python": platform.python_version(), **{name: version(name) for name in _LIBRARIES}},
        machine={
            "system": f"{platform.system()} {platform.release()}",
            "processor": platform.machine(),
            "cores": str(os.cpu_count()),
        },
        seed=experiment.seed,
    )
