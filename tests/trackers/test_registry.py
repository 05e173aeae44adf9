import pytest

from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.trackers.correspondence import Correspondence
from tracknoise.trackers.imported import Imported
from tracknoise.trackers.lucas_kanade import LucasKanade
from tracknoise.trackers.oracle import Oracle
from tracknoise.trackers.rejection import Consensus, Model, Rejection
from tracknoise.trackers.tracker_registry import TRACKERS, make_tracker, tracker_defaults


def test_the_built_in_trackers_are_known_by_name():
    assert TRACKERS.names() == [
        "correspondence",
        "dense-flow",
        "external",
        "imported",
        "lucas-kanade",
        "oracle",
        "patch",
        "second-view",
    ]
    assert all(TRACKERS.load(kind).kind == kind for kind in TRACKERS.names())
    assert all(TRACKERS.load(kind).description for kind in TRACKERS.names())


def test_options_become_settings_nested_ones_and_names_of_members_too():
    made = make_tracker("lucas-kanade", {"window_px": 21, "rejection": {"model": "fundamental", "threshold_px": 1}})
    assert made == LucasKanade(window_px=21, rejection=Rejection(model=Model.fundamental, threshold_px=1.0))
    refined = make_tracker("correspondence", {"rejection": {"consensus": "refined"}})
    assert refined == Correspondence(rejection=Rejection(consensus=Consensus.refined))
    oracle = make_tracker("oracle", {"bias_px": [1, 0.5], "covariance_px2": [[1, 0], [0, 2]]})
    assert oracle == Oracle(bias_px=(1.0, 0.5), covariance_px2=((1.0, 0.0), (0.0, 2.0)))
    assert make_tracker("lucas-kanade") == LucasKanade()


@pytest.mark.parametrize(
    ("kind", "options", "message"),
    [
        (
            "lucas-kanade",
            {"windw_px": 15},
            r"windw_px: unknown setting \(did you mean 'window_px'\?\); known: backward_levels,",
        ),
        ("lucas-kanade", {"rejection": {"treshold_px": 3}}, r"rejection.treshold_px: unknown .*'threshold_px'"),
        ("lucas-kanade", {"rejection": {"model": "affine"}}, r"rejection.model: .*'homography'.*found 'affine'$"),
        (
            "lucas-kanade",
            {"rejection": {"threshold_px": -1}},
            r"rejection.threshold_px is -1, expected a number above 0$",
        ),
        ("lucas-kanade", {"detection": {"square_px": 14}}, r"square_px is 14, expected an odd number$"),
        ("lucas-kanade", {"window_px": "15"}, r"window_px: .*integer, found '15'$"),
        ("lucas-kanade", {"window_px": True}, r"window_px: .*integer, found True$"),
        ("lucas-kanade", {"rejection": 3}, r"rejection: .*found 3$"),
        ("lucas-kanade", {"rejection": object()}, r"expected what a TOML file can hold$"),
        ("oracle", {"bias_px": [1.0]}, r"oracle.*bias_px"),
        ("oracle", {"covariance_px2": [[1.0, 2.0], [2.0, 1.0]]}, r"covariance_px2 is .*eigenvalues$"),
        ("lucas-kanade", {"window_px": 1001}, r": window_px is 1001, expected a number from 3 to 999$"),
        (
            "lucas-kanade",
            {"detection": {"contrast": 1}},
            r"contrast is 1, expected a number from 0 to below 1$",
        ),
        ("lucas-kanade", {"epsilon": float("inf")}, r"epsilon is inf, expected a number above 0$"),
        ("oracle", {"student_nu": 2}, r"student_nu is 2, expected a number above 2$"),
        ("imported", {"path": "x.csv", "raster": [1, 0]}, r"raster.1 is 0, expected a number above 0$"),
        ("imported", {}, r"'imported': path: missing, expected a value$"),
        ("imported", {"path": "x.csv", "pth": "y"}, r"pth: unknown setting"),
    ],
)
def test_wrong_options_are_refused_in_one_line_that_names_them(kind, options, message):
    with pytest.raises(SettingsError, match=message) as caught:
        make_tracker(kind, options)
    assert "\n" not in str(caught.value)
    assert f"tracker {kind!r}: " in str(caught.value)


def test_bounds_hold_without_a_file_too():
    for options, message in (
        ({"epsilon": 0.0}, "epsilon is 0.0, expected a number above 0"),
        ({"max_features": 0, "min_features": 1}, "max_features is 0, expected a number from 1 to 1000000"),
        ({"epsilon": float("nan")}, "epsilon is nan, expected a number above 0"),
    ):
        with pytest.raises(ValueError, match=f"^{message}$"):
            LucasKanade(**options)
    with pytest.raises(ValueError, match=r"^raster is 0.0, expected a number above 0$"):
        Imported("x.csv", raster=(1.0, 0.0))


def test_an_unknown_tracker_is_refused_with_the_known_ones():
    with pytest.raises(
        UnknownNameError, match=r"'lucas-kanade'.*known: basalt, basalt-stereo, correspondence, cuvslam, dense-flow"
    ):
        make_tracker("lucas-kanda")


def test_defaults_are_shown_as_toml_that_makes_the_same_tracker():
    import tomllib

    for kind in ("lucas-kanade", "correspondence", "oracle"):
        assert make_tracker(kind, tomllib.loads(tracker_defaults(kind))) == TRACKERS.load(kind)()
    assert tracker_defaults("imported").splitlines()[0] == "# path = ... (required)"
