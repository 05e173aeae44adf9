"""The route of the README for tracks of another front end, from the images to the report and what follows it."""

import json
from pathlib import Path

import numpy as np
import pytest
from benchmarks.noise import prove
from tests.lean import of_reader, without_figure_files
from tests.writers.track_files import WRITERS, Observed

import tracknoise as tn
from tracknoise.cli.app import main

N_FRAMES = 12
SCENE = "forward"
FORMATS = ("table.csv", "colmap.db")
"""The formats of a front end and of a reconstruction. `tests/trackers/imports` has the others."""


def called(*arguments: str) -> int:
    with pytest.raises(SystemExit) as exit_:
        main(list(arguments))
    return exit_.value.code


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> str:
    """A run with the same tracks in several formats, each a tracker of its own; the report has no files of figures."""
    root = tmp_path_factory.mktemp("imported")
    recording = root / "sim" / SCENE
    size = ("--frames", str(N_FRAMES), *of_reader("width=240", "height=180", "supersampling=1"))
    assert called("simulate", "--motion", SCENE, *size, "--out", str(recording)) == 0
    native = tn.LucasKanade(min_features=150, max_features=200)
    observed = tn.measure(tn.open_sequence("folder", root / "sim", scene=SCENE), native).observations
    track, frame, u, v = (observed[name].to_numpy() for name in ("track", "frame", "u_px", "v_px"))
    seen = Observed(track.astype(np.int64), frame.astype(np.int64), u, v, 0.05 * np.arange(N_FRAMES))
    text = 'name = "mine"\n[dataset]\nreader = "folder"\n'
    for name in FORMATS:
        WRITERS[name](root / f"{SCENE}.{name}", seen)
        text += f'[[trackers]]\nname = "{name}"\nkind = "imported"\noptions = {{ path = "{{scene}}.{name}" }}\n'
    (root / "mine.toml").write_text(f'{text}[estimator]\nname = "sliding_window"\n')
    out = str(root / "run")
    with without_figure_files():
        options = ("--data", str(root / "sim"), "--out", out, "--quiet", "--workers", "1")
        assert called("run", str(root / "mine.toml"), *options) == 0
    return out


def test_the_report_has_tracks_whose_end_is_not_recorded(run):
    text = (Path(run) / "report" / "index.html").read_text(encoding="utf-8")
    found = json.loads(text.split('id="looked">', 1)[1].split("</script>", 1)[0])
    assert {group["tracker"] for group in found["groups"]} == set(FORMATS)
    assert {track["end"] for group in found["groups"] for track in group["tracks"]} == {"not recorded", "sequence end"}


def test_what_follows_a_run_works_without_causes_of_ends(run, tracknoise, tmp_path):
    status, out, _ = tracknoise("check", run)
    assert status == (0 if out.startswith(("Truth: trusted", "Truth: limited")) else 4)
    assert tracknoise("report", run, "--text")[0] == 0
    status, out, _ = tracknoise("compare", run, run, "--trackers", "table.csv", "colmap.db")
    assert status == 0
    assert "neither table.csv nor colmap.db is shown to be better" in out
    model = tmp_path / "lk.noise.json"
    allowed = ("--tracker", "colmap.db", "--allow", "untrusted")
    status, out, _ = tracknoise("export", run, "--to", "text", *allowed, "--model", str(model))
    assert status == 0
    assert "In a sliding window, " in out  # which the experiment names
    assert prove.main([run, str(model), "--window", "6", "--allow", "untrusted"]) == 0
