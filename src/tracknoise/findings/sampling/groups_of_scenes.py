"""Groups of scenes of a run: those of the experiment, or those that readers know."""

from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase

from tracknoise.findings.sampling.groups import SceneGroups
from tracknoise.tables.manifest import SequenceEntry
from tracknoise.tables.store import RunFolder


def groups_of_run(folder: RunFolder) -> SceneGroups:
    """Groups of the scenes of a run, as its experiment declares them.

    Parameters
    ----------
    folder
        Of the run.

    Raises
    ------
    StoreError
        If its manifest or its settings are missing or damaged.
    """
    settings = folder.settings()
    return groups_of_scenes(folder.manifest().sequences, settings["dataset"].get("groups"))


def groups_of_scenes(
    sequences: Mapping[str, SequenceEntry], declared: Mapping[str, Sequence[str]] | None
) -> SceneGroups:
    """Group of each scene that has one, and the scenes that are copies. Groups of readers get copies from elsewhere.

    Parameters
    ----------
    sequences
        Of the manifest.
    declared
        Patterns of the names of scenes by group, the first that fits counts; None for what the readers know.
    """
    found: dict[tuple[str, str], str] = {}
    for entry in sequences.values():
        scene = entry.sequence.scene
        group = entry.group if declared is None else _declared(scene, declared)
        if group is not None:
            found[entry.sequence.dataset, scene] = group
    copies = _copies(sequences)
    if declared is None:
        for (dataset, scene), original in copies.items():
            found[dataset, scene] = found.setdefault((dataset, original), f"copies of {original}")
    return SceneGroups(found, copies)


def _copies(sequences: Mapping[str, SequenceEntry]) -> dict[tuple[str, str], str]:
    """Scenes whose image in the run folder has the pixels of that of an earlier scene, and the earlier one."""
    first: dict[tuple[str, str], str] = {}
    found: dict[tuple[str, str], str] = {}
    for _, entry in sorted(sequences.items()):
        dataset, scene = entry.sequence.dataset, entry.sequence.scene
        original = first.setdefault((dataset, entry.image), scene) if entry.image else scene
        if original != scene:
            found.setdefault((dataset, scene), found.get((dataset, original), original))
    return found


def _declared(scene: str, groups: Mapping[str, Sequence[str]]) -> str | None:
    fitting = (group for group, patterns in groups.items() if any(fnmatchcase(scene, pattern) for pattern in patterns))
    return next(fitting, None)
