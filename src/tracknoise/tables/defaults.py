"""Defaults of what an experiment may set, each written once: settings, functions and the report all use these."""

from tracknoise.tables.enumerations import Population, TrimAmong, Trimming

POPULATION = Population.visible
TRIM_PERCENTILE = 90.0
"""Percentile of the largest errors of tracks above which tracks are dropped."""
TRIM_AMONG = TrimAmong.followed
TRIMMING = Trimming.untrimmed
"""Errors that headlines and verdicts are about."""
MIN_FEATURES = 100
"""Curves are cut where fewer features than this remain."""
SCAN_RADIUS_PX = 0.25
"""How near the projection of a scan point must lie to a feature."""
MARGIN = 0.10
"""Largest relative effect of a factor that does not matter: the threshold that the paper uses for lighting."""
LONGEST_STRIP = 32
"""Frames of the strip of the worst track."""
PATCH_PX = 31
"""Side of the patches that show tracks, px."""
