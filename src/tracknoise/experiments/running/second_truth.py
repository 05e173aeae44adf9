"""The second truth of an experiment: the same sequences with other poses, or with other options of the reader."""

from dataclasses import replace
from functools import partial

from tracknoise.experiments.running.plan import Task, open_batch
from tracknoise.experiments.settings import SecondTruthSettings
from tracknoise.sequences.other_poses import with_trajectory
from tracknoise.sequences.sequence import Sequence


def open_second(tasks: list[Task]) -> list[Sequence]:
    """The sequences of a batch with their second truth; none if the experiment has no second truth.

    Raises
    ------
    TracknoiseError
        If their data cannot be used.
    """
    second = tasks[0].experiment.truth.second
    if second is None:
        return []
    if second.trajectory is not None:
        return open_batch(tasks, change=partial(_with_trajectory, second, second.trajectory))
    experiment = tasks[0].experiment
    for name, value in second.options.items():
        experiment = experiment.with_option(name, value)
    return open_batch([replace(task, experiment=experiment) for task in tasks])


def _with_trajectory(second: SecondTruthSettings, template: str, sequence: Sequence) -> Sequence:
    path = sequence.id.expand(template, speed=1)
    return with_trajectory(sequence, path, time_shift_s=second.time_shift_s)
