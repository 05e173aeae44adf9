"""Reading foreign files: only regular files of bounded size, one line for whatever parsers raise, and their child."""

import math
import os
import signal
import time
from pathlib import Path

import pytest

from tracknoise import parsing_child
from tracknoise.exceptions import DataError, TracknoiseError, one_line
from tracknoise.foreign_files import (
    absolute,
    damage_reported,
    is_folder,
    is_regular_file,
    number_in,
    read_bytes,
    read_text,
)
from tracknoise.parsing_child import LostError, call_in_child, cpu_time_of_calls


def test_pipes_devices_and_folders_are_refused_without_opening_them(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(DataError, match=r"unreadable \(not a regular file\), expected a thing$"):
            read_bytes(path, "a thing")
        assert not is_regular_file(path)
    with pytest.raises(DataError, match=r"unreadable \(Is a directory\), expected text of a thing$"):
        read_text(tmp_path, "a thing")


def test_a_field_with_a_separator_of_records_is_no_number() -> None:
    assert [number_in(field) for field in (" 1.5 ", "\t2\n", "-3e2")] == [1.5, 2.0, -300.0]
    fields = [f"{sign}1" for sign in map(chr, range(0x1C, 0x20))]
    assert all(math.isnan(number_in(field)) for field in (*fields, "1\x1c", "", "1_0", "one"))


def test_files_that_are_too_large_are_refused_by_their_size(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(bytes(11))
    with pytest.raises(DataError, match=r"a: a file of 11 bytes, expected a thing of at most 10 bytes$"):
        read_bytes(tmp_path / "a", "a thing", most=10)


@pytest.mark.parametrize("name", ["a\0b", "a" * 5000])
def test_names_that_no_file_can_have(name: str) -> None:
    with pytest.raises(DataError):
        read_bytes(Path(name), "a thing")
    assert not is_regular_file(Path(name))
    assert not is_folder(Path(name))


def test_links_in_a_circle_are_no_path(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(DataError, match="expected the path of a file or folder"):
        absolute(tmp_path, Path("a\0"))
    assert not is_regular_file(tmp_path / "a")


def test_whatever_a_parser_raises_is_one_error() -> None:
    with pytest.raises(DataError, match=r"^a.dat: damaged \(first line\), expected whole$"), _damage():
        raise RuntimeError("first line.\nsecond line")
    with pytest.raises(DataError, match=r"^a.dat: damaged \(RecursionError\), expected whole$"), _damage():
        raise RecursionError
    with pytest.raises(DataError, match="own"), _damage():
        raise DataError("b", "own", "it")
    with pytest.raises(MemoryError), _damage():
        raise MemoryError


def _damage():
    return damage_reported("a.dat", "damaged", "whole", with_reason=True)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a\nb\x1b[31m\0\u2028\x85", r"a\nb\x1b[31m\x00\u2028\x85"),
        ("\udc80", r"\udc80"),
        ("größe 日本 é", "größe 日本 é"),
    ],
)
def test_messages_are_one_line_of_printable_characters(text: str, line: str) -> None:
    assert one_line(text) == line
    assert str(TracknoiseError(text)) == line
    assert str(DataError(text, text, "x")) == f"{line}: {line}, expected x"


def test_long_messages_keep_their_beginning_and_their_end() -> None:
    message = str(DataError("a.csv:3", f"{'9' * 100_000}", "a number"))
    assert message.startswith("a.csv:3: 999")
    assert message.endswith("999, expected a number")
    assert len(message) < 2000


def test_a_child_answers_and_survives_errors() -> None:
    assert call_in_child(abs, -3, size=0) == 3
    first = parsing_child._current
    with pytest.raises(LostError, match=r"^bad operand type for abs\(\): 'str'$"):
        call_in_child(abs, "x", size=0)
    with pytest.raises(DataError, match=r"^/no: no such file, expected a thing$"):
        call_in_child(read_bytes, Path("/no"), "a thing", size=0)
    assert parsing_child._current is first


def test_the_death_of_a_child_is_an_error_and_the_next_call_has_another() -> None:
    for number in (signal.SIGKILL, signal.SIGABRT):
        with pytest.raises(LostError, match="its parser ended"):
            call_in_child(signal.raise_signal, number, size=0)
        assert call_in_child(abs, -1, size=0) == 1


def test_time_and_memory_of_a_child_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    call_in_child(abs, 1, size=0)
    with monkeypatch.context() as changed:
        changed.setattr(parsing_child, "_WALL_PER_CPU", 0.1)
        with pytest.raises(LostError, match="its parser takes too long"):
            call_in_child(time.sleep, 600, size=0)
    with monkeypatch.context() as changed:
        changed.setattr(parsing_child, "_CPU_S", 1)
        with pytest.raises(LostError, match="its parser takes too long"):
            call_in_child(sum, range(10**12), size=0)
    with pytest.raises(LostError):
        call_in_child(bytearray, 3 << 30, size=0)
    assert len(call_in_child(bytearray, 1 << 20, size=0)) == 1 << 20


def test_the_time_of_calls_is_that_of_their_child() -> None:
    call_in_child(abs, 1, size=0)
    before, own = cpu_time_of_calls(), time.process_time()
    call_in_child(sum, range(10**7), size=0)
    assert cpu_time_of_calls() - before > 4 * (time.process_time() - own)


def test_what_a_parser_prints_is_no_answer(capfd: pytest.CaptureFixture[str]) -> None:
    assert call_in_child(print, "x" * 100, size=0) is None
    assert call_in_child(abs, -2, size=0) == 2
    assert capfd.readouterr() == ("", "")
