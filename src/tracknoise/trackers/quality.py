"""Quality: what trackers report about single observations, by name."""

import re
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from tracknoise.exceptions import TrackerError
from tracknoise.tables.schema import QUALITY_NAME


def is_quality_name(name: str) -> bool:
    """Whether a name matches `QUALITY_NAME`."""
    return re.fullmatch(QUALITY_NAME, name) is not None


def check_quality(quality: Mapping[str, NDArray[np.float32]], count: int) -> None:
    """Check `tracknoise.trackers.tracker.Step.quality` of a step.

    Parameters
    ----------
    quality
        Values by name.
    count
        Number of observations in the step.

    Raises
    ------
    TrackerError
        If a name does not match `QUALITY_NAME`, or values are not one float32 per observation.
    """
    for name, values in quality.items():
        if not is_quality_name(name):
            raise TrackerError(f"a tracker reported quality {name!r}, expected a name of the form {QUALITY_NAME}")
        if values.shape != (count,) or values.dtype != np.float32:
            found = f"{values.dtype} of shape {values.shape}"
            raise TrackerError(f"a tracker reported quality {name!r} as {found}, expected float32 of shape ({count},)")


def covariances(quality: Mapping[str, object]) -> Iterator[tuple[str, str, str]]:
    """Names of the covariances among quality: three numbers called ``<name>_uu``, ``<name>_uv`` and ``<name>_vv``."""
    for name in (key.removesuffix("_uu") for key in quality if key.endswith("_uu")):
        entries = (f"{name}_uu", f"{name}_uv", f"{name}_vv")
        if all(entry in quality for entry in entries):
            yield entries
