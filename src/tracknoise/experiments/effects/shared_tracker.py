"""A tracker that several sequences share: where these have shown the same images, it tracks them once."""

from dataclasses import dataclass, field
from hashlib import blake2b
from typing import ClassVar

from tracknoise.trackers.frame import Frame
from tracknoise.trackers.tracker import SequenceContext, Step, Tracker, TrackerSettings, reports_causes

_Steps = dict[tuple[int, bytes], Step]


@dataclass(frozen=True, slots=True)
class SharedTracker:
    """A tracker for sequences that advance together, of which some have the same images.

    Parameters
    ----------
    settings
        The tracker. Its results must depend on images only, so that it cannot be an oracle.
    """

    kind: ClassVar[str] = "shared"
    description: ClassVar[str] = "another tracker that several sequences share"

    settings: TrackerSettings
    _steps: _Steps = field(default_factory=dict, compare=False, repr=False)

    @property
    def reports_causes(self) -> bool:
        """As the tracker itself: see `tracknoise.trackers.tracker.reports_causes`."""
        return reports_causes(self.settings)

    def start(self, context: SequenceContext) -> Tracker:
        """Start the tracker on one of the sequences."""
        return _Shared(self.settings.start(context), self._steps)


class _Shared:
    """A tracker on one sequence, and the steps of the current frame by the images up to it."""

    def __init__(self, tracker: Tracker, steps: _Steps) -> None:
        self._tracker, self._steps = tracker, steps
        self._unseen: list[Frame] = []
        self._seen = b""

    def step(self, frame: Frame) -> Step:
        """Track into the next frame, or take over what was tracked in the same images."""
        self._seen = blake2b(self._seen + frame.image.tobytes()).digest()
        self._unseen.append(Frame(frame.index, frame.image))
        key = frame.index, self._seen
        if key not in self._steps:
            for past in [past for past in self._steps if past[0] != frame.index]:
                del self._steps[past]
            *_, self._steps[key] = map(self._tracker.step, self._unseen)
            self._unseen.clear()
        return self._steps[key]
