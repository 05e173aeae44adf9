"""Whether tracks follow the images that they are said to be of, whatever the truth is.

The patch around a position and that around a later position of the same track show the same point. Other readings of
the same positions, such as swapped columns, another size of the images or other frames, are compared by how well their
patches agree, and by whether positions lie on corners as those of most detectors do. Patches that are shifted by half a
pixel in all frames agree as well as before: such a shift is not determined.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from tracknoise.trackers.patch_samples import correlation, offsets, sampled

Positions: TypeAlias = NDArray[np.float64]
"""(n, 2) float64, px."""
Image: TypeAlias = Callable[[int], NDArray[np.uint8]]
"""The image of a frame, (height, width)."""


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """Observations of one tracker in one sequence, in any order.

    Attributes
    ----------
    track, frame : (n,) integers
        Of each observation.
    uv : (n, 2) float64
        Its position, px.
    true : (n, 2) float64
        Where the truth expects it, px; NaN where unknown.
    size
        (width, height) of the images, px.
    raster
        The same in the units of the positions that were read: those of a file of tracks of resized images. None for
        positions that were read as rays, whose columns are turned about the centre of the image.
    n_frames
        Number of frames of the sequence.
    """

    track: NDArray[np.integer]
    frame: NDArray[np.integer]
    uv: Positions
    true: Positions
    size: tuple[int, int]
    raster: tuple[float, float] | None
    n_frames: int


@dataclass(frozen=True, slots=True)
class Reading:
    """Another reading of positions; by default that as given.

    Attributes
    ----------
    columns
        For u and v: which number of a position it is, from 1, negative where it counts from the other end.
    raster
        Size of the images of which the positions would be; None as given.
    later
        By how many frames the images of the positions are later than stated.
    shuffled
        Whether ids name other features in each frame.
    """

    columns: tuple[int, int] = (1, 2)
    raster: tuple[float, float] | None = None
    later: int = 0
    shuffled: bool = False

    def moved(self, tracked: Tracked, uv: Positions) -> Positions:
        """Positions in px under this reading."""
        size = np.array(tracked.size)
        chosen = [abs(column) - 1 for column in self.columns]
        if tracked.raster is None:
            centre = (size - 1) / 2
            return np.asarray(centre + np.sign(self.columns) * (uv - centre)[:, chosen])
        stated = np.array(tracked.raster)
        in_raster = (uv + 0.5) * (stated / size)
        turned = np.where(np.array(self.columns) < 0, stated - in_raster[:, chosen], in_raster[:, chosen])
        return np.asarray(turned * (size / np.array(self.raster or tracked.raster)) - 0.5)


AS_GIVEN, STRAY = Reading(), Reading(columns=(0, 0))
_MOST_FRAMES = 3
_SQUARES = (64, 96, 112, 128, 160, 192, 224, 240, 256, 320, 336, 384, 448, 480, 512, 518, 640, 768, 1024)
_SIZES = (
    *((side, side) for side in _SQUARES),
    *((512, 384), (384, 512), (160, 120), (320, 240), (640, 480), (752, 480), (1024, 768), (1280, 960)),
    *((320, 180), (640, 360), (854, 480), (910, 512), (960, 540), (1280, 720), (1920, 1080), (3840, 2160)),
)
_FACTORS = (1 / 8, 1 / 4, 1 / 3, 1 / 2, 2 / 3, 3 / 4, 4 / 3, 3 / 2, 2, 3, 4)
_SAME = 0.01
"""A raster that differs by less from the stated one is the same."""
_OUTSIDE, _LARGER = 0.02, 1.1
"""Of positions of larger images than stated at least this share is outside of these, from this ratio on."""


def readings(tracked: Tracked) -> Iterator[Reading]:
    """Other readings that are tried."""
    for order, signs in product(((1, 2), (2, 1)), product((1, -1), repeat=2)):
        columns = (order[0] * signs[0], order[1] * signs[1])
        if columns != AS_GIVEN.columns:
            yield Reading(columns)
    width, height = tracked.raster or (0.0, 0.0)
    factors = ((round(width * factor), round(height * factor)) for factor in _FACTORS)
    for raster in dict.fromkeys((*_SIZES, *factors)):
        if _is_possible(raster, tracked):
            yield Reading(raster=raster)
    yield from (Reading(later=later) for later in range(-_MOST_FRAMES, _MOST_FRAMES + 1) if later)


def _is_possible(raster: tuple[float, float], tracked: Tracked) -> bool:
    """Whether positions may be of images of another size: most are inside of it, and some outside of a smaller one."""
    if tracked.raster is None:
        return False
    ratio = np.array(raster) / np.array(tracked.raster)
    if np.abs(ratio - 1.0).max() < _SAME:
        return False
    relative = (tracked.uv + 0.5) / np.array(tracked.size)
    inside = ((relative >= 0.0) & (relative <= ratio)).all(axis=1).mean()
    beyond = (relative > 1.0).mean(axis=0)
    return bool(inside > 1.0 - _OUTSIDE and ((ratio < _LARGER) | (beyond > _OUTSIDE)).all())


_MOST_PAIRS, _MOST_TRACKS, _FEWEST = 24, 48, 8
_GAPS = (1, 2, 3, 4, 6, 8, 12, 16)
_MOTION_PX = 8.0
_KEPT_SHARE = 0.5
_PATCH = offsets(15)
_TEXTURE = 3.0
_BLUR_PX = 1.0
_AROUND_PX = 25
_KEPT_IMAGES = 4


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    """Positions of tracks in two frames, where the truth expects them, and all positions in the second frame."""

    first: int
    second: int
    track: NDArray[np.integer]
    uv_first: Positions
    uv_second: Positions
    true_first: Positions
    true_second: Positions
    every_second: Positions


def _pairs(tracked: Tracked) -> Iterator[_Pair]:
    """Pairs of frames spread over the sequence: with some image motion, as long as most tracks last."""
    frames = np.unique(tracked.frame)
    if len(frames) < 2:
        return
    order = np.lexsort([tracked.track, tracked.frame])
    starts = np.searchsorted(tracked.frame[order], frames)
    rows = dict(zip(frames.tolist(), np.split(order, starts[1:]), strict=True))
    step = int(np.diff(frames).min())
    places = np.linspace(0, len(frames) - 2, min(_MOST_PAIRS, len(frames) - 1))
    for first in frames[np.unique(places.astype(int))].tolist():
        if (reached := _reaching(tracked, rows, first, step)) is not None:
            second, rows_first, rows_second = reached
            chosen = np.unique(np.linspace(0, len(rows_first) - 1, _MOST_TRACKS).astype(int))
            in_first, in_second = rows_first[chosen], rows_second[chosen]
            uv, true = tracked.uv, tracked.true
            yield _Pair(
                first,
                second,
                tracked.track[in_first],
                uv[in_first],
                uv[in_second],
                true[in_first],
                true[in_second],
                uv[rows[second]],
            )


def _reaching(
    tracked: Tracked, rows: Mapping[int, NDArray[np.intp]], first: int, step: int
) -> tuple[int, NDArray[np.intp], NDArray[np.intp]] | None:
    """The first later frame in which tracks have moved far enough, and the rows of those that are in both frames."""
    reached, most = None, 0
    for gap in _GAPS:
        second = first + gap * step
        if second not in rows:
            continue
        _, in_first, in_second = np.intersect1d(
            tracked.track[rows[first]], tracked.track[rows[second]], return_indices=True
        )
        most = max(most, len(in_first))
        if len(in_first) < max(_FEWEST, _KEPT_SHARE * most):
            break
        reached = second, rows[first][in_first], rows[second][in_second]
        moved = tracked.uv[reached[2]] - tracked.uv[reached[1]]
        if float(np.median(np.hypot(*moved.T))) >= _MOTION_PX:
            break
    return reached


class _Patches:
    """Patches and corners of the images, of which the last ones are kept."""

    def __init__(self, image: Image) -> None:
        self._read = lru_cache(_KEPT_IMAGES)(lambda index: _prepared(image(index)))

    def of(self, index: int, uv: Positions) -> NDArray[np.float32]:
        """(n, p) float32: gray values around positions; NaN where there is no texture, or the image ends."""
        values = sampled(self._read(index)[0], (uv[:, None] + _PATCH).astype(np.float32))
        values[~np.isfinite(values).all(axis=1) | (np.std(values, axis=1) < _TEXTURE)] = np.nan
        return values

    def corners(self, index: int, uv: Positions) -> NDArray[np.float32]:
        """(n,) float32: how much more than its surroundings a position is a corner, in their standard deviations."""
        return sampled(self._read(index)[1], uv[:, None].astype(np.float32))[:, 0]


def _prepared(image: NDArray[np.uint8]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    smooth = np.asarray(cv2.GaussianBlur(image.astype(np.float32), (0, 0), _BLUR_PX), np.float32)
    response = np.log(cv2.cornerMinEigenVal(smooth, 5) + 1e-3)
    mean, square = (cv2.blur(values, (_AROUND_PX, _AROUND_PX)) for values in (response, response * response))
    return smooth, np.asarray((response - mean) / np.sqrt(np.maximum(square - mean * mean, 1e-2)), np.float32)


@dataclass(frozen=True, slots=True)
class Agreement:
    """How well a reading agrees with the images, beside positions as given.

    Attributes
    ----------
    reading
        The reading.
    n_pairs
        Pairs of frames that were compared.
    loss, loss_given
        Mean of one minus the correlation of patches of a track.
    motion_t
        By how many standard errors its losses are smaller, over pairs of frames.
    corner, corner_given, corner_t
        How much more than their surroundings positions are corners, and the same of the difference.
    """

    reading: Reading
    n_pairs: int
    loss: float
    loss_given: float
    motion_t: float
    corner: float
    corner_given: float
    corner_t: float

    @property
    def ratio(self) -> float:
        """Of the losses; NaN where patches of positions as given have no texture."""
        return self.loss / max(self.loss_given, _LEAST_LOSS)

    @property
    def is_better(self) -> bool:
        """Whether the images show that this reading is right, and that as given wrong."""
        if self.n_pairs < _FEWEST_PAIRS or (self.corner_t < -_AGAINST and self.reading != STRAY):
            return False
        if self.reading.shuffled:
            return self.ratio < _MUCH and self.motion_t > _SURE
        if not self.loss < _UNRELATED:
            return False
        if self.reading == STRAY:
            return self.loss < _CLOSE and self.ratio < _MUCH and self.motion_t > _SURE
        is_close = self.loss < _CLOSE or self.corner_t > _LIKELY
        by_motion = is_close and self.ratio < _MUCH and self.motion_t > _SURE
        by_corners = self.corner - self.corner_given > _CORNER and self.corner_t > _SURE and not self.ratio > 1.0
        by_both = self.ratio < _SOME and self.motion_t > _LIKELY and self.corner_t > _LIKELY
        return by_motion or by_corners or by_both

    @property
    def score(self) -> float:
        """By which readings are ranked."""
        is_known = self.n_pairs >= _FEWEST_PAIRS and self.loss < _UNRELATED
        return self.corner - float(np.log(max(self.loss, _LEAST_LOSS))) if is_known else -np.inf


_FEWEST_PAIRS = 4
_EVERY, _HOPELESS = 3, 1.2
"""A reading is tried in one of so many pairs first; where losses are larger by this factor, it is not right."""
_LEAST_LOSS = 0.005
_MUCH, _SOME, _CLOSE = 0.6, 0.85, 0.15
"""Ratios of losses below which positions are much or somewhat better, and a loss of patches that agree."""
_SURE, _LIKELY, _AGAINST = 5.0, 3.0, 3.0
"""Standard errors."""
_CORNER = 0.3


def agreements(tracked: Tracked, image: Image) -> list[Agreement]:
    """How well other readings of positions agree with the images, the best first.

    Raises
    ------
    DataError
        If an image cannot be read.
    """
    patches, pairs = _Patches(image), list(_pairs(tracked))
    if len(pairs) < _FEWEST_PAIRS:
        return []
    under: dict[int, dict[Reading, _Values | None]] = {}

    def compare(places: Iterable[int], some: Iterable[Reading]) -> list[Agreement]:
        """Readings in some more pairs, with all pairs so far: a pair at a time, so that few images are kept."""
        beside = [AS_GIVEN, *some]
        for place in places:
            under[place] = {reading: _of_pair(reading, tracked, pairs[place], patches) for reading in beside}
        of_pairs = [under[place] for place in sorted(under)]
        given = [values[AS_GIVEN] for values in of_pairs]
        return [_compared(reading, [values[reading] for values in of_pairs], given) for reading in beside[1:]]

    first = range(0, len(pairs), _EVERY)
    likely = [one.reading for one in compare(first, readings(tracked)) if not one.ratio > _HOPELESS]
    tried = compare([place for place in range(len(pairs)) if place not in first], likely)
    as_given = [under[place][AS_GIVEN] for place in range(len(pairs))]
    tried.insert(0, _shuffled(pairs, as_given, patches))
    stray = [_compared(STRAY, [_of_truth(pair, patches) for pair in pairs], as_given)] if _are_far(pairs) else []
    return [*sorted(tried, key=lambda agreement: -agreement.score), *stray]


def wrong_reading(tracked: Tracked, image: Image) -> Reading | None:
    """The reading that the images show to be right where that as given is wrong; None where they show none.

    `STRAY` where none is right, but the images follow the truth at the positions as given.
    """
    return next((agreement.reading for agreement in agreements(tracked, image) if agreement.is_better), None)


_BETWEEN = (-0.25, 0.0, 0.25, 0.5, 0.75, 1.0, 1.25)
_LEAST_ERROR_PX = 0.1


def most_confirmed(tracked: Tracked, image: Image) -> float | None:
    """Largest share of the differences between tracks and truth that the images confirm, of their squares.

    Patches are compared on the way from where the truth expects a track to where it is reported. With tracks whose
    noise is independent of the truth, the best place is as far on it as errors of the truth are in the differences:
    0 where the truth is exact, 1 where the tracks are. Two standard errors over pairs of frames are added. None where
    it is not determined.

    Raises
    ------
    DataError
        If an image cannot be read.
    """
    patches = _Patches(image)
    shares = np.array([_way(pair, patches) for pair in _pairs(tracked)])
    shares = shares[np.isfinite(shares)]
    if len(shares) < 2 * _FEWEST_PAIRS:
        return None
    return float(shares.mean() + 2.0 * shares.std(ddof=1) / np.sqrt(len(shares)))


def _way(pair: _Pair, patches: _Patches) -> float:
    """Where on the way from the truth, 0, to the tracks of a pair, 1, patches agree best; NaN where it is unknown."""
    error = (pair.uv_second - pair.uv_first) - (pair.true_second - pair.true_first)
    places = np.flatnonzero(np.isfinite(error).all(axis=1))
    if len(places) < _FEWEST or float(np.median(np.hypot(*error[places].T))) < _LEAST_ERROR_PX:
        return np.nan
    first = patches.of(pair.first, pair.true_first[places])
    losses = np.array(
        [
            1.0 - correlation(first, patches.of(pair.second, pair.true_second[places] + part * error[places]))
            for part in _BETWEEN
        ]
    )
    all_known = np.isfinite(losses).all(axis=0)
    if all_known.sum() < _FEWEST:
        return np.nan
    mean = losses[:, all_known].mean(axis=1)
    best = int(np.clip(np.argmin(mean), 1, len(mean) - 2))
    before, at, after = mean[best - 1 : best + 2]
    bend = before - 2.0 * at + after
    moved = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(_BETWEEN[best] + np.clip(moved, -1.0, 1.0) * (_BETWEEN[1] - _BETWEEN[0]))


_Values: TypeAlias = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.integer]]
"""Loss of each track of a pair, how much it is a corner, and which track it is; NaN where unknown."""


def _of_pair(reading: Reading, tracked: Tracked, pair: _Pair, patches: _Patches) -> _Values | None:
    """None where the sequence lacks the frames."""
    first, second = pair.first + reading.later, pair.second + reading.later
    if first < 0 or second >= tracked.n_frames:
        return None
    uv_first, uv_second = (reading.moved(tracked, uv) for uv in (pair.uv_first, pair.uv_second))
    loss = 1.0 - correlation(patches.of(first, uv_first), patches.of(second, uv_second))
    return loss, 0.5 * (patches.corners(first, uv_first) + patches.corners(second, uv_second)), pair.track


def _of_truth(pair: _Pair, patches: _Patches) -> _Values:
    """The same of where the truth expects the tracks; what it is of corners does not count."""
    loss = 1.0 - correlation(patches.of(pair.first, pair.true_first), patches.of(pair.second, pair.true_second))
    return loss, np.where(np.isfinite(loss), 0.0, np.nan).astype(np.float32), pair.track


def _are_far(pairs: Sequence[_Pair]) -> bool:
    """Whether tracks move otherwise than the truth by nearly as much as it moves, where that is far."""
    moved = np.concatenate([np.empty((0, 2)), *(pair.true_second - pair.true_first for pair in pairs)])
    observed = np.concatenate([np.empty((0, 2)), *(pair.uv_second - pair.uv_first for pair in pairs)])
    is_known = np.isfinite(moved).all(axis=1)
    if is_known.sum() < _FEWEST:
        return False
    motion = float(np.median(np.hypot(*moved[is_known].T)))
    error = float(np.median(np.hypot(*(observed - moved)[is_known].T)))
    return motion >= _MOTION_PX and error > _FAR * motion


_FAR = 0.8


def _compared(reading: Reading, under: Sequence[_Values | None], given: Sequence[_Values | None]) -> Agreement:
    """A reading beside positions as given, in the pairs that both have."""
    pairs = [
        (of_reading, as_given)
        for of_reading, as_given in zip(under, given, strict=True)
        if of_reading is not None and as_given is not None
    ]
    losses = _known(_means(of_reading[0], as_given[0]) for of_reading, as_given in pairs)
    corners = _known(_means(of_reading[1], as_given[1]) for of_reading, as_given in pairs)
    loss, loss_given = losses.T
    if not len(losses):
        loss_under = np.array([_means(of_reading[0], of_reading[0])[0] for of_reading, _ in pairs])
        loss = loss_under[np.isfinite(loss_under)]
    corner, corner_given = corners.T
    return Agreement(
        reading,
        len(corners),
        _mean(loss),
        _mean(loss_given),
        _in_errors(_smaller(*losses.T)),
        _mean(corner),
        _mean(corner_given),
        min(_in_errors(corner - corner_given), _in_errors(_of_tracks(pairs)), key=abs),
    )


def _of_tracks(pairs: Sequence[tuple[_Values, _Values]]) -> NDArray[np.float64]:
    """How much more a track is a corner under a reading, of each track: pairs of frames show the same tracks."""
    if not pairs:
        return np.empty(0)
    more = np.concatenate([of_reading[1] - as_given[1] for of_reading, as_given in pairs]).astype(np.float64)
    track = np.concatenate([of_reading[2] for of_reading, _ in pairs])
    is_known = np.isfinite(more)
    _, place = np.unique(track[is_known], return_inverse=True)
    return np.asarray(np.bincount(place, more[is_known]) / np.maximum(np.bincount(place), 1))


def _known(rows: Iterable[tuple[float, ...]]) -> NDArray[np.float64]:
    """(n, 2) float64: those without NaN."""
    numbers = np.array(list(rows), dtype=np.float64).reshape(-1, 2)
    return numbers[np.isfinite(numbers).all(axis=1)]


def _means(under: NDArray[np.float32], given: NDArray[np.float32]) -> tuple[float, float]:
    """Means over tracks that have both values; over all where these are few, as most of one are outside the image."""
    is_known, is_known_given = np.isfinite(under), np.isfinite(given)
    both_known = is_known & is_known_given
    if both_known.sum() >= _FEWEST:
        is_known = is_known_given = both_known
    if is_known.sum() < _FEWEST or is_known_given.sum() < _FEWEST:
        return np.nan, np.nan
    return float(under[is_known].mean()), float(given[is_known_given].mean())


def _smaller(loss: NDArray[np.float64], beside: NDArray[np.float64]) -> NDArray[np.float64]:
    """By what factor losses are smaller than others, as its logarithm."""
    return np.asarray(np.log(np.maximum(beside, _LEAST_LOSS) / np.maximum(loss, _LEAST_LOSS)))


def _mean_of_known(values: NDArray[np.float32]) -> float:
    return _mean(values[np.isfinite(values)].astype(np.float64))


def _mean(values: NDArray[np.float64]) -> float:
    return float(values.mean()) if len(values) else np.nan


def _in_errors(values: NDArray[np.float64]) -> float:
    """The mean of values in standard errors of it; 0 where there are too few."""
    if len(values) < _FEWEST_PAIRS:
        return 0.0
    return float(values.mean() / max(values.std(ddof=1) / np.sqrt(len(values)), 1e-9))


_NEIGHBOURS, _ASKED, _JUMP = 24, 16, 0.5
"""Others that are compared, tracks that are asked, and how far tracks move at least, beside the distance of others."""


def _shuffled(pairs: Sequence[_Pair], given: Sequence[_Values | None], patches: _Patches) -> Agreement:
    """Whether tracks jump through the image, and their patches go on at the positions of other tracks nearby.

    Beside the best of others nearby is the best of as many far away, since the best of many is good by chance too.
    """
    beside_given, by_chance, corners = list[tuple[float, float]](), list[tuple[float, float]](), list[float]()
    for pair, values in zip(pairs, given, strict=True):
        if values is None or not _mean_of_known(values[0]) > _UNRELATED or len(pair.every_second) < 2 * _FEWEST:
            continue
        asked = np.unique(np.linspace(0, len(pair.uv_first) - 1, _ASKED).astype(int))
        distance = np.hypot(*(pair.uv_first[asked, None] - pair.every_second).transpose(2, 0, 1))
        if float(np.median(np.hypot(*(pair.uv_second - pair.uv_first).T))) < _JUMP * float(np.median(distance)):
            continue
        order, count = np.argsort(distance, axis=1, kind="stable"), min(_NEIGHBOURS, distance.shape[1] // 2)
        patch = patches.of(pair.first, pair.uv_first[asked])
        near, far = (
            _best(patch, patches.of(pair.second, pair.every_second[chosen.ravel()]))
            for chosen in (order[:, :count], order[:, -count:])
        )
        beside_given.append(_means(near, values[0][asked]))
        by_chance.append(_means(near, far))
        corners.append(_mean_of_known(values[1]))
    (near, as_given), chance, corner = _known(beside_given).T, _known(by_chance), _mean(np.array(corners))
    sure = min(_in_errors(_smaller(near, as_given)), _in_errors(_smaller(*chance.T)) * _SURE / _LIKELY)
    return Agreement(Reading(shuffled=True), len(near), _mean(near), _mean(as_given), sure, corner, corner, 0.0)


_UNRELATED = 0.5
"""A mean loss of patches of which most show different points."""


def _best(patch: NDArray[np.float32], nearby: NDArray[np.float32]) -> NDArray[np.float32]:
    """(n,) smallest losses of patches (n, p), each beside as many others (n k, p)."""
    alike = correlation(np.repeat(patch, len(nearby) // len(patch), axis=0), nearby).reshape(len(patch), -1)
    best = np.max(np.where(np.isfinite(alike), alike, -1.0), axis=1)
    return np.where(np.isfinite(patch).all(axis=1), 1.0 - best, np.nan).astype(np.float32)
