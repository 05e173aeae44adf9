"""Is the truth at fault: what the errors of all trackers say about poses, calibration and clock."""
