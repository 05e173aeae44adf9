"""Audit of the truth: what the errors of all trackers say about poses, calibration, depths and clock."""
