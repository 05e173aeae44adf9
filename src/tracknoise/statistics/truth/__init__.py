"""What errors of the truth contribute: its floor, two truths, differences between trackers."""
