"""A file of results that others can add trackers to: rounds, each with its data and what trackers made of them."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import TypeAdapter, ValidationError

from tracknoise.analysis.factors import RANKED
from tracknoise.analysis.shared_scenes import SceneNumbers, ranks, typical
from tracknoise.exceptions import SettingsError
from tracknoise.foreign_files import MIB, read_text
from tracknoise.inference.conventions import LEVEL
from tracknoise.report.answer import noise_to_set, number_of
from tracknoise.report.leaderboard import (
    UNKNOWN,
    Leaderboard,
    Standing,
    cost_of_step,
    number_of_role,
)
from tracknoise.report.report_data import ReportData
from tracknoise.report.scene_results import group_array, scene_results
from tracknoise.tables.costs import read_costs
from tracknoise.tables.enumerations import Trust
from tracknoise.tables.manifest import STATED, SequenceEntry, joined_fit
from tracknoise.tables.store import RunFolder

FORMAT = 1
_USABLE = (Trust.trusted, Trust.limited)
_MOST_BYTES = 64 * MIB
_LEFT_OUT = ("name", "trackers", "findings", "keep", "verify", "check")
"""Settings that the user chooses who adds a tracker, or that change no error."""


@dataclass(frozen=True, slots=True)
class TrackerResult:
    """What a tracker made of the data of a round.

    Attributes
    ----------
    kind, options
        Of the tracker, as in an experiment file.
    sigma
        What to set in the estimator of the round, and its interval, px; null where it is unknown.
    innovations_px
        What innovations suggest there, px.
    cpu_ms, machine
        CPU time of a step, ms, and of which machine; null where it was not measured.
    scenes
        What each scene measured.
    """

    kind: str
    options: dict[str, Any]
    sigma: tuple[float, float | None, float | None] | None
    innovations_px: float | None
    cpu_ms: float | None
    machine: str
    scenes: dict[str, SceneNumbers]


@dataclass(frozen=True, slots=True)
class StatedPoses:
    """How wrong the stated poses of a recording are, by those that reference tracks refined.

    Attributes
    ----------
    rotation_deg, position_m
        How errors of relative poses grow, per root frame; null where they are too small to tell.
    next_px, stated_px
        What they add to errors of tracks at age 1, and at `age`, px.
    left_px
        What is left of that by refined poses, px.
    age
        Frames.
    """

    rotation_deg: float | None
    position_m: float | None
    next_px: float | None
    stated_px: float
    left_px: float | None
    age: int | None


@dataclass(frozen=True, slots=True)
class Round:
    """Data, and what trackers made of them.

    Attributes
    ----------
    experiment, folder
        Settings without trackers, TOML; and the name of the folder of the data, empty where they are simulated.
    sequences
        What must be the same where a tracker is added, by sequence: frames, size of images, truth, hash of an image.
    groups
        Number of the group of each scene.
    versions
        Of the libraries that results depend on.
    margin
        Largest relative difference that counts as none.
    truth, why
        Verdict on the truth, and its reason.
    trackers
        By name.
    stated_poses
        How wrong they are; null where they are exact, or were not refined.
    """

    experiment: str
    folder: str
    sequences: dict[str, dict[str, str]]
    groups: dict[str, int]
    versions: dict[str, str]
    margin: float
    truth: str
    why: str
    trackers: dict[str, TrackerResult] = field(default_factory=dict)
    stated_poses: StatedPoses | None = None


@dataclass(frozen=True, slots=True)
class Results:
    """Rounds by name. `format`: of this structure."""

    rounds: dict[str, Round] = field(default_factory=dict)
    format: int = FORMAT


def read_results(path: Path) -> Results:
    """Read a file of results.

    Raises
    ------
    DataError, SettingsError
        If it cannot be read, is damaged, or of another format.
    """
    text = read_text(path, "a file of results", most=_MOST_BYTES)
    try:
        found = TypeAdapter(Results).validate_json(text)
    except (ValidationError, ValueError) as error:
        raise SettingsError(f"{path}: damaged ({_first_line(error)}), expected a file of results") from error
    if found.format != FORMAT:
        raise SettingsError(f"{path}: found format {found.format}, expected {FORMAT}")
    return found


def _first_line(error: Exception) -> str:
    if isinstance(error, ValidationError):
        problem = error.errors()[0]
        return f"{'.'.join(map(str, problem['loc']))}: {problem['msg']}".removeprefix(": ")
    return str(error).partition("\n")[0]


def results_json(results: Results) -> str:
    """Results as the text of a file."""
    rounds = {name: asdict(one) for name, one in sorted(results.rounds.items())}
    return json.dumps({"format": results.format, "rounds": rounds}, ensure_ascii=False, allow_nan=False) + "\n"


def round_of(data: ReportData) -> Round:
    """What the trackers of a run made of its data, at its lowest speed."""
    settings, sequences = data.shown(data.settings), data.manifest.sequences
    groups, scenes = scene_results(data)
    to_set, costs = {one.tracker: one for one in noise_to_set(data)}, read_costs(data.run)
    kinds = {choice.get("name") or choice["kind"]: choice for choice in settings["trackers"]}
    machine = ", ".join(f"{name} {value}" for name, value in data.manifest.machine.items())
    trackers = {}
    for tracker, numbers in scenes.items():
        one = to_set.get(tracker)
        trackers[tracker] = TrackerResult(
            kind=str(kinds[tracker]["kind"]),
            options=kinds[tracker].get("options", {}),
            sigma=None if one is None or one.sigma.value is None else (one.sigma.value, one.sigma.low, one.sigma.high),
            innovations_px=None if one is None else one.innovations.value,
            cpu_ms=costs.get(tracker),
            machine=machine,
            scenes=numbers,
        )
    return Round(
        experiment=tomlkit.dumps(_shared(settings)),
        folder=Path(data.settings["dataset"].get("root") or "").name,
        sequences={key: _identity(entry) for key, entry in sorted(sequences.items())},
        groups=groups,
        versions=dict(data.manifest.versions),
        margin=data.margin,
        truth=str(data.truth.verdict),
        why=data.truth.text,
        trackers=trackers,
        stated_poses=_stated_poses(data.run),
    )


def _stated_poses(run: RunFolder) -> StatedPoses | None:
    fit = joined_fit([entry.pose_fit for entry in run.manifest().sequences.values()])
    if fit is None or fit.stated_px is None:
        return None
    growth = fit.stated_errors or {}
    return StatedPoses(
        growth.get("rotation_deg_per_sqrt_frame"),
        growth.get("translation_m_per_sqrt_frame"),
        fit.next_px,
        fit.stated_px,
        fit.left_px,
        fit.age,
    )


def _shared(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of a round: without those of who measures it, and without the folder of the data."""
    shared = {name: value for name, value in settings.items() if name not in _LEFT_OUT}
    return shared | {"dataset": {name: value for name, value in shared["dataset"].items() if name != "root"}}


def _identity(entry: SequenceEntry) -> dict[str, str]:
    return {
        "frames": str(entry.n_frames),
        "size": f"{entry.width} x {entry.height} px",
        "truth": str(entry.truth),
        "poses": entry.leading_poses,
        "image": f"frame {entry.snapshot_frame}: {entry.sha256.get('snapshots')}",
    }


def joined(results: Results, name: str, made: Round) -> Results:
    """Results with a round, or with its trackers where there is one of this name; those of the same name are replaced.

    Raises
    ------
    SettingsError
        If the round that there is has other data, another truth, other settings or other libraries.
    """
    known = results.rounds.get(name)
    if known is None:
        return replace(results, rounds={**results.rounds, name: made})
    for what, found, expected in _differing(known, made):
        raise SettingsError(f"round {name}: {what}: found {found}, expected {expected} as in the results")
    return replace(
        results, rounds={**results.rounds, name: replace(known, trackers={**known.trackers, **made.trackers})}
    )


def _differing(known: Round, made: Round) -> Iterator[tuple[str, str, str]]:
    """What is another one in a new round, what was found, and what is expected.

    Simulated images may differ in their noise: it depends on the processor.
    """
    for library, version in known.versions.items():
        if library != "python" and made.versions.get(library, version) != version:
            yield f"version of {library}", made.versions[library], version
    if made.experiment != known.experiment:
        yield "settings", _line(made.experiment, known.experiment), _line(known.experiment, made.experiment)
    if set(made.sequences) != set(known.sequences):
        yield "sequences", ", ".join(made.sequences) or "none", ", ".join(known.sequences)
        return
    for key, facts in known.sequences.items():
        for what, expected in facts.items():
            found = made.sequences[key][what]
            if found != expected and (what != "image" or (_is_same_frame(found, expected) and known.folder)):
                yield f"{what} of {key}", found, expected


def _is_same_frame(image: str, other: str) -> bool:
    return image.partition(":")[0] == other.partition(":")[0]


def _line(text: str, other: str) -> str:
    """The first line that another text does not have."""
    lines = set(other.splitlines())
    return next((line for line in text.splitlines() if line not in lines), "nothing else")


def standings(of: Round) -> Leaderboard:
    """The leaderboard of a round.

    There are no ranks where poses were refined by tracks, which may favour trackers that are like these, or where
    scenes are too few.
    """
    group = group_array(of.groups)
    are_stated = {facts["poses"] for facts in of.sequences.values()} == {STATED}
    scenes = {tracker: {scene: one.scenes[scene] for scene in of.groups} for tracker, one in of.trackers.items()}
    ranked = ranks(scenes, group, margin=of.margin, level=LEVEL) if are_stated and len(scenes) > 1 else {}
    found = [
        Standing(
            tracker,
            "",
            UNKNOWN if one.sigma is None else number_of(*one.sigma),
            of.truth not in _USABLE,
            {role: number_of_role(role, value) for role, value in typical(scenes[tracker], group, LEVEL).items()},
            {role: ranked[tracker, role] for role in RANKED if (tracker, role) in ranked},
            cost_of_step(one.cpu_ms),
        )
        for tracker, one in of.trackers.items()
    ]
    return Leaderboard(tuple(found), RANKED, len(of.groups), len(of.groups), of.margin)
