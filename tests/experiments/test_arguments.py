import numpy as np
import pytest

import tracknoise as tn
from tracknoise.exceptions import SettingsError, UnknownNameError


@pytest.fixture(scope="module")
def sequence():
    return tn.open_sequence("simulated", motions=["forward"], frames=3, width=64, height=48)


@pytest.mark.parametrize(
    ("speeds", "message"),
    [
        (1, r"speeds = 1, expected a list, such as \[1\]"),
        ("12", r"speeds = '12', expected a list"),
        ([0], r"speeds = \[0\], expected different whole numbers of 1 or more"),
        ([], r"speeds = \[\], expected"),
        ([1, 1], r"speeds = \[1, 1\], expected different"),
        ([1.5], r"speeds = \[1.5\], expected"),
        ([True], r"speeds = \[True\], expected"),
    ],
)
def test_wrong_speeds_are_refused_with_what_to_write(sequence, speeds, message):
    with pytest.raises(SettingsError, match=message):
        tn.measure(sequence, tn.LucasKanade(), speeds=speeds)


@pytest.mark.parametrize(
    ("trackers", "message"),
    [
        (tn.LucasKanade, r"found the class LucasKanade, expected an instance: LucasKanade\(\)"),
        ([tn.LucasKanade(), tn.Correspondence], "found the class Correspondence, expected an instance"),
        ({"a": 3}, "found 3, expected settings of a tracker"),
        (None, "found None, expected settings of a tracker"),
        ([], "no trackers, expected at least one"),
        ([tn.LucasKanade(), "lucas-kanade"], "two trackers of one name"),
    ],
)
def test_wrong_trackers_are_refused_with_what_to_write(sequence, trackers, message):
    with pytest.raises(SettingsError, match=message):
        tn.measure(sequence, trackers)


def test_a_tracker_may_be_named_and_a_name_nearly_right_is_suggested(sequence):
    measured = tn.measure(sequence, "lucas-kanade", speeds=np.array([1, 2]))
    assert measured.tracks.equals(tn.measure(sequence, tn.LucasKanade(), speeds=(1, 2)).tracks)
    with pytest.raises(UnknownNameError, match=r"'lucas_kanade' \(did you mean 'lucas-kanade'\?\)"):
        tn.measure(sequence, "lucas_kanade")


def test_a_preset_is_named_after_its_system(sequence):
    measured = tn.measure(sequence, ["openvins", "vins-fusion", tn.LucasKanade()])
    assert set(measured.frames["tracker"].unique()) == {"openvins", "vins-fusion", "lucas-kanade"}


@pytest.mark.parametrize("wrong", ["/data/office", None, tn.Sequence])
def test_what_is_no_sequence_is_refused(wrong):
    with pytest.raises(SettingsError, match=r"expected a sequence, from tracknoise.open_sequence"):
        tn.measure(wrong, tn.LucasKanade())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: tn.LucasKanade(window_px="15"), "window_px is '15', expected a number from 3 to 999"),
        (lambda: tn.LucasKanade(window_px=-1), "window_px is -1, expected a number from 3 to 999"),
        (lambda: tn.LucasKanade(detection={"detector": "gftt"}), r"detection is {'detector': 'gftt'}, expected Detec"),
        (lambda: tn.Correspondence(rejection=None), r"rejection is None, expected Rejection\(...\)"),
        (lambda: tn.Imported("a.csv", format="csv"), "format is 'csv', expected one of table, xivo"),
        (lambda: tn.Imported("a.csv", units="px"), "units is 'px', expected one of pixels, normalised"),
        (lambda: tn.Imported("a.csv", origin="top"), "origin is 'top', expected one of centre, corner"),
    ],
)
def test_a_wrong_option_in_python_is_an_error_of_the_input(make, message):
    with pytest.raises(tn.TracknoiseError, match=message):
        make()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"corrections": {"focal_scale": 1.1}}, r"corrections = {'focal_scale': 1.1}, expected tracknoise.Corrections"),
        ({"accuracy": 0.1}, r"accuracy = 0.1, expected tracknoise.AccuracyRule"),
        ({"max_frames": 0}, "max_frames = 0, expected a whole number of 2 or more"),
        ({"max_frames": 2.5}, "max_frames = 2.5, expected a whole number of 2 or more"),
        ({"seed": "a"}, "seed = 'a', expected a whole number of 0 or more"),
        ({"seed": -1}, "seed = -1, expected a whole number of 0 or more"),
        ({"second_truth": 3}, "found 3, expected a sequence"),
    ],
)
def test_wrong_options_of_measure_are_refused_with_what_to_write(sequence, options, message):
    with pytest.raises(SettingsError, match=message):
        tn.measure(sequence, tn.LucasKanade(), **options)
