"""Keeps the manifest of a run up to date while it goes on."""

import time
from types import TracebackType
from typing import Self

from tracknoise.exceptions import StoreError
from tracknoise.experiments.running.failures import Failure
from tracknoise.tables.store import Manifest, RunFolder, SequenceEntry

_SHARE = 0.05


class ManifestWriter:
    """What is measured and what failed, written to the run folder as it comes, and in the end.

    Writing takes longer the more sequences there are. It waits while it would take more than a twentieth of the time:
    a run that is killed then measures again what came in that time.

    Parameters
    ----------
    run
        Where to write.
    manifest
        What is known so far; changed in place.
    """

    def __init__(self, run: RunFolder, manifest: Manifest) -> None:
        self._run, self.manifest = run, manifest
        self._failures: dict[str, Failure] = {}
        self._next = 0.0

    def __enter__(self) -> Self:
        self.write()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.write()
        except StoreError:
            if error is None:  # otherwise what ended the run is what is to be told
                raise

    def measured(self, entry: SequenceEntry) -> None:
        """Note that the tables of a sequence are whole."""
        self.manifest.sequences[entry.key] = entry

    def failed(self, key: str, failure: Failure) -> None:
        """Note that a sequence could not be measured."""
        self.manifest.failures[key] = failure.cause
        self._failures[key] = failure

    def write_if_due(self) -> None:
        """Write, unless that was done too shortly before."""
        if time.monotonic() >= self._next:
            self.write()

    def write(self) -> None:
        """Write manifest and failures.

        Raises
        ------
        StoreError
            If the folder cannot be written.
        """
        started = time.monotonic()
        self._run.write_failures({key: failure.entry for key, failure in self._failures.items()})
        self._run.write_manifest(self.manifest)
        finished = time.monotonic()
        self._next = finished + (finished - started) / _SHARE
