"""Things that are chosen by name: those that come with the package, and those of other packages' entry points."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar

from tracknoise.exceptions import SettingsError, UnknownNameError

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Plugins(Generic[T]):
    """Classes by name, each imported only when asked for.

    Parameters
    ----------
    what
        What they are, for messages.
    group
        Entry point group under which other packages offer more.
    built_in
        ``module:attribute`` of those that come with this package, by name; these take precedence.
    """

    what: str
    group: str
    built_in: Mapping[str, str]

    def names(self) -> list[str]:
        """All names, sorted."""
        return sorted({*self.built_in, *(point.name for point in entry_points(group=self.group))})

    def load(self, name: str) -> type[T]:
        """The class of that name.

        Raises
        ------
        UnknownNameError
            Listing the known names.
        SettingsError
            If another package offers the name, but cannot be imported.
        """
        if name in self.built_in:
            module, attribute = self.built_in[name].split(":")
            found: type[T] = getattr(import_module(module), attribute)
            return found
        for point in entry_points(group=self.group):
            if point.name == name:
                return self._load_foreign(point)
        raise UnknownNameError(self.what, name, self.names())

    def _load_foreign(self, point: EntryPoint) -> type[T]:
        try:
            found: type[T] = point.load()
        except (ImportError, AttributeError) as error:
            message = f"{self.what} {point.name!r}: {point.value} cannot be loaded ({error}), expected a class"
            raise SettingsError(message) from error
        return found
