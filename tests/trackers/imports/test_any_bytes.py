"""Whatever a file of tracks contains, it is read or refused in one line."""

import tempfile
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.writers.track_files import WRITERS, Observed

from tracknoise.exceptions import TracknoiseError
from tracknoise.tables.identity import SequenceId
from tracknoise.trackers.imported import Imported
from tracknoise.trackers.tracker import SequenceContext

TIMES = 0.1 * np.arange(5)
CONTEXT = SequenceContext(SequenceId("d", "s"), (64, 48), 5, 1, 0, None, timestamps_s=TIMES)
NUMBERS = np.random.default_rng(0).uniform(1, 40, (2, 15))
SEEN = Observed(np.repeat([0, 1, 2], 5), np.tile(np.arange(5), 3), *NUMBERS, TIMES)
FEW = settings(max_examples=40, suppress_health_check=list(HealthCheck))
CELLS = st.one_of(st.integers(-(2**70), 2**70).map(str), st.floats().map(repr), st.text(max_size=4))


def attempt(path: Path) -> None:
    assert "\n" not in refusal(path)


def refusal(path: Path) -> str:
    """What is wrong with a file; empty if nothing is. Other exceptions and warnings come out."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            Imported(str(path)).start(CONTEXT)
        except TracknoiseError as error:
            return str(error)
    return ""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("tracks")


@pytest.mark.parametrize("name", WRITERS)
@FEW
@given(data=st.data())
def test_valid_files_with_changed_bytes(name, folder, data):
    valid = folder / name
    if not valid.exists():
        WRITERS[name](valid, SEEN)
    content = bytearray(valid.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(content) - 1))
        content[place : place + data.draw(st.integers(0, 8))] = data.draw(st.binary(max_size=8))
    path = Path(tempfile.mkdtemp(dir=folder)) / name
    path.write_bytes(content)
    attempt(path)


@pytest.mark.parametrize("suffix", ["csv", "txt", "npz", "db", "parquet"])
@FEW
@given(content=st.binary(max_size=200))
def test_any_bytes(suffix, folder, content):
    path = folder / f"any.{suffix}"
    path.write_bytes(content)
    attempt(path)


@pytest.mark.parametrize(
    ("name", "separator", "header"),
    [
        ("cells.txt", " ", ""),
        ("xivo.txt", ",", ""),
        ("cells.csv", ",", "track,frame,u_px,v_px\n"),
        ("times.csv", ",", "track,timestamp,u_px,v_px\n"),
        ("seconds.csv", ",", "track,time_s,u_px,v_px,cov_uu\n"),
        ("covariances.csv", ",", "track,frame,u_px,v_px,cov_uu,cov_uv,cov_vv\n"),
    ],
)
@FEW
@given(rows=st.lists(st.lists(CELLS, min_size=3, max_size=7), max_size=4))
def test_rows_of_any_cells(name, separator, header, folder, rows):
    path = folder / name
    text = header + "\n".join(separator.join(row) for row in rows)
    path.write_bytes(text.encode(errors="replace"))
    attempt(path)
