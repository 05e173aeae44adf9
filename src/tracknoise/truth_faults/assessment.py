"""The verdict on the truth: how much of the errors it can explain, and whether something is established to be wrong.

Three causes are measured from the errors themselves, whatever is stated of the truth: a motion of the camera that the
poses lack (`tracknoise.truth_faults.pose_errors`), constant faults, and random errors of depths
(`tracknoise.truth_faults.explained`). The last are established where depth maps of different frames disagree. What
cannot be determined because it moves no true position is in none of them, and does no harm. What looks like a bias of
the trackers is in the bound. With shares s and upper bounds h,

    bound = sum s + sqrt(sum (h - s)^2)    (truth.bound)

A stated accuracy of poses and depths replaces the bound where it is smaller, nothing established contradicts it, and
the tracks do not show more. All trackers have the same truth: what one bounds in px^2 bounds the others too. With the
mean square e of the errors of each tracker, at ages that all have, and m by (truth.moved), which is how much more
faults move the points that it follows,

    bound_i <= m_i min over j of bound_j e_j / e_i    (truth.common)
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import hypot, sqrt
from typing import Any

import polars as pl

from tracknoise.geometry.depth import EDGE_RELATIVE_SPREAD
from tracknoise.sequences.depth_samples import MOST_EDGES
from tracknoise.statistics.definitions import REFERENCE_AGE
from tracknoise.tables.enumerations import FittedTo, Trust, TruthCause
from tracknoise.tables.manifest import PoseFit, joined_fit
from tracknoise.tables.schema import check
from tracknoise.tables.trust import TRUST
from tracknoise.tables.truth_audit import MEASURED, AuditVerdict
from tracknoise.truth.accuracies import sizes_of
from tracknoise.truth_faults.audit_summary import fault_brief
from tracknoise.truth_faults.explained import DEPTH_MAPS, DEPTHS, EVERY_FAULT, MOVED, NAMED_FAULTS
from tracknoise.truth_faults.fault_parameters import FAULTS, Family, Parameter
from tracknoise.words import SPACE, listing, percent, pixels, sentence_case

SMALL, MOST = 0.1, 0.5
"""Shares of the squared errors: up to the first the truth is small beside them, beyond the second it dominates."""
_EXACT = 1e-3
"""A smaller stated share is that of a truth that is exact but for rounding."""
_REPEATED = 0.02
"""What depth maps that disagree explain, with which a smaller stated accuracy is wrong: no tracker has a part in it."""
_ALIKE = 0.5
"""Where constant faults surely explain more than this part of what motions of the camera do, they may be the cause."""
_CLEARER = 0.5
"""A scene is recommended if poses explain at most this part of what they explain of all scenes."""


@dataclass(frozen=True, slots=True)
class ErrorSize:
    """Size of the errors of a tracker.

    Attributes
    ----------
    age
        At which it was measured, frames.
    error_px
        RMS, both coordinates together, px.
    stated_px
        RMS that the stated accuracy of the truth can cause, px, by age up to this one; None where poses or depths have
        none.
    core_px
        Core, both coordinates together, px; None where it is not known.
    """

    age: int
    error_px: float
    stated_px: Mapping[int, float] | None = None
    core_px: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthEvidence:
    """What is known about the truth of a run or a recording.

    Attributes
    ----------
    audit
        Schema `AUDIT`.
    pose_shares
        Schema `POSE_SHARE`, of one view at the lowest speed.
    sizes
        Size of the errors of each tracker.
    curves
        Schema `AUDIT_CURVES`.
    tracks
        Why tracks do not follow the images, and what mends it: then they say nothing about the truth.
    confirmed_share
        Largest share of the squared differences between tracks and truth that the images confirm; None where unknown.
    mistakes
        Sentences about data that cannot be right.
    cautions
        Sentences about single parts of the data that look wrong.
    depth_edges
        Share of the pixels with depth at which depths of neighbours differ: features there have no true position.
    is_fitted
        Whether points are fitted to the tracks.
    measures_depths
        Whether the truth measures the errors of its depths, so that none are to be stated.
    moving
        That parts of the scene move, a sentence; empty where this is not seen.
    lacks_poses
        Whether most frames have no pose.
    of_images
        How well rotations and directions of motion fit images without depth, in sentences; empty where this is unknown.
    pose_fits
        Which poses lead in each sequence, and what reference tracks say of them; None where only stated ones were to.
    is_check
        Whether it is that of a check, which has one tracker and prints no corrections.
    scene_shares
        Share that poses explain in single scenes, by their names.
    """

    audit: pl.DataFrame
    pose_shares: pl.DataFrame
    sizes: Mapping[str, ErrorSize]
    curves: pl.DataFrame
    tracks: Sequence[tuple[str, str]] = ()
    confirmed_share: float | None = None
    mistakes: Sequence[str] = ()
    cautions: Sequence[str] = ()
    depth_edges: float = 0.0
    is_fitted: bool = False
    measures_depths: bool = False
    moving: str = ""
    lacks_poses: bool = False
    of_images: str = ""
    pose_fits: Sequence[PoseFit | None] = ()
    is_check: bool = False
    scene_shares: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Share:
    """A share of the squared errors with its bounds."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, value: float, low: float | None, high: float | None) -> "_Share":
        """Between 0 and 1; a share without an interval may be anything."""
        bounds = value, 0.0 if low is None else low, 1.0 if high is None else high
        return cls(*(min(max(bound, 0.0), 1.0) for bound in bounds))

    def at_least(self, other: "_Share") -> "_Share":
        """The larger one of both, and of their bounds."""
        return _Share(max(self.value, other.value), max(self.low, other.low), max(self.high, other.high))


_UNKNOWN = _Share(0.0, 0.0, 1.0)
"""Of a cause that was not measured."""


@dataclass(frozen=True, slots=True)
class _Size:
    """Size of the errors of a tracker that shares are of, px: the core where it is known, otherwise the RMS.

    Shares are in units of the robust scale. With heavy tails, the RMS within the wider limits of the audit's curves can
    be 1.8 times as large, which makes what is stated look small.

    stated_px, stated_share: RMS at this age that the stated accuracy can cause, and its share of the squared errors;
    None where it is not stated. The share is the larger one of that of this age and that of all audited ages up to it:
    white noise of poses moves young observations as far as old ones, whose errors are larger; a drift does not. Of two
    sizes of errors, the core and the RMS within three scales, the smaller one counts: the share is a bound.
    """

    age: int
    px: float
    is_core: bool
    is_audited: bool = False
    stated_px: float | None = None
    stated_share: float | None = None

    @classmethod
    def of(cls, tracker: str, size: ErrorSize, curves: pl.DataFrame) -> "_Size":
        """Of a tracker: at the last audited age up to that of its size."""
        rows = curves.filter(pl.col("age") <= size.age, tracker=tracker, correction=MEASURED).sort("age").to_dicts()
        cores = [hypot(row["core_u_px"], row["core_v_px"]) for row in rows]
        core = cores[-1] if cores else size.core_px or None
        px = size.error_px if core is None else core
        measured, stated = cls(size.age, px, is_core=core is not None, is_audited=bool(rows)), size.stated_px
        if not stated:
            return measured
        of_last = stated[max(stated)]
        parts = [
            (row["n"], _part(stated[row["age"]], min(row["near_px"], core)))
            for row, core in zip(rows, cores, strict=True)
            if row["age"] in stated
        ]
        if not parts:
            return replace(measured, stated_px=of_last, stated_share=_part(of_last, px))
        mean = sum(count * part for count, part in parts) / sum(count for count, _ in parts)
        return replace(measured, stated_px=of_last, stated_share=max(mean, parts[-1][1]))


def _part(stated_px: float, px: float) -> float:
    """Share of a squared error that a stated accuracy can cause, at most 1."""
    return min((stated_px / px) ** 2, 1.0) if px > 0.0 else float(stated_px > 0.0)


@dataclass(frozen=True, slots=True)
class _Bounds:
    """What the truth can explain of the errors of one tracker."""

    tracker: str
    size: _Size
    causes: Mapping[TruthCause, _Share]
    high: float
    depth_maps: _Share | None
    is_alone: bool

    def least(self, *, is_faulty: bool) -> float:
        """What one of the causes explains at least. `is_faulty`: whether a constant fault is established."""
        unsure = set() if is_faulty else {TruthCause.any_fault}
        return max(share.low for cause, share in self.causes.items() if cause not in unsure)

    @property
    def largest(self) -> TruthCause:
        """The cause with the largest upper bound."""
        return max(self.causes, key=lambda cause: self.causes[cause].high)

    @property
    def established(self) -> TruthCause | None:
        """The cause that surely explains more than is small, the larger one of two; None where none does.

        A motion that no other tracker can confirm has to explain most.
        """
        shares = {TruthCause.poses: self.causes[TruthCause.poses], TruthCause.depths: self.depth_maps}
        least = {TruthCause.poses: _least_of_motion(is_alone=self.is_alone), TruthCause.depths: SMALL}
        sure = {cause: share.value for cause, share in shares.items() if share and share.low > least[cause]}
        return max(sure, key=sure.__getitem__, default=None)

    @property
    def are_depths_shown(self) -> bool:
        """Whether depth maps show random errors of depths."""
        return self.depth_maps is not None and self.depth_maps.low > _REPEATED

    @property
    def established_text(self) -> str:
        """What is established, with its verb; empty where nothing is."""
        if self.established is None:
            return ""
        return _EITHER if self.is_like_fault else _ESTABLISHED[self.established]

    @property
    def is_like_fault(self) -> bool:
        """Whether constant faults surely explain most of what motions that are established explain."""
        least = _ALIKE * self.causes[TruthCause.poses].value
        return self.established is TruthCause.poses and self.causes[TruthCause.any_fault].low > least


@dataclass(frozen=True, slots=True)
class _Named:
    """Established faults, and what they explain together of errors that took no part in their fit.

    Of the tracker of which they explain most: little of the errors of all together can be most of those of an accurate
    one. Of all, without a name, where no tracker's share is known. `rows`: the first of each fault, in their order.
    """

    rows: Sequence[Mapping[str, Any]]
    tracker: str
    share: _Share

    @classmethod
    def of(cls, audit: pl.DataFrame) -> "_Named":
        """From schema `AUDIT`."""
        ranked = audit.filter(pl.col("rank").is_not_null()).unique("rank", keep="first").sort("rank").to_dicts()
        by_tracker = audit.filter(family=str(Family.at_most), parameter=NAMED_FAULTS).sort("gain").to_dicts()
        if by_tracker:
            return cls(ranked, by_tracker[-1]["component"], _of_row(by_tracker[-1]))
        together = audit.filter(family=str(Family.named)).to_dicts()
        return cls(ranked, "", _of_row(together[0]) if together else _Share(0.0, 0.0, 0.0))

    @property
    def of_tracker(self) -> str:
        """Whose errors the share is of, after a space; empty for those of all trackers."""
        return f" of {self.tracker}" if self.tracker else ""


@dataclass(frozen=True, slots=True)
class _Found:
    """A verdict with its sentence, and what would help most."""

    verdict: Trust
    text: str
    step: str = ""


@dataclass(frozen=True, slots=True)
class _FittedPoses:
    """What reference tracks say about the poses of a run."""

    count: int  # of sequences whose refined poses lead
    n_sequences: int
    fit: PoseFit | None
    verdict: Trust | None  # on the stated poses

    @classmethod
    def of(cls, evidence: TruthEvidence, sizes: Mapping[str, _Size]) -> "_FittedPoses":
        """Of sequences where refined poses lead; otherwise of all."""
        leading = [fit for fit in evidence.pose_fits if fit is not None and fit.leads]
        fit = joined_fit(leading or evidence.pose_fits)
        errors = [size.px for size in sizes.values() if size.px > 0.0]
        verdict = None
        if fit is not None and fit.stated_px is not None and errors:
            added_px = max(fit.stated_px, fit.next_px or 0.0)
            share = _part(added_px, hypot(added_px, min(errors)))
            verdict = Trust.trusted if share <= SMALL else Trust.limited if share <= MOST else Trust.not_trusted
        return cls(len(leading), len(evidence.pose_fits), fit, verdict)

    def with_reason(self, text: str) -> str:
        """The sentence of the verdict, and why poses were not refined where reference tracks were followed."""
        fit = self.fit
        return f"{text} {fit.reason}" if fit is not None and not self.count and fit.references is not None else text

    def rows(self) -> Iterator[dict[str, Any]]:
        """What is left of the errors of refined poses, and what the stated ones would add, where refined ones lead."""
        fit = self.fit
        if fit is None or not self.count:
            return
        where = "" if self.count == self.n_sequences else f" in {self.count} of {self.n_sequences} sequences"
        left, stated = (f"{pixels(value)}{SPACE}px" for value in (fit.left_px, fit.stated_px))
        refined = f"Poses were refined with {fit.references:.0f} independent tracks per frame{where}."
        remaining = f"Their remaining errors are {left} at age {fit.age}."
        added = f"The stated poses would add {stated}."
        text = " ".join(filter(None, [refined, remaining, fit.of_depths, added]))
        yield {"cause": TruthCause.refined_poses, "bound_px": fit.left_px, "age": fit.age, "text": text}
        sizes = {"bound_px": fit.stated_px, "age": fit.age, "verdict": self.verdict, "text": self._of_stated(fit)}
        yield {"cause": TruthCause.stated_poses, **sizes}

    def _of_stated(self, fit: PoseFit) -> str:
        """The verdict on the stated poses, and how their errors grow."""
        laws = {noun: _law(fit.stated_errors or {}, topic) for topic, noun in _POSE_PARTS.items()}
        errors = "".join(f" Errors of their {noun}: {law}." for noun, law in laws.items() if law)
        next_px = "" if fit.next_px is None else f" At age 1 the stated poses would add {pixels(fit.next_px)}{SPACE}px."
        return f"Stated poses: {self.verdict or Trust.unknown}.{errors}{next_px}"


_POSE_PARTS = {"rotation": "rotations", "translation": "positions"}


def _law(figures: Mapping[str, float], topic: str) -> str:
    """How errors of rotations or of positions grow; empty where this is unknown."""
    return listing(sizes_of({name: value for name, value in figures.items() if name.startswith(topic)}, digits=2))


def assess(evidence: TruthEvidence, dataset: str) -> pl.DataFrame:
    """The verdict on the truth, its sentence, and the shares that it rests on.

    Returns
    -------
    polars.DataFrame
        Schema `TRUST`: the verdict first.
    """
    if evidence.tracks:
        return _table(_of_tracks(evidence.tracks), dataset)
    faults = _Named.of(evidence.audit)
    sizes = {tracker: _Size.of(tracker, size, evidence.curves) for tracker, size in evidence.sizes.items()}
    bounds = _bounds(evidence, sizes, is_faulty=bool(faults.rows))
    verdict = _verdict(evidence, sizes, bounds, faults)
    fitted = _FittedPoses.of(evidence, sizes)
    text = fitted.with_reason(verdict.text)
    rows = [
        {"cause": TruthCause.every, "verdict": verdict.verdict, "text": text, "step": verdict.step or None},
        *_rows(evidence, bounds, faults),
        *fitted.rows(),
    ]
    return _table(rows, dataset)


def _of_tracks(wrong: Sequence[tuple[str, str]]) -> list[dict[str, Any]]:
    """Rows of a truth that is not assessed, because tracks do not follow the images."""
    (text, step), *rest = wrong
    more = "".join(f" {sentence}" for sentence, _ in rest)
    opening = {"cause": TruthCause.every, "verdict": Trust.not_assessed, "text": f"{text}{more}", "step": step}
    return [opening, *({"cause": TruthCause.tracks, "text": sentence} for sentence, _ in wrong)]


def _table(rows: Sequence[Mapping[str, Any]], dataset: str) -> pl.DataFrame:
    table = pl.DataFrame([{"dataset": dataset, **row} for row in rows], schema=dict(TRUST))
    plain = table.with_columns(pl.col("text", "step").str.replace_all(SPACE, " ", literal=True))  # files have it too
    return check(plain, TRUST, TRUST.name)


def _of_audit(audit: pl.DataFrame, parameter: str, tracker: str) -> _Share | None:
    """A bound of the family `at_most`, the largest where a tracker has too few tracks; None without an audit."""
    of_all = audit.filter(family=str(Family.at_most), parameter=parameter).sort("gain_high")
    of_tracker = of_all.filter(component=tracker)
    rows = (of_all if of_tracker.is_empty() else of_tracker).to_dicts()
    return _of_row(rows[-1]) if rows else None


def _of_row(row: Mapping[str, Any]) -> _Share:
    return _Share.of(row["gain"], row["gain_low"], row["gain_high"])


def _by_source(shares: pl.DataFrame, tracker: str) -> tuple[_Share | None, _Share | None]:
    """What pose errors explain of a tracker that are fitted to its own other tracks, and to other trackers."""
    rows = shares.filter(tracker=tracker).to_dicts()
    by_source = {row["fitted_to"]: _Share.of(row["share"], row["low"], row["high"]) for row in rows}
    return by_source.get(FittedTo.own), by_source.get(FittedTo.others)


def _bounds(evidence: TruthEvidence, sizes: Mapping[str, _Size], *, is_faulty: bool) -> list[_Bounds]:
    """Of each tracker; none where the causes could be measured of no tracker.

    A cause that is unknown of one tracker may explain everything, unless another tracker bounds it: (truth.common).

    A motion that a tracker's own tracks show is established where pose errors that are fitted to other trackers explain
    much of it too, or there is no other: others explain less where they see other points. It contradicts what is
    stated, for all trackers, where it surely explains more of at least half of them. A single tracker has small motions
    of its own also on exact data, and so have trackers of one kind: without another one to confirm it, a motion is
    established, and contradicts, only if it explains most of the errors.
    """
    bounds, by_maps, by_poses = list[_Bounds](), list[bool](), list[bool]()
    for tracker, size in sizes.items():
        poses, of_others = _by_source(evidence.pose_shares, tracker)
        if poses is not None and of_others is not None:
            is_shared = of_others.low > 0.0 and of_others.value > _SHARED * poses.value
            poses = poses if is_shared else replace(poses, low=min(poses.low, of_others.low))
        depths, depth_maps = (_of_audit(evidence.audit, name, tracker) for name in (DEPTHS, DEPTH_MAPS))
        causes = {
            TruthCause.any_fault: _of_audit(evidence.audit, EVERY_FAULT, tracker),
            TruthCause.depths: depths if depths is None or depth_maps is None else depths.at_least(depth_maps),
            TruthCause.poses: poses,
        }
        shares = {cause: _UNKNOWN if share is None else share for cause, share in causes.items()}
        if size.is_audited or _UNKNOWN not in shares.values():
            bounds.append(_Bounds(tracker, size, shares, _bound(shares), depth_maps, is_alone=of_others is None))
        if (stated := size.stated_share) is not None:
            by_maps.append(depth_maps is not None and depth_maps.low > max(stated, _REPEATED))
            if poses is not None:
                by_poses.append(poses.low > max(stated, _least_of_motion(is_alone=of_others is None)))
    if all(_UNKNOWN in bound.causes.values() for bound in bounds):
        return []
    is_refuted = any(by_maps) or 2 * sum(by_poses) >= max(len(by_poses), 1)
    bounds = bounds if is_faulty or is_refuted else [_as_stated(bound) for bound in bounds]
    return _common(bounds, evidence, is_faulty=is_faulty)


def _least_of_motion(*, is_alone: bool) -> float:
    """What a motion of the camera has to explain surely to be established, by one tracker alone or by several."""
    return MOST if is_alone else SMALL


def _as_stated(bounds: _Bounds) -> _Bounds:
    """At most what is stated."""
    stated = bounds.size.stated_share
    return bounds if stated is None else replace(bounds, high=min(bounds.high, _with_stated(stated, bounds.causes)))


def _bound(causes: Mapping[TruthCause, _Share]) -> float:
    """(truth.bound)."""
    value = sum(share.value for share in causes.values())
    return min(value + sqrt(sum((share.high - share.value) ** 2 for share in causes.values())), 1.0)


def _with_stated(stated: float, causes: Mapping[TruthCause, _Share]) -> float:
    """What is stated, and at least what is measured; an exact truth explains nothing."""
    poses = causes[TruthCause.poses]
    measured = [
        poses.value if poses.low > 0.0 else 0.0,
        causes[TruthCause.any_fault].low,
        causes[TruthCause.depths].low,
    ]
    return stated if stated < _EXACT else max(stated, *measured)


def _common(bounds: Sequence[_Bounds], evidence: TruthEvidence, *, is_faulty: bool) -> list[_Bounds]:
    """Bounds of trackers by what others bound, at the ages that all of them have: (truth.common).

    None is smaller than what a cause surely explains of the tracker itself. Constant faults are sure where one is
    established: a bias of the tracker looks like them.
    """
    squares = _squares(evidence.curves, [bound.tracker for bound in bounds])
    rows = evidence.audit.filter(family=str(Family.at_most), parameter=MOVED).drop_nulls("value")
    moved = dict(rows.select("component", "value").iter_rows())
    if not bounds or len(squares) < len(bounds):
        return list(bounds)
    least = min(bound.high * squares[bound.tracker] for bound in bounds)
    most = {name: factor * least / squares[name] for name, factor in moved.items() if name in squares}
    return [
        replace(bound, high=min(bound.high, max(most.get(bound.tracker, 1.0), bound.least(is_faulty=is_faulty))))
        for bound in bounds
    ]


def _squares(curves: pl.DataFrame, trackers: Sequence[str]) -> dict[str, float]:
    """Mean squared cores of the errors, px^2, by tracker."""
    measured = curves.filter(pl.col("age") <= REFERENCE_AGE, pl.col("tracker").is_in(trackers), correction=MEASURED)
    shared = measured.group_by("age").agg(n=pl.col("tracker").n_unique()).filter(pl.col("n") == len(trackers))
    table = (
        measured.join(shared, on="age", how="semi")
        .group_by("tracker")
        .agg(square=(pl.col("core_u_px") ** 2 + pl.col("core_v_px") ** 2).mean())
    )
    return {name: square for name, square in table.iter_rows() if square > 0.0}


def _verdict(evidence: TruthEvidence, sizes: Mapping[str, _Size], bounds: Sequence[_Bounds], faults: _Named) -> _Found:
    if evidence.mistakes:
        more = len(evidence.mistakes) - 1
        further = (
            f" There {'is' if more == 1 else 'are'} {more} more such mistake{'' if more == 1 else 's'}." if more else ""
        )
        return _Found(Trust.not_trusted, f"{evidence.mistakes[0]}{further}", _correct_data(evidence))
    if evidence.is_fitted:
        if evidence.is_check and evidence.measures_depths:
            opening = f"{evidence.of_images} {_WITHOUT_DEPTHS}".lstrip()
            return _Found(Trust.unknown, f"{opening}{_caution(evidence)}", _MEASURED_STEP)
        opening = f"{evidence.of_images} {_FITTED}".lstrip()
        compared = "" if evidence.is_check else " `tracknoise check` says how well poses fit the images."
        return _Found(Trust.unknown, f"{opening}{_caution(evidence)}", f"{_FITTED_STEP}{compared}")
    worst = max(bounds, key=lambda bound: bound.high, default=None)
    if faults.share.value > SMALL and refutes(evidence.confirmed_share, faults.share.value):
        return _refuted(evidence)
    if faults.share.value > SMALL:
        high = 0.0 if worst is None else worst.high
        rest = f" In total, the truth can cause up to {percent(high)}." if high > faults.share.value else ""
        text = f"{_faults_text(faults)} {_explains(faults)}.{rest}"
        return _Found(Trust.not_trusted, text, _corrected(evidence, faults))
    return _unmeasured(evidence, sizes) if worst is None else _measured(evidence, worst, faults)


def refutes(confirmed_share: float | None, share: float) -> bool:
    """Whether images confirm so little that tracks alone cannot show a fault of the truth of this share."""
    return confirmed_share is not None and confirmed_share < _CONFIRMED * share


_CONFIRMED = 0.5
_SHARED = 0.25
"""Part of a motion that other trackers have at least, if it is one of the truth."""


def _refuted(evidence: TruthEvidence) -> _Found:
    """Where tracks contradict a truth that the images confirm."""
    part = percent(max(evidence.confirmed_share or 0.0, 0.0))
    text = f"Tracks contradict the truth, but the images confirm at most {part} of the squared differences."
    return _Found(Trust.unknown, text, "Check the tracks: the images agree better with the truth than with them.")


def _measured(evidence: TruthEvidence, worst: _Bounds, faults: _Named) -> _Found:
    """By how much the truth can explain of the errors of the tracker of which it can explain most."""
    sure, noise = worst.established, _noise_text(evidence)
    if worst.high > MOST and sure is not None and refutes(evidence.confirmed_share, worst.causes[sure].value):
        return _refuted(evidence)
    if worst.high > MOST and sure is not None:
        share = f"{percent(worst.causes[sure].value)} of the squared errors of {worst.tracker}"
        cause = TruthCause.any_fault if worst.is_like_fault else sure
        if evidence.moving:
            text = f"{evidence.moving} These, or {worst.established_text} {share}.{noise}"
            return _Found(Trust.not_trusted, text, _STILL)
        text = f"{sentence_case(worst.established_text)} {share}.{noise}"
        return _Found(Trust.not_trusted, text, _of_cause(evidence, worst, cause))
    part, size = f"{percent(worst.high)} of the squared errors of {worst.tracker}", _in_px(worst)
    of_faults = _small_faults(evidence, faults) if faults.rows else _like_bias(evidence.audit)
    cause = TruthCause.depths if noise else worst.largest
    step = _corrected(evidence, faults) if faults.rows else _of_cause(evidence, worst, cause)
    if worst.high > MOST and evidence.moving and not faults.rows:
        text = f"{evidence.moving} Errors of the truth may explain up to {part}.{size}{noise}"
        return _Found(Trust.unknown, text, _STILL)
    if worst.high > MOST:
        nothing = "" if faults.rows else ", but no cause is established"
        text = f"Errors of the truth may explain up to {part}{nothing}.{size}{_of_causes(worst)}{of_faults}{noise}"
        return _Found(Trust.unknown, text, step)
    if worst.high > SMALL or faults.rows or evidence.cautions or noise:
        rest = f"{of_faults}{noise}{_caution(evidence)}"
        text = f"Errors of the truth can explain up to {part}.{size}{_of_causes(worst)}{rest}"
        return _Found(Trust.limited, text, step)
    stated = worst.size.stated_share
    if stated is not None and stated < _EXACT:
        return _Found(Trust.trusted, f"{_STATED_EXACT[:-1]}, and the tracks do not contradict it.")
    return _Found(Trust.trusted, f"No fault was found. Errors of the truth can explain at most {part}.{size}")


def _unmeasured(evidence: TruthEvidence, sizes: Mapping[str, _Size]) -> _Found:
    """Where tracks are too few, or see too little: by what is stated."""
    stated = [size.stated_share for size in sizes.values()]
    why = (evidence.audit.filter(pl.col("family").is_null())["text"].to_list() or [_TOO_FEW])[0]
    noise, caution = _noise_text(evidence), _caution(evidence)
    step = _SMOOTH if noise else _correct_data(evidence) if evidence.cautions else _MORE_DATA
    step = _MORE_POSES if evidence.lacks_poses else step
    if stated and not noise and all(share is not None and share < _EXACT for share in stated):
        return _Found(Trust.trusted, f"{_STATED_EXACT} The tracks cannot show whether it is.")
    parts = [share for share in stated if share is not None]
    if parts and len(parts) == len(stated) and max(parts) <= MOST:
        stated_part = f"Stated errors of the truth can explain up to {percent(max(parts))} of the squared errors."
        text = f"{stated_part} {why}{noise}{caution}"
        return _Found(Trust.limited, text, step)
    return _Found(Trust.unknown, f"{why}{noise}{caution}", step)


def _caution(evidence: TruthEvidence) -> str:
    """What looks wrong in single parts of the data, after a space; empty where nothing does."""
    return f" {evidence.cautions[0]}" if evidence.cautions else ""


def _noise_text(evidence: TruthEvidence) -> str:
    """That depths have so much noise that features lack a true position, after a space; empty where they do not."""
    if evidence.depth_edges <= MOST_EDGES:
        return ""
    share, spread = (percent(value) for value in (evidence.depth_edges, EDGE_RELATIVE_SPREAD))
    differing = f"At {share} of the pixels, depths of neighbours differ by more than {spread}"
    return f" {differing}: features there have no true position."


def _of_causes(bounds: _Bounds) -> str:
    """What single causes explain, where it is not small, the largest first, in a sentence each; begins with a space.

    Where all are small: what depth maps surely show, otherwise the cause that has the largest part in the bound, unless
    what is stated or another tracker sets it.
    """
    shares = {cause: share.value for cause, share in bounds.causes.items() if share.value > SMALL}
    causes = sorted(shares, key=shares.__getitem__, reverse=True)
    texts = {**_CAUSES, **({bounds.established: bounds.established_text} if bounds.established else {})}
    if not causes and bounds.depth_maps is not None and bounds.are_depths_shown:
        return f" {sentence_case(_ESTABLISHED[TruthCause.depths])} {percent(bounds.depth_maps.value)}."
    if not causes and bounds.high < _bound(bounds.causes):
        return ""
    if not causes:
        return f" {sentence_case(_NAMES[bounds.largest])} contribute most to this bound."
    return "".join(f" {sentence_case(texts[cause])} {percent(shares[cause])}." for cause in causes)


def _like_bias(audit: pl.DataFrame) -> str:
    """The faults that a bias of the trackers explains as well; begins with a space."""
    like = audit.filter(family=str(Family.alone), verdict=str(AuditVerdict.like_bias))["parameter"]
    names = [f"the {FAULTS[Parameter(parameter)].name}" for parameter in like.unique(maintain_order=True)]
    if not names:
        return ""
    first, *other_names = names
    rest = [f" The same holds for {name}." for name in other_names[:_MOST_OTHERS]]
    more = " The same holds for other parameters." if len(other_names) > len(rest) else ""
    opening = f" An error of {first} fits the tracks, but cannot be distinguished from a bias of the trackers."
    return "".join([opening, *rest, more])


def _in_px(bounds: _Bounds) -> str:
    """The same in px, as a sentence after a space; empty where the size is unknown."""
    size = bounds.size
    size_text = f"the {'core' if size.is_core else 'RMS'} of {pixels(size.px)} px at age {size.age}"
    return f" This part is up to {pixels(sqrt(bounds.high) * size.px)} px of {size_text}." if size.px > 0.0 else ""


def _faults_text(faults: _Named) -> str:
    """``The stated focal length is 12 % too long.``, and names of others."""
    others = [f"the {FAULTS[Parameter(row['parameter'])].name}" for row in faults.rows[1:]]
    named = [*others[:_MOST_OTHERS], *(["another parameter"] if len(others) > _MOST_OTHERS else [])]
    more = f" {sentence_case(listing(named))} {'is' if len(others) == 1 else 'are'} wrong too." if others else ""
    return f"{fault_brief(faults.rows[0])}.{more}"


def _small_faults(evidence: TruthEvidence, faults: _Named) -> str:
    """Faults that explain little, after a space. Of a check, whose one tracker cannot establish so small ones."""
    if not evidence.is_check:
        return f" {_faults_text(faults)} But {_they_explain(faults)} little."
    names = [f"another {FAULTS[Parameter(row['parameter'])].name}" for row in faults.rows[: 1 + _MOST_OTHERS]]
    return f" Tracked points fit a little better with {listing(names)}: this may be a bias of the tracks."


def _explains(faults: _Named) -> str:
    return (
        f"{sentence_case(_they_explain(faults))} {percent(faults.share.value)} of the squared errors{faults.of_tracker}"
    )


def _they_explain(faults: _Named) -> str:
    """The faults as a subject, with the verb."""
    return "this fault explains" if len(faults.rows) == 1 else "together, these faults explain"


def _correct_data(evidence: TruthEvidence) -> str:
    return _CORRECT_DATA if evidence.is_check else f"{_CORRECT_DATA} `tracknoise check` shows what fits."


def _corrected(evidence: TruthEvidence, faults: _Named) -> str:
    """What to do about established faults; what a correction does was tried on data that took no part in its fit."""
    undone = [bool(FAULTS[Parameter(row["parameter"])].key) for row in faults.rows]
    if evidence.is_check:
        return f"{_CONFIRM}{', and prints the correction' if any(undone) else '. No setting corrects this fault'}."
    if not any(undone):
        return "No setting corrects this: use other poses, and measure again."
    block = "Apply the corrections that `tracknoise check` prints for the folder of this run, and measure again"
    if not all(undone):
        return f"{block}. No setting corrects the other faults: use other poses."
    falls = f"Squared errors of held-out tracks{faults.of_tracker} then fall by {percent(faults.share.value)}."
    is_foreign = evidence.confirmed_share is not None  # no tracker saw the images here
    may_be_shifted = is_foreign and any(row["parameter"] == Parameter.principal_point for row in faults.rows)
    return f"{block}. {falls}{_SHIFTED if may_be_shifted else ''}"


def _of_cause(evidence: TruthEvidence, bounds: _Bounds, cause: TruthCause) -> str:
    """What would help against a cause; a stated accuracy is no help where it is known, or depth maps contradict it."""
    if cause is TruthCause.poses:
        clearer = min(evidence.scene_shares, key=evidence.scene_shares.__getitem__, default=None)
        shares = sorted(evidence.scene_shares.values())
        if clearer is not None and len(shares) > 1 and shares[0] <= _CLEARER * shares[len(shares) // 2]:
            return (
                f"Measure {clearer} alone: errors of the poses explain {percent(max(shares[0], 0.0))} there. {_POSES}"
            )
        return _POSES
    if cause is TruthCause.depths and _noise_text(evidence):
        return _SMOOTH
    is_known = bounds.are_depths_shown or bounds.size.stated_share is not None or evidence.measures_depths
    return _BETTER_DEPTHS if cause is TruthCause.depths and is_known else _STEPS[cause]


_MOST_OTHERS = 2
"""Of more parameters than this beside the first, only these are named."""
_TOO_FEW = "Too few tracks have a true position for a verdict."
_CORRECT_DATA = "Correct the data, and measure again."
_CONFIRM = (
    "Measure the recording with several trackers (`tracknoise run`): a check has one, whose errors can look like this. "
    "`tracknoise check`, with the folder of that run, then says whether the trackers agree"
)
_FITTED = (
    "True positions are fitted to the tracks, so that errors of the poses cannot be separated from those of tracks."
)
_WITHOUT_DEPTHS = "The recording has no depth maps, and a check computes no depths."
_MEASURED_STEP = "Use `tracknoise run`: it computes depths from the images, and says how far they can be trusted."
_FITTED_STEP = "Use a truth with depth, such as stereo depth maps, a scan, or a reconstruction."
_STATED_EXACT = "The truth is stated to be exact."
_MORE_POSES = "Use poses of more frames: with `--trajectory FILE`, those between key frames are interpolated."
_SHIFTED = " Or positions of the tracks are shifted, as those in cropped images are: then correct them instead."
_MORE_DATA = "Measure more frames or scenes, or state the accuracy of poses and depths in [truth.accuracy]."
_SMOOTH = "Smooth the depth maps, or use others: their noise looks like edges, and more frames do not help."
_BETTER_DEPTHS = "Use more accurate depths, or a recording with less parallax."
_STILL = "Measure a scene that stands still, or a part of the recording without what moves."
_POSES = "Use globally bundle-adjusted poses, or compare trackers at the same corners."
_NAMES: Mapping[TruthCause, str] = {
    TruthCause.poses: "camera motions missing in the poses",
    TruthCause.any_fault: "constant faults, such as of the calibration or the clock,",
    TruthCause.depths: "random errors of depths",
}
_CAUSES = {cause: f"{name} could explain" for cause, name in _NAMES.items()}
_ESTABLISHED: Mapping[TruthCause, str] = {
    TruthCause.poses: f"{_NAMES[TruthCause.poses]} explain",
    TruthCause.depths: "random errors of depths, shown by differences of depth maps, explain",
}
_EITHER = f"{_NAMES[TruthCause.poses]}, or constant faults that look like them, explain"
_STEPS: Mapping[TruthCause, str] = {
    TruthCause.any_fault: (
        "Measure a recording with more motion and more different depths, or state the accuracy of the calibration and "
        "the clock in [truth.accuracy]."
    ),
    TruthCause.depths: "State the accuracy of the depths in [truth.accuracy], or use a recording with less parallax.",
}


def _rows(evidence: TruthEvidence, bounds: Sequence[_Bounds], faults: _Named) -> Iterator[dict[str, Any]]:
    """Shares of each tracker, then what is established for all."""
    for bound in bounds:
        size = bound.size
        bound_px = sqrt(bound.high) * size.px
        of_tracker = {"tracker": bound.tracker, "age": size.age, "error_px": size.px}
        yield {"cause": TruthCause.every, "high": bound.high, "bound_px": bound_px, **of_tracker}
        for cause in (TruthCause.poses, TruthCause.any_fault, TruthCause.depths):
            yield {"cause": cause, **_columns(bound.causes[cause]), "tracker": bound.tracker}
        if size.stated_share is not None:
            yield {"cause": TruthCause.stated, "share": size.stated_share, "bound_px": size.stated_px, **of_tracker}
    if faults.rows:
        named = {"tracker": faults.tracker or None, "text": _faults_text(faults)}
        yield {"cause": TruthCause.faults, **_columns(faults.share), **named}
    for sentence in evidence.mistakes:
        yield {"cause": TruthCause.mistakes, "text": sentence}


def _columns(share: _Share) -> dict[str, float | None]:
    return {"share": None if share == _UNKNOWN else share.value, "low": share.low, "high": share.high}
