"""A temporary folder, and programs that run in it: a guard ends and removes both when this process ends in any way.

The guard is a small process of its own, outside the group of this one. A pipe and the number of its parent tell it that
this process has gone. It ends a program with its process group; on Linux also what left the group. This file is what
the guard runs, with the standard library alone.
"""

import ctypes
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import BufferedRandom
from pathlib import Path
from types import FrameType
from typing import Any

LOG = "output.log"
"""What a program prints, in the folder."""
_LAST_BYTES = 4096
_LOOK_S = 0.5
"""How often the guard looks whether its parent still runs, seconds; the pipe tells it earlier in most cases."""
_SET_DEATH_SIGNAL, _SET_SUBREAPER = 1, 36
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@dataclass(frozen=True, slots=True)
class Ended:
    """How a program ended.

    Parameters
    ----------
    code
        Its exit code, minus the number of a signal; None if it was ended because its time was over.
    last_line
        What it printed last; empty if it printed nothing.
    """

    code: int | None
    last_line: str


class GuardLostError(Exception):
    """The guard was killed. What ran in the folder is ended."""


@dataclass(frozen=True, slots=True)
class GuardedFolder:
    """An open folder: see `guarded_folder`."""

    path: Path
    _guard: "subprocess.Popen[bytes]"

    def run(self, words: Sequence[str], timeout_s: float) -> Ended:
        """Run a program in the folder, and end it and all that it started when it ends or its time is over.

        Raises
        ------
        OSError
            If it cannot be started.
        GuardLostError
            If the guard was killed.
        """
        group = None
        try:
            self._tell({"words": list(words), "timeout_s": timeout_s})
            group = _heard(self._guard)["group"]
            ended = _heard(self._guard)
        except (EOFError, BrokenPipeError) as error:
            with suppress(ProcessLookupError, TypeError):
                os.killpg(group, signal.SIGKILL)  # type: ignore[arg-type]
            raise GuardLostError("the process that watches it was killed") from error
        return Ended(ended["code"], ended["last_line"])

    def _tell(self, request: dict[str, Any]) -> None:
        assert self._guard.stdin is not None, "a pipe"
        self._guard.stdin.write(json.dumps(request).encode() + b"\n")
        self._guard.stdin.flush()


@contextmanager
def guarded_folder(prefix: str) -> Iterator[GuardedFolder]:
    """Give a temporary folder whose name begins with a prefix. It is removed when the block, or this process, ends.

    Raises
    ------
    OSError
        If it cannot be made.
    """
    command = [sys.executable, "-I", "-S", __file__, str(os.getpid()), prefix, tempfile.gettempdir()]
    guard = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # it outlives this process
    )
    folder: Path | None = None
    try:
        folder = Path(os.fsdecode(bytes.fromhex(_heard(guard)["folder"])))
        yield GuardedFolder(folder, guard)
    finally:
        guard.communicate()  # closes its input, and waits
        if guard.returncode and folder is not None:
            shutil.rmtree(folder, ignore_errors=True)  # it was killed


def _heard(guard: "subprocess.Popen[bytes]") -> dict[str, Any]:
    """The next line of the guard."""
    assert guard.stdout is not None, "a pipe"
    line = guard.stdout.readline()
    if not line:
        raise EOFError
    said: dict[str, Any] = json.loads(line)
    if "errno" in said:
        raise OSError(said["errno"], os.strerror(said["errno"]))
    return said


def _serve(parent: int, prefix: str, where: str) -> None:
    """What the guard does: make a folder, run programs on request, and remove the folder."""
    for number in _ENDING:
        signal.signal(number, _leave)
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    _set_process_option(_SET_SUBREAPER, 1)  # what its programs leave becomes its own child
    try:
        folder = tempfile.mkdtemp(prefix=prefix, dir=where)
    except OSError as error:
        _say({"errno": error.errno})
        return
    try:
        _say({"folder": os.fsencode(folder).hex()})
        while request := _request(parent):
            _run(parent, folder, request["words"], request["timeout_s"])
    finally:
        _ignore_signals()
        _end_children()
        shutil.rmtree(folder, ignore_errors=True)


def _run(parent: int, folder: str, words: list[str], timeout_s: float) -> None:
    """Run a program, and say its process group and how it ended."""
    awake, wake = os.pipe()
    os.set_blocking(wake, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
    guard = os.getpid()
    with open(os.path.join(folder, LOG), "w+b") as output:  # noqa: PTH118, PTH123 (as little as possible is loaded)
        try:
            program = subprocess.Popen(
                words,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=lambda: _end_with(guard),  # the guard has one thread
            )
        except OSError as error:
            _say({"errno": error.errno})
            return
        try:
            _say({"group": program.pid})
            code = _waited(program, parent, awake, time.monotonic() + timeout_s)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(program.pid, signal.SIGKILL)
            program.wait()
            _end_children()
        _say({"code": code, "last_line": _last_line(output)})


def _waited(program: "subprocess.Popen[bytes]", parent: int, awake: int, deadline: float) -> int | None:
    """The exit code of a program; None if it still runs when its time is over. Exits if the parent has gone."""
    while program.poll() is None:
        left = deadline - time.monotonic()
        if left <= 0:
            return None
        ready, _, _ = select.select([sys.stdin, awake], [], [], min(left, _LOOK_S))
        if sys.stdin in ready or os.getppid() != parent:  # nothing is asked meanwhile: the pipe was closed
            sys.exit()
        if awake in ready:
            os.read(awake, _LAST_BYTES)
    return program.returncode


def _request(parent: int) -> dict[str, Any] | None:
    """What is to be run next; None at the end."""
    while os.getppid() == parent:
        if select.select([sys.stdin], [], [], _LOOK_S)[0]:
            line = sys.stdin.buffer.readline()
            return json.loads(line) if line else None
    return None


def _say(message: dict[str, Any]) -> None:
    with suppress(BrokenPipeError):
        sys.stdout.write(json.dumps(message) + "\n")
        sys.stdout.flush()


def _leave(number: int, frame: FrameType | None) -> None:
    _ignore_signals()
    sys.exit()


def _ignore_signals() -> None:
    for number in _ENDING:
        signal.signal(number, signal.SIG_IGN)


def _end_with(guard: int) -> None:
    """Let the kernel end this process if the guard is killed, where it can."""
    _set_process_option(_SET_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != guard:
        os._exit(1)


def _set_process_option(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def _end_children() -> None:
    """End all children of this process, and theirs, which become its own: the process group may have been left."""
    while children := _children():
        for child in children:
            with suppress(ProcessLookupError, ChildProcessError):
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)


def _children() -> list[int]:
    """Numbers of the children of this process, from ``/proc``; none where there is no such folder."""
    children = []
    for name in os.listdir("/proc") if os.path.isdir("/proc") else ():  # noqa: PTH112, PTH208
        with suppress(OSError):
            if name.isdecimal():
                with open(f"/proc/{name}/stat", "rb") as file:  # noqa: PTH123
                    after_its_name = file.read().rpartition(b")")[2].split()
                if int(after_its_name[1]) == os.getpid():
                    children.append(int(name))
    return children


def _last_line(log: BufferedRandom) -> str:
    """What a program printed last. It may have removed or replaced the file of this name."""
    number = log.fileno()
    end = os.pread(number, _LAST_BYTES, max(os.fstat(number).st_size - _LAST_BYTES, 0))
    lines = [line.strip() for line in end.decode(errors="replace").splitlines() if line.strip()]
    return lines[-1] if lines else ""


if __name__ == "__main__":
    _serve(int(sys.argv[1]), sys.argv[2], sys.argv[3])
