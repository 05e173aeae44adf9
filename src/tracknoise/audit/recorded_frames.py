"""Frames of a recording of which a run measured some only: what its settings count in."""

from collections.abc import Mapping
from typing import Any


def recorded_step(settings: Mapping[str, Any]) -> int:
    """Frames of the recording from one measured frame to the next.

    Corrections and accuracies count frames of the recording; an audit counts those that were measured.

    Parameters
    ----------
    settings
        Of the run, as its ``experiment.toml`` has them.
    """
    step: int = [*(settings["dataset"].get("frames") or (0, 0)), 1][2]
    return step
