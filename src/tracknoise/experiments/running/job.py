"""What a worker does with a batch."""

import socket
from dataclasses import dataclass
from functools import partial

from tracknoise.experiments.running.failures import Batch, Result
from tracknoise.experiments.running.lock import Claim
from tracknoise.experiments.running.provenance import require_versions
from tracknoise.experiments.running.task import attempt
from tracknoise.experiments.running.worker import notify
from tracknoise.tables.store import RunFolder
from tracknoise.trackers.threads import use_one_thread


@dataclass(frozen=True, slots=True)
class Job:
    """What every worker needs besides its batch.

    Attributes
    ----------
    run
        The run folder.
    claim
        Proof that the run still holds the lock of the folder.
    versions
        Versions at the start of the run of the libraries that affect results.
    debug
        Raise failures instead of recording them.
    one_thread
        Use one thread in OpenCV, because other workers use the other cores.
    """

    run: RunFolder
    claim: Claim
    versions: dict[str, str]
    debug: bool
    one_thread: bool = True

    def __call__(self, batch: Batch) -> Result:
        """Measure a batch in a worker."""
        if self.one_thread:
            use_one_thread()
        require_versions(self.versions, place=f"worker on {socket.gethostname()}")
        self.claim.check()
        progress = partial(notify, batch[0].key)
        return attempt(batch, self.run, claim=self.claim, progress=progress, debug=self.debug)
