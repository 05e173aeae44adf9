"""Names that tables, settings and code share: one enumeration for each column that holds one of a few words."""

from enum import StrEnum


class Population(StrEnum):
    """Which observations errors are of.

    visible: the feature could be seen. projected: all whose true position is known, the occluded ones included.
    """

    visible = "visible"
    projected = "projected"


class Axis(StrEnum):
    """What curves run along: the age of a track, or the frame of the sequence."""

    age = "age"
    frame = "frame"


class Trimming(StrEnum):
    """Whether the tracks with the largest errors were dropped."""

    untrimmed = "untrimmed"
    trimmed = "trimmed"


class TrimAmong(StrEnum):
    """Of which tracks the trimming percentile is taken.

    all: of all that have an error. followed: of those that have an error away from the frame that fixes their truth.
    """

    all = "all"
    followed = "followed"


class Weighting(StrEnum):
    """What counts equally in a mean: each feature, or each scene."""

    features = "features"
    scenes = "scenes"


class Verdict(StrEnum):
    """Answer of a test."""

    yes = "yes"
    no = "no"
    undecided = "undecided"


class IntervalKind(StrEnum):
    """How intervals are made.

    student: from the jackknife, with Student's distribution. percentile, bca: from the bootstrap.
    """

    student = "student"
    percentile = "percentile"
    bca = "bca"


class EffectIntervalKind(StrEnum):
    """How intervals of effects of factors are made: from Fieller's tests and random rotations."""

    fieller = "fieller"


class Resampled(StrEnum):
    """What intervals resample: scenes or, where these are too few, blocks of tracks within them."""

    scenes = "scenes"
    blocks = "blocks"


class Behaviour(StrEnum):
    """How errors grow with age."""

    white = "white"
    random_walk = "random walk"
    drift = "drift"
    none = "none"
    undecided = "undecided"


class Shape(StrEnum):
    """What distribution errors have."""

    gaussian = "Gaussian"
    heavy_tailed = "heavy-tailed"
    contaminated = "contaminated"
    light_tailed = "light-tailed"
    skewed = "skewed"
    undecided = "undecided"


class Aspect(StrEnum):
    """Which errors, and in which axes, a row is about.

    all: errors of all tracks in image axes. change: their changes from one frame of the tracker to the next. gradient
    and motion: errors along and across the dominant image gradient where the feature was first seen, or the motion of
    its true position. long_lived: errors in image axes of tracks that were seen at some age or later.
    """

    all = "all"
    change = "change"
    gradient = "gradient"
    long_lived = "long_lived"
    motion = "motion"
