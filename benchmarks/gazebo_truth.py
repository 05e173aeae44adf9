"""How unsynchronised depth, or a clock offset, would change nu in the two simulated experiments of the paper.

    python -m benchmarks.gazebo_truth gazebo-linear late-depth --scenes 4 --frames 40 --out /tmp/linear
    python -m benchmarks.gazebo_truth gazebo-arvr clock-offset --scenes 4 --frames 40 --out /tmp/arvr

The presets are used as they are, except for the number of scenes and frames and the size of the images. With
``--untrimmed``, no track is dropped.
"""

import argparse
from pathlib import Path

import polars as pl

from benchmarks.effects.files import markdown
from benchmarks.effects.schema import EffectStatistic, Size
from benchmarks.effects.study import Effect, Options, Study, merged, run_study
from tracknoise.experiments.load import load_experiment
from tracknoise.report.cells import Cells
from tracknoise.words import DASH

AGES = (5, 20)


def _effects(name: str, unit: str, options: dict[float, Options]) -> tuple[Effect, ...]:
    """One effect of one size for each of several settings, so that all share their images."""
    return tuple(
        Effect(
            f"{name} {value:g}",
            "truth",
            unit,
            {Size.usual: changes},
            {Size.usual: f"{value:g} {'frame' if value <= 1 else 'frames'}"},
        )
        for value, changes in options.items()
    )


_LATE = _effects("late depth", "frames", {lag: {"faults": {"depth": {"lag_frames": lag}}} for lag in (0.5, 1.0, 2.0)})
_OFFSETS = _effects(
    "clock offset", "frames", {offset: {"faults": {"clock_frames": offset}} for offset in (0.25, 0.5, 1.0)}
)
EFFECTS = {"late-depth": _LATE, "clock-offset": _OFFSETS}
PRESETS = ("gazebo-linear", "gazebo-arvr")
_SHOWN = {
    EffectStatistic.mean_u: "nu, u",
    EffectStatistic.mean_v: "nu, v",
    EffectStatistic.second_moment: "second moment",
    EffectStatistic.core: "core",
}


def study(preset: str, fault: str, *, scenes: int, frames: int, width: int, untrimmed: bool) -> Study:
    """The experiment of a preset with one fault of several sizes."""
    experiment = load_experiment(preset)
    limits = {"worlds": scenes, "frames": frames, "width": width, "height": width * 3 // 4}
    return Study(
        merged(experiment.dataset.options, limits),
        EFFECTS[fault],
        {choice.kind: choice.options for choice in experiment.trackers},
        (Size.usual,),
        AGES,
        str(experiment.truth.population),
        100.0 if untrimmed else experiment.statistics.trim_percentile,
        str(experiment.statistics.trim_among),
    )


def table(changes: pl.DataFrame) -> Cells:
    """nu, second moment and core of each tracker and age: exact, and their changes by the fault."""
    rows = []
    for (tracker, age, name), part in changes.group_by("tracker", "age", "statistic", maintain_order=True):
        if name in _SHOWN:
            values = [_text(row) for row in part.to_dicts()]
            exact = part["clean"][0]
            rows.append([tracker, str(age), _SHOWN[name], DASH if exact is None else f"{exact:.4f}", *values])
    shown = changes["shown"].unique(maintain_order=True).to_list()
    caption = "nu and core in px, second moment in px²; changes by the fault ± half the 95 % interval over scenes."
    headings = ["tracker", "age", "", "exact", *shown]
    return Cells(caption, headings, rows, [False, True, False, *[True] * (len(headings) - 3)])


def _text(row: dict[str, float | None]) -> str:
    change, low, high = row["change"], row["change_low"], row["change_high"]
    if change is None:
        return DASH
    return f"{change:+.4f}" + ("" if low is None or high is None else f" ± {(high - low) / 2:.4f}")


def _print_done(part: tuple[str, Size], count: int, total: int) -> None:
    print(f"{count} of {total}: {part[0]}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("preset", choices=PRESETS)
    parser.add_argument("fault", choices=list(EFFECTS))
    parser.add_argument("--scenes", type=int, default=4)
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--width", type=int, default=400)
    parser.add_argument("--untrimmed", action="store_true")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    limits = {"scenes": given.scenes, "frames": given.frames, "width": given.width}
    chosen = study(given.preset, given.fault, **limits, untrimmed=given.untrimmed)
    changes = run_study(chosen, given.out, workers=given.workers, done=_print_done)
    print(markdown(table(changes)))


if __name__ == "__main__":
    main()
