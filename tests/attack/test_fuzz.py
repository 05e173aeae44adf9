"""The fuzzing tool at a small size, and that it notices every kind of fault."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from benchmarks.attack import fuzz
from benchmarks.attack.fuzz import Outcome
from benchmarks.attack.mutations import LONGEST, mutated, with_png_checksums
from benchmarks.attack.parsers import PARSERS, Parser

from tracknoise.exceptions import DataError

ROOT = Path(__file__).parents[2]


def test_no_parser_fails_on_damaged_files(tmp_path: Path) -> None:
    """A process of its own, because the tool forks, and this one has threads of Polars."""
    command = [sys.executable, "-m", "benchmarks.attack", "fuzz", "--count", str(5 * len(PARSERS)), "--seed", "13"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    finished = subprocess.run([*command, "--out", tmp_path], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert finished.returncode == 0, finished.stdout + finished.stderr
    lines = finished.stdout.splitlines()
    assert [line[:26].strip() for line in lines] == [parser.name for parser in PARSERS]
    assert sum(int(line.split("refused")[1].split()[0]) for line in lines) > 2 * len(PARSERS)


def faulty(content: bytes) -> None:
    """A parser with every fault, which depends on the length of a file."""
    kind = len(content) % 7
    if kind == 1:
        raise KeyError("foreign")
    if kind == 2:
        os.abort()
    if kind == 3:
        time.sleep(60)
    if kind == 4:
        bytearray(2 * fuzz.MEMORY)
    if kind == 5:
        error = DataError("file", "damaged", "whole")
        error.__class__ = type("Two", (DataError,), {"__str__": lambda self: "two\nlines"})
        raise error
    if kind == 6:
        raise DataError("file", "damaged", "whole")


def test_every_kind_of_fault_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def write(folder: Path) -> None:
        folder.mkdir()
        (folder / "valid.txt").write_bytes(b"1234567" * 4)

    monkeypatch.setattr(fuzz, "TIMEOUT_S", 0.2)
    parser = Parser("faulty", write, "*.txt", lambda path: faulty(path.read_bytes()))
    counts, faults = fuzz.fuzz(parser, 40, 5, tmp_path)
    assert set(counts) == {outcome for outcome in Outcome if outcome > Outcome.started}
    assert sum(counts.values()) == 40
    assert len(faults) == 40 - counts[Outcome.accepted] - counts[Outcome.refused]
    expected = {1: "KeyError", 2: "death: exit status -6", 3: "hang", 4: "MemoryError", 5: "not one printable line"}
    for fault in faults:
        assert fault.summary.startswith(expected[len(fault.saved.read_bytes()) % 7])


def test_the_same_seed_gives_the_same_damage() -> None:
    from random import Random

    valid = b"width 24 height 16\n" * 5
    first, second = ([mutated(valid, Random(f"3 {n}"), [valid]) for n in range(200)] for _ in range(2))
    assert first == second
    assert len(set(first)) > 150
    assert max(map(len, first)) <= LONGEST


def test_checksums_are_made_right_again() -> None:
    import cv2
    import numpy as np

    png = cv2.imencode(".png", np.zeros((4, 4), np.uint8))[1].tobytes()
    damaged = png[:20] + bytes([png[20] ^ 1]) + png[21:]
    assert with_png_checksums(png) == png
    assert with_png_checksums(damaged)[20] == damaged[20]
    assert with_png_checksums(damaged)[29:33] != png[29:33]
