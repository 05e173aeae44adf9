"""Comparing runs: whether they can be compared, what is read of them, and the result."""
