"""A small version of `python -m benchmarks.attack flips`, and whether it would notice what it looks for."""

import pytest
from benchmarks.attack import flips

from tracknoise.exceptions import StoreError


def test_no_flip_deceives_a_reader(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(flips, "memory_folder", lambda: tmp_path)
    assert flips.main(["--count", "2", "--seed", "1", "--workers", "1", "--keep", str(tmp_path / "kept")]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[-1] == "2 flips in 2 files, seed 1: 0 readers deceived or crashed"
    counted = [line.split() for line in printed[:-1]]
    assert sum(int(line[-1]) for line in counted if line[1] == "summary") == 2
    assert {line[-2] for line in counted} & {"repaired", "noticed"}
    assert len((tmp_path / "kept" / "flips.jsonl").read_text().splitlines()) == 2


def test_files_take_turns_and_offsets_are_spread(tmp_path):
    for name, size in (("a", 1), ("b", 300), ("c", 3)):
        (tmp_path / name).write_bytes(bytes(size))
    planned = flips.plan(tmp_path, 9, seed=0)
    assert sorted(flip.path for flip in planned) == list("aaabbbccc")
    assert sorted(flip.offset // 100 for flip in planned if flip.path == "b") == [0, 1, 2]
    assert sorted(flip.offset for flip in planned if flip.path == "c") == [0, 1, 2]
    assert planned == flips.plan(tmp_path, 9, seed=0)
    flip = flips.Flip("b", 7, 3)
    flip.apply(tmp_path)
    assert (tmp_path / "b").read_bytes() == bytes(7) + b"\x08" + bytes(292)


@pytest.mark.parametrize(
    ("shown", "kind"),
    [
        ("whole", "unchanged"),
        ("other", "changed"),
        (StoreError("one line"), "noticed"),
        (StoreError("two\nlines"), "noticed"),  # every error of the package is one line
        (KeyError("x"), "crashed"),
    ],
)
def test_a_reader_is_judged_by_what_it_shows(tmp_path, shown, kind):
    (tmp_path / "file").write_text("content")

    def read(run):
        (run / "file").read_text()
        if isinstance(shown, Exception) and damaged:
            raise shown
        return shown if damaged else "whole"

    damaged = False
    reader = flips.Reader.of("reader", read, tmp_path)
    damaged = True
    assert reader.judged(tmp_path, flips.Flip("file", 0, 0)).kind == kind
    assert reader.judged(tmp_path, flips.Flip("another", 0, 0)).kind == "not read"
