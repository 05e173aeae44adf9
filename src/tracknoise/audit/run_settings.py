"""What an audit needs of the settings of its run, as ``experiment.toml`` has them: what it found is beside them."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

NO_SETTINGS: Mapping[str, Any] = MappingProxyType({})


def recorded_step(settings: Mapping[str, Any]) -> int:
    """Frames of the recording from one measured frame to the next.

    Corrections and accuracies count frames of the recording; an audit counts those that were measured.
    """
    step: int = [*(settings.get("dataset", {}).get("frames") or (0, 0)), 1][2]
    return step


def present_corrections(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Corrections that the run has, by their keys. What it states, and an audit calls stated, includes them."""
    return dict(settings.get("truth", {}).get("corrections", {}))
