"""Faults that are usual mistakes are said in the words of the mistake."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.validity.audit_worlds import World, make_samples, theta_of

from tracknoise.truth_faults.audit_summary import (
    audit_sentences,
    corrections_toml,
    shifted_text,
    usual_mistakes,
    whole_frames,
)
from tracknoise.truth_faults.audit_tables import tables_of
from tracknoise.truth_faults.fault_parameters import Parameter

WORLD = World(per_scene=100, n_frames=60)


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
    assert text.startswith("Poses are off by 1 frame: pose i -1 belongs to frame i (clock offset −33.3 ± 0.")
    assert audit_sentences(found)[0] == text
    assert shifted_text(2) == "Poses are off by 2 frames: pose i +2 belongs to frame i"


def test_distances_along_the_ray_are_named_with_their_correction() -> None:
    found = audit(ray_depth=1.0)
    (text,) = usual_mistakes(found)
    assert text.startswith("Depth is the distance along the ray, not along the optical axis (share ")
    assert corrections_toml(found) == "[truth.corrections]\ndepth_along_ray = true"


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


@pytest.mark.parametrize("faults", [{}, {"clock_offset": 0.5}, {"clock_offset": 0.8}, {"focal_length": 0.1}])
def test_no_other_fault_is_a_usual_mistake(faults) -> None:
    assert usual_mistakes(audit(**faults)) == []
