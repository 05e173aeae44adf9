"""Keeps the manifest of a run up to date while it is measured."""

import time
from types import TracebackType
from typing import Self

from tracknoise.exceptions import StoreError
from tracknoise.experiments.running.failures import Failure
from tracknoise.experiments.running.lock import Claim
from tracknoise.tables.manifest import Manifest, SequenceEntry
from tracknoise.tables.store import RunFolder

_SHARE = 0.05
"""Maximum share of the time that is spent writing the manifest."""


class ManifestWriter:
    """Records measured and failed sequences, and writes them to the run folder during the run and at its end.

    Writing takes longer with more sequences. It is delayed so that it takes at most a twentieth of the time. Sequences
    measured since the last write are measured again if the run is killed.

    Parameters
    ----------
    run
        The run folder.
    manifest
        The manifest so far; changed in place.
    claim
        Proof that the run holds the lock of the folder, checked before each write. Not needed by default.
    """

    def __init__(self, run: RunFolder, manifest: Manifest, claim: Claim | None = None) -> None:
        self._run, self.manifest, self._claim = run, manifest, claim
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
            if error is None:  # otherwise report the error that ended the run
                raise

    def measured(self, entry: SequenceEntry) -> None:
        """Record that a sequence was measured and its tables are complete. Earlier statistics are outdated."""
        self.manifest.sequences[entry.key] = entry
        self.manifest.statistics.clear()

    def failed(self, key: str, failure: Failure) -> None:
        """Record that a sequence failed."""
        self.manifest.failures[key] = failure.cause
        self._failures[key] = failure

    def write_if_due(self) -> None:
        """Write, unless the last write was too recent."""
        if time.monotonic() >= self._next:
            self.write()

    def write(self) -> None:
        """Write manifest and failures.

        Raises
        ------
        StoreError
            If the folder cannot be written, or was removed.
        """
        if self._claim:
            self._claim.require()  # a folder that was removed must not be created again
        started = time.monotonic()
        self._run.write_failures({key: failure.entry for key, failure in self._failures.items()})
        self._run.write_manifest(self.manifest)
        finished = time.monotonic()
        self._next = finished + (finished - started) / _SHARE
