import pytest
from benchmarks.effects.schema import Size
from benchmarks.effects.study import Effect, Study, base_options, catalogue, chosen_effects, merged

from tracknoise.exceptions import SettingsError, UnknownNameError


@pytest.mark.parametrize("effect", catalogue(), ids=lambda effect: effect.name)
def test_every_size_changes_the_sequences_in_another_way(effect: Effect) -> None:
    study = Study(base_options(), (effect,))
    readers = [study.reader, *(study.changed(effect, size) for size in Size)]
    assert len(set(readers)) == 4
    assert len(set(effect.shown.values())) == 3
    assert effect.source


def test_images_and_truth_are_what_the_kind_says() -> None:
    for effect in catalogue():
        study = Study(base_options(), (effect,))
        for size in Size:
            changed = study.changed(effect, size)
            assert (changed.faults != study.reader.faults) == (effect.kind == "truth")
            if effect.kind == "truth" and effect.name != "hidden shutter":
                assert (changed.imaging, changed.lens) == (study.reader.imaging, study.reader.lens)


def test_names_can_be_separated_by_commas() -> None:
    names = [effect.name for effect in catalogue()]
    assert len(set(names)) == len(names)
    assert not any("," in name for name in names)


def test_effects_are_chosen_by_name_in_their_order() -> None:
    assert [effect.name for effect in chosen_effects(["clock offset", "JPEG"])] == ["JPEG", "clock offset"]
    assert chosen_effects(None) == catalogue()
    with pytest.raises(UnknownNameError, match="'jpg'"):
        chosen_effects(["jpg"])
    with pytest.raises(SettingsError, match="no name of an effect, expected some of photon noise, fixed pattern"):
        chosen_effects([])


def test_nested_options_are_merged() -> None:
    given = {"width": 4, "imaging": {"rate_hz": 30.0, "prnu": 0.1}}
    assert merged(given, {"imaging": {"prnu": 0.2}, "lens": "radtan"}) == {
        "width": 4,
        "imaging": {"rate_hz": 30.0, "prnu": 0.2},
        "lens": "radtan",
    }
    assert given["imaging"]["prnu"] == 0.1
