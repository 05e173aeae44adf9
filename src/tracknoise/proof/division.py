"""Which windows of a run something is learned from, and which it is tried on.

Scenes of one group, such as pieces of one recording, are not independent. Where a run has enough groups to resample
them, each group counts as one scene: it is learned from or tried on as a whole, and intervals are over groups.

A single scene is cut in two: its earlier windows are learned from, and its later ones tried. Nothing is decided then.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from tracknoise.exceptions import SettingsError
from tracknoise.findings.sampling.groups import JoinedScenes, SceneGroups
from tracknoise.findings.sampling.groups_of_scenes import groups_of_run
from tracknoise.findings.wording import count
from tracknoise.noise_models.model import Training
from tracknoise.proof.problem import Problem
from tracknoise.tables.store import RunFolder

_LEAST_SCENES, _LEAST_TIMES = 2, 2
_SAME_SCENES = "The model was fitted to all scenes with windows, so that the gain of whole tracks may be too large."
_ONE_SCENE = "There is one scene. Its first half was learned from, its second half tried. One scene decides nothing."
_SAME_GROUPS = "Scenes of one group are not independent of each other: what is found holds for these groups only."


@dataclass(frozen=True, slots=True, eq=False)
class Division:
    """Windows of training scenes, and of the others.

    Attributes
    ----------
    learned_from, tested : list of Problem
    limits : tuple of str
        Sentences on what the division does not separate.
    """

    learned_from: list[Problem]
    tested: list[Problem]
    limits: tuple[str, ...]


def divided(folder: RunFolder, problems: Sequence[Problem], training: Training) -> Division:
    """Windows of a run, divided.

    Scenes that the model was fitted to are used for training if there are others. If it was fitted to none of them or
    to all, every second scene is, or every second group where these count as scenes. One scene is cut in two.

    Raises
    ------
    SettingsError
        If there are fewer than two windows that begin at different frames or are of different scenes.
    """
    scenes = scenes_of(problems)
    dataset, groups = _dataset(folder), groups_of_run(folder)
    fitted = training.scenes_of(dataset)
    if len(scenes) < _LEAST_SCENES:
        return _halves(folder, problems, is_fitted=not fitted.isdisjoint(scenes))
    learned = fitted.intersection(scenes)
    if len(learned) in (0, len(scenes)):
        joined = JoinedScenes.of({dataset: scenes}, groups)
        learned = _every_second([joined.names.get((dataset, scene), scene) for scene in scenes], scenes)
    tested = sorted(set(scenes) - learned)
    others = sorted((learned | fitted).difference(tested))
    limits = {
        _SAME_SCENES: bool(fitted.intersection(tested)),
        _SAME_GROUPS: _are_alike(JoinedScenes.of({dataset: tested}, groups), groups, dataset, tested, others),
    }
    return Division(
        learned_from=[problem for problem in problems if problem.scene in learned],
        tested=[problem for problem in problems if problem.scene in tested],
        limits=tuple(limit for limit, applies in limits.items() if applies),
    )


def _halves(folder: RunFolder, problems: Sequence[Problem], *, is_fitted: bool) -> Division:
    """The earlier windows of one scene, and the later ones; the model may be fitted to it."""
    starts = sorted({problem.start for problem in problems})
    if len(starts) < _LEAST_TIMES:
        found = f"usable windows at {count(len(starts), 'time')} in {count(len(scenes_of(problems)), 'scene')}"
        raise SettingsError(f"{folder.path}: found {found}, expected two times or scenes; shorter windows may help")
    middle = starts[len(starts) // 2]
    return Division(
        learned_from=[problem for problem in problems if problem.start < middle],
        tested=[problem for problem in problems if problem.start >= middle],
        limits=(_ONE_SCENE, _SAME_SCENES) if is_fitted else (_ONE_SCENE,),
    )


def with_joined_scenes(folder: RunFolder, problems: Sequence[Problem]) -> list[Problem]:
    """Windows whose scenes are named by their groups, where these count as scenes."""
    dataset = _dataset(folder)
    names = JoinedScenes.of({dataset: scenes_of(problems)}, groups_of_run(folder)).names
    return [replace(problem, scene=names.get((dataset, problem.scene), problem.scene)) for problem in problems]


def scenes_of(problems: Sequence[Problem]) -> tuple[str, ...]:
    """Names of the scenes of windows, sorted."""
    return tuple(sorted({problem.scene for problem in problems}))


def _dataset(folder: RunFolder) -> str:
    """Name of the dataset: a run has one."""
    return next(iter(folder.manifest().sequences.values())).sequence.dataset


def _every_second(names: Sequence[str], scenes: Sequence[str]) -> frozenset[str]:
    """Scenes whose names, which several may share, are every second one."""
    chosen = set(list(dict.fromkeys(names))[::2])
    return frozenset(scene for scene, name in zip(scenes, names, strict=True) if name in chosen)


def _are_alike(
    joined: JoinedScenes, groups: SceneGroups, dataset: str, tested: Sequence[str], others: Sequence[str]
) -> bool:
    """Whether tested scenes that are not joined are of one group, or of one that something was learned from."""
    number = groups.of(dataset, [*tested, *others]).tolist()
    own, learned = number[: len(tested)], number[len(tested) :]
    return (not joined.names and len({*own}) < len(own)) or not {*own}.isdisjoint(learned)
