"""Faults of the truth: what a recording shows before it is measured, and what errors of all trackers show then."""
