"""Are findings about planted errors true? Verdicts and intervals that sentences rest on are compared with the plan.

    python -m benchmarks.validity.planted_sentences [--runs N] [--seed N] [--show]

Each run has two trackers with errors of two worlds of `benchmarks.validity.planted`, in 8 or 12 scenes. It is analysed
as any other run. A finding names the rows of results that its text has. Each row is compared with what was planted, by
its quantity. Printed is, by topic and quantity, how many verdicts were given, how many of them are false, and how many
intervals do not hold the true value. Verdicts of undecided claim nothing and are not counted.
"""

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import tracknoise as tn
from benchmarks.selfcheck.known_worlds import Script, Scripted, in_memory, plain_scene
from benchmarks.selfcheck.scene_pools import scene_name
from benchmarks.validity.planted import AGES, FRAMES, WORLDS, Scenes, World, draw
from tracknoise.experiments.measure import measure
from tracknoise.experiments.run_findings import compute_findings
from tracknoise.experiments.run_statistics import compute_statistics
from tracknoise.experiments.settings import DatasetSettings, Experiment, StatisticsSettings, TrackerChoice
from tracknoise.experiments.task import write_measurement, write_settings
from tracknoise.tables.identity import SequenceId
from tracknoise.tables.store import RunFolder

Row = Mapping[str, Any]
MARGIN = 1.1
LEFT_OUT = ("groups",)
"""Worlds whose scenes come in groups: these are not named in the run."""


def planted_run(folder: Path, worlds: Mapping[str, World], n_scenes: int, rng: np.random.Generator) -> RunFolder:
    """A run with its statistics and findings, of trackers with errors of some worlds."""
    run = RunFolder(folder)
    experiment = Experiment(
        name="planted",
        dataset=DatasetSettings(reader="folder"),
        trackers=[TrackerChoice(kind="scripted", name=tracker) for tracker in worlds],
        statistics=StatisticsSettings(trim_percentile=100.0),
    )
    drawn, entries = {name: draw(world, n_scenes, rng) for name, world in worlds.items()}, []
    for number in range(n_scenes):
        scene = plain_scene(number, n_frames=FRAMES)
        recording = in_memory(scene, SequenceId("planted", scene_name(number)))
        scripts = {name: _script(scene, scenes, number, rng) for name, scenes in drawn.items()}
        trackers = {name: Scripted({(recording.id.key, 1): script}) for name, script in scripts.items()}
        entries.append(write_measurement(run, experiment, measure(recording, trackers, trim_percentile=100.0)))
    write_settings(run, experiment, entries)
    compute_findings(run, experiment, compute_statistics(run, experiment))
    return run


def _script(scene: Any, scenes: Scenes, number: int, rng: np.random.Generator) -> Script:
    """Tracks of one scene of features that stay in the image, which carry the planted errors from their birth on."""
    alive, birth = scenes.alive[number], scenes.birth[number]
    tracks = len(alive)
    size = np.array([scene.camera.width, scene.camera.height])
    first_px, frame = rng.uniform(0.2 * size, 0.8 * size, (tracks, 2)), np.zeros(tracks, dtype=np.int64)
    true_px, depth_m = scene.images(scene.world(frame, first_px, scene.look(frame, first_px)[0]))
    there, errors = np.zeros((tracks, FRAMES), dtype=bool), np.zeros((tracks, FRAMES, 2))
    track, age = np.nonzero(alive)
    there[track, birth[track] + age] = True
    errors[track, birth[track] + age] = scenes.errors[number][track, age]
    end = np.where(scenes.ended[number], np.where(rng.random(tracks) < 0.3, "outlier", "lost"), "sequence_end")
    last = birth + alive.sum(axis=1) - 1
    end = np.where(last == FRAMES - 1, "sequence_end", np.where(end == "sequence_end", "lost", end))
    return Script(
        frames=np.arange(FRAMES),
        alive=there,
        true_px=true_px,
        error_px=errors,
        status=np.full(there.shape, "valid"),
        end=end.astype("<U16"),
        depth_m=depth_m[np.arange(tracks), birth],
        zero_frame=birth,
    )


def holds(row: Row, true: float | None) -> bool | None:
    """Whether the interval of a row holds a value; None where there is no interval, or the value is not known."""
    if true is None or row["low"] is None or row["high"] is None:
        return None
    return bool(row["low"] - 1e-9 <= true <= row["high"] + 1e-9)


def true_value(row: Row, world: World) -> float | None:
    """What a row estimates, where it is known in closed form."""
    if world.lives == "lost" or row["trimming"] == "trimmed" or row["at"] == 0:
        return None
    typical, every = float(np.exp(world.log_scale())), world.squared_scale()
    at = row["at"]
    match row["quantity"]:
        case "mean_error":
            return world.bias
        case "second_moment" if row["coordinate"] in ("u", "v") and at is not None:
            noise = world.second(at) - world.bias**2
            if row["weighting"] == "geometric":
                return None if world.bias else noise * typical**2
            return noise * every + world.bias**2
        case "core" if at is not None and world.is_gaussian() and not world.bias:
            return float(np.sqrt(world.second(at))) * typical
        case "growth_ratio" if not (world.bias and world.scale):
            return world.rise()
        case "white" | "random_walk" | "drift" if row["weighting"] == "geometric" and not (world.ar or world.bias):
            return world.sizes()[{"random_walk": "walk"}.get(row["quantity"], row["quantity"])] * typical
    return None


def is_true(row: Row, worlds: Mapping[str, World]) -> bool | None:
    """Whether the verdict of a row is true; None where it claims nothing, or where this is not known."""
    verdict, world = row["verdict"], worlds.get(row["tracker"])
    if verdict in (None, "undecided", "none"):
        return None
    claims: dict[str, Callable[[], bool | None]] = {
        "bias": lambda: None if world is None else (verdict == "yes") == (world.bias != 0),
        "growth_ratio": lambda: None if world is None else (verdict == "yes") == (world.rise() > MARGIN),
        "growth": lambda: None if world is None else _grows_so(world, verdict),
        "shape": lambda: None if world is None else _has_shape(world, verdict),
        "effect": lambda: _differ(row, verdict, worlds),
    }
    return claims.get(row["quantity"], lambda: None)()


def _grows_so(world: World, verdict: str) -> bool:
    known = {"white": world.rise() < MARGIN, "random walk": world.walk > 0, "drift": world.drift > 0}
    return bool(known.get(verdict, world.ar > 0))


def _has_shape(world: World, verdict: str) -> bool | None:
    if world.lives == "lost":
        return None
    heavy = not world.is_gaussian()
    return {"Gaussian": not heavy}.get(verdict, heavy if verdict in ("heavy-tailed", "contaminated") else False)


def _differ(row: Row, verdict: str, worlds: Mapping[str, World]) -> bool | None:
    """Whether two trackers differ by more than the margin, or nowhere."""
    first, second = (worlds.get(row[level]) for level in ("level_a", "level_b"))
    if row["factor"] != "tracker" or first is None or second is None or "lost" in (first.lives, second.lives):
        return None
    if row["of"] == "lifetime":
        alike = first.lives == second.lives
        return alike == (verdict == "no") if alike else None
    if row["of"] not in ("Phi", "core"):
        return None
    if row["of"] == "core" and any(not one.is_gaussian() or one.bias for one in (first, second)):
        return None
    power = 2 if row["of"] == "Phi" else 1
    ratios = [
        power * (first.log_scale() - second.log_scale()) + power / 2 * np.log(first.second(k) / second.second(k))
        for k in range(1, AGES)
    ]
    largest = float(np.abs(ratios).max())
    return (largest > np.log(MARGIN)) == (verdict == "yes")


def main() -> None:
    """Print how many verdicts and intervals are false."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--show", action="store_true", help="print sentences with a false verdict")
    given = parser.parse_args()
    counts: Counter[tuple[str, str, str]] = Counter()
    names = [name for name in WORLDS if name not in LEFT_OUT]
    for number in range(given.runs):
        rng = np.random.default_rng([given.seed, number])
        chosen = rng.choice(names, 2, replace=False)
        worlds = {name: WORLDS[name] for name in chosen}
        with tempfile.TemporaryDirectory() as folder:
            planted_run(Path(folder) / "run", worlds, int(rng.choice([8, 12])), rng)
            _count(tn.open_run(Path(folder) / "run"), worlds, counts, show=given.show)
        print(f"{number + 1} of {given.runs}: {', '.join(chosen)}", flush=True)
    print(f"\n{'topic':<12}{'quantity':<18}{'verdicts':>10}{'false':>8}{'intervals':>11}{'missed':>8}")
    for topic, quantity in sorted({key[:2] for key in counts}):
        cells = [counts[topic, quantity, what] for what in ("verdicts", "false", "intervals", "missed")]
        print(f"{topic:<12}{quantity:<18}" + "".join(f"{n:>{w}}" for n, w in zip(cells, (10, 8, 11, 8), strict=True)))


def _count(run: Any, worlds: Mapping[str, World], counts: Counter[tuple[str, str, str]], *, show: bool) -> None:
    """Add the rows of all findings of a run."""
    results = {row["id"]: row for row in run.results(columns="all").to_dicts()}
    for finding in run.findings().to_dicts():
        for row in (results[one] for one in dict.fromkeys(finding["rows"]) if one in results):
            key = (finding["topic"], str(row["quantity"]))
            claim = is_true(row, worlds)
            held = holds(row, true_value(row, worlds[row["tracker"]])) if row["tracker"] in worlds else None
            counts[*key, "verdicts"] += claim is not None
            counts[*key, "false"] += claim is False
            counts[*key, "intervals"] += held is not None
            counts[*key, "missed"] += held is False
            if show and claim is False:
                print(
                    f"FALSE {row['quantity']} {row['tracker']} {row['coordinate']} {row['verdict']}: {finding['text']}"
                )


if __name__ == "__main__":
    main()
