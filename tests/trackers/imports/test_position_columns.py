"""What the two numbers of a position are, and files that begin before or after the sequence."""

import numpy as np
import polars as pl
import pytest

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.trackers.imported import Imported
from tracknoise.trackers.imported_rows import Columns
from tracknoise.trackers.tracker import Frame

WIDTH, HEIGHT = 50, 40
UV = np.array([[10.0, 5.0], [12.0, 6.5], [30.25, 20.0], [31.0, 22.0]])
STATED = {
    "u v": lambda u, v: (u, v),
    "v u": lambda u, v: (v, u),
    "u -v": lambda u, v: (u, HEIGHT - 1 - v),
    "-u v": lambda u, v: (WIDTH - 1 - u, v),
    "-u -v": lambda u, v: (WIDTH - 1 - u, HEIGHT - 1 - v),
    "v -u": lambda u, v: (v, WIDTH - 1 - u),
    "-v u": lambda u, v: (HEIGHT - 1 - v, u),
    "-v -u": lambda u, v: (HEIGHT - 1 - v, WIDTH - 1 - u),
}


def positions(settings: Imported, setting, frames: int = 2) -> np.ndarray:
    tracker = settings.start(setting(size=(WIDTH, HEIGHT)))
    steps = [tracker.step(Frame(index, np.zeros((HEIGHT, WIDTH), np.uint8))) for index in range(frames)]
    return np.concatenate([step.uv for step in steps])


def written(path, first, second, frame=(0, 0, 1, 1), **more):
    table = {"track": [1, 2, 1, 2], "frame": list(frame), "u_px": first, "v_px": second, **more}
    pl.DataFrame(table).write_csv(path)
    return path


@pytest.mark.parametrize("columns", STATED)
def test_every_order_of_columns_is_read(columns, tmp_path, setting):
    path = written(tmp_path / "tracks.csv", *STATED[columns](*UV.T))
    assert positions(Imported(str(path), columns=columns), setting) == pytest.approx(UV)


def test_all_orders_are_tested():
    assert list(STATED) == sorted(map(str, Columns), key=list(STATED).index)


def test_columns_are_those_of_the_raster_of_the_file(tmp_path, setting):
    """A point of an image of 100 x 100, from its corner: twice as wide, and 2.5 times as high."""
    u, v = (UV.T + 0.5) * np.array([[2.0], [2.5]])
    path = written(tmp_path / "tracks.csv", 100 - v, u)
    settings = Imported(str(path), columns="-v u", raster=(100, 100), origin="corner")
    assert positions(settings, setting) == pytest.approx(UV)


def test_covariances_turn_with_their_positions(tmp_path, setting):
    covariances = {"cov_uu": [1.0] * 4, "cov_uv": [0.5] * 4, "cov_vv": [4.0] * 4}
    path = written(tmp_path / "tracks.csv", HEIGHT - 1 - UV[:, 1], UV[:, 0], **covariances)
    tracker = Imported(str(path), columns="-v u").start(setting(size=(WIDTH, HEIGHT)))
    found = tracker.step(Frame(0, np.zeros((HEIGHT, WIDTH), np.uint8))).quality
    assert [sorted(set(found[name].tolist())) for name in sorted(found)] == [[4.0], [-0.5], [1.0]]


def test_a_file_that_begins_later_than_the_sequence_has_a_negative_first_frame(tmp_path, setting):
    path = written(tmp_path / "tracks.csv", *UV.T, frame=(0, 0, 1, 1))
    tracker = Imported(str(path), first_frame=-2).start(setting(size=(WIDTH, HEIGHT)))
    steps = [tracker.step(Frame(index, np.zeros((HEIGHT, WIDTH), np.uint8))) for index in range(5)]
    assert [len(step.ids) for step in steps] == [0, 0, 2, 2, 0]


def test_columns_that_no_position_has_are_refused():
    with pytest.raises(SettingsError, match="columns"):
        Imported("tracks.csv", columns="u w")


def test_positions_outside_name_the_option(tmp_path, setting):
    wide = np.array([[45.0, 5.0], [46.0, 6.0], [47.0, 7.0], [48.0, 8.0]])
    path = written(tmp_path / "tracks.csv", wide[:, 1], wide[:, 0])
    with pytest.raises(DataError, match=r"the columns are swapped.*; of a file, the option columns says which is u"):
        positions(Imported(str(path)), setting)
    assert positions(Imported(str(path), columns="v u"), setting) == pytest.approx(wide)
