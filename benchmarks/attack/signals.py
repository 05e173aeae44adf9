"""Runs that are ended by a signal at random moments and resumed, compared with one that was left alone.

    python -m benchmarks.attack signals [--count N] [--seed N] [--phases PHASE ...]

Ctrl-C, SIGTERM and SIGHUP go to the program alone or to all its processes, as from a terminal, once or five times. The
program must print exactly one line, exit with 128 plus the number of the signal, and leave no worker. After the run is
resumed, every file must be the same to the byte; of the manifest, everything but the seconds.

A program whose results are all written ignores signals while its interpreter exits. Whether it still handles them is
asked while it is stopped, right before the signal is sent. If it does not, nothing was interrupted, and another run is
started.
"""

import argparse
import os
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Mapping, Sequence

from benchmarks.attack.subject import (
    PHASES,
    SCENES,
    Subject,
    handles_signals,
    measured,
    subjects,
    wait_for,
    wait_until_stopped,
    workers,
)

NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
TIMES = (1, 5)
_PAUSE_S = 0.05
_LIMIT_S = 60


def main(arguments: Sequence[str]) -> int:
    """Print one line per run; the exit code is 1 if one of them ended in another way or has other results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.attack signals", description=__doc__)
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--phases", nargs="+", choices=PHASES, default=list(PHASES))
    options = parser.parse_args(arguments)
    with subjects(options.phases) as attacked:
        wrong = _all(attacked, random.Random(options.seed), options.count)
    print(f"{options.count - wrong} of {options.count} runs ended with one line and have the same results")
    return int(bool(wrong))


def _all(attacked: Mapping[str, Subject], rng: random.Random, count: int) -> int:
    phases, sent, wrong = tuple(attacked), 0, 0
    while sent < count:
        phase, number = phases[sent % len(phases)], NUMBERS[(sent + sent // len(phases)) % len(NUMBERS)]
        subject = attacked[phase]
        times, group = rng.choice(TIMES), rng.random() < 0.5
        shutil.rmtree(subject.folder / "run", ignore_errors=True)
        program = subject.start("run")
        if not subject.reach(program, "run", phase, rng):
            program.communicate()
            continue
        there, done = workers(program.pid), measured(subject.folder / "run")
        if not interrupt(program, number, times, group=group):
            program.communicate()
            continue
        sent += 1
        faults = _faults(program, number)
        if wait_for(there) == float("inf"):
            faults.append("a worker is left")
        status = subject.resume("run")
        faults += [f"resumed with status {status}"] * bool(status) + subject.differences("run")
        wrong += bool(faults)
        how = f"{number.name} {times} x to {'all' if group else 'the program'}"
        verdict = "; ".join(faults) or "one line, the same"
        print(f"{how:>27} in phase {phase:>11}, {done} of {SCENES} measured: {verdict}", flush=True)
    return wrong


def interrupt(program: subprocess.Popen[str], number: signal.Signals, times: int, *, group: bool) -> bool:
    """Send a signal some times; False, and nothing is sent, if the program has ended but for its interpreter."""
    receiver = -program.pid if group else program.pid
    os.kill(program.pid, signal.SIGSTOP)
    handles = wait_until_stopped(program.pid) and handles_signals(program.pid)
    if handles:
        os.kill(receiver, number)
    os.kill(program.pid, signal.SIGCONT)
    for _ in range(handles * (times - 1)):
        time.sleep(_PAUSE_S)
        if program.poll() is None:
            os.kill(receiver, number)
    return handles


def _faults(program: subprocess.Popen[str], number: signal.Signals) -> list[str]:
    """What is wrong with the end of a program that was interrupted."""
    try:
        _, errors = program.communicate(timeout=_LIMIT_S)
    except subprocess.TimeoutExpired:
        program.kill()
        return [f"it did not end; it said {program.communicate()[1]!r}"]
    how = "interrupted" if number is signal.SIGINT else f"ended by {number.name}"
    expected = f"tracknoise: error: {how}; run the same command again to resume\n"
    faults = [] if errors == expected else [f"it said {errors!r}"]
    return faults if program.returncode == 128 + number else [*faults, f"status {program.returncode}"]
