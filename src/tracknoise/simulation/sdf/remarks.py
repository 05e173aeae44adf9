"""What of a world is not shown as Gazebo would show it."""

from pathlib import Path


class Remarks:
    """Collects one sentence for each thing that is left out or replaced, in order, once each."""

    def __init__(self) -> None:
        self._lines: dict[str, None] = {}

    def add(self, place: str | Path, what: str) -> None:
        """Remark upon something.

        Parameters
        ----------
        place
            The file that it stands in.
        what
            What was found, and what happens instead.
        """
        self._lines[f"{place}: {what}"] = None

    @property
    def lines(self) -> tuple[str, ...]:
        """All remarks."""
        return tuple(self._lines)
