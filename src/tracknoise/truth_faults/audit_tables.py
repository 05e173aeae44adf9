"""The tables of an audit, from tables of sequences."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.geometry.cameras import KnownCamera, make_camera
from tracknoise.geometry.pose import first_visits
from tracknoise.inference.bootstrap import scattered
from tracknoise.inference.conventions import LEVEL
from tracknoise.inference.robust_fits import condition_number
from tracknoise.inference.units import Resampled, SceneGroups, scheme
from tracknoise.tables.findings_schema import DEPTH_REPEATS
from tracknoise.tables.schema import check, empty
from tracknoise.tables.truth_audit import AUDIT, AUDIT_CURVES, EVERYTHING, MEASURED, AuditTables, AuditVerdict
from tracknoise.text import counted
from tracknoise.truth_faults.audit_fit import Gain, ResampledFit, curves, fit, second_moments
from tracknoise.truth_faults.audit_samples import AuditSamples, DepthRepeats, Paths, instants_of, numbered
from tracknoise.truth_faults.audit_selection import (
    Assessment,
    Basis,
    Judged,
    Named,
    Selection,
    Stage,
    available,
    judge,
    select,
)
from tracknoise.truth_faults.audit_summary import (
    Estimate,
    effect_text,
    fault_text,
    in_unit,
    kind_not_tried,
    like_text,
    other_text,
)
from tracknoise.truth_faults.corrected_positions import predict
from tracknoise.truth_faults.explained import DEPTH_MAPS, DEPTHS, EVERY_FAULT, MOVED, NAMED_FAULTS, explained, moved
from tracknoise.truth_faults.fault_parameters import COUNT, FAULTS, LIKE, TIMED, Family, Fit, Parameter, Shown, shown
from tracknoise.words import listing

MOST_SAMPLES = 16_000
"""Largest number of observations that are used, shared equally by sequences and trackers."""
LEAST_SAMPLES, LEAST_CLUSTERS = 200, 4
"""Fewest observations, and fewest scenes or blocks of tracks, of an audit."""
BLOCKS_JOINED = 2
"""Neighbouring blocks of tracks are joined, so that few errors are common to two of them."""
_REPRODUCED_PX = 0.01
"""An observation is used if its stated true position is reproduced this well."""
_STILL_PX = 1e-6
"""True positions that move less are those of a camera that stands still."""


@dataclass(frozen=True, slots=True)
class AuditedTables:
    """Tables of one sequence: `AUDIT_SAMPLES`, `CAMERAS` and `POSES`; `PATH` and `DEPTH_REPEATS` where it has them.

    z_depth_from is what its depths were computed from, if they are along z by construction. refined is whether its
    poses were fitted to reference tracks.
    """

    samples: pl.DataFrame
    cameras: pl.DataFrame
    poses: pl.DataFrame
    path: pl.DataFrame | None = None
    depth_repeats: pl.DataFrame | None = None
    z_depth_from: str | None = None
    refined: bool = False

    @property
    def repeats(self) -> DepthRepeats:
        """How well its depth maps agree."""
        rows = empty(DEPTH_REPEATS) if self.depth_repeats is None else self.depth_repeats
        return DepthRepeats.of_rows(rows["depth_m"].to_numpy(), rows["relative_sd"].to_numpy())

    @property
    def has_known_lens(self) -> bool:
        """Whether the cameras can be made again from the table."""
        return self.cameras["model"].null_count() == 0

    @property
    def has_times(self) -> bool:
        """Whether the time of each frame is known."""
        return self.cameras["time_s"].null_count() == 0

    @property
    def has_readout(self) -> bool:
        """Whether a rolling shutter is stated."""
        return self.cameras["readout_s"].null_count() < self.cameras.height


def read_samples(
    tables: Sequence[AuditedTables], groups: SceneGroups, *, without: Collection[str] = ()
) -> AuditSamples | str:
    """Samples of several sequences, or why there are none.

    `tables`: of one view of each scene and camera. `groups`: scenes that are not independent of each other. `without`:
    trackers that take no part unless there are no others, such as those that were made from the truth.
    """
    if not tables:
        return "no sequence was measured upright and forward"
    used = [audited for audited in tables if audited.has_known_lens and not audited.samples.is_empty()]
    if not used:
        unknown = any(not audited.has_known_lens for audited in tables)
        return "the camera model is not known" if unknown else "it is fitted to the tracks, or no track was followed"
    if len({audited.has_times for audited in used}) == 2 and any(audited.has_readout for audited in used):
        return "a readout in seconds is stated, and some recordings have timestamps while others have none"
    names = sorted(set().union(*(audited.samples["tracker"].unique() for audited in used)))
    trackers = tuple(name for name in names if name not in without) or tuple(names)
    around = surrounded(_joined(used, trackers, groups))
    samples = _reproduced(around)
    return enough(samples, unlike=len(around.age) - len(samples.age))


def enough(samples: AuditSamples, *, unlike: int = 0) -> AuditSamples | str:
    """The samples, or why they are too few, where those of `unlike` more are not what poses and cameras give."""
    if len(samples.age) < LEAST_SAMPLES or samples.n_clusters < LEAST_CLUSTERS:
        return _too_few(samples, unlike=unlike)
    if np.abs(samples.stated - samples.uv_at_birth).max() < _STILL_PX:
        return "no true position moves in the images, so that errors of poses, depths and cameras cannot be seen"
    return samples


def _too_few(samples: AuditSamples, *, unlike: int) -> str:
    """Why there is no audit, where the stated positions of `unlike` observations are not those of poses and cameras."""
    clusters = counted(samples.n_clusters, "scene or block of tracks", "scenes or blocks of tracks")
    opening = f"only {counted(len(samples.age), 'observation')} in {clusters} can be used"
    return f"{opening}; poses and cameras of the run give other true positions of {unlike} more" if unlike else opening


def surrounded(samples: AuditSamples) -> AuditSamples:
    """Observations whose frames have poses around them."""
    posed = samples.paths.surrounded
    return samples.chosen(np.flatnonzero(posed[samples.birth] & posed[samples.now]))


def _reproduced(samples: AuditSamples) -> AuditSamples:
    """Observations whose stated true position is that of the stated poses and cameras."""
    if not len(samples.age):
        return samples
    apart = np.abs(predict(samples, np.zeros(COUNT)).uv - samples.stated).max(axis=1)
    return samples.chosen(np.flatnonzero(apart <= _REPRODUCED_PX))


def _joined(used: Sequence[AuditedTables], trackers: tuple[str, ...], groups: SceneGroups) -> AuditSamples:
    share = max(1, MOST_SAMPLES // (len(used) * len(trackers)))
    parts = [_thinned(audited.samples.filter(pl.col("tracker").is_in(trackers)), share) for audited in used]
    interval = _interval_s(used)
    timed = interval is not None
    instants = [instants_of(audited.cameras, audited.poses, audited.path if timed else None) for audited in used]
    lengths = [len(instant.poses) for instant in instants]
    places = [start + instant.place for start, instant in zip(np.cumsum([0, *lengths[:-1]]), instants, strict=True)]
    cameras, camera = _cameras(pl.concat([instant.cameras for instant in instants]))
    unit = interval or 1.0
    times = [instant.cameras["time_s" if timed else "frame"].to_numpy() / unit for instant in instants]
    shutters = pl.concat([instant.cameras.select("readout_s", "shutter_axis") for instant in instants])
    visits = [first_visits(instant.poses[instant.place]) for instant in instants]
    table = pl.concat([_in_blocks(*pair) for pair in zip(parts, visits, strict=True)])
    cluster, block, resampled, n_scenes = _clusters(table, groups)
    return AuditSamples(
        trackers=trackers,
        tracker=np.searchsorted(trackers, table["tracker"].to_list()).astype(np.intp),
        age=table["age"].to_numpy().astype(np.intp),
        cluster=cluster,
        block=block,
        resampled=resampled,
        n_scenes=n_scenes,
        birth=_placed(parts, places, "birth_frame"),
        now=_placed(parts, places, "frame"),
        uv_at_birth=table.select("u_birth_px", "v_birth_px").to_numpy(),
        observed=table.select("u_px", "v_px").to_numpy(),
        stated=table.select("u_true_px", "v_true_px").to_numpy(),
        depth=table["depth_m"].to_numpy(),
        depth_sd=np.concatenate(
            [audited.repeats.at(part["depth_m"].to_numpy()) for audited, part in zip(used, parts, strict=True)]
        ),
        paths=Paths.of(
            np.concatenate(times),
            np.concatenate([instant.poses for instant in instants]),
            np.repeat(np.arange(len(used)), lengths),
        ),
        cameras=cameras,
        camera=camera,
        readout_of=shutters["readout_s"].fill_null(0.0).to_numpy() / unit,
        axis_of=shutters["shutter_axis"].fill_null(1).to_numpy().astype(np.intp),
        interval_s=interval,
        z_depth_from=_z_depth_from(used),
        refined=any(audited.refined for audited in used),
    )


def _in_blocks(part: pl.DataFrame, visits: NDArray[np.intp]) -> pl.DataFrame:
    """Rows of a sequence; those born where the camera was before are in the block of its first visit."""
    birth, block = part["birth_frame"].to_numpy(), part["block"].to_numpy()
    first = visits[birth]
    of_frame = np.zeros(len(visits), block.dtype)
    np.maximum.at(of_frame, birth, block)
    at_first = np.maximum.accumulate(of_frame)[first]
    return part.with_columns(block=pl.Series(np.where(first < birth, at_first, block), dtype=part["block"].dtype))


def _z_depth_from(used: Sequence[AuditedTables]) -> str | None:
    """What depths are known to be along z from; None where that is not known of any sequence.

    A correction of the kind of depth holds for all sequences of a run, so that one of them rules it out.
    """
    sources = [audited.z_depth_from for audited in used if audited.z_depth_from is not None]
    if not sources:
        return None
    text = listing(dict.fromkeys(sources))
    return text if len(sources) == len(used) else f"{text}, in {len(sources)} of {len(used)} sequences"


def _interval_s(used: Sequence[AuditedTables]) -> float | None:
    """Median time between frames, seconds; None where times of a sequence are unknown."""
    if not all(audited.has_times for audited in used):
        return None
    times = [audited.cameras["time_s"] for audited in used]
    gaps = np.concatenate([np.diff(time_s.to_numpy()) for time_s in times])
    return float(np.median(gaps)) if len(gaps) else 1.0


def _placed(parts: Sequence[pl.DataFrame], places: Sequence[NDArray[np.intp]], frame: str) -> NDArray[np.intp]:
    """Where the frames of samples are among the times of all sequences, (n,)."""
    return np.concatenate([place[part[frame].to_numpy()] for part, place in zip(parts, places, strict=True)])


def _thinned(table: pl.DataFrame, share: int) -> pl.DataFrame:
    """At most `share` rows of each tracker, chosen by a hash of track and frame."""
    hashed = scattered(scattered(table["track"].to_numpy()) ^ table["frame"].to_numpy().astype(np.uint64))
    ranked = table.with_columns(hashed=pl.Series(hashed))
    return ranked.filter(pl.col("hashed").rank("ordinal").over("tracker") <= share).drop("hashed")


def _cameras(table: pl.DataFrame) -> tuple[tuple[KnownCamera, ...], NDArray[np.intp]]:
    """The different cameras, and the place of each frame's camera among them."""
    columns = ["model", "width", "height", "fx_px", "fy_px", "cx_px", "cy_px", "distortion"]
    rows = [(*row[:-1], tuple(row[-1])) for row in table.select(columns).iter_rows()]
    places = {row: place for place, row in enumerate(dict.fromkeys(rows))}
    cameras = tuple(make_camera(row[0], row[1:3], row[3:7], row[7]) for row in places)
    return cameras, np.array([places[row] for row in rows], dtype=np.intp)


def _clusters(table: pl.DataFrame, groups: SceneGroups) -> tuple[NDArray[np.intp], NDArray[np.intp], Resampled, int]:
    """Cluster and block of tracks of each row, both without gaps.

    Clusters are groups, scenes, or the blocks within scenes where these are few.
    """
    scenes = table["scene"].unique().sort().to_list()
    scene = np.searchsorted(scenes, table["scene"].to_list())
    group = groups.of(table["dataset"][0] if table.height else "", scenes)
    resampled = scheme(group) or Resampled.blocks
    within = table["block"].to_numpy().astype(np.intp) // BLOCKS_JOINED
    block = scene * (int(within.max(initial=0)) + 1) + within
    number = {Resampled.groups: group[scene], Resampled.blocks: block}.get(resampled, scene)
    return numbered(number), numbered(block), resampled, len(scenes)


Row = dict[str, Any]


def _not_audited(why: str, dataset: str) -> AuditTables:
    """Tables of a run that could not be audited: one row, with the reason."""
    text = f"The truth was not audited: {why}."
    row = {"dataset": dataset, "verdict": AuditVerdict.undetermined, "text": text}
    return AuditTables(pl.DataFrame([row], schema=dict(AUDIT)), empty(AUDIT_CURVES))


_EXTREME = "numbers of its poses, depths or camera are too large or too small beside the others"


def tables_of(samples: AuditSamples | str, dataset: str) -> AuditTables:
    """Audit the truth of a dataset by some observations; without rows but the reason where that is not possible."""
    if isinstance(samples, str):
        return _not_audited(samples, dataset)
    try:
        with np.errstate(all="ignore"):
            selection = select(samples)
            curve = curves(samples, _corrected_errors(samples, selection), dataset)
            shares = [*_named_shares(samples, selection), *_bounds(samples)]
            rows = [*_single_rows(samples, selection, curve), *_named_rows(selection), *shares]
    except np.linalg.LinAlgError:
        return _not_audited(_EXTREME, dataset)
    table = pl.DataFrame([{"dataset": dataset, **row} for row in rows], schema=dict(AUDIT))
    return AuditTables(check(table, AUDIT, AUDIT.name), check(curve, AUDIT_CURVES, AUDIT_CURVES.name))


def _named_shares(samples: AuditSamples, selection: Selection) -> Iterator[Row]:
    """What the named faults explain of each tracker: little of all together may be much of the most accurate one."""
    if not selection.named:
        return
    base, final = _base(selection), selection.final.resampled
    for number, tracker in enumerate(samples.trackers):
        of_tracker = samples.tracker == number
        if isinstance(enough(samples.chosen(np.flatnonzero(of_tracker))), str):
            continue
        share = final.gain_beyond(base.resampled, base.scale, of_tracker)
        yield _share_row(NAMED_FAULTS, tracker, share, samples)


def _bounds(samples: AuditSamples) -> Iterator[Row]:
    """What the truth can explain at most of each tracker, by all constant faults and by random errors of depths.

    The same error of the truth is a larger share of smaller errors: a share of all trackers together bounds none.
    """
    bounded = []
    for number, tracker in enumerate(samples.trackers):
        tracker_samples = enough(samples.chosen(np.flatnonzero(samples.tracker == number)))
        if isinstance(tracker_samples, str):
            continue
        bounded.append(number)
        shares = explained(tracker_samples, available(tracker_samples))
        for name, share in ((EVERY_FAULT, shares.faults), (DEPTHS, shares.depths), (DEPTH_MAPS, shares.depth_maps)):
            if share is None:
                continue
            yield _share_row(name, tracker, share, tracker_samples)
    of_bounded = samples.chosen(np.flatnonzero(np.isin(samples.tracker, bounded)))
    for number, factor in moved(of_bounded, available(of_bounded)).items():
        row = {"family": Family.at_most, "parameter": MOVED, "component": samples.trackers[number], "unit": "times"}
        yield {**row, "value": factor}


def _share_row(name: str, tracker: str, share: Gain, samples: AuditSamples) -> Row:
    """A share of the errors of one tracker."""
    bounds = {"gain": share.value, "gain_low": share.low, "gain_high": share.high, **_resampled(samples)}
    return {"family": Family.at_most, "parameter": name, "component": tracker, "unit": "", **bounds}


def _resampled(samples: AuditSamples) -> Row:
    """What intervals are from."""
    return {
        "level": LEVEL,
        "resampled": samples.resampled,
        "n_units": samples.n_clusters,
        "n_scenes": samples.n_scenes,
        "n": len(samples.age),
    }


def _corrected_errors(samples: AuditSamples, selection: Selection) -> dict[str, NDArray[np.float64]]:
    """Errors (n, 2), px, by correction: as measured, with each fault and those before it corrected, and with all."""
    errors = {MEASURED: samples.observed - samples.stated}
    for fault in selection.named:
        errors[fault.parameter] = fault.resampled.error
    if selection.named:
        errors[EVERYTHING] = selection.final.resampled.error
    return errors


def _single_rows(samples: AuditSamples, selection: Selection, curve: pl.DataFrame) -> Iterator[Row]:
    """Of the families of one parameter; verdicts and sentences are in the rows of the family alone."""
    judged = judge(selection)
    for judgement in judged:
        extra = {
            "rank": judgement.rank,
            "verdict": judgement.verdict,
            "text": _text(samples, selection, judgement, curve),
        }
        factor = shown(samples, judgement.parameter).factor
        for component, row in enumerate(_assessed_rows(Family.alone, selection.alone, judgement.parameter)):
            visible = abs(factor) * float(judgement.visible_above[component])
            yield {**row, **extra, "visible_above": visible if np.isfinite(visible) and not samples.refined else None}
    yield from _known_rows(samples)
    for judgement in judged:
        yield from _assessed_rows(Family.beside_bias, selection.beside_bias, judgement.parameter)


def _known_rows(samples: AuditSamples) -> Iterator[Row]:
    """A sentence about what was not tried, because the program itself made it so."""
    if samples.z_depth_from is not None:
        yield {
            "family": Family.alone,
            "parameter": Parameter.ray_depth,
            "component": "",
            "unit": "",
            "verdict": AuditVerdict.not_tried,
            "text": kind_not_tried(samples.z_depth_from),
        }


def _assessed_rows(family: Family, stage: Stage, parameter: Parameter) -> Iterator[Row]:
    assessment = stage.assessed[parameter]
    for row in _fit_rows(family, assessment.resampled, assessment.gain):
        yield {**row, "p": stage.p[parameter]}


def _base(selection: Selection) -> Basis:
    """The fit without a fault that the one of all named faults is compared with."""
    return (selection.beside_bias if selection.final.fitted.with_bias else selection.alone).basis


def _named_rows(selection: Selection) -> Iterator[Row]:
    """Of all named faults together."""
    if selection.named:
        together = selection.final.resampled
        yield from _fit_rows(Family.named, together, _base(selection).gain_of(together))


def _fit_rows(family: Family, resampled: ResampledFit, explained: Gain) -> Iterator[Row]:
    """One row per free number of a fit."""
    samples, fitted = resampled.samples, resampled.fitted
    names = [(fault, component) for fault in fitted.parameters for component in FAULTS[fault].components]
    half = resampled.half_widths
    related = _correlations(fitted)
    errors = {MEASURED: samples.observed - samples.stated, EVERYTHING: resampled.error}
    second = second_moments(samples, errors)
    fits = {
        **_resampled(samples),
        "gain": explained.value,
        "gain_low": explained.low,
        "gain_high": explained.high,
        "second_moment_share": 1.0 - second[EVERYTHING] / max(second[MEASURED], 1e-300),
        "condition": condition_number(fitted.equations),
    }
    for place, (parameter, component) in enumerate(names):
        yield {
            "family": family,
            "parameter": parameter,
            "component": component,
            **_values(samples, parameter, component, float(fitted.estimate[place]), float(half[place])),
            **fits,
            **_most_related(names, related[place], place),
        }


def _values(samples: AuditSamples, parameter: Parameter, component: str, number: float, half: float) -> Row:
    """The corrected value of a number of the fit beside the stated one, in the unit of its text."""
    unit = shown(samples, parameter)
    stated = unit.stated[FAULTS[parameter].components.index(component)]
    value, reach = stated + unit.factor * number, abs(unit.factor) * half
    return {
        "unit": unit.unit,
        "stated": stated,
        "value": value,
        "low": value - reach,
        "high": value + reach,
        "in_frames": value / unit.factor if parameter in TIMED else None,
    }


def _correlations(fitted: Fit) -> NDArray[np.float64]:
    """Correlation of each free number with all numbers of the fit, (free, free)."""
    covariance = np.linalg.inv(fitted.equations.information)[: len(fitted.free), : len(fitted.free)]
    root = np.sqrt(np.diag(covariance))
    return np.asarray(covariance / root[:, None] / root)


def _most_related(names: Sequence[tuple[Parameter, str]], related: NDArray[np.float64], place: int) -> Row:
    sizes = np.abs(related)
    sizes[place] = -1.0
    if len(names) < 2:
        return {}
    strongest = int(np.argmax(sizes))
    return {"correlation": float(related[strongest]), "correlated_with": " ".join(names[strongest]).strip()}


def _text(samples: AuditSamples, selection: Selection, judgement: Judged, curve: pl.DataFrame) -> str:
    unit = shown(samples, judgement.parameter)
    if judgement.rank is not None:
        names = [MEASURED, *(fault.parameter for fault in selection.named)]
        effect = effect_text(curve, names[judgement.rank - 1], judgement.parameter)
        fault = selection.named[judgement.rank - 1]
        estimate = _estimate(unit, fault)
        beside_others = _beside_like(samples, selection, judgement, estimate)
        return fault_text(judgement.parameter, estimate, effect, fault.rivals) + beside_others
    beside = selection.last.assessed[judgement.parameter]
    return other_text(
        judgement.parameter,
        judgement.verdict,
        in_unit(judgement.visible_above, unit),
        condition=judgement.condition,
        found=_estimate(unit, beside),
        named=[fault.parameter for fault in selection.named],
        samples=samples,
    )


def _estimate(unit: Shown, assessed: Assessment | Named) -> Estimate:
    """Of a parameter, together with the faults that were named before it."""
    return Estimate(unit, unit.values(assessed.estimate), assessed.half_widths * abs(unit.factor))


def _beside_like(samples: AuditSamples, selection: Selection, judgement: Judged, estimate: Estimate) -> str:
    """A sentence if the first fault has another value beside parameters like it, none of which was named."""
    parameters, named = available(samples), [fault.parameter for fault in selection.named]
    alike = [name for group in LIKE if judgement.parameter in group for name in group if name in parameters]
    others = [name for name in alike if name != judgement.parameter]
    if not others or judgement.rank != 1 or any(name in named for name in others):
        return ""
    start, with_bias = selection.beside_bias.basis.start, selection.final.fitted.with_bias
    fitted = fit(samples, alike, start, with_bias=with_bias)
    resampled = ResampledFit.of(samples, fitted)
    mine = fitted.places_of(judgement.parameter)
    unit = shown(samples, judgement.parameter)
    together = Estimate(unit, unit.values(fitted.estimate[mine]), resampled.half_widths[mine] * abs(unit.factor))
    moved = np.abs(together.values - estimate.values) > estimate.half
    return like_text(others, together) if moved.any() else ""
