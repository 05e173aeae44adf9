"""``tracknoise simulate``, as a user would."""

import pytest

from tracknoise.sequences.reader_registry import make_reader, open_sequence


@pytest.fixture
def simulate(tracknoise, tmp_path):
    def go(*arguments, out="out"):
        code, printed, err = tracknoise("simulate", *arguments, "--out", str(tmp_path / out), "--quiet")
        return code, printed, err, tmp_path / out

    return go


def test_several_scenes_go_into_folders_of_their_own(simulate):
    small = ["--frames", "2", "--width", "64", "--height", "48", "--supersampling", "1"]
    code, printed, err, out = simulate("--scenes", "2", "--motion", "forward", *small)
    assert (code, err) == (0, "")
    assert "wrote 4 frames" in printed
    assert [item.scene for item in make_reader("folder", out).sequences()] == ["forward-00", "forward-01"]


def test_the_light_stage_is_what_the_dtu_reader_reads(simulate):
    code, printed, err, out = simulate("--layout", "dtu", "--width", "64", "--height", "48", "--image-format", "bmp")
    assert (code, err) == (0, "")
    assert "wrote 1 scene to" in printed
    sequence = open_sequence("dtu", out, lighting="LR9")
    assert (len(sequence), sequence.camera.width, sequence.notes) == (49, 32, ())
    assert sequence.image(48).shape == (24, 32)


def test_a_drive_is_what_the_kitti_reader_reads(simulate):
    small = ["--frames", "12", "--width", "128", "--height", "48", "--supersampling", "1"]
    code, _, err, out = simulate("--layout", "kitti", *small)
    assert (code, err) == (0, "")
    assert len(open_sequence("kitti", out)) == 12


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--layout", "dtu", "--motion", "forward"], "layout dtu has no --motion; it has --noise, --shadows, --seed"),
        (["--layout", "dtu", "--world-file", "x"], "layout dtu has no --world-file; it has"),
        (["--image-format", "bmp"], "layout folder has no --image-format; it has"),
        (["--layout", "dtu", "--image-format", "jpg"], "--image-format: found 'jpg', expected one of png, bmp"),
        (["--layout", "dtu", "--width", "65"], "--width, --height: found an odd number, expected even numbers"),
        (["--motion", "flying"], "unknown motion 'flying'"),
    ],
)
def test_what_a_layout_does_not_have_is_one_line(simulate, arguments, message):
    code, _, err, out = simulate(*arguments)
    assert code == 1
    assert err.startswith(f"tracknoise: error: {message}")
    assert err.count("\n") == 1
    assert not out.exists()
