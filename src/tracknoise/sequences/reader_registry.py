"""Readers by name: the built-in ones, and those of other packages' entry points ``tracknoise.sequences``."""

from collections.abc import Iterator, Mapping
from collections.abc import Sequence as Items
from pathlib import Path

from tracknoise.checks import path_of
from tracknoise.exceptions import SettingsError, UnknownNameError
from tracknoise.plugins import Plugins, plugin_defaults
from tracknoise.sequences.sequence import Reader, Sequence, SharingReader, with_known_facts
from tracknoise.sequences.views import chosen_frames
from tracknoise.tables.identity import SequenceId

READERS: Plugins[Reader] = Plugins(
    what="reader",
    group="tracknoise.sequences",
    built_in={
        "colmap": "tracknoise.sequences.colmap:Colmap",
        "dtu": "tracknoise.paper.dtu:Dtu",
        "euroc": "tracknoise.sequences.euroc:Euroc",
        "folder": "tracknoise.sequences.folder:Folder",
        "kitti": "tracknoise.sequences.kitti:Kitti",
        "kitti-odometry": "tracknoise.sequences.kitti_odometry:KittiOdometry",
        "nerfstudio": "tracknoise.sequences.nerfstudio:Nerfstudio",
        "rosbag": "tracknoise.sequences.rosbag:Rosbag",
        "sevenscenes": "tracknoise.sequences.sevenscenes:SevenScenes",
        "simulated": "tracknoise.sequences.simulated:Simulated",
        "tartanair": "tracknoise.sequences.tartanair:TartanAir",
        "tum": "tracknoise.sequences.tum:Tum",
    },
    needs=("name", "description", "needs_root", "sequences", "open"),
    given=frozenset({"root"}),
)


def make_reader(name: str, root: Path | None = None, options: Mapping[str, object] | None = None) -> Reader:
    """Make a reader from its name, the folder of its data and its own options.

    Raises
    ------
    UnknownNameError
        If there is no reader of that name.
    SettingsError
        If the folder is missing where the reader needs one, or an option is unknown or missing, or has a wrong type or
        value; the message names it.
    """
    if not READERS.load(name).needs_root:
        return READERS.make(name, options)
    if root is None:
        raise SettingsError(f"reader {name!r} needs the folder of its data: `root` or --data")
    return READERS.make(name, options, given={"root": Path(root)})


def reader_defaults(name: str) -> str:
    """The options of a reader with their defaults as TOML, those without a default as comments.

    Raises
    ------
    UnknownNameError
        If there is no reader of that name.
    """
    return plugin_defaults(READERS, name)


def select(reader: Reader, scene: str | None = None, lighting: str | None = None) -> SequenceId:
    """The first sequence of a reader that has the given scene and lighting; None means any."""
    listed = reader.sequences()
    matching = [sequence for sequence in listed if scene in (None, sequence.scene)]
    if not matching:
        raise UnknownNameError("scene", str(scene), {sequence.scene for sequence in listed})
    lit = [sequence for sequence in matching if lighting in (None, sequence.lighting)]
    if not lit:
        raise UnknownNameError("lighting", str(lighting), {sequence.lighting for sequence in matching})
    return lit[0]


def open_together(reader: Reader, sequences: list[SequenceId]) -> list[Sequence]:
    """Open several sequences of one scene, which share files if the reader supports it.

    Raises
    ------
    TracknoiseError
        As `Reader.open`.
    """
    if isinstance(reader, SharingReader):
        return [*map(with_known_facts, reader.open_together(sequences))]
    return [with_known_facts(reader.open(sequence)) for sequence in sequences]


def open_sequence(
    reader: str,
    root: str | Path | None = None,
    *,
    scene: str | None = None,
    lighting: str | None = None,
    frames: int | Items[int] | None = None,
    **options: object,
) -> Sequence:
    """Open one sequence of a data set.

    Parameters
    ----------
    reader
        Name of the format: see `READERS.names()`.
    root
        Folder of the data; None for ``simulated``.
    scene, lighting
        Which sequence; by default the first.
    frames
        Which of its frames: first, last and step, the last included. They are numbered from 0 again. By default all.
        A single number is the option `frames` of the reader ``simulated``.
    **options
        Options of the reader.

    Raises
    ------
    TracknoiseError
        If a name is unknown, an option is wrong, or the data cannot be used.
    """
    if isinstance(frames, int):
        options, frames = {**options, "frames": frames}, None
    made = make_reader(reader, None if root is None else path_of("root", root), options)
    return chosen_frames(with_known_facts(made.open(select(made, scene, lighting))), frames)


def open_sequences(reader: str, root: str | Path | None = None, **options: object) -> Iterator[Sequence]:
    """Open every sequence of a data set in turn.

    Parameters
    ----------
    reader
        Name of the format: see `READERS.names()`.
    root
        Folder of the data; None for ``simulated``.
    **options
        Options of the reader.

    Yields
    ------
    Sequence
        Each is opened when it is requested.

    Raises
    ------
    TracknoiseError
        If a name is unknown, an option is wrong, or the data cannot be used.
    """
    made = make_reader(reader, None if root is None else path_of("root", root), options)
    for sequence in made.sequences():
        yield with_known_facts(made.open(sequence))
