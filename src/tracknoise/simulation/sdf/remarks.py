"""Differences between the rendered world and Gazebo's."""

from pathlib import Path

from tracknoise.exceptions import one_line


class Remarks:
    """Collects one sentence for each thing that is left out or replaced, in order, without repetitions."""

    def __init__(self) -> None:
        self._lines: dict[str, None] = {}

    def add(self, place: str | Path, what: str) -> None:
        """Add a remark.

        Parameters
        ----------
        place
            The file that contains it.
        what
            What was found, and what is done instead.
        """
        self.add_line(f"{place}: {what}")

    def add_line(self, line: str) -> None:
        """Add a remark that another collection has."""
        self._lines[one_line(line)] = None

    @property
    def lines(self) -> tuple[str, ...]:
        """All remarks."""
        return tuple(self._lines)
