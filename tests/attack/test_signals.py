"""A signal that comes while the interpreter exits interrupts nothing, and is not counted."""

import signal
import subprocess
import sys

import pytest
from benchmarks.attack.signals import interrupt

RUNNING = "signal.signal(signal.SIGHUP, lambda *_: sys.exit(7))"
EXITING = "processes.ignore()"


@pytest.mark.parametrize(("state", "sent", "status"), [(RUNNING, True, 7), (EXITING, False, 0)])
@pytest.mark.parametrize("group", [False, True])
def test_a_signal_is_sent_only_to_a_program_that_handles_it(state, sent, status, group):
    imports = "import signal, sys; from tracknoise import processes"
    text = f"{imports}; {state}; print('ready', flush=True); sys.stdin.read()"
    program = subprocess.Popen(
        [sys.executable, "-c", text], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, process_group=0
    )
    assert program.stdout.readline() == "ready\n"
    assert interrupt(program, signal.SIGHUP, 1, group=group) == sent
    program.communicate()
    assert program.returncode == status
