"""What columns of tracks mean beside positions: whether a feature was seen, by which camera, and when.

Front ends name such columns in many ways. A meaning that is known is used. Where it leaves a choice, such as the limit
of a score, the choice is an option, and a file without it is refused.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tracknoise.exceptions import DataError
from tracknoise.text import counted_of, significant
from tracknoise.time_units import TimeUnit


class Moment(StrEnum):
    """What says in which frame an observation is: the number of the frame, a time, or the name of an image file."""

    frame = "frame"
    time = "time"
    image = "image"


@dataclass(frozen=True, slots=True)
class Selection:
    """Which rows of a file are observations, where it has several kinds of rows, and what their times are."""

    topic: str | None = None  # of a bag: the topic that has the tracks; None for the only one
    camera: int | str | None = None  # whose observations are read; None for the only one
    visible_above: float | None = None  # a feature was seen where a score is larger
    time_unit: TimeUnit | None = None  # of times whose column does not name it
    frames_by: Moment | None = None  # what counts where a file states two of them; None: both, which must agree


PLAIN = Selection()


def key(column: str) -> str:
    """The name of a column without upper case, blanks, signs and a leading ``is``: ``Is_Visible`` is ``visible``."""
    plain = re.sub(r"[^a-z0-9]", "", column.lower())
    return plain.removeprefix("is") if len(plain) > len("is") + 2 else plain


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_SEEN = _words("visible visibles visibility vis predvisibility seen valid found tracked inlier")
"""Columns in which 1 says that the feature was seen."""
_NOT_SEEN = _words(
    "occluded predoccluded occlusion occ hidden invisible notvisible lost tracklost outlier rejected missing invalid"
)
"""Columns in which 1 says that it was not."""
_STATUS = _words("status state trackstatus trackstate trackingstatus trackingstate")
"""Columns in which 1 says that it was seen, as OpenCV has it, or that have words."""
_SCORE = _words(
    "score scores confidence conf prob probability likelihood trackscore trackconfidence visibilityscore visibleprob "
    "visprob visconf visscore"
)
"""Columns of numbers that are larger where a feature was more likely seen."""
_CAMERA = _words(
    "camera cam cameraid camid cameraindex camindex cameraidx camidx cameraname camname cameranumber camnumber "
    "cameranum sensor sensorid sensorname"
)
IMAGES = _words(
    "image imagename img imgname imagefile imagepath imgpath imgfile filename file filepath framename framefile "
    "rgb rgbfile"
)
"""Columns that may have the names of image files."""
_TIME_BASES = ("timestamp", "time", "t", "stamp")
_UNITS: Mapping[str, tuple[str, ...]] = {
    TimeUnit.ns: ("ns", "nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds"),
    TimeUnit.us: ("us", "usec", "usecs", "microsec", "microsecs", "microseconds"),
    TimeUnit.ms: ("ms", "msec", "msecs", "millisec", "millisecs", "milliseconds"),
    TimeUnit.s: ("sec", "secs", "seconds"),
}
TIMES: Mapping[str, TimeUnit | None] = {
    "times": TimeUnit.s,
    **dict.fromkeys((*_TIME_BASES, "ts", "timestamps", "stamps")),
    **{base + name: TimeUnit(unit) for base in _TIME_BASES for unit, names in _UNITS.items() for name in names},
}
"""Keys of columns of times, best first, and the unit that their names state."""
_LEAST_FOUND = 0.5
"""A smaller share of found features says that 0 is what was found."""
_MEANT = _SEEN | _NOT_SEEN | _STATUS | _SCORE | _CAMERA
_TRUE, _FALSE = _words("1 1.0 true yes t y"), _words("0 0.0 false no f n")
_WORDS_SEEN = _words("visible seen tracked tracking ok found good valid inlier active alive new success")
_WORDS_NOT_SEEN = _words(
    "occluded hidden invisible lost missing failed failure bad invalid outlier rejected dead removed"
)
_NO_NAME = re.compile(r"|_duplicated_.*|unnamed.*|index|id|column\d*")
_MOST_NAMED = 6


SYNONYMS: Mapping[str, tuple[str, ...]] = {
    "track": ("track_id", "feature_id", "point_id", "feature", "id"),
    "frame": ("frame_id", "frame_index", "frame_number", "image_id", "image_index"),
    "u_px": ("u", "x", "x_px"),
    "v_px": ("v", "y", "y_px"),
}
"""Other names of columns, for files that lack the first; ``id`` comes last, as it may count rows. Upper and lower case
and signs are the same: see `key`."""


def renamed(columns: Iterable[str]) -> dict[str, str]:
    """New names of the columns that have another one of `SYNONYMS`."""
    named = [*columns]
    column_of = {key(column): column for column in reversed(named)}
    new = {}
    for name, synonyms in SYNONYMS.items():
        used = next((column_of[synonym] for synonym in map(key, (name, *synonyms)) if synonym in column_of), name)
        if used != name and name not in named:
            new[used] = name
    return new


def known_name(column: str) -> str:
    """The name of one column, that of `SYNONYMS` where it has another one of them."""
    return renamed([column]).get(column, column)


def has_meaning(column: str) -> bool:
    """Whether a column says of a row whether its feature was seen, or by which camera."""
    return key(column) in _MEANT


def unused_notes(path: Path, columns: Iterable[str]) -> tuple[str, ...]:
    """A sentence that names columns that are not used; none for those without a name, which count rows."""
    names = [column for column in columns if _NO_NAME.fullmatch(column.strip().lower()) is None]
    if not names:
        return ()
    more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
    is_one = len(names) == 1
    subject = f"{'column' if is_one else 'columns'} {', '.join(names[:_MOST_NAMED])}{more}"
    return (f"{subject} of {path.name} {'is' if is_one else 'are'} not used",)


@dataclass(frozen=True, slots=True, eq=False)
class Meant:
    """What columns say of the rows of a file."""

    mine: NDArray[np.bool_]  # (n,): whether each row is of the camera that is read
    seen: NDArray[np.bool_] | None  # (n,): whether its feature was seen; None where no column says so
    unused: tuple[str, ...]  # columns whose meaning is known and was not needed
    notes: tuple[str, ...]  # what is left out, one sentence each


def meant(
    path: Path, columns: Mapping[str, pl.Series], n_rows: int, chosen: Selection, place: Callable[[int], str]
) -> Meant:
    """What the columns of a file say of its rows.

    Parameters
    ----------
    path
        The file.
    columns
        Those that `has_meaning`, by name, (n,) each.
    n_rows
        Number of rows n.
    chosen
        What the user says.
    place
        Where a row is, for errors.

    Raises
    ------
    DataError
        If there are several cameras and none is chosen, a score has no limit, a cell is not understood, or what is
        chosen is not there.
    """
    cameras = {name: _texts(column) for name, column in columns.items() if key(name) in _CAMERA}
    mine, unused = _of_camera(path, cameras, n_rows, chosen.camera)
    rows, flags = np.flatnonzero(mine), dict[str, NDArray[np.bool_]]()
    scores: dict[str, NDArray[np.float64]] = {}
    for name, column in columns.items():
        if name in cameras:
            continue
        flag = None if key(name) in _SCORE else _flags(name, column.gather(rows), lambda row: place(rows[row]))
        if flag is None:
            scores[name] = np.full(n_rows, np.nan)
            scores[name][rows] = _numbers(name, column.gather(rows), lambda row: place(rows[row]))
        else:
            flags[name] = np.zeros(n_rows, dtype=np.bool_)
            flags[name][rows] = flag
    for name, flag in flags.items():
        if key(name) in _STATUS and flag[mine].mean() < _LEAST_FOUND:
            found = f"{name} is 0 in {1 - flag[mine].mean():.0%} of the rows"
            raise DataError(path, found, "1 where a feature was found; name the column lost if 1 says that it was not")
    limited, left = _limited(path, scores, bool(flags), chosen.visible_above)
    all_flags = flags | limited
    seen = np.logical_and.reduce([*all_flags.values()]) if all_flags else None
    return Meant(mine, seen, (*unused, *left), tuple(_left_out(mine, seen, all_flags)))


def _of_camera(
    path: Path, cameras: Mapping[str, NDArray[np.str_]], n_rows: int, chosen: int | str | None
) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Which rows are of the camera that is read, and the columns of cameras that were not needed."""
    several = [name for name, values in cameras.items() if len(np.unique(values)) > 1]
    name = next(iter((*several, *cameras)), None)
    if name is None:
        if chosen is not None:
            raise DataError(
                path, f"camera = {chosen} and no column of the camera", "a column camera, or no such option"
            )
        return np.ones(n_rows, dtype=np.bool_), ()
    names = np.unique(cameras[name]).tolist()
    listed = ", ".join(names[:_MOST_NAMED])
    if chosen is None and len(names) > 1:
        option = names[0] if names[0].isdecimal() else f'"{names[0]}"'
        raise DataError(path, f"several cameras: {name} is {listed}", f"one, or the option camera = {option}")
    if chosen is not None and n_rows and str(chosen) not in names:
        raise DataError(path, f"no row of camera {chosen}: {name} is {listed}", "one of these as the option camera")
    rest = tuple(column for column in cameras if column != name)
    return cameras[name] == (str(chosen) if chosen is not None or not names else names[0]), rest


def _texts(column: pl.Series) -> NDArray[np.str_]:
    """Cells as text, whole numbers without decimals."""
    if column.dtype.is_float():
        integers = column.cast(pl.Int64, strict=False)
        column = integers if (integers == column).all() else column
    text = column.cast(pl.String).fill_null("").str.strip_chars().str.replace(r"^(-?\d+)\.0+$", "$1")
    return np.array(text.to_list(), dtype=np.str_)


def _flags(name: str, column: pl.Series, place: Callable[[int], str]) -> NDArray[np.bool_] | None:
    """Whether each feature was seen, where cells are 0 and 1 or words; None where they are other numbers."""
    text = pl.Series([value.lower() for value in _texts(column).tolist()], dtype=pl.String)
    yes, no = text.is_in([*_TRUE]), text.is_in([*_FALSE])
    if key(name) in _NOT_SEEN:
        yes, no = no, yes
    yes, no = yes | text.is_in([*_WORDS_SEEN]), no | text.is_in([*_WORDS_NOT_SEEN])
    bad = np.flatnonzero(~(yes | no).to_numpy())
    if not len(bad):
        return np.asarray(yes.to_numpy(), dtype=np.bool_)
    if text[bad].cast(pl.Float64, strict=False).is_not_null().any():
        return None
    raise DataError(place(int(bad[0])), f"{name} {column[int(bad[0])]!r}", "0 or 1, true or false")


def _numbers(name: str, column: pl.Series, place: Callable[[int], str]) -> NDArray[np.float64]:
    """The numbers of a score, NaN where a cell is empty."""
    text = column.cast(pl.String).str.strip_chars()
    numbers = text.cast(pl.Float64, strict=False)
    bad = np.flatnonzero(
        (
            numbers.is_null() & ~text.str.to_lowercase().is_in(["", "nan", "null", "none"]).fill_null(value=True)
        ).to_numpy()
    )
    if len(bad):
        raise DataError(place(int(bad[0])), f"{name} {column[int(bad[0])]!r}", "a number")
    values: NDArray[np.float64] = numbers.fill_null(np.nan).to_numpy()
    return values


def _limited(
    path: Path, scores: Mapping[str, NDArray[np.float64]], has_flags: bool, limit: float | None
) -> tuple[dict[str, NDArray[np.bool_]], tuple[str, ...]]:
    """Whether a score is above its limit, by name, and the scores that are not needed."""
    shown = {name: _of_being_seen(path, name, values) for name, values in scores.items()}
    finite = {name: values[np.isfinite(values)] for name, values in shown.items()}
    ranges = {name: (float(values.min()), float(values.max())) for name, values in finite.items() if len(values)}
    stated = [name for name in ranges if key(name) not in _SCORE]
    stated = stated or [name for name, (low, high) in ranges.items() if low < high]
    if limit is None:
        if not stated or has_flags:
            return {}, tuple(scores)
        least, most = (significant(value, 3) for value in ranges[stated[0]])
        found = f"column {stated[0]}, by which scores are from {least} to {most}"
        expected = f"the option visible_above = ..., above which rows are observations; below {least} it takes all"
        raise DataError(path, found, expected)
    if len(stated) != 1:
        found = f"several scores: {', '.join(stated)}" if stated else f"visible_above = {limit:g} and no score"
        raise DataError(path, found, "one column of a score or visibility that is no 0 or 1")
    (name,) = stated
    return {name: shown[name] > limit}, tuple(score for score in scores if score != name)


def _of_being_seen(path: Path, name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """A score that is larger where a feature was more likely seen: of a probability that it was not, one minus it."""
    if key(name) not in _NOT_SEEN:
        return values
    finite = values[np.isfinite(values)]
    if ((finite < 0.0) | (finite > 1.0)).any():
        raise DataError(path, f"column {name} from {finite.min():g} to {finite.max():g}", "0 or 1, or probabilities")
    return 1.0 - values


def _left_out(mine: NDArray[np.bool_], seen: NDArray[np.bool_] | None, columns: Iterable[str]) -> Iterator[str]:
    """What was left out, one sentence each."""
    n_others = int(np.count_nonzero(~mine))
    if n_others:
        yield f"{counted_of(n_others, len(mine), 'imported row', 'is', 'are')} of other cameras, and left out"
    if seen is not None and (hidden := int(np.count_nonzero(mine & ~seen))):
        rows = counted_of(hidden, int(mine.sum()), "imported row", "says", "say")
        yield f"{rows} that the feature was not seen (column {', '.join(columns)}), and are no observations"
