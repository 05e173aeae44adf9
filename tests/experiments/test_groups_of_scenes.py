"""Groups of scenes: those that readers know, and those that an experiment declares."""

from dataclasses import replace

import pytest

from tracknoise.analysis.condition_units import groups_of_scenes
from tracknoise.inference.units import scheme
from tracknoise.sequences.kitti_files import recording_of
from tracknoise.sequences.scenes import parent_of
from tracknoise.sequences.sequence import group_of
from tracknoise.sequences.simulated import Simulated
from tracknoise.sequences.views import view
from tracknoise.tables.identity import Direction, SequenceId
from tracknoise.tables.manifest import Manifest, SequenceEntry

SCENES = {"chess/seq-01": "chess", "chess/seq-02": "chess", "fire/seq-01": "fire", "alone": None}
ENTRIES = {
    scene: SequenceEntry(SequenceId("d", scene), 10, 64, 48, "birth", 5, 1.5, group=group)
    for scene, group in SCENES.items()
}


def test_by_default_groups_are_what_readers_know() -> None:
    named = {("d", scene): group for scene, group in SCENES.items() if group}
    assert groups_of_scenes(ENTRIES, None).names == named


def test_declared_groups_replace_them_and_the_first_that_fits_counts() -> None:
    declared = {"first": ["*/seq-01"], "chess": ["chess/*"]}
    assert groups_of_scenes(ENTRIES, declared).names == {
        ("d", "chess/seq-01"): "first",
        ("d", "fire/seq-01"): "first",
        ("d", "chess/seq-02"): "chess",
    }
    assert groups_of_scenes(ENTRIES, {}).names == {}


def test_scenes_with_the_same_image_are_copies_and_of_one_group() -> None:
    images = {"fire/seq-01": "same", "alone": "same", "chess/seq-01": "other", "chess/seq-02": "another"}
    entries = {scene: replace(ENTRIES[scene], image=image) for scene, image in images.items()}
    found = groups_of_scenes(entries, None)
    assert found.copies == {("d", "fire/seq-01"): "alone"}
    assert found.names["d", "alone"] == found.names["d", "fire/seq-01"] == "copies of alone"
    assert found.of("d", sorted(images)).tolist() == [0, 1, 1, 0]
    assert groups_of_scenes(entries, {}).names == {}


def test_copies_are_not_independent_even_if_there_are_no_other_scenes() -> None:
    scenes = [f"scene-{place}" for place in range(6)]
    entries = {s: replace(ENTRIES["alone"], sequence=SequenceId("d", s), image="x") for s in scenes}
    number = groups_of_scenes(entries, None).of("d", scenes)
    assert number.tolist() == [0] * 6
    assert scheme(number) is None


def test_a_manifest_keeps_the_group() -> None:
    manifest = Manifest("", {}, {}, 0, dict(ENTRIES))
    again = Manifest.from_json(manifest.to_json(), place="x")
    assert {scene: entry.group for scene, entry in again.sequences.items()} == SCENES


def test_the_group_of_a_simulated_scene_is_its_motion_in_every_view() -> None:
    reader = Simulated(worlds=1, frames=2, width=64, height=48)
    sequence = reader.open(reader.sequences()[0])
    assert group_of(sequence) == sequence.id.scene.removesuffix("-00")
    backward = view(sequence, n_frames=None, direction=Direction.backward, rotation=90)
    assert group_of(backward) == group_of(sequence)


@pytest.mark.parametrize(
    ("scene", "levels", "expected"),
    [("chess/seq-01", 1, "chess"), ("seq-01", 1, None), ("office/Easy/P000", 2, "office"), ("Easy/P000", 2, None)],
)
def test_the_group_of_a_nested_scene_is_the_folder_above(scene: str, levels: int, expected: str | None) -> None:
    assert parent_of(scene, levels=levels) == expected


@pytest.mark.parametrize(
    ("drive", "expected"),
    [
        ("2011_09_26_drive_0001_sync", "2011_09_26_drive_0001"),
        ("2011_09_26_drive_0001_sync_b", "2011_09_26_drive_0001"),
        ("2011_09_26_drive_sample_sync", None),
    ],
)
def test_pieces_of_a_drive_are_of_one_recording(drive: str, expected: str | None) -> None:
    assert recording_of(drive) == expected
