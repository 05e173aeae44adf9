"""A first experiment file for a recording."""

import shlex
from collections.abc import Mapping
from itertools import chain
from pathlib import Path

import tomlkit

from tracknoise.sequences.reader_registry import READERS, reader_defaults
from tracknoise.sequences.sequence import SWEPT, Reader, Sequence, second_of
from tracknoise.sequences.stereo import with_stereo_depth
from tracknoise.sequences.timed_poses import PosesOf
from tracknoise.text import counted
from tracknoise.trackers.rejection import Model, Rejection

_MOST_NAMED = 6
_TRACKERS = ("lucas-kanade", "correspondence")
_FEW_FRAMES = 60
"""Shorter sequences are measured at speed 1 only."""
_DEFAULT = Rejection()
_REJECTION = (
    f"# {' and '.join(_TRACKERS)} reject outliers by a {_DEFAULT.model}: matches that are more than",
    f"# {_DEFAULT.threshold_px:g} px off one {_DEFAULT.model} between two frames that they see. It describes planes,",
    "# rotation alone, and a baseline so small that parallax stays below that. With more parallax it rejects correct",
    "# matches too. For general scenes with parallax, choose the fundamental matrix instead: it describes every rigid",
    "# scene, but does not see errors along epipolar lines, and a plane or rotation alone does not determine it.",
)
"""What the default of outlier rejection means."""


def experiment_template(
    reader: Reader,
    path: Path | None,
    options: Mapping[str, object],
    *,
    name: str = "",
    stereo: bool = False,
    trajectory: str | None = None,
    trajectory_of: PosesOf = PosesOf.camera,
) -> str:
    """Experiment file (TOML) that measures all sequences of a reader with two trackers.

    Parameters
    ----------
    reader
        Of the recording.
    path
        Folder of the data; None where the reader needs none.
    options
        Options of the reader that differ from the defaults; relative paths start from the current folder, and are
        written as absolute ones.
    name
        Of the experiment, and so of its run folder; by default that of the recording.
    stereo
        Whether depth is computed by stereo matching with a second camera, in place of recorded depth.
    trajectory
        File of poses that the reader's were replaced by, an absolute path; None for none.
    trajectory_of
        What these are poses of.

    Raises
    ------
    DataError
        If the reader finds no sequence, cannot open the first or read its first image, or that has no second camera for
        depth from stereo.
    """
    listed = reader.sequences()
    first = reader.open(listed[0])
    first.image(0)
    if stereo:
        first = with_stereo_depth(first)
    scenes = list(dict.fromkeys(item.scene for item in listed))
    name = name or (name_of(path).strip(".") if path else "") or reader.name
    given = READERS.with_paths_from(Path(), reader.name, options)
    poses = {} if trajectory is None else {"trajectory": trajectory, "trajectory_of": str(trajectory_of)}
    dataset = [_dataset(reader, path, scenes, poses), _options(reader.name, given)]
    named = _named_again(reader, path, given, poses)
    parts = [_heading(name, named, first), *dataset, _truth(first, stereo=stereo), _ESTIMATOR, _trackers(first)]
    return "\n".join(chain.from_iterable(parts)) + "\n"


def name_of(recording: Path) -> str:
    """Name of a folder, or of a file without its ending."""
    return recording.resolve().stem if recording.is_file() else recording.resolve().name


def _named_again(reader: Reader, path: Path | None, options: Mapping[str, object], poses: Mapping[str, str]) -> str:
    """The recording as arguments of a command."""
    words = (
        [reader.name, str(path.resolve())]
        if path and (options or poses)
        else [str(path.resolve()) if path else reader.name]
    )
    for key, value in options.items():
        words += ["--option", f"{key}={value}" if isinstance(value, str) else _entry(key, value).replace(" = ", "=", 1)]
    if "trajectory" in poses:
        words += ["--trajectory", poses["trajectory"]]
    if "trajectory_of" in poses:
        words += ["--option", f"trajectory_of={poses['trajectory_of']}"]
    return shlex.join(words)


def _heading(name: str, checked: str, first: Sequence) -> list[str]:
    speeds = [1] if len(first) < _FEW_FRAMES else [1, 2, 4]
    return [
        f"# {counted(len(first), 'frame')} of {first.camera.width}x{first.camera.height} px in the first sequence.",
        *(f"# Note of the reader: {' '.join(note.split())}" for note in first.notes),
        f"# Check the recording before you measure it: tracknoise check {checked}",
        "# All keys of this file: docs/experiment.schema.json in the repository",
        _entry("name", name),
        f"{_entry('speeds', speeds)}  # at speed s, trackers see every s-th frame",
    ]


def _dataset(reader: Reader, path: Path | None, scenes: list[str], poses: Mapping[str, str]) -> list[str]:
    named = scenes[:_MOST_NAMED]
    more = f" (and {len(scenes) - len(named)} more)" if len(scenes) > len(named) else ""
    root = [] if path is None else [_entry("root", str(path.resolve()))]
    return [
        "",
        "[dataset]",
        _entry("reader", reader.name),
        *root,
        *(_entry(key, value) for key, value in poses.items()),
        f"# {_entry('scenes', named)}  # to measure only some{more}",
        "# max_frames = 300  # to measure only the first frames of each sequence",
    ]


def _options(name: str, options: Mapping[str, object]) -> list[str]:
    """The options that were chosen; the defaults of all as comments."""
    shown = filter(None, reader_defaults(name).splitlines())
    lines = [line.replace("[", "[dataset.options.", 1) if line.startswith("[") else line for line in shown]
    defaults = [line if line.startswith("#") else f"# {line}" for line in lines]
    if not defaults:
        return []
    return ["", "[dataset.options]", *(_entry(key, value) for key, value in options.items()), *defaults]


def _truth(first: Sequence, *, stereo: bool) -> list[str]:
    """Depth from stereo matching if chosen, and the default kind of truth as a comment; nothing if none is possible."""
    if not first.truths:
        return []
    best = first.truths[0]
    why = "there is no depth: it is computed from the images of other frames" if best == SWEPT else "the default here"
    if best == SWEPT and second_of(first) is not None:
        why += " and of the second camera"
    depth = [_entry("depth", "stereo")] if stereo else []
    return ["", "[truth]", *depth, f"# {_entry('kind', best)}  # {why}"]


def _trackers(sequence: Sequence) -> list[str]:
    """Both trackers with how they reject outliers and, as comments, the other choice and further trackers."""
    choice = f'# options = {{ rejection = {{ model = "{Model.fundamental}" }} }}'
    tables = (("", "[[trackers]]", _entry("kind", kind), choice) for kind in _TRACKERS)
    second = [] if second_of(sequence) is None else _SECOND_CAMERA
    return ["", *_REJECTION, *chain.from_iterable(tables), *_OTHER_TRACKERS, *second]


_ESTIMATOR = (
    "",
    "# [estimator]  # what to set in it leads the findings; all of them: tracknoise export",
    '# name = "openvins"',
)
_OTHER_TRACKERS = (
    "",
    "# [[trackers]]  # with the settings of a system; all of them: tracknoise trackers",
    '# preset = "openvins"',
    "",
    "# [[trackers]]  # tracks of your own front end; other files, and a program: docs/your-tracks.md",
    '# kind = "imported"',
    '# name = "my front end"',
    '# options = { path = "tracks/{scene}.csv" }  # columns track, image (or frame), u_px, v_px',
)
_SECOND_CAMERA = (
    "",
    "# [[trackers]]  # the features of the first one in the images of the second camera",
    '# kind = "second-view"',
    f'# options = {{ of = "{_TRACKERS[0]}" }}',
)


def _entry(key: str, value: object) -> str:
    return tomlkit.dumps({key: value}).strip()
