"""Imported tracks of a plane that a camera passes: a run says first that they do not follow the images."""

import json

import cv2
import numpy as np
import polars as pl
import pytest

import tracknoise as tn
from tracknoise.geometry.cameras import Camera
from tracknoise.sequences.folder import write_folder

WIDTH, HEIGHT, FRAMES, FOCAL_PX, DEPTH_M = 128, 96, 16, 110.0, 3.0
STEPS = np.random.default_rng(2).integers(-7, 8, (FRAMES, 2))
PATH = 150 + np.cumsum(STEPS, axis=0)
EXPERIMENT = """
name = "x"
speeds = [1]
[dataset]
reader = "folder"
root = "data"
[[trackers]]
name = "mine"
kind = "imported"
options = {{ path = "tracks.csv"{more} }}
"""


@pytest.fixture(scope="module")
def world():
    rng = np.random.default_rng(1)
    texture = sum(cv2.GaussianBlur(rng.normal(size=(420, 420)), (0, 0), sigma) * sigma for sigma in (1.5, 3.0, 6.0))
    return np.asarray(255 * (texture - texture.min()) / np.ptp(texture), np.uint8)


def recording(world):
    """Images of the plane, with exact poses and depths."""
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :2, 3] = PATH * DEPTH_M / FOCAL_PX
    images = [world[y : y + HEIGHT, x : x + WIDTH] for x, y in PATH]
    camera = Camera(WIDTH, HEIGHT, FOCAL_PX, FOCAL_PX, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)
    return tn.Sequence.from_arrays(images, poses, camera, [np.full((HEIGHT, WIDTH), DEPTH_M)] * FRAMES)


def tracks(world):
    """Exact positions of corners with a little noise: track, frame, u, v."""
    corners = cv2.goodFeaturesToTrack(world, 2000, 0.01, 6)[:, 0]
    uv = corners[None] - PATH[:, None]
    seen = ((uv >= 1) & (uv <= [WIDTH - 2, HEIGHT - 2])).all(axis=2)
    frame, track = np.nonzero(seen)
    return track, frame, *(uv[seen] + np.random.default_rng(3).normal(0.0, 0.08, (len(track), 2))).T


@pytest.fixture
def run_of(tracknoise, world, tmp_path):
    """Runs the experiment with a table of tracks and further options; its first line, and the folder of the run."""
    write_folder(recording(world), tmp_path / "data")

    def go(change, more="", folder="run"):
        track, frame, u, v = change(*tracks(world))
        table = pl.DataFrame({"track": track, "frame": frame, "u_px": u, "v_px": v})
        table.filter(pl.col("frame") >= 0).write_csv(tmp_path / "tracks.csv")
        (tmp_path / "x.toml").write_text(EXPERIMENT.format(more=more))
        out = tmp_path / folder
        status, told, failed = tracknoise("run", str(tmp_path / "x.toml"), "--out", str(out), "--no-report", "-w", "1")
        assert status == 0, failed
        return " ".join(told.split()), str(out)

    return go


def swapped(track, frame, u, v):
    """The columns of what is in the square at the left, so that no position shows it."""
    square = u < HEIGHT
    return track[square], frame[square], v[square], u[square]


def late(track, frame, u, v):
    """Frames from 1, of which the last ones are missing, so that their numbers do not show it."""
    kept = frame < FRAMES - 2
    return track[kept], frame[kept] + 1, u[kept], v[kept]


SPOILT = {
    "swapped": (
        swapped,
        'their columns are swapped. Next: Set columns = "v u" for mine.',
        ', columns = "v u"',
    ),
    "upwards": (
        lambda track, frame, u, v: (track, frame, u, HEIGHT - 1 - v),
        'v counts upwards. Next: Set columns = "u -v" for mine.',
        ', columns = "u -v"',
    ),
    "resized": (
        lambda track, frame, u, v: (track, frame, 0.75 * (u + 0.5), v + 0.5),
        "they are positions in images of 96 x 96 px. Next: Set raster = [96, 96] for mine.",
        ', raster = [96, 96], origin = "corner"',
    ),
    "late": (
        late,
        "they are those of images 1 frame earlier. Next: Set first_frame = 1 for mine.",
        ", first_frame = 1",
    ),
    "early": (
        lambda track, frame, u, v: (track, frame - 2, u, v),
        "they are those of images 2 frames later. Next: Set first_frame = -2 for mine.",
        ", first_frame = -2",
    ),
}


@pytest.mark.parametrize("spoil", SPOILT)
def test_wrong_tracks_are_named_first_and_the_option_mends_them(spoil, run_of):
    change, said, option = SPOILT[spoil]
    told, _ = run_of(change)
    assert told == f"Tracks: wrong. Tracks of mine do not follow the images: {said}"
    mended, _ = run_of(change, option, "mended")
    assert "Tracks: wrong" not in mended
    assert "the core error of mine" in mended


def test_right_tracks_are_not_accused(run_of):
    told, _ = run_of(lambda *rows: rows)
    assert "Tracks: wrong" not in told


def test_no_number_and_no_correction_is_given_with_wrong_tracks(run_of, tracknoise):
    _, out = run_of(swapped)
    status, told, _ = tracknoise("check", out)
    assert status == 4
    assert "correct this" not in told
    document = json.loads(tracknoise("check", out, "--json")[1])
    assert (document["corrections"], document["accuracy"], document["audit"]) == (None, None, [])
    _, told, _ = tracknoise("report", out, "--all")
    assert told.count("columns are swapped") == 1
    assert " px" not in told
    for accepted in ([], ["--allow", "untrusted"]):
        status, _, told = tracknoise("export", out, "--to", "text", *accepted)
        assert status != 0
        assert "do not follow the images" in told
    run = tn.open_run(out)
    assert run.truth.are_tracks_wrong
    assert "do not follow the images" in run.truth.sentence
    html = (run.report() / "index.html").read_text() if hasattr(run, "report") else ""
    assert not html or "their columns are swapped" in html


def test_a_function_whose_tracks_do_not_follow_the_images_is_named(world):
    track, frame, u, v = swapped(*tracks(world))
    measured = tn.measure(recording(world), {"mine": tn.Imported.from_arrays(track, frame, u, v)})
    assert "Tracks of mine do not follow the images: their columns are swapped" in tn.analyse(measured).truth.text
    lucas = tn.analyse(tn.measure(recording(world), {"lucas-kanade": tn.LucasKanade()}))
    assert not lucas.truth.are_tracks_wrong
