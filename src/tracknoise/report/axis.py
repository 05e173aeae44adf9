"""What curves run along, and its words: the age of a feature, or the frames around the key frame of a scan."""

from collections.abc import Mapping
from dataclasses import dataclass

from tracknoise.findings import wording
from tracknoise.statistics.definitions import NAMES

NU, MU, KAPPA = "\N{GREEK SMALL LETTER NU}", "\N{GREEK SMALL LETTER MU}", "\N{GREEK SMALL LETTER KAPPA}"


@dataclass(frozen=True, slots=True)
class Axis:
    """What curves run along, and how the report speaks of it.

    Attributes
    ----------
    name
        As in the tables: age or frame.
    title
        Of the horizontal axis of a figure.
    zero
        Where errors are zero by construction.
    distance
        What the distance from there is called.
    signs
        Sign of each statistic, by its role: mean, absolute and second.
    """

    name: str
    title: str
    zero: str
    distance: str
    signs: Mapping[str, str]

    @property
    def roles(self) -> dict[str, str]:
        """Role of each statistic, by its name in the tables."""
        return {name: role for role, name in NAMES[self.name].items()}

    def place(self, since: int) -> str:
        """Write a place by its distance from where errors are zero: ``at age 10``, ``8 frames after the key frame``.

        Parameters
        ----------
        since
            Frames of the sequence; negative before the key frame.
        """
        return wording.place(self.name, since)

    def opening_place(self, since: int) -> str:
        """Write a place as `place` does, as the start of a sentence.

        Parameters
        ----------
        since
            As in `place`.
        """
        return wording.opening_place(self.name, since)


AGE = Axis("age", "age (frames of the sequence)", "age 0", "age", {"mean": NU, "absolute": "η", "second": "√Φ"})
FRAME = Axis(
    "frame", "frame", "the key frame", "distance from the key frame", {"mean": MU, "absolute": KAPPA, "second": "√Σ"}
)
