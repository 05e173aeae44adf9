"""Workers are as many as cores that this process may use."""

import os
import subprocess
import sys

import pytest

from tracknoise.cli.shared_options import processes

ASK = "from tracknoise.cli.shared_options import processes; print(processes(None), processes(3))"


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system limits no process to some cores")
def test_a_process_that_is_limited_to_one_core_gets_one_worker_unless_more_are_asked_for():
    one = min(os.sched_getaffinity(0))
    command = [sys.executable, "-c", f"import os; os.sched_setaffinity(0, {{{one}}}); {ASK}"]
    ended = subprocess.run(command, capture_output=True, text=True, check=True)
    assert ended.stdout.split() == ["1", "3"]


def test_there_is_one_worker_where_the_system_does_not_say(monkeypatch):
    for name in ("process_cpu_count", "sched_getaffinity"):
        monkeypatch.delattr(os, name, raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    monkeypatch.setattr(sys, "version_info", (3, 12))
    assert processes(None) == 1
