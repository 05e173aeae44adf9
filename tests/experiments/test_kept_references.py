"""Reference tracks are made once for a run folder, as long as the images are the same."""

import shutil

import pytest

from tracknoise.experiments.execute import execute
from tracknoise.experiments.settings import parse_experiment
from tracknoise.measurement import reference_tracks
from tracknoise.sequences.folder import write_folder
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.tables.store import RunFolder


class Silent:
    """Listens to a run and says nothing."""

    def __getattr__(self, name):
        return lambda *arguments: None


@pytest.fixture
def data(tmp_path):
    sequence = open_sequence("simulated", motions=["sideways"], frames=6, width=80, height=60, supersampling=1)
    write_folder(sequence, tmp_path / "data" / "scene")
    return tmp_path / "data" / "scene"


@pytest.fixture
def followed(monkeypatch):
    """Numbers of frames that were followed, one for each time."""
    times, follow = [], reference_tracks._followed

    def counted(sequence, n_frames, progress):
        times.append(n_frames)
        return follow(sequence, n_frames, progress)

    monkeypatch.setattr(reference_tracks, "_followed", counted)
    return times


def measured(data, run, *trackers, more=""):
    chosen = "".join(f'[[trackers]]\nkind = "{kind}"\n' for kind in trackers)
    text = f'name = "kept"\n{more}\n[dataset]\nreader = "folder"\nroot = "{data}"\n{chosen}'
    execute(parse_experiment(text, place="kept.toml"), run, listener=Silent(), fresh=True)
    ((_, entry),) = run.manifest().sequences.items()
    return entry


def test_another_run_of_the_same_images_in_the_folder_follows_nothing_again(data, tmp_path, followed):
    run = RunFolder(tmp_path / "run")
    first = measured(data, run, "lucas-kanade")
    second = measured(data, run, "lucas-kanade", "correspondence")
    assert followed == [6]
    assert second.pose_fit == first.pose_fit
    shutil.copy(data / "images" / "000001.png", data / "images" / "000003.png")
    measured(data, run, "lucas-kanade")
    assert followed == [6, 6]


def test_each_part_of_a_sequence_keeps_its_own(data, tmp_path, followed):
    run = RunFolder(tmp_path / "run")
    for tracker in ("lucas-kanade", "correspondence"):
        entry = measured(data, run, tracker, more="part_frames = 3")
        assert entry.parts == ((0, 3), (3, 6))
    assert followed == [3, 3]


def test_damaged_ones_are_made_again(data, tmp_path, followed):
    run = RunFolder(tmp_path / "run")
    first = measured(data, run, "lucas-kanade")
    (file,) = (run.path / "references").glob("*/*.parquet")
    table = run.references(first.key, None)
    assert table is not None
    run.write_references(first.key, None, table.with_columns(table["u_px"] + 1.0))
    measured(data, run, "lucas-kanade")
    file.write_bytes(b"no table")
    assert measured(data, run, "lucas-kanade").pose_fit == first.pose_fit
    assert followed == [6, 6, 6]


def test_those_of_sequences_that_are_no_longer_measured_are_removed(data, tmp_path, followed):
    run = RunFolder(tmp_path / "run")
    measured(data, run, "lucas-kanade")
    data.rename(data.with_name("other"))
    measured(data.with_name("other"), run, "lucas-kanade")
    assert len(list((run.path / "references").iterdir())) == 1
