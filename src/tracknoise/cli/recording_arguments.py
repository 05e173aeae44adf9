"""Arguments that name a recording: a format and a path, or a path alone whose format is recognised."""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tracknoise.cli.shared_options import text

if TYPE_CHECKING:
    from tracknoise.sequences.sequence import Reader
    from tracknoise.sequences.sequence import Sequence as Images
    from tracknoise.sequences.timed_poses import PosesOf

RecordingArgument = Annotated[
    list[str], typer.Argument(metavar="[READER] PATH", help="Folder of the recording; its format may come first.")
]
OptionOption = Annotated[
    list[str] | None,
    text("--option", metavar="NAME=VALUE", help="Option of the reader, depth=stereo, trajectory_of=body; repeatable."),
]
TrajectoryOption = Annotated[
    str | None,
    text("--trajectory", metavar="FILE", help="Poses in place of the recording's: TUM, EuRoC, KITTI or COLMAP."),
]
_DEPTH, _DEPTHS = "depth", ("recorded", "stereo")
_TRAJECTORY_OF = "trajectory_of"
"""Options that are none of the reader: keys of the sections `truth` and `dataset` of an experiment."""
_CAMERA_FILE, _LEVELS = "camera_file", "image_levels"


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording that was named on the command line.

    Attributes
    ----------
    reader, path
        Its reader, and the path of its data; None where the reader needs none.
    options
        Options of the reader that were given.
    stereo
        Whether depth is computed by stereo matching with a second camera, in place of recorded depth.
    trajectory
        File of the poses, in place of the recorded ones, as an absolute path; None for the recorded ones.
    trajectory_of
        What they are poses of.
    """

    reader: "Reader"
    path: Path | None
    options: dict[str, object]
    stereo: bool
    trajectory: str | None
    trajectory_of: "PosesOf"

    def view(self, sequence: "Images") -> "Images":
        """A sequence of the reader, with the depth that was asked for."""
        from tracknoise.sequences.stereo import with_stereo_depth

        return with_stereo_depth(sequence) if self.stereo else sequence


def named_recording(words: Sequence[str], *, images_alone: bool = False) -> tuple[str, Path | None]:
    """Name of the reader and path of the data, from one or two arguments.

    With `images_alone`, a folder of images in no known layout is one of the reader ``folder``.
    """
    from tracknoise.exceptions import SettingsError
    from tracknoise.sequences.reader_registry import READERS
    from tracknoise.sequences.recognise import recognise

    if len(words) > 2:
        raise SettingsError(f"found {len(words)} arguments, expected a format and a path, or a path alone")
    if len(words) == 2:
        return words[0], Path(words[1])
    (word,) = words
    if word in READERS and not READERS.load(word).needs_root:
        return word, None
    return recognise(Path(word), images_alone=images_alone), Path(word)


def open_recording(
    words: Sequence[str],
    options: Sequence[str] | None,
    *,
    trajectory: str | None = None,
    camera: Path | None = None,
) -> Recording:
    """The recording that arguments and options name; `camera`: file of the intrinsics, the reader's `camera_file`."""
    from tracknoise.exceptions import SettingsError
    from tracknoise.foreign_files import absolute
    from tracknoise.sequences.estimated_poses import posed_by
    from tracknoise.sequences.reader_registry import READERS, make_reader
    from tracknoise.sequences.timed_poses import PosesOf

    name, path = named_recording(words, images_alone=trajectory is not None or camera is not None)
    given = options_of(options)
    asked = not _is_of_reader(name, _DEPTH) and _DEPTH in given
    stereo = asked and _is_stereo(given.pop(_DEPTH))
    trajectory_of = given.pop(_TRAJECTORY_OF, PosesOf.camera)
    if trajectory_of not in list(PosesOf):
        raise SettingsError(f"--option {_TRAJECTORY_OF}={trajectory_of}: expected {' or '.join(PosesOf)}")
    of = PosesOf(str(trajectory_of))
    if camera is not None:
        if not _is_of_reader(name, _CAMERA_FILE):
            with_file = [kind for kind in READERS.names() if _is_of_reader(kind, _CAMERA_FILE)]
            raise SettingsError(f"--camera: the reader {name} takes none, expected one of {', '.join(with_file)}")
        given[_CAMERA_FILE] = str(camera)
    if _is_of_reader(name, _LEVELS) and _LEVELS not in given:
        given |= _levels(name, path, given)
    reader = make_reader(name, path, given)
    if trajectory is not None:
        trajectory = str(absolute(Path(), Path(trajectory)))
        reader = posed_by(reader, trajectory, of)
    return Recording(reader, path, given, stereo, trajectory, of)


def open_experiment(path: Path, options: Sequence[str] | None) -> Recording:
    """The recordings of an experiment file as it wants to see them, with other options of the reader where given."""
    from tracknoise.experiments.load import load_experiment
    from tracknoise.experiments.plan import planned
    from tracknoise.sequences.timed_poses import PosesOf

    experiment = load_experiment(path, options=options_of(options))
    dataset = experiment.dataset
    return Recording(planned(experiment), dataset.root, dict(dataset.options), False, None, PosesOf.camera)


def _levels(name: str, path: Path | None, options: dict[str, object]) -> dict[str, object]:
    """The option for images of 16 bits, by three of the first recording; none for others, or where they are damaged."""
    from tracknoise.exceptions import DataError
    from tracknoise.sequences.images import ALL_LEVELS, DeepImageError, likely_levels
    from tracknoise.sequences.reader_registry import make_reader
    from tracknoise.sequences.sequence import ImageReader

    def opened(more: dict[str, object]) -> "Images":
        reader = make_reader(name, path, options | more)
        if isinstance(reader, ImageReader):
            return reader.open_images(reader.recordings()[0])
        return reader.open(reader.sequences()[0])

    try:
        try:
            opened({}).image(0)
        except DeepImageError:
            deep = opened({_LEVELS: list(ALL_LEVELS)})
            return {_LEVELS: [*likely_levels(deep.image(place) for place in {0, len(deep) // 2, len(deep) - 1})]}
    except DataError:  # which is said where the recording is read
        pass
    return {}


def _is_of_reader(name: str, option: str) -> bool:
    """Whether a reader has an option of this name itself."""
    from tracknoise.sequences.reader_registry import READERS

    return option in getattr(READERS.load(name), "__dataclass_fields__", {})


def _is_stereo(depth: object) -> bool:
    from tracknoise.exceptions import SettingsError

    if depth not in _DEPTHS:
        raise SettingsError(f"--option {_DEPTH}={depth}: expected {' or '.join(_DEPTHS)}")
    return depth == _DEPTHS[1]


def options_of(texts: Sequence[str] | None) -> dict[str, object]:
    """Options of the reader by name, from ``NAME=VALUE``."""
    return dict(map(_option, texts or ()))


def _option(text: str) -> tuple[str, object]:
    """Name and value of an option; what is not TOML is a string."""
    from tracknoise.exceptions import SettingsError
    from tracknoise.text import parse_toml

    name, equals, value = text.partition("=")
    if not equals:
        raise SettingsError(f"--option {text!r}: no '=', expected NAME=VALUE")
    try:
        return name, parse_toml(f"value = {value}")["value"]
    except ValueError as error:
        if isinstance(error.__cause__, tomllib.TOMLDecodeError):
            return name, value
        raise SettingsError(f"--option {name}: {error}") from error
