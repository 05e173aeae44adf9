"""Which trackers of other programs report tracks that do not follow the images, and the option that mends it."""

from collections import Counter
from collections.abc import Iterator
from collections.abc import Sequence as Items
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from tracknoise.experiments.settings import SECOND_CAMERA, SYNTHETIC, Experiment, TrackerChoice
from tracknoise.sequences.sequence import Sequence, times_of
from tracknoise.text import counted
from tracknoise.trackers.imported import Imported
from tracknoise.trackers.imported_rows import Units
from tracknoise.trackers.tracker_registry import is_foreign, make_tracker
from tracknoise.truth_faults.tracks_in_images import STRAY, Reading, Tracked, most_confirmed, wrong_reading

if TYPE_CHECKING:
    from tracknoise.experiments.measure import Measurement


def wrong_tracks(measurement: "Measurement", experiment: Experiment) -> tuple[tuple[str, str], ...]:
    """Why tracks do not follow the images, and what mends it, by tracker.

    Built-in trackers are not asked: what they report comes from these images.
    """
    asked = [choice for choice in experiment.trackers if is_foreign(choice.kind) and choice.kind not in SYNTHETIC]
    return tuple(_wrong(measurement, asked))


def confirmed_share(measurement: "Measurement", experiment: Experiment) -> float | None:
    """Largest share of the squared differences between tracks and truth that the images confirm, of any tracker.

    None where it is not determined. Built-in trackers see the images themselves: with one of them it is not asked.
    """
    seen = [choice for choice in experiment.trackers if choice.kind not in SYNTHETIC | SECOND_CAMERA]
    if not all(is_foreign(choice.kind) for choice in seen):
        return None
    tracked = (_tracked(measurement, choice.label, None) for choice in seen)
    return largest([most_confirmed(choice, measurement.image) for choice in tracked])


def largest(shares: Items[float | None]) -> float | None:
    """The largest share; None where one is unknown, or there is none."""
    measured = [share for share in shares if share is not None]
    return max(measured) if measured and len(measured) == len(shares) else None


def wrong_in_most(parts: Items[Items[tuple[str, str]]]) -> tuple[tuple[str, str], ...]:
    """What is wrong in at least half of the parts of a sequence."""
    counts = Counter(chain.from_iterable(parts))
    return tuple(wrong for wrong, count in counts.items() if 2 * count >= len(parts))


def wrong_in_run(sequences: Items[Items[tuple[str, str]]]) -> list[tuple[str, str]]:
    """What is wrong in a run, with the number of its sequences where it is not wrong in all."""
    counts = Counter(chain.from_iterable(sequences))
    return [(_in_some(text, count, len(sequences)), step) for (text, step), count in counts.most_common()]


def _in_some(text: str, count: int, total: int) -> str:
    return text if count == total else f"{text[:-1]} in {count} of {counted(total, 'sequence')}."


def _wrong(measurement: "Measurement", asked: list[TrackerChoice]) -> Iterator[tuple[str, str]]:
    for choice in asked:
        of_file = choice.kind == Imported.kind and "path" in choice.options  # tracks from arrays have no options
        settings = make_tracker(choice.kind, choice.options) if of_file else None
        imported = settings if isinstance(settings, Imported) else None
        reading = wrong_reading(_tracked(measurement, choice.label, imported), measurement.image)
        if reading is not None:
            text = f"Tracks of {choice.label} do not follow the images: {_cause(reading)}."
            yield text, _step(reading, choice.label, imported, measurement.sequence)


def _tracked(measurement: "Measurement", tracker: str, imported: Imported | None) -> Tracked:
    """Observations of a tracker at the lowest speed."""
    rows = measurement.observations.filter(tracker=tracker)
    rows = rows.filter(pl.col("speed") == pl.col("speed").min())
    camera = measurement.sequence.camera
    size = camera.width, camera.height
    stated = size if imported is None or imported.raster is None else imported.raster
    return Tracked(
        rows["track"].to_numpy().astype(np.int64),
        rows["frame"].to_numpy().astype(np.int64),
        rows.select("u_px", "v_px").to_numpy(),
        rows.select("u_true_px", "v_true_px").to_numpy(),
        size,
        None if imported is not None and imported.units == Units.normalised else stated,
        measurement.n_frames,
    )


_TURNED = {
    (2, 1): "their columns are swapped",
    (1, -2): "v counts upwards",
    (-1, 2): "u counts to the left",
    (-1, -2): "u counts to the left, and v upwards",
}


def _cause(reading: Reading) -> str:
    """What is wrong."""
    if reading == STRAY:
        return "these follow the truth at the same points"
    if reading.shuffled:
        return "their ids name other features in other frames"
    if reading.later:
        when = "later" if reading.later > 0 else "earlier"
        return f"they are those of images {counted(abs(reading.later), 'frame')} {when}"
    if reading.raster is not None:
        return f"they are positions in images of {_size(reading)} px"
    return _TURNED.get(reading.columns, "their columns are swapped, and one of them counts from the other end")


def _step(reading: Reading, tracker: str, imported: Imported | None, sequence: Sequence) -> str:
    """What mends it: an option of imported tracks, or what another tracker should report."""
    if reading == STRAY:
        return f"Check which recording, frames and size of images the positions of {tracker} are of."
    if reading.shuffled:
        if imported is None:
            return f"Give each feature of {tracker} one id in all frames."
        return f'Set ids = "slots" for {tracker} if they are slots of an array; otherwise give each feature one id.'
    if imported is None:
        return f"Make {tracker} report u to the right and v down, in px of these images, in the frame that it sees."
    if reading.later:
        of_times = _with_times(reading, imported, sequence)
        return f"Set first_frame = {imported.first_frame - reading.later} for {tracker}{of_times}."
    if reading.raster is not None:
        return f"Set raster = [{_size(reading, ', ')}] for {tracker}."
    return f'Set columns = "{imported.columns.then(reading.columns)}" for {tracker}.'


def _with_times(reading: Reading, imported: Imported, sequence: Sequence) -> str:
    """The option for files that state times instead of frames; empty where the sequence has no times."""
    times = times_of(sequence)
    if times is None or len(times) < 2:
        return ""
    offset_s = imported.time_offset_s + reading.later * float(np.median(np.diff(times)))
    return f", or time_offset_s = {offset_s:.6g} if it has times"


def _size(reading: Reading, between: str = " x ") -> str:
    assert reading.raster is not None, "the size of images"
    return between.join(f"{side:g}" for side in reading.raster)
