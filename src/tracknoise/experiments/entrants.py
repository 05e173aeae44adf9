"""A tournament: many trackers on the same scenes, and what a step of each costs."""

import json
import time
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

import numpy as np
import tomlkit
from numpy.typing import NDArray

from tracknoise.experiments.load import resolve
from tracknoise.experiments.plan import make_trackers, open_batch, plan
from tracknoise.experiments.settings import (
    FROM_FILES,
    SECOND_CAMERA,
    Experiment,
    TrackerChoice,
    parse_experiment,
)
from tracknoise.measurement.tracking import TrackerSetup, second_images, start_tracker
from tracknoise.parsing_child import cpu_time_of_calls
from tracknoise.sequences import sequence as sequences
from tracknoise.trackers.tracker import Frame
from tracknoise.trackers.tracker_registry import load_preset, preset_names

MOST_FRAMES = 30
_KINDS = ("lucas-kanade", "correspondence", "dense-flow", "patch")
"""Kinds of trackers that take part with their default options, where they are not compared anyway."""
_WITHOUT_COSTS = FROM_FILES | {"external", "oracle"}
"""Kinds that read files, start programs or know the truth."""


def entrants(experiment: Experiment) -> list[str]:
    """Names of who takes part: trackers of an experiment, other kinds with their defaults, presets of one camera."""
    own = {choice.label: choice.kind for choice in experiment.trackers}
    kinds = [kind for kind in _KINDS if kind not in own]
    presets = (name for name in preset_names() if load_preset(name).tracker not in SECOND_CAMERA)
    return [*own, *kinds, *(name for name in presets if name not in own)]


def fitting(own: Iterable[TrackerChoice], kinds: Iterable[str]) -> list[TrackerChoice]:
    """Those of some trackers whose errors are of the same camera as those of trackers of these kinds."""
    of_round = {*kinds}
    are_of_second = bool(of_round) and of_round <= SECOND_CAMERA
    return [choice for choice in own if (choice.kind in SECOND_CAMERA) == are_of_second]


def of_round(experiment: str, name: str, trackers: Sequence[TrackerChoice], root: Path | None) -> Experiment:
    """The experiment of a round of results with other trackers.

    Parameters
    ----------
    experiment, name
        Settings of the round without trackers, TOML, and its name.
    trackers
        Those that take part.
    root
        Folder of the data; None where they are simulated.

    Raises
    ------
    SettingsError
        If the settings are not those of an experiment, or a tracker or the reader cannot be made.
    """
    chosen = tomlkit.dumps({"trackers": [one.model_dump(mode="json", exclude_none=True) for one in trackers]})
    text = f"name = {json.dumps(name)}\n{experiment}\n{chosen}"
    return resolve(parse_experiment(text, place=f"round {name}").with_root(root))


def step_costs(experiment: Experiment, measured: Collection[str]) -> dict[str, float]:
    """Mean CPU time of a step, ms, of each tracker alone, in the first frames of a sequence, at full rate.

    What a tracker does before its first step counts; reading and decoding images do not. Trackers that read files,
    start programs or know the truth are left out.

    Parameters
    ----------
    experiment
        The trackers, and the data.
    measured
        Keys of sequences that were measured. The first of them in the order of the experiment is taken, and at most
        `MOST_FRAMES` frames.

    Raises
    ------
    TracknoiseError
        If the sequence cannot be read any more, or a tracker fails.
    """
    task = next((task for task in plan(experiment) if task.key in measured), None)
    if task is None:
        return {}
    (sequence,) = open_batch([task])
    images = [sequence.image(index) for index in range(min(len(sequence), MOST_FRAMES))]
    kinds = {choice.label: choice.kind for choice in experiment.trackers}
    timed = {name: item for name, item in make_trackers(experiment).items() if kinds[name] not in _WITHOUT_COSTS}
    setups = [TrackerSetup(name, settings, speed=1) for name, settings in timed.items()]
    return {item.tracker: _cost_ms(item, sequence, images, experiment.seed) for item in setups}


def _cost_ms(setup: TrackerSetup, sequence: sequences.Sequence, images: list[NDArray[np.uint8]], seed: int) -> float:
    read_second = second_images(sequence)
    frames = [Frame(index, image, read_second(index)) for index, image in enumerate(images)]
    started = _cpu_s()
    tracker = start_tracker(setup, sequence, None, seed, len(images))
    for frame in frames:
        tracker.step(frame)
    return round(1e3 * (_cpu_s() - started) / len(frames), 3)


def _cpu_s() -> float:
    """Time of the processor of this process, and of networks that it runs in another, seconds."""
    return time.process_time() + cpu_time_of_calls()
