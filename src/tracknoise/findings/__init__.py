"""Which claims hold: intervals, tests and verdicts, with the scene as the sampling unit."""
