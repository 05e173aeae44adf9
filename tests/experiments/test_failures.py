"""What is tried again, what is recorded, and what ends a run."""

import errno
import json
import resource
import subprocess
import sys

import cv2
import numpy as np
import pytest

from tracknoise.cli.app import main
from tracknoise.exceptions import DataError, StoreError
from tracknoise.experiments.execute import execute
from tracknoise.experiments.failures import Failure, FailureKind, diagnose, with_retries
from tracknoise.experiments.load import load_experiment
from tracknoise.experiments.plan import batches, plan
from tracknoise.sequences.images import encode_png
from tracknoise.tables.store import RunFolder


def caught(error: BaseException, cause: BaseException | None = None) -> BaseException:
    try:
        raise error from cause
    except BaseException as raised:
        return raised


def out_of_memory_in_opencv() -> BaseException:
    with pytest.raises(cv2.error) as info:
        cv2.resize(np.zeros((9, 9), np.uint8), (2**30, 2**30))
    return info.value


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (DataError("a.png", "truncated", "all of it"), FailureKind.permanent),
        (ValueError("x"), FailureKind.permanent),
        (OSError(errno.ENOENT, "No such file"), FailureKind.permanent),
        (OSError(errno.ESTALE, "Stale file handle"), FailureKind.transient),
        (
            caught(DataError("a.png", "cannot be read", "an image"), OSError(errno.EIO, "I/O error")),
            FailureKind.transient,
        ),
        (caught(StoreError("x"), OSError(errno.ESTALE, "Stale file handle")), FailureKind.transient),
        (caught(StoreError("x"), OSError(errno.ENOSPC, "No space left on device")), FailureKind.fatal),
        (caught(StoreError("x"), OSError(errno.EROFS, "Read-only file system")), FailureKind.fatal),
        (MemoryError(), FailureKind.transient),
        (out_of_memory_in_opencv(), FailureKind.transient),
    ],
)
def test_transient_and_permanent_failures_are_distinguished(error, kind):
    assert diagnose(error).kind is kind


def test_the_place_is_the_file_or_else_the_line_of_the_program():
    assert diagnose(DataError("a.png", "truncated", "all of it")).place == "a.png"
    with pytest.raises(cv2.error) as info:
        encode_png(np.zeros((0, 0), np.uint8))
    found = diagnose(info.value)
    assert found.place is not None
    assert found.place.startswith("tracknoise/sequences/images.py:")
    assert found.cause.startswith("error: ")
    assert "\n" not in found.cause


class Flaky:
    """Measures batches, each of which fails so often before it comes out well."""

    def __init__(self, times, kind):
        self.left, self.kind, self.calls = dict(times), kind, []

    def __call__(self, together):
        for batch in together:
            key = batch[0].key
            self.calls.append(key)
            self.left[key] -= 1
            yield batch, Failure("lost", None, self.kind) if self.left[key] >= 0 else []


@pytest.fixture
def together(scenes):
    return batches(plan(scenes(3)))


ONE, TWO, THREE = (f"seq-{number:02d}@default" for number in (1, 2, 3))


def test_what_may_pass_is_tried_again_after_all_others_and_so_often_only(together):
    measure, retried = Flaky({ONE: 1, TWO: 0, THREE: 9}, FailureKind.transient), []
    results = with_retries(measure, together, retries=2, retrying=lambda batch, cause: retried.append(batch[0].key))
    found = {batch[0].key: result for batch, result in results}
    assert measure.calls == [ONE, TWO, THREE, ONE, THREE, THREE]
    assert retried == [ONE, THREE, THREE]
    assert found == {ONE: [], TWO: [], THREE: Failure("lost", None, FailureKind.transient, attempts=3)}


def test_what_lasts_is_not_tried_again(together):
    measure = Flaky({ONE: 1, TWO: 0, THREE: 0}, FailureKind.permanent)
    found = {batch[0].key: result for batch, result in with_retries(measure, together, retries=2, retrying=None)}
    assert measure.calls == [ONE, TWO, THREE]
    assert found[ONE] == Failure("lost", None, FailureKind.permanent, attempts=1)


def test_a_corrupt_image_in_one_scene_of_two(experiment_file, tmp_path, capsys):
    """One finishes, the other is named with file and cause; after repair, that one alone is measured."""
    path = experiment_file(2)
    image = tmp_path / "data" / "seq-01" / "frame-000002.color.png"
    whole = image.read_bytes()
    image.write_bytes(whole[:-20])

    def run():
        with pytest.raises(SystemExit) as exit_:
            main(["run", str(path), "--out", str(tmp_path / "run"), "--no-report", "--workers", "1"])
        return exit_.value.code, capsys.readouterr().err

    code, stderr = run()
    assert code == 2
    assert f"tracknoise: error: {ONE}: {image}: truncated" in stderr
    assert f"1 of 2 sequences failed: {ONE}; see failures.jsonl" in stderr
    lines = (tmp_path / "run" / "failures.jsonl").read_text().splitlines()
    (line,) = map(json.loads, lines)
    assert (line["sequence"], line["place"], line["attempts"]) == (ONE, str(image), 1)
    assert "truncated" in line["cause"]
    image.write_bytes(whole)
    code, stderr = run()
    assert code == 0
    assert "resuming: 1 of 2 sequences already measured" in stderr
    assert [row.split(":")[0] for row in stderr.splitlines() if row.startswith("measured seq")] == [f"measured {ONE}"]
    assert not (tmp_path / "run" / "failures.jsonl").exists()


def test_a_failed_batch_is_reported_once_and_recorded_for_each_sequence(experiment_file, tmp_path, capsys, monkeypatch):
    path = experiment_file(6)
    image = tmp_path / "data" / "seq-02" / "frame-000002.color.png"
    image.write_bytes(image.read_bytes()[:-20])
    monkeypatch.setattr("tracknoise.experiments.execute.batches", lambda tasks: [tasks[:5], tasks[5:]])
    with pytest.raises(SystemExit) as exit_:
        main(["run", str(path), "--out", str(tmp_path / "run"), "--no-report", "--workers", "1"])
    assert exit_.value.code == 2
    lines, five = capsys.readouterr().err.splitlines(), f"{ONE}, {TWO}, {THREE} and 2 others"
    (error,) = [line for line in lines if line.startswith("tracknoise: error")]
    assert error.startswith(f"tracknoise: error: {five}: {image}: truncated")
    assert f"5 of 6 sequences failed: {five}; see failures.jsonl." in " ".join(lines)
    recorded = [json.loads(line) for line in (tmp_path / "run" / "failures.jsonl").read_text().splitlines()]
    assert [entry["sequence"] for entry in recorded] == [f"seq-{number:02d}@default" for number in range(1, 6)]
    assert {entry["place"] for entry in recorded} == {str(image)}


def limited(command, limit_bytes):
    """Run the command line so that no file it writes can be larger, as on a disk that is full."""

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))

    arguments = [sys.executable, "-c", "from tracknoise.cli.app import main; main()", *command]
    return subprocess.run(arguments, preexec_fn=limit, capture_output=True, text=True)


@pytest.mark.usefixtures("lean")
def test_a_full_disk_ends_the_run_with_one_line_and_keeps_what_was_whole(experiment_file, tmp_path, told, files):
    path, run = experiment_file(3, 16), RunFolder(tmp_path / "run")
    for name in ("seq-02", "seq-03"):
        (tmp_path / "data" / name).rename(tmp_path / name)
    execute(load_experiment(path), run, listener=told())
    before = files(run)
    observed = min(len(content) for name, content in before.items() if name.startswith("observations"))
    for name in ("seq-02", "seq-03"):
        (tmp_path / name).rename(tmp_path / "data" / name)
    ended = limited(["run", path, "--out", run.path, "--no-report", "--workers", "1"], observed - 1)
    errors = [line for line in ended.stderr.splitlines() if "error" in line]
    assert ended.returncode == 1
    assert len(errors) == 1, ended.stderr
    assert "seq-02@default.parquet: cannot be written (File too large), expected a writable folder" in errors[0]
    assert sorted(run.manifest().sequences) == [ONE]
    assert run.manifest().failures == {}, "a full disk is not a failure of each scene in turn"
    outcome = told()
    execute(load_experiment(path), run, listener=outcome)
    assert outcome.keys == [TWO, THREE]
    assert all(files(run)[name] == content for name, content in before.items() if not name.startswith("statistics"))


@pytest.mark.usefixtures("lean")
def test_a_folder_that_cannot_be_written_ends_the_run_at_once(scenes, tmp_path, told):
    run = RunFolder(tmp_path / "run")
    run.path.mkdir()
    experiment = scenes(2)
    execute(experiment, run, listener=told())
    (run.path / "tracks").rename(run.path / "moved")
    (run.path / "tracks").touch()  # in the way of the folder
    listener = told()
    with pytest.raises(StoreError, match=r"tracks.*cannot be written"):
        execute(experiment, run, listener=listener)
    assert (listener.keys, listener.failures) == ([], {})
    assert not run.lock_path.exists()
