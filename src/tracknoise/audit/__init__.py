"""Audit of the truth: faults of the stated truth, fitted to the errors of all trackers."""
