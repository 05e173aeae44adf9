"""Whether two runs can be compared: the same data, truth and libraries, whatever their trackers are."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from tracknoise.exceptions import SettingsError
from tracknoise.experiments.running.provenance import LIBRARIES
from tracknoise.experiments.settings import dotted
from tracknoise.tables.identity import readable
from tracknoise.tables.manifest import Manifest, SequenceEntry
from tracknoise.tables.store import RunFolder

_DATA, _TRUTH = "dataset.", "truth."
_FREE = (
    *("dataset.root", "dataset.groups", "dataset.scenes", "dataset.lightings", "dataset.max_scenes"),
    *("truth.accuracy.", "truth.second."),
)
"""Settings that may differ: the folder of the data, which part of it is measured, and what changes no error."""
_OF_IMAGES = ("n_frames", "width", "height")
_OF_TRUTH = ("truth", "key_frame")
_SHORT = 10


@dataclass(frozen=True, slots=True)
class OpenedRun:
    """A run that takes part in a comparison.

    Attributes
    ----------
    name
        Name of the run in the result.
    folder
        Where it is.
    manifest
        Of the run.
    settings
        All resolved settings.
    """

    name: str
    folder: RunFolder
    manifest: Manifest
    settings: Mapping[str, Any]

    @classmethod
    def of(cls, folder: RunFolder, name: str) -> "OpenedRun":
        """Read a run.

        Raises
        ------
        StoreError
            If there is no finished run, or it is damaged.
        """
        folder.statistics("summary")
        return cls(name, folder, folder.manifest(), folder.settings())

    def flat(self) -> dict[str, Any]:
        """Settings by dotted name, without those of the trackers."""
        return dict(dotted({key: value for key, value in self.settings.items() if key != "trackers"}))


def require_comparable(first: OpenedRun, second: OpenedRun) -> list[str]:
    """Keys of the sequences that both runs have measured, sorted.

    Raises
    ------
    SettingsError
        Naming the first reason why the runs cannot be compared: other data, other truth or other libraries.
    StoreError
        If a file is damaged.
    """
    _require_settings(first, second)
    _require_libraries(first, second)
    common = sorted(set(first.manifest.sequences) & set(second.manifest.sequences))
    if not common:
        known, found = (_some(run.manifest.sequences) for run in (first, second))
        raise _refusal(first, second, "other data", f"sequences {known} and {found}", "at least one of the same name")
    for key in common:
        _require_sequence(first, second, key)
    return common


def differing(first: OpenedRun, second: OpenedRun) -> tuple[tuple[str, str, str], ...]:
    """Settings and versions that differ: name, value in the first run, value in the second."""
    settings = [dict(dotted(run.settings)) for run in (first, second)]
    versions = [
        {f"version of {name}": value for name, value in run.manifest.versions.items()} for run in (first, second)
    ]
    return tuple(
        (name, _shown(a.get(name)), _shown(b.get(name)))
        for a, b in (settings, versions)
        for name in dict.fromkeys([*a, *b])
        if a.get(name) != b.get(name)
    )


def _versions(run: OpenedRun) -> dict[str, str]:
    return {f"version of {name}": found for name, found in run.manifest.versions.items()}


def _require_settings(first: OpenedRun, second: OpenedRun) -> None:
    known, found = first.flat(), second.flat()
    for name in dict.fromkeys([*known, *found]):
        counts = name.startswith((_DATA, _TRUTH)) and not name.startswith(_FREE)
        if counts and known.get(name) != found.get(name):
            what = "other data" if name.startswith(_DATA) else "other truth"
            values = f"{name} is {_shown(known.get(name))} and {_shown(found.get(name))}"
            raise _refusal(first, second, what, values, "the same")


def _require_libraries(first: OpenedRun, second: OpenedRun) -> None:
    known, found = first.manifest.versions, second.manifest.versions
    for name in LIBRARIES:
        if known.get(name) != found.get(name):
            values = f"{name} {known.get(name, 'of unknown version')} and {found.get(name, 'of unknown version')}"
            raise _refusal(first, second, "another library", values, "the same version")


def _require_sequence(first: OpenedRun, second: OpenedRun, key: str) -> None:
    """Refuse a sequence whose images or true geometry are not the same."""
    known, found = (run.manifest.sequences[key] for run in (first, second))
    sequence = readable(key)
    for what, names in (("other data", _OF_IMAGES), ("other truth", _OF_TRUTH)):
        for name in names:
            if getattr(known, name) != getattr(found, name):
                values = f"{name} of {sequence} is {getattr(known, name)} and {getattr(found, name)}"
                raise _refusal(first, second, what, values, "the same")
    if known.snapshot_frame == found.snapshot_frame and _hash(known, "snapshots") != _hash(found, "snapshots"):
        raise _refusal(
            first, second, "other data", f"frame {known.snapshot_frame} of {sequence} differs", "the same image"
        )
    for name in ("poses", "cameras"):
        if _hash(known, name) != _hash(found, name) and not _equal(first, second, name, key):
            raise _refusal(first, second, "other truth", f"{name} of {sequence} differ", "the same")


def _hash(entry: SequenceEntry, name: str) -> str | None:
    return entry.sha256.get(name)


def _equal(first: OpenedRun, second: OpenedRun, name: str, key: str) -> bool:
    """Whether two tables have the same content, although their files differ."""
    return first.folder.sequence_table(name, key).equals(second.folder.sequence_table(name, key))


def _refusal(first: OpenedRun, second: OpenedRun, what: str, found: str, expected: str) -> SettingsError:
    pair = f"{first.name} and {second.name} cannot be compared"
    return SettingsError(f"{pair}: {what}: {found}, expected {expected}")


def _shown(value: object) -> str:
    return "not set" if value is None else str(value)


def _some(keys: Iterable[str]) -> str:
    """A few keys."""
    ordered = sorted(keys)
    return ", ".join(ordered[:_SHORT]) + (", ..." if len(ordered) > _SHORT else "")


def failed_in(first: OpenedRun, second: OpenedRun) -> Iterator[str]:
    """Sentences about sequences that the first run has measured, and the second could not."""
    failed = set(first.manifest.sequences) & set(second.manifest.failures)
    if failed:
        yield f"{second.name} could not measure {_some(failed)}, which {first.name} measured."


def left_out(first: OpenedRun, second: OpenedRun) -> Iterator[str]:
    """Sentences about sequences that only one of the runs was to measure."""
    for one, other in ((first, second), (second, first)):
        known = set(other.manifest.sequences) | set(other.manifest.failures)
        if only := set(one.manifest.sequences) - known:
            yield f"{other.name} has no {_some(only)}, which {one.name} measured."
