"""Kinds of truth by name: the built-in ones, and those of other packages' entry points ``tracknoise.truths``."""

from collections.abc import Sequence as Items
from dataclasses import asdict

import numpy as np

from tracknoise.exceptions import DataError, SettingsError
from tracknoise.plugins import Plugins
from tracknoise.sequences.sequence import Sequence, TruthKind, camera_at, shutter_of
from tracknoise.truth.scan import SCAN_RULE, ScanRule
from tracknoise.truth.truth import Truth, TruthSource

TRUTHS: Plugins[TruthSource] = Plugins(
    what="kind of truth",
    group="tracknoise.truths",
    built_in={
        "birth": "tracknoise.truth.birth:BirthDepth",
        "raycast": "tracknoise.truth.raycast:RayCast",
        "scan": "tracknoise.truth.scan:KeyFrameScan",
        "swept": "tracknoise.truth.swept:SweptDepth",
        "triangulated": "tracknoise.truth.triangulated:Triangulated",
    },
    needs=("kind", "open"),
)


def make_truth(sequence: Sequence, kind: str | None = None, *, scan_rule: ScanRule = SCAN_RULE) -> Truth:
    """Make the truth of a sequence.

    Parameters
    ----------
    sequence
        The sequence.
    kind
        A name of `TRUTHS`; by default the best that the sequence offers. A `TruthKind` must be one that the sequence
        offers. Any other kind decides for itself whether the sequence has what it needs.
    scan_rule
        How features are associated with a scan, for the kind ``scan``.

    Raises
    ------
    DataError
        If the sequence offers no truth, or lacks what this kind needs.
    SettingsError
        If the sequence does not offer this kind.
    UnknownNameError
        If there is no such kind.
    """
    kind = _offered(sequence, kind)
    options = {"rule": asdict(scan_rule)} if kind == TruthKind.scan else {}
    return TRUTHS.make(kind, options).open(sequence)


def make_truths(sequences: Items[Sequence], kind: str | None = None, *, scan_rule: ScanRule) -> list[Truth]:
    """Make the truth of each sequence; sequences with the same scan, camera and poses share one.

    Raises
    ------
    TracknoiseError
        As `make_truth`.
    """
    truths: list[Truth] = []
    for place, sequence in enumerate(sequences):
        twins = (truths[before] for before in range(place) if _is_same_scan(sequences[before], sequence))
        shared = next(twins, None) if kind in (None, TruthKind.scan) else None
        truths.append(shared or make_truth(sequence, kind, scan_rule=scan_rule))
    return truths


def _offered(sequence: Sequence, kind: str | None) -> str:
    """The requested kind, or the best; an error if it needs data that this sequence does not offer."""
    place, offered = sequence.source, sequence.truths
    if kind is not None and (kind in offered or kind not in tuple(TruthKind)):
        return kind
    if not offered:
        raise DataError(place, "no depth, scan or exact surface", "one of them to compute true positions")
    if kind is not None:
        raise SettingsError(f"{place}: found truth = {str(kind)!r}, expected one of: {', '.join(offered)}")
    return offered[0]


def _is_same_scan(first: Sequence, second: Sequence) -> bool:
    """Whether the only truth that both sequences offer is the same scan, seen by one camera from the same poses."""
    if first.truths != (TruthKind.scan,) or second.truths != first.truths or len(first) != len(second):
        return False
    if shutter_of(first) is not None or shutter_of(second) is not None:
        return False
    if any(camera_at(first, index) != camera_at(second, index) for index in range(len(first))):
        return False
    scan, scanned = first.scan, second.scan
    if scan is None or scanned is None or scan.points_world is not scanned.points_world:
        return False
    return scan.key_frame == scanned.key_frame and np.array_equal(
        first.world_from_camera, second.world_from_camera, equal_nan=True
    )
