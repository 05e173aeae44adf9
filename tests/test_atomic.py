"""Files and folders that appear whole or not at all."""

import os
import subprocess
import sys

import pytest

from tracknoise import atomic

KILLED = """
import os, signal, sys
from pathlib import Path
from tracknoise import atomic

with getattr(atomic, sys.argv[1])(Path(sys.argv[2])) as folder:
    (folder / "file").write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def kill_while_writing(kind, path):
    """Let a process that writes a folder be killed, and return what it leaves."""
    subprocess.run([sys.executable, "-c", KILLED, kind, str(path)], check=False)
    return list(atomic.unfinished(path.parent, of=path.name))


def test_a_file_has_all_of_its_content_and_nothing_is_left_beside_it(tmp_path):
    atomic.write_file(tmp_path / "below" / "file", b"old")
    atomic.write_file(tmp_path / "below" / "file", b"new", durably=True)
    assert (tmp_path / "below" / "file").read_bytes() == b"new"
    assert [path.name for path in (tmp_path / "below").iterdir()] == ["file"]


def test_a_file_that_cannot_be_written_is_as_it_was(tmp_path, monkeypatch):
    atomic.write_file(tmp_path / "file", b"old")

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        atomic.write_file(tmp_path / "file", b"new", durably=True)
    assert (tmp_path / "file").read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def write(path, content):
    with atomic.replaced_folder(path) as folder:
        (folder / content).write_text(content)
        assert not (path / content).exists()


def test_a_folder_is_replaced_as_a_whole(tmp_path):
    write(tmp_path / "folder", "old")
    write(tmp_path / "folder", "new")
    assert [path.name for path in (tmp_path / "folder").iterdir()] == ["new"]
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


def fail(path):
    with atomic.replaced_folder(path):
        raise KeyboardInterrupt


def test_a_folder_whose_replacement_fails_stays(tmp_path):
    write(tmp_path / "folder", "old")
    with pytest.raises(KeyboardInterrupt):
        fail(tmp_path / "folder")
    assert (tmp_path / "folder" / "old").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


def test_a_file_is_not_replaced_by_a_folder(tmp_path):
    (tmp_path / "folder").write_text("a file")
    with pytest.raises(OSError, match="Not a directory"):
        write(tmp_path / "folder", "new")
    assert (tmp_path / "folder").read_text() == "a file"


@pytest.mark.parametrize("kind", ["created_folder", "replaced_folder"])
def test_what_a_killed_process_left_is_removed_by_the_next_one(tmp_path, kind):
    path = tmp_path / "report [1]"
    assert [leftover.name.endswith(atomic.UNFINISHED) for leftover in kill_while_writing(kind, path)] == [True]
    with getattr(atomic, kind)(path) as folder:
        (folder / "file").write_text("whole")
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_running_process_is_writing_stays(tmp_path):
    with atomic.replaced_folder(tmp_path / "report") as folder:
        write(tmp_path / "report", "meanwhile")
        (folder / "file").write_text("later")
    assert [path.name for path in (tmp_path / "report").iterdir()] == ["file"]


@pytest.mark.parametrize("kind", ["created_folder", "replaced_folder"])
def test_a_folder_of_a_killed_process_is_removed_although_another_process_has_its_number(tmp_path, kind):
    path = tmp_path / "report"
    (leftover,) = kill_while_writing(kind, path)
    number = leftover.name.split(".")[2]
    leftover.rename(leftover.with_name(leftover.name.replace(f".{number}.", f".{os.getpid()}.")))
    with getattr(atomic, kind)(path) as folder:
        (folder / "file").write_text("whole")
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_is_removed_before_it_is_locked_is_made_again(tmp_path, monkeypatch):
    opened, open_ = [], os.open

    def remove_the_first(name, flags):
        opened.append(name)
        if len(opened) == 1:
            name.rmdir()
        return open_(name, flags)

    monkeypatch.setattr(os, "open", remove_the_first)
    with atomic.created_folder(tmp_path / "folder") as folder:
        assert folder.is_dir()
        assert opened[0] != folder


def test_without_locks_the_folder_of_a_process_that_runs_stays(tmp_path, monkeypatch):
    def unsupported(descriptor, operation):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr("tracknoise.atomic.fcntl.flock", unsupported)
    test_what_a_running_process_is_writing_stays(tmp_path / "a")
    kill_while_writing("replaced_folder", tmp_path / "b" / "report")
    write(tmp_path / "b" / "report", "whole")
    assert [path.name for path in (tmp_path / "b").iterdir()] == ["report"]


def test_unfinished_files_of_other_names_are_not_those_of_a_folder(tmp_path):
    path = tmp_path / "report"
    kill_while_writing("created_folder", tmp_path / "reports")
    assert not list(atomic.unfinished(tmp_path, of=path.name))
    assert len(list(atomic.unfinished(tmp_path))) == 1
