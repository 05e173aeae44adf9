"""Runs that are killed at random moments and resumed, compared with one that was left alone.

    python -m benchmarks.attack kills [--count N] [--seed N] [--phases PHASE ...]

Each run is the whole program, `tracknoise run` with two workers, in a folder of its own. Runs that are killed before
the report begins write none, because it would take most of the time. SIGKILL goes to the program, to some of its
workers, or to all at once, at a random moment of each phase, or of the phases that are named, in turn. A program that
was killed is started again. In the end every file of the run must be the same to the byte; of the manifest, everything
but the seconds. What was killed has workers and programs of the user, one of which leaves its session: all processes
must end by themselves, and leave no temporary folder. Printed is how long that took.
"""

import argparse
import math
import random
import shutil
import signal
from collections.abc import Mapping, Sequence

from benchmarks.attack.subject import PHASES, SCENES, Subject, below, measured, subjects, wait_for, workers

VICTIMS = ("program", "worker", "all")
_SHOWN = 3


def main(arguments: Sequence[str]) -> int:
    """Print one line per run; the exit code is 1 if one of them has other results."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.attack kills", description=__doc__)
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--phases", nargs="+", choices=PHASES, default=list(PHASES))
    options = parser.parse_args(arguments)
    with subjects(options.phases) as attacked:
        wrong = _all(attacked, random.Random(options.seed), options.count)
    print(f"{options.count - wrong} of {options.count} runs are the same as the one that was left alone")
    return int(bool(wrong))


def _all(attacked: Mapping[str, Subject], rng: random.Random, count: int) -> int:
    phases, killed, wrong = tuple(attacked), 0, 0
    while killed < count:
        phase = phases[killed % len(phases)]
        victim = VICTIMS[killed // len(phases) % len(VICTIMS)] if phase in ("workers", "measurement") else "program"
        subject = attacked[phase]
        shutil.rmtree(subject.folder / "run", ignore_errors=True)
        ended = _one(subject, phase, victim, rng)
        if ended is None:  # it had ended, or there was no worker
            continue
        result, orphaned_s = ended
        killed += 1
        faults = subject.differences("run") + ["PROCESSES"] * math.isinf(orphaned_s)
        wrong += bool(faults)
        verdict = f"OTHER FILES: {', '.join(faults[:_SHOWN])}" if faults else "the same"
        print(f"{victim:>8} killed in phase {phase:>11}: {result}: {verdict}", flush=True)
    return wrong


def _one(attacked: Subject, phase: str, victim: str, rng: random.Random) -> tuple[str, float] | None:
    """Kill once, and let the run end; what happened, and how long processes were left. None: nothing to kill."""
    program = attacked.start("run")
    reached = attacked.reach(program, "run", phase, rng)
    there = workers(program.pid)
    if not reached or (victim == "worker" and not there):
        program.communicate()
        return None
    done = measured(attacked.folder / "run")
    chosen = {"program": [], "worker": there[: 1 + rng.randrange(len(there) or 1)], "all": there}[victim]
    killed = [worker.pid for worker in chosen] if victim == "worker" else [program.pid]
    left = [process for pid in killed for process in below(pid)]
    for worker in chosen:
        worker.kill()
    if victim == "worker":
        orphaned_s = wait_for(left)
        program.communicate()
        what = f"{len(chosen)} of {len(there)} workers; status {program.returncode}"
    else:
        program.send_signal(signal.SIGKILL)
        program.communicate()
        orphaned_s = wait_for(left)
        what = f"then status {attacked.resume('run')}"
    return f"{done} of {SCENES} measured; {len(left)} processes below gone after {orphaned_s:.1f} s; {what}", orphaned_s
