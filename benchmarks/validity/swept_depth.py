"""How right the errors of tracks and the sigma to set are where the depth of a recording is hidden.

    python -m benchmarks.validity.swept_depth RESULTS --cache FOLDER [--scenes NAME ...] [--frames N] [--width N]
        [--without WAY ...] [--recordings READER:PATH ...] [--truth KIND] [--trackers NAME ...]

Simulated recordings are rendered once, and kept in `--cache`. A scene is named by its motion and the number of its
world. `shaken` adds rotations of a hand. `slow` goes a tenth of the way, and `still` none, with the rotations of arvr.
Each is followed once by the trackers, and the same tracks are measured with the exact truth, and without recorded depth
in these ways:

- `exact poses`: depth from the images of other frames (`swept`);
- `refined poses`: the same, where poses walk by 0.05 degrees and 4 mm per root frame and are refined;
- `images alone`: the same, with poses that pycolmap reconstructs from the images, refined where this is possible;
- `stereo`: depth from a second camera 0.11 m away (`depth = "stereo"`), and exact poses;
- `two cameras`: the first three again, where the images of this camera are further views of the sweep.

Each scene and way is one line of RESULTS, a file of JSON, and is not measured again. Printed are

- of the depths of all tracks that have one, with exact poses: median and robust standard deviation of the relative
  error, the share beyond 5 %, and of true positions that the error of a depth moves, over what is stated, the median
  (0.67 is right) and the share within two (0.95);
- the share of tracks with a depth, and of those in which the exact truth sees a point;
- by tracker and age: core (1.4826 times the median absolute deviation) and RMS (of errors up to 5 px) in u and v, by
  the exact truth of all observations, by exact depth maps, which leave out features at depth edges, by the exact truth
  of the observations that have one without depth, and by that. The third against the first is what selection does, the
  fourth against the third what depth does;
- the sigma to set in the estimator `openvins`, by all four, and for each way the share of scenes in which it is within
  15 % of each of the others. With the exact truth of the same observations, that of these is compared.
"""

import argparse
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

import tracknoise as tn
from benchmarks.validity.rigid import pose_noise
from benchmarks.validity.truth_verdicts import Recorded, Replayed, by_hand
from tracknoise.exceptions import TracknoiseError
from tracknoise.experiments.measure import Measurement, complete, measure
from tracknoise.measurement.sequence_tables import SequenceTables
from tracknoise.sequences.other_poses import OtherPoses
from tracknoise.sequences.reconstruction import reconstruct
from tracknoise.sequences.sequence import SWEPT, SecondCamera, second_of
from tracknoise.sequences.sequence import Sequence as Recording
from tracknoise.sequences.stereo import with_stereo_depth
from tracknoise.sequences.views import View
from tracknoise.trackers.tracker_registry import make_tracker

Array = NDArray[np.float64]
Images = NDArray[np.uint8]

MOTIONS, WORLDS = ("arvr", "forward", "sideways", "shaken arvr", "still", "slow arvr"), (1, 2)
SLOW = 0.1
"""Share of the way, between the first and each other frame, in `slow` scenes."""
TRACKERS = ("lucas-kanade", "correspondence")
AGES = (1, 3, 10, 24)
LARGEST_PX = 5.0
NEAR = 0.15
KEY = ("tracker", "speed", "track")
BASELINE_M = 0.11
WALK_DEG, WALK_M = 0.05, 0.004
RATE_HZ = 30.0
ESTIMATOR = "openvins"
EXACT, MAPS, SAME = OTHERS = ("exact truth", "exact depth maps", "exact truth of the same")
"""What the sigma to set without depth is compared with."""
FEWEST = 50
"""Observations of a tracker and age of which errors are printed."""


@dataclass(frozen=True, slots=True, eq=False)
class Kept(View):
    """A sequence whose images are in memory."""

    images: Mapping[int, Images]
    seconds: Mapping[int, Images] = field(default_factory=dict)

    def image(self, index: int) -> Images:
        """That of the sequence shown."""
        return self.images[index]

    @property
    def second(self) -> SecondCamera | None:
        """That of the sequence shown."""
        found = second_of(self.sequence)
        return None if found is None else replace(found, images=self.seconds.__getitem__)


@dataclass(frozen=True, slots=True, eq=False)
class Hidden(View):
    """A sequence without depth and surface, and unless it is kept, without a second camera."""

    both: bool = False

    @property
    def second(self) -> SecondCamera | None:
        """That of the sequence shown, if it is kept."""
        return second_of(self.sequence) if self.both else None

    @property
    def truths(self) -> tuple[str, ...]:
        """None: what is found without depth."""
        return ()

    @property
    def surface(self) -> None:
        """Hidden."""

    def depth(self, index: int) -> None:
        """Hidden."""


def simulated(name: str, size: tuple[int, int, int], cache: Path) -> Recording:
    """A simulated scene whose images are in the cache."""
    motion, world = name.removeprefix("shaken ").removeprefix("slow ").replace("still", "arvr").rsplit(" ", 1)
    width, height, frames = size
    options: dict[str, Any] = {"motions": [motion], "frames": frames, "width": width, "height": height}
    options |= {"baseline_m": BASELINE_M, "imaging": {"rate_hz": RATE_HZ}}
    sequence = tn.open_sequence("simulated", seed=int(world), **options)
    if name.startswith("shaken "):
        sequence = replace(sequence, world_from_camera=by_hand(sequence.world_from_camera))  # type: ignore[type-var]
    if name.startswith(("slow ", "still ")):
        sequence = replace(sequence, world_from_camera=_slowed(sequence.world_from_camera, name.startswith("slow ")))  # type: ignore[type-var]
    file = cache / f"{name.replace(' ', '-')}-{width}x{height}x{frames}.npz"
    if not file.is_file():
        cache.mkdir(parents=True, exist_ok=True)
        second = second_of(sequence)
        assert second is not None
        every = range(len(sequence))
        np.savez(file, first=[sequence.image(one) for one in every], second=[second.images(one) for one in every])
    kept = np.load(file)
    return Kept(sequence, *(dict(enumerate(kept[side])) for side in ("first", "second")))


def _slowed(poses: Array, share: float) -> Array:
    """Poses at a share of the way from the first; rotations stay."""
    slowed = poses.copy()
    slowed[:, :3, 3] = poses[0, :3, 3] + SLOW * share * (poses[:, :3, 3] - poses[0, :3, 3])
    return slowed


def recorded(name: str) -> Recording:
    """A recording of another reader, in memory."""
    reader, _, path = name.partition(":")
    (sequence,) = tn.open_sequences(reader, path)
    return Kept(sequence, {index: sequence.image(index) for index in range(len(sequence))})


def spoilt(sequence: Recording) -> Recording:
    """The sequence with poses that walk."""
    noise = pose_noise("walk", WALK_DEG, WALK_M, len(sequence), np.random.default_rng(0))
    return OtherPoses(sequence, sequence.world_from_camera @ noise, "spoilt poses")


def _exact_poses(sequence: Recording, trackers: Mapping[str, Any]) -> Measurement:
    return measure(Hidden(sequence), trackers, truth=SWEPT)


def _refined_poses(sequence: Recording, trackers: Mapping[str, Any]) -> Measurement:
    return measure(spoilt(Hidden(sequence)), trackers, truth=SWEPT, poses="refined")


def _images_alone(sequence: Recording, trackers: Mapping[str, Any]) -> Measurement:
    hidden = Hidden(sequence)
    return measure(OtherPoses(hidden, reconstruct(hidden), "images"), trackers, truth=SWEPT, poses="refined")


def _two_cameras(sequence: Recording, trackers: Mapping[str, Any]) -> Measurement:
    return measure(Hidden(sequence, both=True), trackers, truth=SWEPT)


def _two_refined(sequence: Recording, trackers: Mapping[str, Any]) -> Measurement:
    return measure(spoilt(Hidden(sequence, both=True)), trackers, truth=SWEPT, poses="refined")


def _two_alone(sequence: Recording, trackers: Mapping[str, Any]) -> Measurement:
    hidden = Hidden(sequence, both=True)
    return measure(OtherPoses(hidden, reconstruct(hidden), "images"), trackers, truth=SWEPT, poses="refined")


def _stereo(sequence: Recording, trackers: Mapping[str, Any]) -> Measurement:
    return measure(with_stereo_depth(sequence), trackers, truth="birth")


WAYS: Mapping[str, Callable[[Recording, Mapping[str, Any]], Measurement]] = {
    "exact poses": _exact_poses,
    "refined poses": _refined_poses,
    "images alone": _images_alone,
    "stereo": _stereo,
    "two cameras": _two_cameras,
    "two cameras, refined poses": _two_refined,
    "two cameras, images alone": _two_alone,
}
_WITH_EXACT_POSES = ("exact poses", "stereo", "two cameras")


def of_depths(exact: Measurement, other: Measurement) -> str:
    """Errors of depth."""
    both = exact.tracks.join(other.tracks, on=KEY, suffix="_other")
    known = both.drop_nulls(["depth_m", "depth_m_other"])
    error = (known["depth_m_other"] / known["depth_m"] - 1.0).to_numpy()
    median = float(np.median(error))
    robust = 1.4826 * float(np.median(np.abs(error - median)))
    beyond = float(np.mean(np.abs(error) > 0.05))
    return (
        f"relative error median {median:+.4f}, robust sd {robust:.4f}, beyond 5 % {beyond:.3f}; {_floors(exact, other)}"
    )


def _floors(exact: Measurement, other: Measurement) -> str:
    """Whether the stated covariances of true positions are right: differences over their standard deviations."""
    names = [*KEY, "frame"]
    true = [one.observations.drop_nulls("u_true_px").filter(pl.col("age") > 0) for one in (exact, other)]
    both = true[0].select(*names, "u_true_px", "v_true_px").join(true[1], on=names, suffix="_other")
    if "cov_true_uu" not in both.columns:
        return "nothing is stated"
    moved = both.select((pl.col(f"{one}_true_px_other") - pl.col(f"{one}_true_px")) for one in "uv").to_numpy()
    stated = both.select(pl.col("cov_true_uu") + pl.col("cov_true_vv")).to_series().to_numpy()
    ratio = np.hypot(*moved.T) / np.sqrt(np.maximum(stated, 1e-12))
    return (
        f"moved over stated: median {np.nanmedian(ratio):.2f}, within 2 {np.nanmean(ratio[np.isfinite(ratio)] < 2):.3f}"
    )


def of_positions(exact: Measurement, maps: Measurement, other: Measurement) -> Iterator[str]:
    """Core and RMS by tracker and age."""
    names = [*KEY, "frame"]
    truths = [one.observations.select(*names, "age", "truth", "du_px", "dv_px") for one in (exact, maps, other)]
    both = truths[0].join(truths[1], on=names, suffix="_maps").join(truths[2], on=names, suffix="_other")
    shown = both.filter(pl.col("truth") == "valid", pl.col("du_px").is_not_null())
    for tracker in TRACKERS:
        for age in AGES:
            here = shown.filter(tracker=tracker, age=age)
            known = here.filter(pl.col("truth_other") == "valid")
            if known.height < FEWEST:
                continue
            parts = [here.select("du_px", "dv_px")]
            parts.append(here.filter(pl.col("truth_maps") == "valid").select("du_px_maps", "dv_px_maps"))
            parts.append(known.select("du_px", "dv_px"))
            parts.append(known.select("du_px_other", "dv_px_other"))
            cells = "   ".join(_cell(one.to_numpy()) for one in parts)
            yield f"{tracker:<15}{age:>3}  {cells}   {known.height / here.height:.3f} of {here.height}"


def _cell(error_px: Array) -> str:
    core = 1.4826 * np.median(np.abs(error_px - np.median(error_px, axis=0)), axis=0)
    rms = np.sqrt(np.mean(np.square(error_px[np.hypot(*error_px.T) < LARGEST_PX]), axis=0))
    return f"{core[0]:.3f} {core[1]:.3f} / {rms[0]:.3f} {rms[1]:.3f}"


def of_the_same(exact: Measurement, other: Measurement) -> Measurement:
    """The errors by one truth, of the observations that have one by the other too."""
    names = [*KEY, "frame"]
    seen = other.observations.select(*names, known=pl.col("truth") == "valid")
    hidden = ~pl.col("known") & (pl.col("truth") == "valid")
    without = [
        pl.when(~hidden).then(pl.col(one)).alias(one) for one in exact.observations.columns if one.endswith("_px")
        and one not in ("u_px", "v_px")
    ]  # fmt: skip
    truth = exact.observations.schema["truth"]
    status = pl.when(hidden).then(pl.lit("no_depth", dtype=truth)).otherwise(pl.col("truth")).alias("truth")
    observations = exact.observations.join(seen, on=names, how="left", maintain_order="left")
    observations = observations.with_columns(pl.col("known").fill_null(False)).with_columns(*without, status)
    tables = SequenceTables(
        observations=observations.select(exact.observations.columns).with_columns(kept=pl.lit(True)),
        tracks=exact.tracks.with_columns(
            max_error_px=pl.lit(None, dtype=pl.Float64), kept=pl.lit(True)
        ),
        frames=exact.frames,
        floors=exact.floors,
        truth=exact.truth,
        key_frame=exact.key_frame,
        n_frames=exact.n_frames,
        snapshot_frame=exact.snapshot_frame,
        snapshot=exact.snapshot,
    )  # fmt: skip
    return complete(exact.sequence, tables)


def sigmas(measured: Measurement) -> dict[str, float]:
    """The sigma to set, by tracker; none where there is none, with the reason printed."""
    try:
        found = tn.analyse(measured).sigma(ESTIMATOR)
    except TracknoiseError as error:
        print(error)
        return {}
    return {tracker: one.sigma_px for tracker, one in found.items()}


def shares(exact: Measurement, other: Measurement) -> dict[str, float]:
    """Share of tracks with a depth, by tracker, of those in which the exact truth sees a point."""
    both = exact.tracks.join(other.tracks, on=KEY, suffix="_other").drop_nulls("depth_m")
    found = both.group_by("tracker").agg(pl.col("depth_m_other").is_not_null().mean().alias("share"))
    return dict(found.select("tracker", "share").rows())


def compared(
    way: str, sequence: Recording, exact: Measurement, maps: Measurement, trackers: Mapping[str, Any]
) -> dict[str, Any]:
    """One line of the results."""
    try:
        other = WAYS[way](sequence, trackers)
    except TracknoiseError as error:
        return {"refused": str(error)}
    if way.endswith("refined poses") and other.pose_fit is not None and not other.pose_fit.leads:
        return {"refused": other.pose_fit.reason}
    row: dict[str, Any] = {"tracks": shares(exact, other), "errors": [*of_positions(exact, maps, other)]}
    row["sigma"], row["sigma of the same"] = sigmas(other), sigmas(of_the_same(other, exact))
    row[SAME] = sigmas(of_the_same(exact, other))
    if way in _WITH_EXACT_POSES:
        row["depths"] = of_depths(exact, other)
    if other.pose_fit is not None:
        row["poses"] = other.pose_fit.reason or f"refined: {other.pose_fit.left_px:.3f} px left"
    return row


def told(row: Mapping[str, Any]) -> Iterator[str]:
    """What is printed of a line of the results."""
    yield f"{row['scene']}, {row['way']}: " + (row.get("refused") or row.get("depths") or row.get("poses") or "")
    for line in row.get("errors", ()):
        yield f"    {line}"
    for tracker, share in row.get("tracks", {}).items():
        pairs = {name: (sigma_without(row, name, tracker), row[name].get(tracker, np.nan)) for name in OTHERS}
        against = ", ".join(f"{name} {one:.3f} ({own / one - 1:+.1%})" for name, (own, one) in pairs.items())
        yield f"    {tracker}: sigma {pairs[EXACT][0]:.3f} px; {against}; tracks with depth {share:.3f}"


def sigma_without(row: Mapping[str, Any], against: str, tracker: str) -> float:
    """The sigma to set without depth that is compared with another one: of the same observations, or of all."""
    return float(row["sigma of the same" if against == SAME else "sigma"].get(tracker, np.nan))


def summary(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Shares of scenes whose sigma is near the exact one."""
    for way in dict.fromkeys(row["way"] for row in rows):
        own = [row for row in rows if row["way"] == way]
        known = [row for row in own if "refused" not in row]
        yield f"{way}: {len(own)} scenes, {len(own) - len(known)} refused"
        for tracker in dict.fromkeys(name for row in known for name in row["sigma"]):
            for against in OTHERS:
                ratios = [sigma_without(row, against, tracker) / row[against].get(tracker, np.nan) for row in known]
                near = np.mean(np.abs(np.array(ratios) - 1.0) <= NEAR)
                worst = max(ratios, key=lambda one: abs(one - 1.0))
                yield f"    {tracker} against {against}: within 15 % {near:.2f}, worst {worst - 1:+.1%}"


def main() -> None:
    """Measure what is missing, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("--cache", type=Path, required=True, help="folder of the rendered images")
    parser.add_argument("--scenes", nargs="*", help="by default all")
    parser.add_argument("--frames", type=int, default=50)
    parser.add_argument("--width", type=int, default=480)
    parser.add_argument("--without", nargs="*", default=[*WAYS], choices=WAYS, help="ways to do without depth")
    parser.add_argument("--recordings", nargs="*", default=[], metavar="READER:PATH")
    parser.add_argument("--trackers", nargs="*", default=TRACKERS)
    parser.add_argument("--truth", help="kind of the exact truth: birth leaves out features at depth edges")
    given = parser.parse_args()
    size = (given.width, given.width * 3 // 4, given.frames)
    names = given.scenes if given.scenes is not None else [f"{motion} {one}" for one in WORLDS for motion in MOTIONS]
    rows = [json.loads(line) for line in given.results.read_text().splitlines()] if given.results.exists() else []
    done = {(row["scene"], row["way"]) for row in rows}
    for name in [*names, *given.recordings]:
        missing = [way for way in given.without if (name, way) not in done]
        if not missing:
            continue
        sequence = recorded(name) if name in given.recordings else simulated(name, size, given.cache)
        first = {one: Recorded(make_tracker(one, {}), []) for one in given.trackers}
        exact = measure(sequence, first, truth=given.truth)
        trackers = {one: Replayed(kept.steps) for one, kept in first.items()}
        maps = measure(sequence, trackers, truth="birth")
        common = {"scene": name, EXACT: sigmas(exact), MAPS: sigmas(maps)}
        for way in missing:
            row = common | {"way": way} | compared(way, sequence, exact, maps, trackers)
            rows.append(row)
            with given.results.open("a") as file:
                print(json.dumps(row), file=file)
            print("\n".join(told(row)), flush=True)
    print("\n".join(summary(rows)))


if __name__ == "__main__":
    main()
