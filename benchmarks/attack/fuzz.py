"""Damaged files for every parser: ``python -m benchmarks.attack fuzz [--count N] [--seed N] [--only NAME]``.

Every input is a valid file with one to four random changes, which depend only on the seed, the parser's name and the
input's number. A parser must accept it or raise one of tracknoise's own exceptions, of one line. Inputs are read in
forked processes, 500 in each, under a limit of memory (1 GiB more than before) and of time (10 s for each input).

Printed is a table of counts: inputs that were accepted or refused, and the faults: another exception, the death of the
process, a hang, and too much memory. Inputs with a fault are saved with their tracebacks.
"""

import argparse
import mmap
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from random import Random

from benchmarks.attack.mutations import mutated
from benchmarks.attack.parsers import PARSERS, Parser
from tracknoise.exceptions import DataWarning, TracknoiseError

BATCH, TIMEOUT_S, MEMORY = 500, 10.0, 1 << 30


class Outcome(IntEnum):
    """What became of one input. `waiting` and `started` are states of a batch only."""

    waiting = 0
    started = 1
    accepted = 2
    refused = 3
    foreign = 4
    death = 5
    hang = 6
    memory = 7


FAULTS = (Outcome.foreign, Outcome.death, Outcome.hang, Outcome.memory)


@dataclass(frozen=True, slots=True)
class Fault:
    """One input that a parser neither accepted nor refused with one line."""

    parser: str
    number: int
    outcome: Outcome
    saved: Path

    @property
    def summary(self) -> str:
        """The first line of its record."""
        return record_of(self.saved).read_text().partition("\n")[0]


def main(arguments: list[str]) -> int:
    """Fuzz every parser and print a table; 1 if there was a fault."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.attack fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=20_000, help="inputs in all")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", action="append", choices=[item.name for item in PARSERS], help="repeatable")
    parser.add_argument("--out", type=Path, help="where to save inputs with a fault")
    options = parser.parse_args(arguments)
    chosen = [item for item in PARSERS if not options.only or item.name in options.only]
    out = options.out or Path(tempfile.mkdtemp(prefix="tracknoise-fuzz-"))
    faults = [fault for item in chosen for fault in _report(item, options.count // len(chosen), options.seed, out)]
    for (name, summary), count in Counter((fault.parser, fault.summary) for fault in faults).most_common():
        example = next(fault for fault in faults if (fault.parser, fault.summary) == (name, summary))
        print(f"{count:6d} x {name}: {summary}\n         {example.saved}")
    return int(bool(faults))


def _report(parser: Parser, count: int, seed: int, out: Path) -> list[Fault]:
    started = time.monotonic()
    counts, faults = fuzz(parser, count, seed, out)
    figures = "  ".join(f"{outcome.name} {counts[outcome]:6d}" for outcome in Outcome if outcome > Outcome.started)
    print(f"{parser.name:26} {figures}  {time.monotonic() - started:6.1f} s", flush=True)
    return faults


def fuzz(parser: Parser, count: int, seed: int, out: Path) -> tuple[Counter[Outcome], list[Fault]]:
    """Give a parser damaged files.

    Parameters
    ----------
    parser
        Which one.
    count
        Number of inputs.
    seed
        Of the damage.
    out
        Where inputs with a fault are saved.

    Returns
    -------
    counts
        Number of inputs by outcome.
    faults
        Those that are neither accepted nor refused.
    """
    outcomes = mmap.mmap(-1, count)
    with tempfile.TemporaryDirectory(dir=_memory_folder(), prefix="tracknoise-fuzz-") as folder:
        samples = Path(folder) / "samples"
        if _forked(lambda: parser.write(samples)):
            raise RuntimeError(f"{parser.name}: its valid files cannot be written")
        case = _Cases(parser, samples, seed, out / parser.name.replace(" ", "-"))
        start = 0
        while start < count:
            start = _batch(case, outcomes, start, min(count, start + BATCH))
    found = [Outcome(value) for value in outcomes[:]]
    faults = [Fault(parser.name, n, value, case.saved(n)) for n, value in enumerate(found) if value in FAULTS]
    return Counter(found), faults


class _Cases:
    """The numbered inputs of one parser."""

    def __init__(self, parser: Parser, samples: Path, seed: int, out: Path) -> None:
        self._parser, self._seed, self._out = parser, seed, out
        self._files = sorted(path for path in samples.glob(parser.files) if path.is_file())
        self._valid = {path: path.read_bytes() for path in self._files}
        if not self._files:
            raise RuntimeError(f"{parser.name}: no valid file matches {parser.files}")

    def warm_up(self) -> None:
        """Read every valid file, so that whatever is loaded or started once is there before memory is limited."""
        for path, content in self._valid.items():
            path.write_bytes(content)  # a process that died may have left it damaged
        for path in self._files:
            self._parser.read(path)

    def input(self, number: int) -> tuple[Path, bytes]:
        """The file to damage, and its damaged content."""
        rng = Random(f"{self._seed} {self._parser.name} {number}")
        path = rng.choice(self._files)
        content = mutated(self._valid[path], rng, list(self._valid.values()))
        return path, self._parser.repaired(content, rng)

    def read(self, number: int) -> Outcome:
        """Let the parser read one input."""
        path, content = self.input(number)
        path.write_bytes(content)
        try:
            return self._read(path, number)
        finally:
            path.write_bytes(self._valid[path])

    def _read(self, path: Path, number: int) -> Outcome:
        try:
            self._parser.read(path)
        except TracknoiseError as error:
            if len(str(error).splitlines()) == 1 and str(error).isprintable():
                return Outcome.refused
            self.save(number, f"not one printable line: {type(error).__name__} at {_place(error)}\n{error!s}")
            return Outcome.foreign
        except MemoryError as error:
            self.save(number, f"MemoryError at {_place(error)}\n{traceback.format_exc()}")
            return Outcome.memory
        except BaseException as error:
            self.save(number, f"{type(error).__name__} at {_place(error)}\n{traceback.format_exc()}")
            return Outcome.foreign
        return Outcome.accepted

    def saved(self, number: int) -> Path:
        """Where an input is saved."""
        return self._out / f"{number}-{self.input(number)[0].name}"

    def save(self, number: int, record: str) -> None:
        """Save an input, and what happened, beside it."""
        self._out.mkdir(parents=True, exist_ok=True)
        self.saved(number).write_bytes(self.input(number)[1])
        record_of(self.saved(number)).write_text(record, errors="backslashreplace")


def record_of(saved: Path) -> Path:
    """The file, beside a saved input, that says what happened."""
    return saved.with_name(f"{saved.name}.fault")


def _batch(cases: _Cases, outcomes: mmap.mmap, start: int, stop: int) -> int:
    """Read some inputs in a child process; the number of the first that is left, because the process ended before."""

    def read_all() -> None:
        cases.warm_up()
        _limit_memory()
        for number in range(start, stop):
            outcomes[number] = Outcome.started
            signal.setitimer(signal.ITIMER_REAL, TIMEOUT_S)
            outcomes[number] = cases.read(number)
            signal.setitimer(signal.ITIMER_REAL, 0)

    status = _forked(read_all)
    last = max((number for number in range(start, stop) if outcomes[number] != Outcome.waiting), default=None)
    if last is None:
        raise RuntimeError(f"the valid files cannot be read (status {status})")
    if outcomes[last] == Outcome.started:
        outcomes[last] = Outcome.hang if -status == signal.SIGALRM else Outcome.death
        cases.save(last, f"{Outcome(outcomes[last]).name}: exit status {status}")
    return last + 1


def _forked(work: object) -> int:
    """Do something in a forked process, in silence. Returns its exit status, negative for a signal."""
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            _be_silent()
            work()  # type: ignore[operator]
            code = 0
        except BaseException:
            os.write(_STDERR, traceback.format_exc().encode(errors="backslashreplace"))
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


_STDERR = os.dup(2)


def _be_silent() -> None:
    """Decoders and libraries print. A warning that is not tracknoise's own counts as an exception."""
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", DataWarning)
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    os.dup2(nothing, 2)


def _limit_memory() -> None:
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))


def _memory_folder() -> str | None:
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def _place(error: BaseException) -> str:
    """File and line where an exception was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if "tracknoise" in frame.filename]
    return " < ".join(f"{Path(frame.filename).name}:{frame.lineno}" for frame in (frames[-1], *ours[-1:]))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
