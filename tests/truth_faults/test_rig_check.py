"""What a check says of the second camera of a recording."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tracknoise.experiments.doubts import doubts
from tracknoise.experiments.measure import measure
from tracknoise.geometry.cameras import Camera
from tracknoise.sequences.kept_frames import KeptFrames
from tracknoise.sequences.reader_registry import open_sequence
from tracknoise.sequences.stereo import with_stereo_depth
from tracknoise.sequences.views import View
from tracknoise.trackers.second_view import SecondView
from tracknoise.truth_faults.check_recording import check_sequence
from tracknoise.truth_faults.check_report import Severity
from tracknoise.truth_faults.rig_check import TOPIC, second_camera

FRAMES = 12


@dataclass(frozen=True, eq=False)
class Pair(View):
    """A pair of cameras of which something else is stated."""

    change: object = staticmethod(lambda second: second)
    has_maps: bool = True
    stated: Camera | None = None

    @property
    def second(self):
        return self.change(self.sequence.second)

    @property
    def camera(self):
        return self.stated or self.sequence.camera

    def depth(self, index):
        return self.sequence.depth(index) if self.has_maps else None


def moved(rotation=None, factor=1.0):
    def change(second):
        pose = second.first_from_second.copy()
        pose[:3, 3] *= factor
        if rotation is not None:
            pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(rotation, degrees=True).as_matrix()
        return replace(second, first_from_second=pose)

    return change


def late(frames):
    def change(second):
        return replace(second, images=lambda index: second.images(min(max(index - frames, 0), FRAMES - 1)))

    return change


@dataclass(frozen=True, eq=False)
class WithSecond(KeptFrames):
    """Images of both cameras are rendered once."""

    @property
    def second(self):
        second, kept = self.sequence.second, self.of_second

        def image(index):
            if index not in kept:
                kept[index] = second.images(index)
            return kept[index]

        return replace(second, images=image)

    of_second: dict = None


@pytest.fixture(scope="module")
def simulated():
    options = {"motions": ["arvr"], "frames": FRAMES, "width": 320, "height": 240, "baseline_m": 0.12}
    return WithSecond(open_sequence("simulated", seed=2, imaging={"rate_hz": 30.0}, **options), of_second={})


@pytest.mark.parametrize("has_maps", [True, False])
def test_a_pair_that_is_right_agrees(simulated, has_maps):
    item = second_camera(Pair(simulated, has_maps=has_maps))
    assert item.severity is Severity.ok
    assert item.values["left_px"] < 0.3


@pytest.mark.parametrize(
    ("change", "name", "size"),
    [
        (moved([0.0, 0.6, 0.0]), "turned by", ("turn_deg", 0.6)),
        (moved(factor=1.1), "too long", ("baseline_off", 0.1)),
        (late(2), "before those of the first", ("delay_frames", -2.0)),
    ],
)
def test_a_fault_is_named_with_its_size(simulated, change, name, size):
    item = second_camera(Pair(simulated, change))
    assert item.severity is Severity.caveat  # depths of maps do not depend on the second camera
    assert name in item.text
    assert item.values[size[0]] == pytest.approx(size[1], rel=0.15)


def test_a_simulated_delay_is_named_with_its_size():
    options = {"motions": ["fixating"], "frames": FRAMES, "width": 320, "height": 240, "baseline_m": 0.12}
    item = second_camera(open_sequence("simulated", seed=2, second_delay_frames=0.5, **options))
    assert "images of the second camera were taken" in item.text
    assert "frames after those of the first" in item.text
    assert item.values["delay_frames"] == pytest.approx(0.5, rel=0.15)


def test_a_baseline_of_the_wrong_sign_is_named(simulated):
    item = second_camera(Pair(simulated, moved(factor=-1.0)))
    assert "wrong sign" in item.text
    assert item.values["undone_px"] < 0.3 < item.values["given_px"]


def test_images_that_are_not_rectified_are_named(simulated):
    pose = np.eye(4)
    pose[:3, 3] = simulated.second.first_from_second[:3, 3]
    turned = moved([0.0, 0.0, 1.0])
    item = second_camera(Pair(simulated, lambda second: turned(replace(second, first_from_second=pose))))
    assert "turned by 1" in item.text
    rectified = second_camera(
        Pair(simulated, lambda second: replace(second, camera=replace(second.camera, cy=second.camera.cy + 6.0)))
    )
    assert "rectified" in rectified.text


def test_faults_make_depths_of_the_pair_wrong(simulated):
    wrong = with_stereo_depth(Pair(simulated, moved([0.6, 0.0, 0.0])))
    assert second_camera(wrong).severity is Severity.fatal
    measured = measure(wrong, "lucas-kanade", truth="birth")
    assert any("turned by" in text for text in doubts(measured, {"lucas-kanade": "lucas-kanade"}).mistakes)
    right = measure(with_stereo_depth(Pair(simulated)), "lucas-kanade", truth="birth")
    assert not any("second camera" in text for text in doubts(right, {"lucas-kanade": "lucas-kanade"}).mistakes)


def test_a_run_of_second_views_alone_has_the_fault(simulated):
    wrong = Pair(simulated, moved([0.6, 0.0, 0.0]))
    measured = measure(wrong, {"second": SecondView(epipolar_px=None)}, truth="birth")
    assert any("turned by" in text for text in doubts(measured, {"second": "second-view"}).mistakes)


def test_a_check_has_the_topic_only_where_there_is_a_second_camera(simulated):
    assert TOPIC in {item.topic for item in check_sequence(Pair(simulated)).items}
    assert TOPIC not in {item.topic for item in check_sequence(Pair(simulated, lambda _: None)).items}


def test_images_without_texture_cannot_be_checked(simulated):
    blank = replace(simulated.second, images=lambda index: np.full((240, 320), 90, np.uint8))
    assert second_camera(Pair(simulated, lambda _: blank)).severity is Severity.unknown


def test_images_of_another_size_are_a_finding(simulated):
    small = replace(simulated.second, images=lambda index: np.zeros((120, 160), np.uint8))
    item = second_camera(Pair(simulated, lambda _: small))
    assert item.severity is Severity.caveat
    assert "shape (120, 160)" in item.text


def test_pixels_without_a_ray_do_not_count(simulated):
    class Lens(Camera):
        def bearings(self, uv):
            rays = super().bearings(uv)
            rays[np.asarray(uv)[..., 0] < 120.0] = np.nan
            return rays

    camera = simulated.second.camera
    lens = Lens(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
    item = second_camera(Pair(simulated, lambda second: moved([0.0, 0.6, 0.0])(replace(second, camera=lens))))
    assert item.values["turn_deg"] == pytest.approx(0.6, rel=0.1)
