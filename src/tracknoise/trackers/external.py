"""A program of your own that follows points through a folder of images: the folder protocol of the VOT challenge."""

import os
import shlex
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

import cv2
import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from tracknoise.checks import Positive, require, require_bounds, require_list
from tracknoise.exceptions import DataError, SettingsError, TrackerError
from tracknoise.foreign_files import absolute, is_there, number_in, read_text, require_regular
from tracknoise.guarded_folder import GuardedFolder, GuardLostError, guarded_folder
from tracknoise.opened_files import absolute_path, note, note_stated, note_unknown
from tracknoise.processes import signal_name
from tracknoise.text import counted
from tracknoise.trackers.detection import MOST_FEATURES, Detection
from tracknoise.trackers.imported import ImportedTracker
from tracknoise.trackers.imported_rows import Tracks, are_far, expected_near
from tracknoise.trackers.refinement import Refinement
from tracknoise.trackers.spacing import places_in
from tracknoise.trackers.tracker import Frame, SequenceContext, StatedPoints

_ABSENT, _WORDS = "0", {"true": 1.0, "false": 0.0}


@dataclass(frozen=True, slots=True)
class External:
    """Settings of a program that follows points, by the folder protocol of the VOT challenge of points.

    The command is started once per sequence and speed, in a folder of its own with these files:

    - ``frames_color.txt``: absolute paths of the images that the tracker sees (8-bit PNG), one per line.
    - ``query_N.txt``, one per point, N from 1: the number of the image in which it begins, from 0, and in the next line
      its position ``x,y``, px. The centre of the first pixel is 0,0.

    It must end with code 0 and leave ``output_N.txt`` for each point, one line per image: ``x,y``, or ``0`` where the
    point is not seen, and in the images before its own. In ``output_N_visible.txt``, if there is one, lines of ``0`` or
    ``false`` hide points too. The position in the first image of a point is that of the query, whatever is written.

    Parameters
    ----------
    command
        The program and its arguments. It is looked up on the path; other words are passed as they are.
    script
        A file that is passed as the last argument, with its absolute path.
    inputs
        Files and folders that the command reads besides, such as modules, weights and settings; ``[]`` if there are
        none. A run measures again what was measured with another version of them, of the program, the script, or a file
        that an argument names. None: they are not known, and a run that is started again measures everything again.
    timeout_s
        Longest time that the command may take for one sequence at one speed, seconds.
    detection
        Where points begin.
    every
        Points begin in each of so many images that the tracker sees, from the first one on. None: in the first only.
    max_features
        Number of points that begin in one image, at most.
    refine
        Whether positions are refined by Lucas-Kanade: see `tracknoise.trackers.refinement.Refinement`.
    """

    kind: ClassVar[str] = "external"
    description: ClassVar[str] = "points followed by a program of your own: the folder protocol of the VOT challenge"
    needs_frames_only: ClassVar[bool] = True
    reports_causes: ClassVar[bool] = False

    command: tuple[str, ...]
    script: Path | None = None
    inputs: tuple[Path, ...] | None = None
    timeout_s: Positive = 600.0
    detection: Detection = field(default_factory=Detection)
    every: Annotated[int, Ge(1)] | None = 10
    max_features: Annotated[int, Ge(1), Le(MOST_FEATURES)] = 100
    refine: Refinement = field(default_factory=Refinement)

    def __post_init__(self) -> None:
        require_list("command", self.command, "a program and its arguments")
        words = tuple(self.command)
        good = len(words) > 0 and all(_is_argument(word) for word in words) and bool(words[0])
        require(good, "command", self.command, "a program and its arguments, without null characters or surrogates")
        object.__setattr__(self, "command", words)
        if self.inputs is not None:
            require_list("inputs", self.inputs, "files and folders")
            object.__setattr__(self, "inputs", tuple(map(Path, self.inputs)))
        require_bounds(self)

    def start(self, context: SequenceContext) -> ImportedTracker:
        """Run the command on the images of one sequence at one speed.

        Raises
        ------
        DataError
            If the script or a file that is stated is missing.
        SettingsError
            If the command cannot be started.
        TrackerError
            If it takes too long, fails, or writes something else than was agreed.
        """
        self.detection.require_usable()
        if context.images is None:
            raise SettingsError("external: images come one by one, expected all of a sequence before the first step")
        with guarded_folder("tracknoise-external-") as guarded:
            folder = _Folder(guarded.path)
            offset, uv, response = folder.written(context.images(), self)
            if len(offset):
                _run(self, guarded)
            tracks = folder.read(offset, uv, response, context)
        return ImportedTracker(tracks, refine=self.refine)


@dataclass(slots=True)
class _Folder:
    """The folder that a command is given."""

    path: Path
    n_images: int = 0

    def written(
        self, images: Iterator[NDArray[np.uint8]], settings: External
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float32]]:
        """Write images and queries. Returns the image (n,), the position (n, 2) and the response (n,) of each query."""
        paths, parts = [], []
        for number, image in enumerate(images):
            paths.append(self.path / "images" / f"{number:06d}.png")
            paths[-1].parent.mkdir(exist_ok=True)
            cv2.imwrite(str(paths[-1]), image)
            if number == 0 or (settings.every is not None and number % settings.every == 0):
                frame = Frame(number, image)
                births = places_in(frame.size, settings.detection).births(frame, settings.max_features)
                parts.append((np.full(len(births[0]), number, dtype=np.int64), *births))
        self.n_images = len(paths)
        (self.path / "frames_color.txt").write_text("".join(f"{path}\n" for path in paths), encoding="utf-8")
        offset, uv, response = (np.concatenate(part) for part in zip(*parts, strict=True))
        for number, (first, (x, y)) in enumerate(zip(offset.tolist(), uv.tolist(), strict=True), 1):
            (self.path / f"query_{number}.txt").write_text(f"{first}\n{x!r},{y!r}\n", encoding="utf-8")
        return offset, uv, response

    def read(
        self,
        offset: NDArray[np.int64],
        uv: NDArray[np.float64],
        response: NDArray[np.float32],
        context: SequenceContext,
    ) -> Tracks:
        """What the command wrote about all queries, in frames of the nominal sequence."""
        speed = context.speed
        parts: list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]]] = []
        for number, (first, position) in enumerate(zip(offset.tolist(), uv, strict=True), 1):
            stated, visible = self._output(number)
            stated[:first] = np.nan
            stated[first], visible[first] = position, True
            rows = np.flatnonzero(np.isfinite(stated[:, 0]))
            parts.append((np.full(len(rows), number - 1, dtype=np.int64), rows * speed, stated[rows], visible[rows]))
        nothing = np.empty(0, dtype=np.int64)
        track, frame, at, seen = (
            np.concatenate([empty, *(part[place] for part in parts)])
            for place, empty in enumerate((nothing, nothing, np.empty((0, 2)), np.empty(0, dtype=np.bool_)))
        )
        points = None if seen.all() else StatedPoints(track, frame, at, seen)
        track, frame, at = track[seen], frame[seen], at[seen]
        for row in np.flatnonzero(are_far(at, context.size))[:1]:
            place = f"output_{track[row] + 1}.txt:{frame[row] // speed + 1}"
            raise TrackerError(f"external: found {at[row].tolist()} in {place}, expected {expected_near(context.size)}")
        order = np.lexsort((track, frame))
        first_row = frame == offset[track] * speed
        responses = np.where(first_row, response[track], np.float32(np.nan)).astype(np.float32)
        quality: Mapping[str, NDArray[np.float32]] = {}
        return Tracks(track[order], frame[order], at[order], responses[order], quality, points=points)

    def _output(self, number: int) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Positions (n, 2) of a query in all images, NaN where none is stated, and whether it is visible (n,)."""
        name = f"output_{number}.txt"
        stated, visible = np.full((self.n_images, 2), np.nan), np.ones(self.n_images, dtype=np.bool_)
        for row, text in enumerate(self._lines(name)):
            if text != _ABSENT:
                stated[row] = _position(text, f"{name}:{row + 1}")
        of_visible = f"output_{number}_visible.txt"
        if (self.path / of_visible).exists():
            lines = self._lines(of_visible)
            visible[[_is_hidden(text, f"{of_visible}:{row}") for row, text in enumerate(lines, 1)]] = False
        return stated, visible

    def _lines(self, name: str) -> list[str]:
        try:
            text = read_text(self.path / name, counted(self.n_images, "line"))
        except DataError as error:
            raise TrackerError(f"external: {name}: {error.found}, expected {error.expected}") from error
        lines = [line.strip() for line in text.replace("\r\n", "\n").replace("\r", "\n").split("\n")]
        lines = lines[:-1] if lines[-1] == "" else lines
        if len(lines) != self.n_images:
            found = f"{counted(len(lines), 'line')} in {name}"
            raise TrackerError(f"external: found {found}, expected {self.n_images}, one per image")
        return lines


def _note_files(settings: External, words: Sequence[str]) -> None:
    """Let a run note the files that a command consists of and names, and those that are stated.

    An argument may be the name of a file, or end with one, as in ``--weights=/models/a.pth``.
    """
    program = shutil.which(words[0])
    endings = [Path(ending) for word in words for ending in (word, word.partition("=")[2])]
    for path in [*([] if program is None else [Path(program)]), *filter(Path.is_absolute, endings)]:
        note_stated(path)
    for path in settings.inputs or ():
        if not is_there(path):
            raise DataError(path, "no such file", "a file or folder that `inputs` of a tracker states")
        note(absolute_path(path))
    if settings.inputs is None:
        note_unknown(shlex.join(words))


def _is_argument(word: object) -> bool:
    """Whether a program can be given a word."""
    try:
        return isinstance(word, str) and b"\0" not in os.fsencode(word)
    except UnicodeEncodeError:  # a surrogate
        return False


def _position(text: str, place: str) -> list[float]:
    position = [number_in(part) for part in text.split(",")]
    if len(position) != 2 or not np.isfinite(position).all():
        raise TrackerError(f"external: found {text!r} in {place}, expected x,y or 0")
    return position


def _is_hidden(text: str, place: str) -> bool:
    visible = _WORDS.get(text.lower(), number_in(text))
    if visible not in _WORDS.values():
        raise TrackerError(f"external: found {text!r} in {place}, expected 0, 1, true or false")
    return not visible


def _run(settings: External, folder: GuardedFolder) -> None:
    """Run the command in a folder."""
    words = [*settings.command]
    if settings.script is not None:
        path = absolute(Path(), settings.script)
        require_regular(path, "the script of a tracker")
        words.append(str(path))
    _note_files(settings, words)
    shown = f"external: {shlex.join(words)}"
    try:
        ended = folder.run(words, settings.timeout_s)
    except GuardLostError as error:
        raise TrackerError(f"{shown}: {error}, expected it to run") from error
    except OSError as error:
        raise SettingsError(f"{shown}: cannot be started ({error.strerror}), expected a program") from error
    printed = f"; it printed last: {ended.last_line}" if ended.last_line else ""
    if ended.code is None:
        raise TrackerError(f"{shown}: still runs after {settings.timeout_s:g} s, expected it to end{printed}")
    if ended.code:
        how = f"ended with code {ended.code}" if ended.code > 0 else f"was ended by {signal_name(-ended.code)}"
        raise TrackerError(f"{shown}: {how}, expected code 0{printed}")
