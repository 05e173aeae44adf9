"""``tracknoise simulate``, as a user would."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.lean import of_reader

from tracknoise.sequences.reader_registry import make_reader, open_sequence


@pytest.fixture
def simulate(tracknoise, tmp_path):
    def go(*arguments, out="out"):
        code, printed, err = tracknoise("simulate", *arguments, "--out", str(tmp_path / out), "--quiet")
        return code, printed, err, tmp_path / out

    return go


def test_several_scenes_go_into_folders_of_their_own(simulate):
    small = ["--frames", "2", *of_reader("width=64", "height=48", "supersampling=1")]
    code, printed, err, out = simulate("--option", "worlds=2", "--motion", "forward", *small)
    assert (code, err) == (0, "")
    assert "wrote 4 frames" in printed
    assert [item.scene for item in make_reader("folder", out).sequences()] == ["forward-00", "forward-01"]


def test_the_light_stage_is_what_the_dtu_reader_reads(simulate):
    code, printed, err, out = simulate("--layout", "dtu", *of_reader("width=64", "height=48", "image_format=bmp"))
    assert (code, err) == (0, "")
    assert "wrote 1 scene to" in printed
    sequence = open_sequence("dtu", out, lighting="LR9")
    assert (len(sequence), sequence.camera.width, sequence.notes) == (49, 32, ())
    assert sequence.image(48).shape == (24, 32)


def test_a_drive_is_what_the_kitti_reader_reads(simulate):
    small = ["--frames", "12", *of_reader("width=128", "height=48", "supersampling=1")]
    code, _, err, out = simulate("--layout", "kitti", *small)
    assert (code, err) == (0, "")
    assert len(open_sequence("kitti", out)) == 12


SMALL = ["--layout", "euroc", *of_reader("width=64", "height=48", "supersampling=1", "seed=5")]


def table(folder, sensor):
    """Times and numbers of a ``data.csv``."""
    times, *values = np.loadtxt(folder / "mav0" / sensor / "data.csv", delimiter=",", unpack=True)
    return times.astype(np.int64), np.array(values).T


def test_a_recording_with_inertial_readings_is_what_the_euroc_reader_reads(simulate):
    code, printed, err, out = simulate(*SMALL, "--motion", "arvr", "--frames", "5", "--option", "noise_sigma=0")
    assert (code, err) == (0, "")
    assert "wrote 5 frames" in printed
    written = open_sequence("euroc", out)
    options = {"motions": ["arvr"], "frames": 5, "width": 64, "height": 48, "hfov_deg": 78.8}
    options |= {"supersampling": 1, "seed": 5, "noise_sigma": 0.0, "imaging": {"rate_hz": 20.0}}
    made = make_reader("simulated", None, options)
    simulated = made.open(made.sequences()[0])
    assert written.camera == simulated.camera
    np.testing.assert_allclose(written.timestamps_s, np.arange(5) / 20.0, atol=1e-12)
    np.testing.assert_allclose(written.world_from_camera, simulated.world_from_camera, atol=1e-12)
    np.testing.assert_array_equal(written.image(3), simulated.image(3))


def test_readings_and_truth_are_200_hz_and_of_the_same_motion(simulate):
    code, _, err, out = simulate(*SMALL, "--motion", "arvr", "--frames", "21")
    assert (code, err) == (0, "")
    (times, readings), (true_times, truth) = table(out, "imu0"), table(out, "state_groundtruth_estimate0")
    np.testing.assert_array_equal(times, 1_000_000_000 + 5_000_000 * np.arange(221))  # beyond the last frame at 2 s
    np.testing.assert_array_equal(times, true_times)
    position, velocity, biases = truth[:, :3], truth[:, 7:10], truth[:, 10:]
    np.testing.assert_allclose(np.diff(position, axis=0) * 200.0, (velocity[1:] + velocity[:-1]) / 2.0, atol=1e-4)
    rotation = Rotation.from_quat(truth[:, [4, 5, 6, 3]])
    acceleration = rotation.apply(readings[:, 3:] - biases[:, 3:]) - (0.0, 0.0, 9.81)
    gained = ((acceleration[1:] + acceleration[:-1]) / 2.0).sum(axis=0) / 200.0
    np.testing.assert_allclose(gained, velocity[-1] - velocity[0], atol=5 * 2e-3)  # 5 sigma of the noise over 1 s
    rate = (rotation[:-1].inv() * rotation[1:]).as_rotvec() * 200.0
    noise = readings[:-1, :3] - biases[:-1, :3] - rate
    assert noise.std() == pytest.approx(1.6968e-4 * 200.0**0.5, rel=0.2)
    assert not biases[0].any()
    assert biases[-1].all()


def test_the_seed_decides_the_readings(simulate):
    first, again, other = (
        table(simulate(*SMALL, *seed, "--frames", "2", out=name)[3], "imu0")[1]
        for name, seed in (("a", ()), ("b", ()), ("c", ("--option", "seed=6")))
    )
    np.testing.assert_array_equal(first, again)
    assert not np.isclose(first, other).any()


def test_one_frame_has_no_inertial_readings(simulate):
    code, _, err, out = simulate(*SMALL, "--frames", "1")
    assert code == 1
    assert ": 1 frame, expected at least 2 frames with times, which inertial readings need" in err
    assert err.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--layout", "dtu", "--motion", "forward"], "layout dtu has no --motion; it has worlds, noise_sigma, shadows"),
        (["--layout", "dtu", "--option", "world_file=x"], "unknown option of layout dtu 'world_file'"),
        (["--option", "image_format=bmp"], "reader 'simulated': image_format: unknown setting"),
        (
            ["--layout", "dtu", "--option", "image_format=jpg"],
            "--option image_format: found 'jpg'",
        ),
        (["--layout", "dtu", "--option", "worlds=0"], "--option worlds: found 0, expected at least 1"),
        (["--layout", "dtu", "--option", "width=65"], "--option width, height: found an odd number"),
        (["--layout", "dtu", "--option", "width=wide"], "--option width: found 'wide', expected a value such as 1600"),
        (["--motion", "flying"], "unknown motion 'flying'"),
        (["--layout", "kitti", "--option", "baseline_m=0.1"], "--option baseline_m: found 0.1, expected none"),
    ],
)
def test_what_a_layout_does_not_have_is_one_line(simulate, arguments, message):
    code, _, err, out = simulate(*arguments)
    assert code == 1
    assert err.startswith(f"tracknoise: error: {message}")
    assert err.count("\n") == 1
    assert not out.exists()
