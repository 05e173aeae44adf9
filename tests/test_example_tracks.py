"""The example of a front end of plain OpenCV: what it writes is imported, and lies near the true positions."""

import subprocess
import sys
import tomllib
from pathlib import Path

import tracknoise as tn
from tracknoise.sequences.folder import write_folder

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_its_tracks_are_imported_as_the_example_of_an_experiment_says(tmp_path):
    simulated = tn.open_sequence("simulated", motions=["sideways"], frames=8, width=320, height=240, noise_sigma=1)
    write_folder(simulated, tmp_path / "room")
    options = tomllib.loads((EXAMPLES / "your-tracks.toml").read_text())["trackers"][0]["options"]
    file = tmp_path / options["path"].format(scene="room")
    program = [sys.executable, EXAMPLES / "own_opencv_tracks.py", tmp_path / "room" / "images", file]
    subprocess.run(program, check=True)
    measured = tn.measure(tn.open_sequence("folder", tmp_path / "room"), tn.Imported(path=file))
    followed = measured.observations.filter(
        (measured.observations["frame"] > 0) & (measured.observations["truth"] == "valid")
    )
    assert followed["track"].n_unique() > 100
    assert followed["du_px"].abs().median() < 0.3
