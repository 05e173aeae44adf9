"""Other focal lengths and rates than those of the model: what is converted, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from tests.estimators.exports.models import component, detections, lucas_kanade

from tracknoise.estimators.export_render import converted, export
from tracknoise.estimators.exports import FocalChange, RateChange, Target
from tracknoise.estimators.linear_window import CAMERA as CAMERA_OF_WINDOWS
from tracknoise.estimators.linear_window import Motion, consistent_sigma, linear_tracks, simulated_tracks, trajectory
from tracknoise.estimators.model import CameraOfModel, Landmark, Purpose
from tracknoise.exceptions import SettingsError
from tracknoise.inference.track_noise import TrackNoise

CAMERA = CameraOfModel(width=752, height=480, focal_px=458.6, rate_hz=20.0)
EVERY_FOURTH = Target(rate_hz=5.0, rate_change=RateChange.THINNED)
UNKNOWN_RATE = replace(CAMERA, rate_hz=None)


def short(**changes: object):
    """A model with sigmas of short windows only, which are quick to convert."""
    model = lucas_kanade(**changes)
    return replace(model, equivalents=tuple(one for one in model.equivalents if one.window in (5, 11)))


def sigma(model) -> float:
    return model.equivalent(landmark=Landmark.FREE, purpose=Purpose.NEWEST_POSE, window=11).sigma.value


def test_the_same_camera_changes_nothing():
    model = lucas_kanade()
    for target in (Target(), Target(focal_px=458.6, rate_hz=20.0), Target(focal_px=452.0, rate_hz=20.2)):
        found = converted(model, target)
        assert found.caveats == ()
        assert sigma(found.model) == sigma(model)
        assert found.model.camera.focal_px == (target.focal_px or 458.6)
        np.testing.assert_array_equal(found.model.walk.covariance, model.walk.covariance)


@pytest.mark.parametrize(
    ("target", "message"),
    [
        (Target(focal_px=0.0), "focal length is 0 px, expected a number from 1e-06 to 1e+06"),
        (Target(focal_px=-458.6, focal_change=FocalChange.LENS), "focal length is -458.6 px, expected a number"),
        (Target(focal_px=float("nan")), "focal length is nan px"),
        (Target(focal_px=float("inf"), focal_change=FocalChange.RESAMPLED), "focal length is inf px"),
        (Target(focal_px=0.1, focal_change=FocalChange.RESAMPLED), "which makes images of 0.164 x 0.105 px"),
        (Target(focal_px=1e300, focal_change=FocalChange.RESAMPLED), "expected a number from 1e-06 to 1e+06"),
        (Target(focal_px=470.0), "expected that of the model, 458.6 px, to 2 %"),
        (Target(focal_px=229.3), "`--allow resampled`"),
        (Target(rate_hz=0.0), "rate is 0 Hz, expected a number from 1e-06 to 1e+06"),
        (Target(rate_hz=float("nan")), "rate is nan Hz"),
        (Target(rate_hz=10.0), "rate is 10 Hz, expected that of the model, 20 Hz, to 2 %"),
        (Target(rate_hz=30.0, rate_change=RateChange.UNCHECKED), "rate is 30 Hz, expected that of the model"),
        (Target(rate_hz=30.0, rate_change=RateChange.THINNED), "20 Hz of the model over a whole number"),
        (Target(rate_hz=8.0, rate_change=RateChange.THINNED), "20 Hz of the model over a whole number"),
    ],
)
def test_refused(target, message):
    with pytest.raises(SettingsError) as error:
        converted(detections(), target)
    assert message in str(error.value)


def test_a_rate_cannot_be_compared_with_an_unknown_one():
    model = lucas_kanade(camera=UNKNOWN_RATE)
    with pytest.raises(SettingsError, match="does not know the rate of its recordings"):
        converted(model, Target(rate_hz=20.0))
    found = converted(model, Target(rate_hz=20.0, rate_change=RateChange.UNCHECKED))
    assert found.model.camera.rate_hz == 20.0
    assert "It is taken to be 20 Hz" in found.caveats[0]


MILLISECONDS = replace(CAMERA, rate_hz=0.02)
"""What 20 Hz are where times in milliseconds were taken as seconds."""


def test_the_true_rate_is_refused_beside_a_wrong_one_with_what_to_do():
    model = lucas_kanade(camera=MILLISECONDS)
    mended = (
        r"are probably not in seconds, probably ms \(20 Hz\): measure them again with time_unit in \[dataset.options\]"
    )
    with pytest.raises(SettingsError, match=f"rate is 20 Hz, expected that of the model, 0.02 Hz, .*{mended}"):
        converted(model, Target(rate_hz=20.0))


def test_a_rate_that_no_camera_has_reaches_no_file_unless_it_is_stated():
    model = lucas_kanade(camera=MILLISECONDS)
    with pytest.raises(
        SettingsError, match=r"at 0.02 Hz, are probably not in seconds.*if the rate is right, --rate 0.02"
    ):
        export(model, "rovio")
    slow = export(model, "rovio", target=Target(rate_hz=0.02))
    assert slow.rate_hz == 0.02
    assert ", 0.02 frames per second\n" in slow.files["rovio_noise.info"]
    assert export(model, "openvins").files  # no number of it depends on the rate


def test_files_whose_numbers_depend_on_the_rate_state_it():
    found = export(lucas_kanade(), "rovio")
    assert found.rate_hz == 20.0
    assert ", 20 frames per second\n" in found.files["rovio_noise.info"]
    half = export(lucas_kanade(), "rovio", target=Target(rate_hz=10.0, rate_change=RateChange.THINNED))
    assert ", 10 frames per second\n" in half.files["rovio_noise.info"]


def test_what_needs_a_rate_asks_for_it():
    model = lucas_kanade(camera=UNKNOWN_RATE)
    with pytest.raises(SettingsError, match=r"ROVIO: no rate, expected frames per second, with `--rate`"):
        export(model, "rovio")
    assert export(model, "openvins").files


def test_resampled_images_scale_all_px():
    model = lucas_kanade()
    found = converted(model, Target(focal_px=229.3, focal_change=FocalChange.RESAMPLED))
    assert (found.model.camera.width, found.model.camera.height) == (376, 240)
    assert sigma(found.model) == pytest.approx(sigma(model) / 2)
    assert found.model.equivalents[0].sigma.low == pytest.approx(model.equivalents[0].sigma.low / 2)
    for name in ("first", "white", "walk"):
        np.testing.assert_allclose(getattr(found.model, name).covariance, getattr(model, name).covariance / 4)
    assert "resampled by 0.5" in found.caveats[0]


def test_another_lens_keeps_px():
    found = converted(lucas_kanade(), Target(focal_px=300.0, focal_change=FocalChange.LENS))
    assert sigma(found.model) == sigma(lucas_kanade())
    assert found.model.camera.focal_px == 300.0
    assert "another lens" in found.caveats[0]


def test_numbers_on_the_normalised_plane_do_not_depend_on_the_size_of_images():
    target = Target(focal_px=229.3, focal_change=FocalChange.RESAMPLED)
    full, half = (export(lucas_kanade(), "msckf_vio", target=one).files for one in (None, target))
    assert [text.splitlines()[1] for text in full.values()] == [text.splitlines()[1] for text in half.values()]


def test_a_tracker_that_skips_frames_walks_more_from_frame_to_frame():
    model = lucas_kanade(training=replace(lucas_kanade().training, speed=2.0))
    found = converted(model, Target(rate_hz=10.0))
    np.testing.assert_allclose(found.model.walk.covariance, 2.0 * model.walk.covariance)
    np.testing.assert_allclose(found.model.white.covariance, model.white.covariance)
    per_second = found.model.walk.covariance * found.model.camera.rate_hz
    np.testing.assert_allclose(per_second, model.walk.covariance * model.camera.rate_hz)
    with pytest.raises(SettingsError, match="expected that of the model, 10 Hz"):
        converted(model, Target(rate_hz=20.0))


def test_every_second_frame_of_detections_has_the_same_noise():
    found = converted(detections(), Target(rate_hz=10.0, rate_change=RateChange.THINNED))
    assert sigma(found.model) == sigma(detections())
    assert found.caveats == ("Features are tracked in every frame, and one frame of 2 is used.",)


def test_the_walk_of_the_frames_between_adds_up():
    model, at = short(), converted(short(), EVERY_FOURTH)
    assert "The walk of 4 frames adds up" in at.caveats[1]
    np.testing.assert_allclose(at.model.walk.covariance, 4.0 * model.walk.covariance)
    np.testing.assert_allclose(at.model.white.covariance, model.white.covariance)
    for before, after in zip(model.equivalents, at.model.equivalents, strict=True):
        ratio = after.sigma.value / before.sigma.value
        assert 1.0 < ratio < 2.0
        assert after.sigma.high / after.sigma.value == pytest.approx(before.sigma.high / before.sigma.value)


def test_the_sigma_of_a_pure_walk_grows_as_the_walk():
    walking = short(white=component(0.0))
    target = Target(rate_hz=10.0, rate_change=RateChange.THINNED)
    for before, after in zip(walking.equivalents, converted(walking, target).model.equivalents, strict=True):
        assert after.sigma.value / before.sigma.value == pytest.approx(np.sqrt(2.0))
        assert (after.gate_95, after.gate_99) == pytest.approx((before.gate_95, before.gate_99))


def test_sigma_grows_as_in_the_linear_benchmark():
    """The benchmark itself, asked for sideways and for forward motion: the ratio of a mean is between both."""
    ratios = []
    for motion in Motion:
        poses = trajectory(motion, 11)
        window = [linear_tracks(CAMERA_OF_WINDOWS, poses, tracks) for tracks in simulated_tracks(poses, n_tracks=40)]
        noises = [TrackNoise.isotropic(white=0.1, walk=walk) for walk in (0.08, 0.16)]
        before, after = (consistent_sigma(window, noise, purpose=Purpose.NEWEST_POSE) for noise in noises)
        ratios.append(after / before)
    model = short(white=component(0.1))
    found = sigma(converted(model, EVERY_FOURTH).model) / sigma(model)
    assert min(ratios) <= found <= max(ratios)


def test_gates_follow_the_innovations():
    model, found = short(), converted(short(), EVERY_FOURTH).model
    pairs = list(zip(model.equivalents, found.equivalents, strict=True))
    for landmark in (Landmark.FREE, Landmark.EXACT):
        chosen = [pair for pair in pairs if (pair[0].landmark, pair[0].window) == (landmark, 11)]
        ratios = [
            after.gate_95 * after.sigma.value**2 / (before.gate_95 * before.sigma.value**2) for before, after in chosen
        ]
        np.testing.assert_allclose(ratios, ratios[0])
    innovations = next(one for one in found.equivalents if one.purpose is Purpose.INNOVATIONS)
    assert innovations.gate_95 == pytest.approx(1.2)


def test_a_focal_length_cannot_be_compared_with_an_unknown_one():
    model = lucas_kanade(camera=replace(CAMERA, focal_px=None))
    for change in (None, FocalChange.RESAMPLED):
        with pytest.raises(SettingsError, match="does not know that of its recordings"):
            converted(model, Target(focal_px=458.6, focal_change=change))
    with pytest.raises(SettingsError, match="VINS-Mono: no focal length, expected that of its camera"):
        export(model, "vins")
    lens = Target(focal_px=458.6, focal_change=FocalChange.LENS)
    assert "focal_px = 458.600;" in export(model, "vins", target=lens).files["vins_mono_noise.cpp"]
