"""Faults that are usual mistakes are said in the words of the mistake."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.validity.audit_worlds import World, make_samples, theta_of
from scipy.spatial.transform import Rotation

from tracknoise.truth_faults.audit_samples import Paths
from tracknoise.truth_faults.audit_summary import (
    audit_sentences,
    corrections_toml,
    shifted_text,
    usual_mistakes,
    whole_frames,
)
from tracknoise.truth_faults.audit_tables import tables_of
from tracknoise.truth_faults.corrected_positions import predict
from tracknoise.truth_faults.fault_parameters import COUNT, Parameter
from tracknoise.words import SPACE

WORLD = World(per_scene=40, n_frames=60)


def audit(z_depth_from=None, **faults):
    theta = theta_of({Parameter(name): value for name, value in faults.items()})
    samples = make_samples(np.random.default_rng(1), WORLD, theta)
    return tables_of(replace(samples, z_depth_from=z_depth_from), "made-up").audit


@pytest.mark.parametrize(
    ("offset", "half", "frames"),
    [
        (0.98, 0.1, 1),
        (0.95, 0.01, 1),
        (-2.1, 0.2, -2),
        (0.18, 0.03, 0),
        (0.8, 0.01, 0),
        (-1.22, 0.1, 0),
        (0.5, 0.01, 0),
        (-2.0, 0.6, 0),
        (0.02, 0.01, 0),
    ],
)
def test_an_offset_is_one_of_whole_frames_only_if_this_is_sure(offset, half, frames) -> None:
    assert whole_frames(offset, half) == frames


def test_poses_of_the_next_frame_are_named_as_such() -> None:
    found = audit(clock_offset=-1.0)
    (text,) = usual_mistakes(found)
    assert text.startswith("Poses are off by 1 frame: pose i - 1 belongs to frame i (clock offset −33.39 ± 0.")
    assert audit_sentences(found)[0] == text
    assert shifted_text(2) == "Poses are off by 2 frames: pose i + 2 belongs to frame i"


def test_distances_along_the_ray_are_named_with_their_correction() -> None:
    found = audit(ray_depth=1.0)
    (text,) = usual_mistakes(found)
    assert text.startswith("Depth is the distance along the ray, not along the optical axis (share ")
    assert corrections_toml(found) == "[truth.corrections]\ndepth_along_ray = true"


def test_depths_against_the_path_are_one_number() -> None:
    text, *others = audit_sentences(audit(depth_scale=0.1))
    assert text.startswith(f"The scale of the depths against the camera's path is 9.2{SPACE}% too small (1.10")
    assert " A camera path that is too long by the same factor looks the same." in text
    (explained,) = others
    assert explained.startswith("The focal length, ")
    assert explained.endswith("once the scale of the depths against the camera's path is corrected.")


def test_a_wrong_disparity_is_named_with_its_correction() -> None:
    found = audit(inverse_depth_offset=0.05)
    assert audit_sentences(found)[0].startswith(
        "The inverse depths are off by a constant, as those of stereo with a wrong disparity (0.0"
    )
    block = tomllib.loads(corrections_toml(found))["truth"]["corrections"]
    assert block == {"inverse_depth_offset_per_m": pytest.approx(0.05, abs=2e-3)}


def test_a_clock_that_runs_too_slow_is_named_with_its_rate() -> None:
    """One frame of 1/30 s too early after 29.5 frames from the middle."""
    found = audit(clock_drift=-1.0)
    text, rate = audit_sentences(found)[0], 1.0 / 29.5
    assert text.startswith("The clock of the poses runs too slow (−33.")
    assert f"{SPACE}ms/s instead of 0)" in text
    block = tomllib.loads(corrections_toml(found))["truth"]["corrections"]
    assert block == {"clock_drift": pytest.approx(-rate, abs=1e-3)}


def test_a_drift_without_timestamps_is_one_of_frames_and_has_no_setting() -> None:
    samples = make_samples(np.random.default_rng(1), WORLD, theta_of({Parameter.clock_drift: 1.0}))
    found = tables_of(replace(samples, interval_s=None), "made-up").audit
    assert f"{SPACE}frames per 100 instead of 0)" in audit_sentences(found)[0]
    block = tomllib.loads(corrections_toml(found))
    assert block["truth"]["corrections"] == {}


@pytest.mark.parametrize(
    ("faults", "opening", "to_do"),
    [
        ({"smoothing": 1.0}, "The poses are smoothed (1.0", "use the poses from before the filter."),
        (
            {"smoothing": -1.0},
            "The poses overshoot, as a sharpened path does (",
            "use smoother poses, or the poses from",
        ),
        (
            {"rotation_delay": (0.5, 0.5, 0.5)},
            "Rotations and positions of the poses are of different times (late by (16.",
            "make poses whose rotations and positions have one clock.",
        ),
    ],
)
def test_what_no_setting_undoes_is_said_with_what_to_do(faults, opening, to_do) -> None:
    found = audit(**faults)
    text = audit_sentences(found)[0]
    assert text.startswith(opening)
    assert f" No setting corrects this: {to_do}" in text
    assert corrections_toml(found) is None


def test_white_noise_of_poses_is_called_jitter() -> None:
    """Noise of 0.3 degrees and 1 cm on poses that were exact."""
    rng = np.random.default_rng(1)
    exact = make_samples(rng, WORLD, theta_of({}))
    paths = exact.paths
    turned, moved = rng.normal(size=(2, len(paths.times), 3)) * np.array([0.005, 0.01])[:, None, None]
    poses = np.tile(np.eye(4), (len(paths.times), 1, 1))
    poses[:, :3, :3] = paths.rotation @ Rotation.from_rotvec(turned).as_matrix()
    poses[:, :3, 3] = paths.position + moved
    jittered = replace(exact, paths=Paths.of(paths.times, poses, np.cumsum(paths.first == np.arange(len(poses)))))
    stated = replace(jittered, stated=predict(jittered, np.zeros(COUNT)).uv)
    text = audit_sentences(tables_of(stated, "made-up").audit)[0]
    assert text.startswith("The poses jitter from frame to frame, or overshoot as a sharpened path does (")
    assert " No setting corrects this: use smoother poses, or the poses from before the filter." in text


def test_a_kind_of_depth_that_is_known_is_not_tried() -> None:
    """Errors like those of distances along the ray have another cause then."""
    found = audit(z_depth_from="stereo matching", ray_depth=1.0)
    about = found.filter(parameter="ray_depth")
    assert about.select("family", "verdict", "rank", "value").rows() == [("alone", "not_tried", None, None)]
    assert usual_mistakes(found) == []
    assert "depth_along_ray" not in (corrections_toml(found) or "")
    assert "The kind of depth was not tried: depths are z by construction (from stereo matching)." in audit_sentences(
        found, every=True
    )
    assert not any("ray" in text or "kind of depth" in text for text in audit_sentences(found))


def test_half_a_kind_of_depth_is_no_fault_of_this_kind() -> None:
    found = audit(ray_depth=0.3)
    assert "ray_depth" not in found.drop_nulls("rank")["parameter"].to_list()
    assert usual_mistakes(found) == []


@pytest.mark.parametrize("faults", [{}, {"clock_offset": 0.5}, {"focal_length": 0.1}])
def test_no_other_fault_is_a_usual_mistake(faults) -> None:
    assert usual_mistakes(audit(**faults)) == []
