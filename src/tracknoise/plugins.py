"""Trackers, readers and truths by name: those of this package, and those of other packages, by entry point."""

import os
import sys
import sysconfig
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Generic, TypeVar

from tracknoise.exceptions import SettingsError, UnknownNameError, with_type
from tracknoise.foreign_files import absolute
from tracknoise.opened_files import content_of
from tracknoise.options import PathTemplate, change_paths, defaults_as_toml, find_paths, validated

T = TypeVar("T")
CODE = (".py", ".so", ".pyd")
"""Suffixes of the source files and compiled modules of a package."""


@dataclass(frozen=True, slots=True)
class Plugins(Generic[T]):
    """Settings dataclasses by name, each imported only when requested.

    Parameters
    ----------
    what
        What is chosen, for messages: "tracker" or "reader".
    group
        Entry point group for other packages.
    built_in
        ``module:attribute`` of those that come with this package, by name; these take precedence.
    needs
        Attributes that a class has, beside the fields of a dataclass.
    given
        Fields that are not options, because they are set in another way.
    """

    what: str
    group: str
    built_in: Mapping[str, str]
    needs: tuple[str, ...] = ()
    given: frozenset[str] = frozenset()

    def names(self) -> list[str]:
        """All names, sorted."""
        return sorted({*self.built_in, *(point.name for point in entry_points(group=self.group))})

    def descriptions(self) -> dict[str, str]:
        """What each class says of itself, by name; of one that cannot be used, why."""
        return {name: self._description(name) for name in self.names()}

    def __contains__(self, name: str) -> bool:
        """Whether there is such a name; those of other packages take longer, and are looked at last."""
        return name in self.built_in or name in self.names()

    def load(self, name: str) -> type[T]:
        """The class of that name.

        Raises
        ------
        UnknownNameError
            Listing the known names.
        SettingsError
            If another package offers the name, but cannot be imported, or it offers no such class.
        """
        if name in self.built_in:
            module, attribute = self.built_in[name].split(":")
            kind: type[T] = getattr(import_module(module), attribute)
            return kind
        point = self._entry_point(name)
        if point is None:
            raise UnknownNameError(self.what, name, self.names(), {})
        return self._load_entry_point(point)

    def make(
        self, name: str, options: Mapping[str, object] | None = None, given: Mapping[str, object] | None = None
    ) -> T:
        """Make settings from a name and options, types checked: see `tracknoise.options.validated`.

        Parameters
        ----------
        name
            Name of the class.
        options
            Values of its fields that are not the defaults.
        given
            Values of the fields that are not options.

        Raises
        ------
        UnknownNameError
            If there is no such name.
        SettingsError
            If an option is unknown or missing, or has a wrong type or value; the message names it.
        """
        kind = self.load(name)
        try:
            return validated(kind, options or {}, given or {})
        except ValueError as error:
            raise SettingsError(f"{self.what} {name!r}: {error}") from error
        except SystemExit as error:
            problem = f"cannot be made ({with_type(error)}), expected settings"
            raise SettingsError(f"{self.what} {name!r}: {problem}") from error

    def with_paths_from(self, folder: Path, name: str, options: Mapping[str, object]) -> dict[str, object]:
        """Options with relative paths made absolute, starting from a folder; those of the type `DataPath` stay.

        Raises
        ------
        UnknownNameError, SettingsError
            As `load`.
        DataError
            If one is no path.
        """
        return change_paths(self.load(name), options, lambda path: str(absolute(folder, Path(path))))

    def paths(self, name: str, options: Mapping[str, object], root: Path | None = None) -> list[Path | PathTemplate]:
        """The files and folders that options name. Those of the type `DataPath` start from the folder of the data.

        Raises
        ------
        UnknownNameError, SettingsError
            As `load`.
        """
        return find_paths(self.load(name), options, root)

    def versions(self, name: str) -> dict[str, str]:
        """Name and version of the other package that offers a name; empty if this package does."""
        point = self._entry_point(name)
        return {} if point is None or point.dist is None else {point.dist.name: point.dist.version}

    def sources(self, name: str) -> dict[Path, dict[Path, str | None]]:
        """Checksums of the source files of the other package that offers a name, by the folder that the package is in.

        They are those of its outermost package, and of modules in the same folder that are loaded, unless that is where
        packages are installed. Empty if this package offers the name. Checksums are those of the
        files as this process loaded them.

        Raises
        ------
        SettingsError
            If it cannot be imported, or a file has changed since it was loaded.
        """
        point = self._entry_point(name)
        if point is None:
            return {}
        self._load_entry_point(point)
        folder, paths = _sources(point.module)
        return {folder: {path: _as_loaded(path) for path in paths}}

    def _entry_point(self, name: str) -> EntryPoint | None:
        """Where another package offers a name; None if this package does, or none."""
        if name in self.built_in:
            return None
        return next((point for point in entry_points(group=self.group) if point.name == name), None)

    def _load_entry_point(self, point: EntryPoint) -> type[T]:
        try:
            kind: type[T] = point.load()
        except (Exception, SystemExit) as error:  # its modules are run here
            said = error if isinstance(error, ImportError | AttributeError) else with_type(error)
            message = f"{self.what} {point.name!r}: {point.value} cannot be loaded ({said}), expected a class"
            raise SettingsError(message) from error
        self._require_class(point.name, kind)
        for path in _sources(point.module)[1]:
            if path not in _hashes:
                _hashes[path] = content_of(path)
        return kind

    def _require_class(self, name: str, kind: object) -> None:
        place = f"{self.what} {name!r}: found {kind!r}"
        if not (isinstance(kind, type) and is_dataclass(kind)):
            raise SettingsError(f"{place}, expected a dataclass")
        missing = [attribute for attribute in self.needs if not hasattr(kind, attribute)]
        if missing:
            raise SettingsError(f"{place} without {', '.join(missing)}, expected one with {', '.join(self.needs)}")

    def _description(self, name: str) -> str:
        try:
            kind: Any = self.load(name)
        except SettingsError as error:
            return f"cannot be used: {error}"
        return str(kind.description)


_hashes: dict[Path, str | None] = {}
"""Checksums of the source files of other packages, when this process loaded them."""


def _as_loaded(path: Path) -> str | None:
    now = content_of(path)
    if _hashes.setdefault(path, now) != now:
        raise SettingsError(
            f"{path}: changed since this process loaded it, expected a new process or restarted workers"
        )
    return now


def _sources(module: str) -> tuple[Path, list[Path]]:
    """The folder of the package of a loaded module, and its source files: see `Plugins.sources`."""
    parts = module.split(".")
    names = [".".join(parts[: count + 1]) for count in range(len(parts))]
    files = [(name, getattr(sys.modules.get(name), "__file__", None)) for name in names]
    outermost = next(((name, Path(file)) for name, file in files if file is not None), None)  # others are namespaces
    if outermost is None:
        return Path(), []
    name, file = outermost
    is_package = file.name.startswith("__init__.")
    folder = file.parents[name.count(".") + is_package]
    sources = (
        {path for path in file.parent.rglob("*") if path.suffix in CODE and path.is_file()} if is_package else {file}
    )
    if folder not in map(Path, sysconfig.get_paths().values()):
        loaded = (getattr(loaded_module, "__file__", None) for loaded_module in list(sys.modules.values()))
        named = f"{folder.name}{os.sep}" if folder.name else ""  # of thousands of modules, few are to be looked at
        near = {Path(loaded_file) for loaded_file in loaded if loaded_file is not None and named in loaded_file}
        sources |= {path for path in near if path.is_relative_to(folder)}
    own_folder = Path(__file__).parent
    return folder, sorted(path for path in sources if not path.is_relative_to(own_folder))


def plugin_defaults(plugins: Plugins[Any], name: str) -> str:
    """The options of a tracker or reader with their defaults as TOML, those without a default as comments.

    Raises
    ------
    UnknownNameError, SettingsError
        As `Plugins.load`.
    """
    return defaults_as_toml(plugins.load(name), plugins.given)
