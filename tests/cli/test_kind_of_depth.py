"""Depths that the program computes are along z: no run says that they are distances along the ray."""

import json
import shutil
from dataclasses import replace

import pytest
from tests.writers.euroc import BODY_FROM_CAMERA, write_euroc, write_images, write_sensor

from tracknoise.cli.app import main
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.tables.store import RunFolder

FRAMES = 24
NOT_TRIED = "The kind of depth was not tried: depths are z by construction (from {})."
EXPERIMENT = """
name = "stereo"
keep = "statistics"

[dataset]
reader = "euroc"

[truth]
depth = "stereo"
poses = "stated"  # refined ones would absorb most of what wrong depths do

[[trackers]]
kind = "lucas-kanade"
"""


@pytest.fixture(scope="module")
def stereo(made_once):
    """A recording in the layout of EuRoC. Its second camera is stated with a lens distortion that it does not have.

    Stereo depth is then wrong by an amount that grows with the distance from the axis, as if it were along the ray.
    """

    def write(folder):
        made = open_sequence(
            "simulated", motions=("arvr",), frames=FRAMES, width=400, height=300, hfov_deg=75.0, baseline_m=0.1,
            supersampling=1,
        )  # fmt: skip
        camera, second = made.camera, made.second
        intrinsics = (camera.fx, camera.fy, camera.cx, camera.cy)
        recording, frames = folder / "recording", range(FRAMES)
        images = [made.image(index) for index in frames]
        times_ns = write_euroc(recording, images, made.world_from_camera, intrinsics=intrinsics)
        write_images(recording / "mav0", "cam1", times_ns.tolist(), [second.images(index) for index in frames])
        write_sensor(
            recording / "mav0" / "cam1" / "sensor.yaml", (400, 300), intrinsics, distortion=(0.0, 0.0, 0.0, -0.007),
            body_from_camera=BODY_FROM_CAMERA @ second.first_from_second,
        )  # fmt: skip
        (folder / "stereo.toml").write_text(EXPERIMENT)

    return made_once("stereo-euroc", write)


@pytest.fixture(scope="module")
def run(stereo, tmp_path_factory):
    out = tmp_path_factory.mktemp("stereo") / "run"
    with pytest.raises(SystemExit) as exit_:
        main([
            "run", str(stereo / "stereo.toml"), "--data", str(stereo / "recording"), "--out", str(out), "--no-report",
            "--quiet", "--workers", "1",
        ])  # fmt: skip
    assert exit_.value.code == 0
    return out


def test_an_audit_of_stereo_depth_says_that_its_kind_was_not_tried(run, tracknoise) -> None:
    status, text, stderr = tracknoise("check", str(run))
    assert (status, stderr) == (4 if text.startswith(("Truth: not trusted", "Truth: unknown")) else 0, "")
    assert NOT_TRIED.format("stereo matching of two cameras") in " ".join(text.split())
    assert "along the ray" not in text
    assert "depth_along_ray" not in text
    document = json.loads(tracknoise("check", str(run), "--json")[1])
    about = [row for row in document["audit"] if row["parameter"] == "ray_depth"]
    assert [row["verdict"] for row in about] == ["not_tried"]
    assert "depth_along_ray" not in (document["corrections"] or "")


def test_a_run_that_does_not_say_what_is_known_is_audited_as_before(run, tracknoise, tmp_path) -> None:
    """A run of an earlier version: its manifest has no such entry."""
    run = shutil.copytree(run, tmp_path / "run")
    folder = RunFolder(run)
    manifest = folder.manifest()
    manifest.sequences = {key: replace(entry, z_depth_from=None) for key, entry in manifest.sequences.items()}
    manifest.statistics.clear()
    folder.write_manifest(manifest)
    settings = run / "experiment.toml"
    assert tracknoise("run", str(settings), "--out", str(run), "--no-report", "--workers", "1")[0] == 0
    text = tracknoise("check", str(run))[1]
    assert "Depth is the distance along the ray" in text
    assert "depth_along_ray = true" in text


def test_a_check_of_a_simulated_world_says_that_the_kind_was_not_tried(tracknoise) -> None:
    options = ('motions=["fixating"]', "frames=12", "width=200", "height=150", "supersampling=1")
    status, text, _ = tracknoise("check", "simulated", *(part for one in options for part in ("--option", one)))
    assert status == 0  # simulated: stated to be exact
    assert "Depth along the ray was not tried" in " ".join(text.split())
    assert "depths are z by construction (from the surfaces of a simulated world)" in " ".join(text.split())
