"""Enumerations that tables, settings and code share: one for each column with a fixed set of values."""

from enum import StrEnum


class Population(StrEnum):
    """Observations whose errors are used.

    visible: the true position is known and visible. projected: the true position is known, visible or not.
    """

    visible = "visible"
    projected = "projected"


class Axis(StrEnum):
    """Axis of curves: the age of a track, or the frame of the sequence."""

    age = "age"
    frame = "frame"


class Trimming(StrEnum):
    """Whether the tracks with the largest errors were dropped."""

    untrimmed = "untrimmed"
    trimmed = "trimmed"


class Reading(StrEnum):
    """A reading of the paper's trimming.

    none: no track is dropped. all: the percentile is that of all tracks with an error, also of those that were seen
    once. followed: it is that of tracks that were seen more than once.
    """

    none = "none"
    all = "all"
    followed = "followed"


class TrimAmong(StrEnum):
    """Tracks from which the trimming percentile is computed.

    all: tracks that have an error. followed: tracks that have an error in a frame other than that of their anchor.
    """

    all = "all"
    followed = "followed"


class Weighting(StrEnum):
    """How scenes are combined.

    features: pooled, so that every feature has the same weight. scenes: mean over scenes of each scene's own value.
    geometric: geometric mean over scenes of each scene's own value, which is defined for scales only.
    """

    features = "features"
    scenes = "scenes"
    geometric = "geometric"


class Product(StrEnum):
    """Products of errors of one track, about the first position, from which components of the noise are fitted.

    error: an error with itself. before: the error in the frame before, carried on by the magnification of the image,
    with itself. change: the error minus the one before, carried on, with itself. lagged: a change with the one before.
    """

    error = "error"
    before = "before"
    change = "change"
    lagged = "lagged"


class Lookup(StrEnum):
    """What a table of noise is looked up by, the coarsest first. The motion is the group of a scene."""

    one = "one for all"
    tracker = "tracker"
    speed = "tracker, speed"
    motion = "tracker, speed, motion"


class FloorSource(StrEnum):
    """What makes a true position wrong.

    all: the sources that follow together, as far as their size is known. poses: relative error of the poses of two
    frames. depth: of the frame in which a point was fixed. clock: offset between images and poses. readout: rolling
    shutter that the truth does not account for. focal: focal length.
    """

    all = "all"
    poses = "poses"
    depth = "depth"
    clock = "clock"
    readout = "readout"
    focal = "focal"


class Verdict(StrEnum):
    """Answer of a test."""

    yes = "yes"
    no = "no"
    undecided = "undecided"


class EffectIntervalKind(StrEnum):
    """Method of intervals of factor effects: Student's, from differences paired by scene, for all pairs together."""

    paired = "paired"


class FittedMeasure(StrEnum):
    """What the noise of tracks with triangulated truth is estimated from.

    triangulated: errors about the fitted points. epipolar: distances from epipolar lines.
    """

    triangulated = "triangulated"
    epipolar = "epipolar"


class FittedTo(StrEnum):
    """Tracks to which pose errors are fitted, before they predict the errors of a tracker.

    own: the other half of the tracks of the same tracker. others: those of all other trackers that saw images.
    """

    own = "own"
    others = "others"


class Trust(StrEnum):
    """Verdict on the truth of a run or a recording.

    trusted: what could be wrong was looked for, could have been seen, and is small beside the errors. limited: the
    truth can explain a part of the errors, up to a stated bound. not_trusted: a fault is established, or the truth
    explains most of the errors. unknown: how much it explains could not be determined. not_assessed: tracks do not
    follow the images, so that errors say nothing about it.
    """

    trusted = "trusted"
    limited = "limited"
    not_trusted = "not trusted"
    unknown = "unknown"
    not_assessed = "not assessed"


class TruthCause(StrEnum):
    """What a share of the errors may be due to: all causes together, or one of them.

    tracks: those that do not follow the images. mistakes: data that cannot be right. faults: constant faults that are
    established. any_fault: all constant faults together, established or not. poses: a motion of the camera that the
    poses lack. depths: random errors of single depths. stated: the stated accuracy. every: all together. refined poses:
    what is left of the errors of poses that reference tracks refined. stated poses: what the stated ones would add.
    """

    every = "every"
    tracks = "tracks"
    mistakes = "mistakes"
    faults = "faults"
    any_fault = "any fault"
    poses = "poses"
    depths = "depths"
    stated = "stated"
    refined_poses = "refined poses"
    stated_poses = "stated poses"


class TruthQuantity(StrEnum):
    """What a row about two truths describes.

    disagreement: true positions by the second truth minus those by the first. first and second: errors of a tracker by
    one of them.
    """

    disagreement = "disagreement"
    first = "first"
    second = "second"


class Behaviour(StrEnum):
    """How errors grow with age."""

    white = "white"
    random_walk = "random walk"
    drift = "drift"
    saturating = "saturating"
    none = "none"
    undecided = "undecided"


class Shape(StrEnum):
    """Distribution of errors."""

    gaussian = "Gaussian"
    heavy_tailed = "heavy-tailed"
    contaminated = "contaminated"
    light_tailed = "light-tailed"
    skewed = "skewed"
    undecided = "undecided"


class Aspect(StrEnum):
    """Errors that a row describes, and their axes.

    all: errors of all tracks in image axes. change: their changes from one frame of the tracker to the next. gradient
    and motion: errors along and across the dominant image gradient in the first frame of the feature, or the motion of
    its true position. long_lived: errors in image axes of tracks that were seen at a given age or later.
    """

    all = "all"
    change = "change"
    gradient = "gradient"
    long_lived = "long_lived"
    motion = "motion"


class EdgeSide(StrEnum):
    """Side of the nearest depth edge on which a feature lies.

    near: on the surface in front. far: on the surface behind. none: no edge is near.
    """

    near = "near"
    far = "far"
    none = "none"


class Surrounding(StrEnum):
    """Property by which features are divided into classes.

    depth: of the point, metres. edge: signed distance to the nearest depth edge, px, negative on the far side.
    incidence: angle between the ray and the normal of the surface, degrees. side: side of a depth edge beside which the
    feature lies. These are of the first frame of the track. occlusion: whether the point is occluded now, later, or
    never while it is tracked. parallax: motion of the true position since errors were zero, less the median motion of
    all features over the same frames, px.
    """

    depth = "depth"
    edge = "edge"
    incidence = "incidence"
    side = "side"
    occlusion = "occlusion"
    parallax = "parallax"


class Occlusion(StrEnum):
    """Whether the point of a track is occluded.

    never: neither now nor in a later observation of its track. later: visible now, and occluded in a later one. now:
    occluded now.
    """

    never = "never"
    later = "later"
    now = "now"


class ChangeVerdict(StrEnum):
    """Answer to whether a statistic of one run is better or worse than that of another, by more than a margin.

    none: it is shown to differ by less than the margin.
    """

    worse = "worse"
    better = "better"
    none = "no difference"
    undecided = "undecided"


class ComparedAges(StrEnum):
    """Ages that the verdict of a comparison is about.

    every: each single age, and their mean. mean: the mean over ages alone.
    """

    every = "every"
    mean = "mean"


class InputKind(StrEnum):
    """What a measurement depends on.

    file: the content of a file. folder: the names in a folder. code: a source file of a plug-in. frames: the number of
    frames that the reader finds. unknown: a program that reads files which are not known.
    """

    file = "file"
    folder = "folder"
    code = "code"
    frames = "frames"
    unknown = "unknown"
