"""The verdict on the truth follows from what the causes explain, what is established, and what is stated."""

from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl
import pytest
from benchmarks.validity.audit_worlds import World, make_samples, theta_of

from tracknoise.inference.robust_fits import scales
from tracknoise.tables.enumerations import Trust
from tracknoise.tables.trust import AssessedTruth, TruthVerdict
from tracknoise.tables.truth_audit import AUDIT, AUDIT_CURVES
from tracknoise.truth_faults.assessment import ErrorSize, TruthEvidence, assess
from tracknoise.truth_faults.audit_selection import available
from tracknoise.truth_faults.audit_tables import tables_of
from tracknoise.truth_faults.corrected_positions import predict
from tracknoise.truth_faults.explained import explained, moved
from tracknoise.truth_faults.fault_parameters import COUNT, Parameter
from tracknoise.truth_faults.pose_accuracy import POSE_SHARE

Share = tuple[float, float, float]
SMALL: Share = (0.01, 0.0, 0.02)


def audit(
    faults: Share = SMALL, depths: Share = SMALL, named: Share | None = None, maps: Share | None = None
) -> pl.DataFrame:
    bounds = ("gain", "gain_low", "gain_high")
    rows: list[dict[str, Any]] = [
        {"family": "at_most", "parameter": name, "component": "lk", **dict(zip(bounds, share, strict=True))}
        for name, share in (("every_fault", faults), ("depths", depths), ("depth_maps", maps))
        if share is not None
    ]
    if named is not None:
        fault = {"parameter": "focal_length", "component": "", "unit": "px", "stated": 110.0, "value": 100.0}
        rows += [
            {"family": "alone", "rank": 1, "verdict": "fault", **fault},
            {"family": "named", **fault, **dict(zip(bounds, named, strict=True))},
        ]
    return pl.DataFrame(rows, schema=dict(AUDIT))


def poses(**by_tracker: tuple[Share, Share | None]) -> pl.DataFrame:
    rows = [
        {"tracker": name, "fitted_to": source, **dict(zip(("share", "low", "high"), share, strict=True))}
        for name, sources in by_tracker.items()
        for source, share in zip(("own", "others"), sources, strict=True)
        if share is not None
    ]
    return pl.DataFrame(rows, schema=dict(POSE_SHARE))


def verdict(**given: Any) -> TruthVerdict:
    return TruthVerdict.of(table(**given))


def table(**given: Any) -> pl.DataFrame:
    usual = {"audit": audit(), "pose_shares": poses(lk=(SMALL, None)), "sizes": {"lk": ErrorSize(10, 0.5)}}
    usual |= {"curves": pl.DataFrame(schema=dict(AUDIT_CURVES))}
    return assess(TruthEvidence(**{**usual, **given}), "d")


def test_a_truth_that_explains_little_is_trusted_and_says_how_much() -> None:
    found = verdict()
    assert (found.verdict, found.step) == (Trust.trusted, "")
    assert found.text.startswith("No fault was found. Errors of the truth can explain at most 4.7")  # .03 + .01 sqrt(3)
    assert "of the squared errors of lk. This part is up to 0.109 px of the RMS of 0.500 px at age 10." in found.text


@pytest.mark.parametrize(
    ("share", "expected"),
    [((0.05, 0.04, 0.06), "trusted"), ((0.3, 0.2, 0.4), "limited"), ((0.3, 0.0, 0.9), "unknown"),
     ((0.9, 0.8, 0.95), "not trusted"), ((0.5, 0.15, 0.8), "not trusted")],
)  # fmt: skip
def test_motions_that_poses_lack_decide_by_their_bounds(share: Share, expected: str) -> None:
    found = verdict(pose_shares=poses(lk=(share, share)))
    assert found.verdict == expected
    assert bool(found.step) == (expected != "trusted")


def test_a_motion_that_no_other_tracker_can_confirm_is_established_only_if_it_explains_most() -> None:
    """A single tracker has motions of its own on exact data: a fifth of the squared errors, up to a half."""
    alone = verdict(pose_shares=poses(lk=((0.5, 0.15, 0.8), None)))
    assert alone.verdict is Trust.unknown
    assert "no cause is established" in alone.text
    assert verdict(pose_shares=poses(lk=((0.9, 0.8, 0.95), None))).verdict is Trust.not_trusted


@pytest.mark.parametrize(
    "shown", [{"audit": audit(named=(0.6, 0.5, 0.7))}, {"pose_shares": poses(lk=((0.9, 0.8, 0.95), None))}]
)
def test_tracks_alone_cannot_convict_a_truth_that_the_images_confirm(shown: dict[str, pl.DataFrame]) -> None:
    for unclear in (None, 0.6):
        assert verdict(**shown, confirmed_share=unclear).verdict is Trust.not_trusted
    found = verdict(**shown, confirmed_share=0.1)
    assert found.verdict is Trust.unknown
    assert found.text.startswith("Tracks contradict the truth, but the images confirm at most 10.0")


def test_a_principal_point_that_only_imported_tracks_want_may_be_a_shift_of_these() -> None:
    shown = {"audit": audit(named=(0.6, 0.5, 0.7)).with_columns(parameter=pl.lit("principal_point"))}
    assert "shifted" not in verdict(**shown).step
    assert "shifted" in verdict(**shown, confirmed_share=0.9).step


def test_where_most_frames_lack_a_pose_more_frames_do_not_help() -> None:
    nothing = {"audit": audit().clear(), "sizes": {}, "pose_shares": poses()}
    assert "more frames or scenes" in verdict(**nothing).step
    assert "poses of more frames" in verdict(**nothing, lacks_poses=True).step


def test_wrong_tracks_say_nothing_about_the_truth() -> None:
    shown = {"audit": audit(named=(0.6, 0.5, 0.7)), "mistakes": ["Poses are inverted."]}
    found = table(
        **shown, tracks=[("Tracks of one are wrong.", "Mend one."), ("Tracks of two are wrong.", "Mend two.")]
    )
    assert found["cause"].to_list() == ["every", "tracks", "tracks"]
    said = TruthVerdict.of(found)
    assert (said.verdict, said.is_usable, said.are_tracks_wrong) == (Trust.not_assessed, False, True)
    assert said.sentence == "Tracks: wrong. Tracks of one are wrong. Tracks of two are wrong. Next: Mend one."


def test_a_motion_that_other_trackers_do_not_see_is_not_established() -> None:
    large, seen = (0.9, 0.8, 0.95), (0.3, 0.1, 0.5)
    assert verdict(pose_shares=poses(lk=(large, (0.0, -0.1, 0.1)))).verdict == Trust.unknown
    assert verdict(pose_shares=poses(lk=(large, seen))).verdict == Trust.not_trusted


def test_parts_of_the_scene_that_move_are_named_before_motions_of_the_camera() -> None:
    found = verdict(pose_shares=poses(lk=((0.9, 0.8, 0.95), None)), moving="Parts of the scene probably move.")
    assert found.verdict is Trust.not_trusted
    assert found.text.startswith("Parts of the scene probably move. These, or camera motions missing in the poses")
    assert found.step.startswith("Measure a scene that stands still")


def test_parts_of_the_scene_that_move_are_named_where_nothing_is_established() -> None:
    unclear = {"pose_shares": poses(lk=((0.3, 0.0, 0.9), None))}
    found = verdict(**unclear, moving="Parts of the scene probably move.")
    assert found.text.startswith("Parts of the scene probably move. Errors of the truth may explain up to")
    assert (found.verdict, found.step[:29]) == (Trust.unknown, "Measure a scene that stands s")
    assert "depths" in verdict(**unclear).step or "poses" in verdict(**unclear).step


def test_a_motion_that_constant_faults_explain_as_well_is_called_either() -> None:
    """Depths that are wrong by their distance look like motions of the camera where the scene changes little."""
    seen = {"pose_shares": poses(lk=((0.31, 0.27, 0.35), (0.31, 0.27, 0.35)))}
    either = verdict(audit=audit(faults=(0.28, 0.25, 0.32)), **seen)
    assert either.verdict is Trust.not_trusted
    assert either.text.startswith(
        "Camera motions missing in the poses, or constant faults that look like them, explain 31.0"
    )
    assert "calibration" in either.step
    motion = verdict(audit=audit(faults=(0.28, 0.0, 0.5)), **seen)
    assert motion.text.startswith("Camera motions missing in the poses explain 31.0")
    assert "bundle-adjusted" in motion.step


@pytest.mark.parametrize(
    ("cause", "share", "expected"),
    [("faults", (0.3, 0.2, 0.4), "limited"), ("depths", (0.3, 0.2, 0.4), "limited"),
     ("faults", (0.7, 0.6, 0.8), "unknown"), ("depths", (0.7, 0.6, 0.8), "unknown")],
)  # fmt: skip
def test_what_cannot_be_separated_from_the_trackers_is_never_yes(cause: str, share: Share, expected: str) -> None:
    assert verdict(audit=audit(**{cause: share})).verdict == expected


def test_a_limited_truth_says_what_limits_it_where_no_cause_surely_explains_much() -> None:
    by_chance = verdict(audit=audit(depths=(0.05, 0.0, 0.3)))
    assert by_chance.verdict is Trust.limited
    assert "Random errors of depths contribute most to this bound." in by_chance.text
    faults = verdict(audit=audit(faults=(0.05, 0.0, 0.3)))
    assert "Constant faults, such as of the calibration or the clock, contribute most to this bound." in faults.text
    stated = verdict(audit=audit(depths=(0.05, 0.0, 0.3)), sizes={"lk": ErrorSize(10, 0.5, {10: 0.2})})
    assert stated.verdict is Trust.limited
    assert "contribute most" not in stated.text
    by_maps = verdict(audit=audit(depths=(0.05, 0.0, 0.3), maps=(0.06, 0.04, 0.08)))
    assert "Random errors of depths, shown by differences of depth maps, explain 6.0" in by_maps.text


def test_depths_that_maps_do_not_repeat_are_established_whatever_the_tracks_say() -> None:
    clear, dominant = (0.3, 0.2, 0.4), (0.6, 0.5, 0.7)
    found = verdict(audit=audit(maps=clear))
    assert found.verdict is Trust.limited
    assert "Random errors of depths, shown by differences of depth maps, explain 30.0 %." in found.text
    worse = verdict(audit=audit(maps=dominant))
    assert worse.verdict is Trust.not_trusted
    assert worse.text.startswith("Random errors of depths, shown by differences of depth maps, explain 60.0 %")
    assert "disagree" not in verdict(audit=audit(depths=dominant, maps=SMALL)).text


def test_an_established_fault_decides_by_what_it_explains() -> None:
    large = verdict(audit=audit(named=(0.4, 0.3, 0.5)))
    assert large.verdict == Trust.not_trusted
    assert large.text.startswith("The stated focal length is 10.0")
    assert "corrections that `tracknoise check` prints" in large.step
    small = verdict(audit=audit(named=(0.04, 0.02, 0.06)))
    assert small.verdict == Trust.limited
    assert "The stated focal length is 10.0" in small.text
    beside = verdict(audit=audit(faults=(0.7, 0.6, 0.8), named=(0.04, 0.02, 0.06)))
    assert beside.verdict == Trust.unknown
    assert "The stated focal length is 10.0" in beside.text
    assert "no cause is established" not in beside.text
    smoothed = audit(named=(0.4, 0.3, 0.5)).with_columns(pl.col("parameter").replace("focal_length", "smoothing"))
    assert "corrections" not in verdict(audit=smoothed).step  # no setting undoes it


def test_a_fault_decides_by_the_tracker_of_which_it_explains_most() -> None:
    """A noisy tracker hides a fault in the share of all: it is most of what an accurate one errs."""
    plain, little = audit(named=(0.07, 0.04, 0.1)), audit(named=(0.05, 0.04, 0.06))
    bounds = ("gain", "gain_low", "gain_high")
    rows = [
        {"family": "at_most", "parameter": "named_faults", "component": name, **dict(zip(bounds, share, strict=True))}
        for name, share in (("lk", (0.3, 0.2, 0.4)), ("noisy", (0.01, 0.0, 0.02)))
    ]
    of_each = pl.DataFrame(rows, schema=dict(AUDIT))
    found = verdict(audit=pl.concat([plain, of_each]))
    assert found.verdict == Trust.not_trusted
    assert "This fault explains 30.0 % of the squared errors of lk." in found.text
    assert found.step.endswith("Squared errors of held-out tracks of lk then fall by 30.0 %.")
    noisy = of_each.filter(component="noisy")
    assert verdict(audit=pl.concat([little, noisy])).verdict == Trust.limited


@pytest.mark.parametrize("share", [(0.3, 0.2, 0.4), (0.7, 0.6, 0.8)])
def test_faults_that_look_like_a_bias_of_the_trackers_are_named_as_such(share: Share) -> None:
    rows = [
        {"family": "alone", "parameter": name, "component": "", "verdict": found}
        for name, found in (("readout", "like_bias"), ("depth_scale", "like_bias"), ("focal_length", "none"))
    ]
    plain = audit(faults=share)
    known = verdict(audit=pl.concat([plain, pl.DataFrame(rows, schema=dict(AUDIT))]))
    told = "cannot be distinguished from a bias of the trackers."
    other = "The same holds for the scale of the depths against the camera's path."
    first = "An error of the readout time of the shutter fits the tracks"
    assert known.text == f"{verdict(audit=plain).text} {first}, but {told} {other}"


def test_mistakes_and_fitted_points_decide_before_all_else() -> None:
    found = verdict(mistakes=["Poses are inverted.", "Depths are in mm.", "More."], is_fitted=True)
    assert (found.verdict, found.text) == (Trust.not_trusted, "Poses are inverted. There are 2 more such mistakes.")
    assert verdict(is_fitted=True).verdict == Trust.unknown
    assert verdict(cautions=["Poses jump in 1 place."]).verdict == Trust.limited


@pytest.mark.parametrize(
    ("stated", "expected"),
    [({10: 0.0}, "trusted"), ({10: 0.1}, "trusted"), ({10: 0.3}, "limited"), (None, "unknown")],
)
def test_a_stated_accuracy_bounds_what_tracks_cannot(stated: dict[int, float] | None, expected: str) -> None:
    wide = {"audit": audit(faults=(0.3, -0.5, 1.0)), "sizes": {"lk": ErrorSize(10, 0.5, stated)}}
    assert verdict(**wide).verdict == expected
    assert verdict(**wide, pose_shares=poses(lk=((0.8, 0.7, 0.9), None))).verdict == Trust.not_trusted


@pytest.mark.parametrize(
    ("own", "others", "expected"),
    [((0.2, 0.12, 0.3), None, "trusted"), ((0.2, 0.12, 0.3), (0.0, -0.1, 0.1), "trusted"),
     ((0.2, 0.12, 0.3), (0.1, 0.05, 0.2), "limited"), ((0.8, 0.7, 0.9), None, "not trusted")],
)  # fmt: skip
def test_a_motion_of_a_single_tracker_does_not_contradict_an_exact_truth(
    own: Share, others: Share | None, expected: str
) -> None:
    sizes = {"lk": ErrorSize(10, 0.5, {10: 0.0})}
    assert verdict(sizes=sizes, pose_shares=poses(lk=(own, others))).verdict == expected


def test_what_is_stated_is_a_share_of_the_core_where_tracks_are_too_few_for_an_audit() -> None:
    found = verdict(audit=audit()[:0], sizes={"lk": ErrorSize(10, 2.0, {10: 0.1}, core_px=0.2)}, pose_shares=poses())
    assert found.verdict == Trust.limited
    assert "Stated errors of the truth can explain up to 25.0 % of the squared errors." in found.text


def test_depths_that_their_maps_contradict_are_not_to_be_stated_but_replaced() -> None:
    better = "Use more accurate depths, or a recording with less parallax."
    shown = {"depths": (0.4, 0.3, 0.7), "maps": (0.37, 0.3, 0.4)}
    assert verdict(audit=audit(**shown)).step == better
    assert verdict(audit=audit(**shown), sizes={"lk": ErrorSize(10, 0.5, {10: 0.1})}).step == better
    assert "State the accuracy of the depths" in verdict(audit=audit(depths=(0.4, 0.0, 0.7))).step
    assert verdict(audit=audit(depths=(0.4, 0.0, 0.7)), measures_depths=True).step == better


def test_what_is_stated_is_compared_with_errors_of_all_ages() -> None:
    """White noise of poses is as large at age 1 as at age 10, where the errors are larger; a drift is not."""
    rows = [
        {
            "tracker": "lk",
            "correction": "measured",
            "age": age,
            "n": n,
            "core_u_px": px,
            "core_v_px": 0.0,
            "near_px": px,
        }
        for age, n, px in ((1, 300, 0.1), (10, 100, 0.5))
    ]
    curves = pl.DataFrame(rows, schema=dict(AUDIT_CURVES))
    white = {"curves": curves, "sizes": {"lk": ErrorSize(10, 0.5, {1: 0.05, 10: 0.05})}}
    found = table(**white).filter(cause="stated")
    assert found["share"].item() == pytest.approx((300 * 0.05**2 / 0.1**2 + 100 * 0.05**2 / 0.5**2) / 400)
    assert found["bound_px"].item() == 0.05
    drift = table(curves=curves, sizes={"lk": ErrorSize(10, 0.5, {1: 0.01, 10: 0.2})}).filter(cause="stated")
    assert drift["share"].item() == pytest.approx(0.2**2 / 0.5**2)
    assert verdict(**white, audit=audit(faults=(0.3, -0.5, 1.0))).verdict is Trust.limited


def test_a_stated_accuracy_does_not_hide_what_the_tracks_show() -> None:
    shown = poses(lk=((0.15, 0.05, 0.3), (0.1, 0.02, 0.2)))
    found = verdict(sizes={"lk": ErrorSize(10, 0.5, {10: 0.05})}, pose_shares=shown)
    assert found.verdict == Trust.limited
    assert "up to 15.0" in found.text  # the upper bound alone would be more


def test_too_few_tracks_leave_what_is_stated() -> None:
    few = tables_of("only 20 observations can be used", "d").audit
    assert verdict(audit=few).verdict == Trust.unknown
    assert "only 20 observations" in verdict(audit=few).text
    for stated, expected in ((0.0, Trust.trusted), (0.2, Trust.limited), (0.45, Trust.unknown)):
        assert verdict(audit=few, sizes={"lk": ErrorSize(10, 0.5, {10: stated})}).verdict == expected


@pytest.mark.parametrize(
    ("given", "expected"),
    [({}, "limited"), ({"audit": audit(depths=(0.7, 0.6, 0.8))}, "unknown"),
     ({"audit": tables_of("3 observations", "d").audit}, "unknown"),
     ({"pose_shares": poses(lk=((0.3, 0.0, 0.9), None))}, "unknown")],
)  # fmt: skip
def test_noise_of_depths_that_takes_the_truth_from_features_is_named_with_what_helps(
    given: dict[str, Any], expected: str
) -> None:
    found = verdict(**given, depth_edges=0.82)
    assert found.verdict == expected
    assert "At 82.0" in found.text
    assert "depths of neighbours differ by more than 2.0" in found.text
    assert found.step.startswith("Smooth the depth maps, or use others")
    assert "Measure more frames" not in found.step
    assert "neighbours" not in verdict(**given, depth_edges=0.1).text


def with_moved(**by_tracker: float | None) -> pl.DataFrame:
    rows = [
        {"family": "at_most", "parameter": "moved", "component": name, "value": by_tracker[name]} for name in by_tracker
    ]
    return pl.concat([audit(), pl.DataFrame(rows, schema=dict(AUDIT))])


@pytest.mark.parametrize(
    ("factor", "expected", "times"),
    [(1.0, "trusted", 0.25), (2.0, "trusted", 0.5), (None, "unknown", None)],
)  # fmt: skip
def test_what_one_tracker_bounds_in_px_bounds_others_by_how_far_faults_move_them(
    factor: float | None, expected: str, times: float | None
) -> None:
    rows = [
        {"tracker": name, "correction": "measured", "age": 8, "n": 500, "core_u_px": core, "core_v_px": core}
        for name, core in (("lk", 1.0), ("sift", 2.0))
    ]
    found = table(
        audit=with_moved(lk=1.0, sift=factor),
        pose_shares=poses(lk=(SMALL, SMALL), sift=((0.3, 0.0, 0.9), SMALL)),
        sizes={"lk": ErrorSize(8, 1.4), "sift": ErrorSize(8, 2.8)},
        curves=pl.DataFrame(rows, schema=dict(AUDIT_CURVES)),
    )
    assert TruthVerdict.of(found).verdict == expected
    if times is not None:
        truth = AssessedTruth(found)
        assert truth.explained_share("sift") == pytest.approx(times * truth.explained_share("lk"))


@pytest.mark.parametrize(
    ("of_others", "expected"), [((0.002, 0.001, 0.003), "trusted"), ((0.7, 0.6, 0.8), "not trusted")]
)
def test_a_motion_of_one_tracker_is_its_own_where_another_one_has_no_errors(of_others: Share, expected: str) -> None:
    """A tracker with a bias beside one without: the truth of both is the same."""
    rows = [
        {"tracker": name, "correction": "measured", "age": 8, "n": 500, "core_u_px": core, "core_v_px": core}
        for name, core in (("exact", 1e-6), ("biased", 0.5))
    ]
    like_faults = audit(faults=(0.38, 0.32, 0.44)).filter(parameter="every_fault")
    found = table(
        audit=pl.concat(
            [
                with_moved(exact=1.0, biased=1.0).with_columns(component=pl.col("component").replace("lk", "exact")),
                like_faults.with_columns(component=pl.lit("biased")),
                audit().filter(parameter="depths").with_columns(component=pl.lit("biased")),
            ]
        ),
        pose_shares=poses(exact=(SMALL, SMALL), biased=((0.76, 0.75, 0.77), of_others)),
        sizes={"exact": ErrorSize(8, 1e-6), "biased": ErrorSize(8, 0.7)},
        curves=pl.DataFrame(rows, schema=dict(AUDIT_CURVES)),
    )
    assert TruthVerdict.of(found).verdict == expected


def test_faults_move_near_points_farther() -> None:
    """One tracker has points at 1 to 5 m; the other one has these too, or only those nearer than 1.5 m."""
    rng = np.random.default_rng(2)
    samples = make_samples(rng, World(), theta_of({}))
    assert max(moved(samples, available(samples)).values()) < 1.5
    nothing = samples.chosen(np.empty(0, np.intp))  # no tracker has enough observations
    assert moved(nothing, available(nothing)) == {}
    near = samples.chosen(np.flatnonzero((samples.tracker == 0) | (samples.depth < 1.5)))
    factors = moved(near, available(near))
    assert factors[1] > 4.0
    assert factors[0] < 2.0


def test_each_tracker_is_bounded_by_what_explains_its_own_errors() -> None:
    """The same error of the truth is a large share of small errors, and a small one of large errors."""
    both = {"pose_shares": poses(lk=(SMALL, SMALL), sift=(SMALL, SMALL))}
    sizes = {"lk": ErrorSize(8, 0.2), "sift": ErrorSize(8, 2.0)}
    of_lk = audit(faults=(0.3, 0.2, 0.4))
    of_sift = audit().with_columns(component=pl.lit("sift"))
    found = table(audit=pl.concat([of_lk, of_sift]), sizes=sizes, **both)
    assert TruthVerdict.of(found).verdict == Trust.limited
    assert AssessedTruth(found).explained_share("lk") == pytest.approx(0.32 + 0.01 * np.sqrt(102.0))
    assert AssessedTruth(found).explained_share("sift") == pytest.approx(0.03 + 0.01 * np.sqrt(3.0))
    few = table(audit=of_lk, sizes=sizes, **both)  # a tracker with too few tracks has the largest bound of the others
    assert AssessedTruth(few).explained_share("sift") == AssessedTruth(few).explained_share("lk")


@pytest.mark.parametrize("missing", ["poses", "depths"])
def test_a_truth_with_a_cause_that_was_not_measured_is_not_trusted(missing: str) -> None:
    known = {"pose_shares": poses()} if missing == "poses" else {"audit": audit().filter(parameter="every_fault")}
    found = table(**known)
    assert TruthVerdict.of(found).verdict is Trust.unknown
    assert "0 %" not in TruthVerdict.of(found).text


@pytest.mark.parametrize(("factor", "expected"), [(1.0, "trusted"), (None, "unknown")])
def test_a_tracker_whose_motion_is_unknown_is_bounded_by_another_one(factor: float | None, expected: str) -> None:
    rows = [
        {"tracker": name, "correction": "measured", "age": 8, "n": 500, "core_u_px": 1.0, "core_v_px": 1.0}
        for name in ("lk", "sift")
    ]
    found = table(
        audit=with_moved(lk=1.0, sift=factor),
        pose_shares=poses(lk=(SMALL, None)),
        sizes={"lk": ErrorSize(8, 1.4), "sift": ErrorSize(8, 1.4)},
        curves=pl.DataFrame(rows, schema=dict(AUDIT_CURVES)),
    )
    assert TruthVerdict.of(found).verdict == expected
    assert found.filter(tracker="sift", cause="poses")["share"].to_list() == [None]
    if expected == "trusted":
        assert AssessedTruth(found).explained_share("sift") == pytest.approx(AssessedTruth(found).explained_share("lk"))


def test_a_clearer_scene_is_recommended() -> None:
    given = {"pose_shares": poses(lk=((0.3, 0.2, 0.4), None))}
    assert "Measure hall alone" in verdict(**given, scene_shares={"hall": 0.05, "yard": 0.4, "lab": 0.5}).step
    assert "Measure" not in verdict(**given, scene_shares={"hall": 0.3, "yard": 0.4}).step


def test_a_run_without_a_verdict_is_not_usable() -> None:
    found = TruthVerdict.of(pl.DataFrame(schema={"verdict": pl.String}))
    assert (found.verdict, found.is_usable) == (Trust.unknown, False)


WORLD = World(n_scenes=8, per_scene=200)


@pytest.mark.parametrize("seed", range(3))
def test_exact_worlds_leave_next_to_nothing_to_the_truth(seed: int) -> None:
    samples = make_samples(np.random.default_rng(seed), WORLD, theta_of({}))
    found = explained(samples, available(samples))
    assert found.faults.high < 0.06
    assert found.depths.high < 0.1


@pytest.mark.parametrize(
    "fault",
    [{Parameter.focal_length: 0.1}, {Parameter.clock_offset: 0.5},
     {Parameter.mounting_rotation: (0.03, 0.02, -0.04), Parameter.depth_scale: 0.05}],
)  # fmt: skip
def test_the_bound_holds_what_constant_faults_explain(fault: dict[Parameter, Any]) -> None:
    samples = make_samples(np.random.default_rng(1), WORLD, theta_of(fault))
    exact = make_samples(np.random.default_rng(1), WORLD, theta_of({}))
    noise = np.median(np.hypot(*(exact.observed - exact.stated).T))
    error = np.median(np.hypot(*(samples.observed - samples.stated).T))
    planted = 1.0 - (noise / error) ** 2
    found = explained(samples, available(samples)).faults
    assert planted > 0.1
    assert found.high > 0.9 * planted


@pytest.mark.parametrize("relative", [0.01, 0.03])
def test_the_bound_holds_what_random_depths_explain(relative: float) -> None:
    """Depths that are wrong by chance, each by itself; the errors that they cause are known."""
    exact = make_samples(np.random.default_rng(2), WORLD, theta_of({}))
    rng = np.random.default_rng(3)
    wrong = replace(exact, depth=exact.depth * (1.0 + relative * rng.standard_normal(len(exact.depth))))
    stated = predict(wrong, np.zeros(COUNT)).uv
    planted = np.sum((stated - exact.stated) ** 2) / np.sum((exact.observed - stated) ** 2)
    found = explained(replace(wrong, stated=stated), available(wrong)).depths
    assert found.high > 0.5 * planted
    assert found.low < found.value <= found.high


@pytest.mark.parametrize("per_m", [0.003, 0.01])
def test_depth_maps_tell_what_random_depths_explain_that_grow_with_the_square(per_m: float) -> None:
    """Errors of stereo: they move positions alike at all depths, so that the tracks alone cannot tell."""
    exact = make_samples(np.random.default_rng(2), WORLD, theta_of({}))
    sd = per_m * exact.depth
    rng = np.random.default_rng(3)
    wrong = replace(exact, depth=exact.depth * np.exp(sd * rng.standard_normal(len(sd))))
    stated = predict(wrong, np.zeros(COUNT)).uv
    shift, error = stated - exact.stated, exact.observed - stated
    scale = scales(exact.group, error)
    weight = (np.hypot(*error.T) < 3.0 * scale) / scale**2
    planted = weight @ np.sum(shift**2, axis=1) / (weight @ np.sum(error**2, axis=1))
    found = explained(replace(wrong, stated=stated, depth_sd=sd), available(wrong)).depth_maps
    assert found is not None
    assert found.value == pytest.approx(planted, rel=0.35)
    assert explained(wrong, available(wrong)).depth_maps is None


@pytest.mark.parametrize("power", [-1, 0, 1])
@pytest.mark.parametrize("share", [0.15, 0.4])
def test_the_bound_holds_random_depths_that_no_map_shows(power: int, share: float) -> None:
    """Fused depths repeat from frame to frame; how they grow with depth is not known."""
    exact = make_samples(np.random.default_rng(2), WORLD, theta_of({}))
    noise = np.random.default_rng(3).standard_normal(len(exact.depth)) * exact.depth**power
    size, planted = 0.001, 0.0
    while planted < share:
        size *= 1.1
        wrong = replace(exact, depth=exact.depth * np.exp(size * noise))
        stated = predict(wrong, np.zeros(COUNT)).uv
        shift, error = stated - exact.stated, exact.observed - stated
        scale = scales(exact.group, error)
        weight = (np.hypot(*error.T) < 3.0 * scale) / scale**2
        planted = weight @ np.sum(shift**2, axis=1) / (weight @ np.sum(error**2, axis=1))
    found = explained(replace(wrong, stated=stated), available(wrong)).depths
    assert found is not None
    assert found.high > 0.9 * planted


def test_random_depths_are_seen_where_the_camera_moves_evenly_to_the_side() -> None:
    """Errors of stereo then move all positions of one age alike, which a constant of each age could hide."""
    steady = replace(WORLD, wobble=(0.0, 0.0), steady_m=(0.05, 0.0, 0.0))
    exact = make_samples(np.random.default_rng(2), steady, theta_of({}))
    noise = 0.01 * exact.depth * np.random.default_rng(3).standard_normal(len(exact.depth))
    wrong = replace(exact, depth=exact.depth * np.exp(noise))
    stated = predict(wrong, np.zeros(COUNT)).uv
    planted = np.sum((stated - exact.stated) ** 2) / np.sum((exact.observed - stated) ** 2)
    found = explained(replace(wrong, stated=stated), available(wrong)).depths
    assert found is not None
    assert found.high > 0.5 * planted


def test_what_few_errors_do_not_tell_about_depths_is_unknown() -> None:
    samples = make_samples(np.random.default_rng(0), replace(WORLD, noise_px=(0.3,)), theta_of({}))
    few = samples.chosen(np.arange(0, len(samples.age), len(samples.age) // 70))
    assert explained(few, available(few)).depths is None


def test_rounding_of_depths_explains_nothing_of_errors_that_are_rounding() -> None:
    exact = make_samples(np.random.default_rng(2), WORLD, theta_of({}))
    rounded = np.full(len(exact.depth), 1e-8)
    found = explained(replace(exact, observed=exact.stated + 1e-9, depth_sd=rounded), available(exact))
    assert found.depth_maps is not None
    assert found.depth_maps.high < 1e-6
    assert found.depths.high < 1e-6


def test_depth_maps_that_disagree_contradict_an_exact_truth() -> None:
    """No tracker has a part in that, so that less of it is enough than of what the tracks show."""
    exact, bound = {"lk": ErrorSize(10, 0.5, {10: 0.0})}, (0.2, 0.1, 0.3)
    rounding, noise = (0.002, 0.001, 0.004), (0.06, 0.04, 0.08)
    assert verdict(sizes=exact, audit=audit(depths=bound, maps=rounding)).verdict == Trust.trusted
    assert verdict(sizes=exact, audit=audit(depths=bound, maps=noise)).verdict == Trust.limited


@pytest.mark.parametrize("is_by_maps", [False, True])
def test_what_contradicts_a_statement_by_one_tracker_does_so_for_all(is_by_maps: bool) -> None:
    """A noisy tracker does not see that a truth is not exact, and says nothing about the errors of others."""
    cores = {"lk": 0.1, "noisy": 0.5}
    rows = [
        {"tracker": name, "correction": "measured", "age": 8, "n": 500, "core_u_px": core, "core_v_px": core}
        for name, core in cores.items()
    ]
    large: Share = (0.6, 0.5, 0.7)
    of_lk, of_noisy = (audit(maps=share) for share in ((large if is_by_maps else SMALL), SMALL))
    found = verdict(
        audit=pl.concat([of_lk, of_noisy.with_columns(component=pl.lit("noisy"))]),
        pose_shares=poses(lk=(SMALL if is_by_maps else large, large), noisy=(SMALL, SMALL)),
        sizes={name: ErrorSize(8, core, 0.0) for name, core in cores.items()},
        curves=pl.DataFrame(rows, schema=dict(AUDIT_CURVES)),
    )
    assert found.verdict == Trust.not_trusted


def test_a_check_has_one_tracker_and_prints_no_corrections() -> None:
    faulty = {"audit": audit(named=(0.4, 0.3, 0.5))}
    of_run, of_check = verdict(**faulty), verdict(**faulty, is_check=True)
    assert of_run.text == of_check.text
    assert "corrections that `tracknoise check` prints" in of_run.step
    assert "several trackers (`tracknoise run`)" in of_check.step
    assert "corrections that" not in of_check.step


def test_points_that_are_fitted_leave_the_verdict_open_and_say_how_poses_fit_the_images() -> None:
    found = verdict(is_fitted=True, of_images="Rotations agree to 0.05 px.", is_check=True)
    assert found.verdict is Trust.unknown
    assert found.text.startswith("Rotations agree to 0.05 px. True positions are fitted to the tracks")
    assert "`tracknoise check` says how well poses fit the images." in verdict(is_fitted=True).step
