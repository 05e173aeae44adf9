"""Analysis: from sums per scene to findings with intervals, tests and verdicts, by tables and arrays alone."""
