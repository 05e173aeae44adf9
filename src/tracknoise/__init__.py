"""Measure how wrong feature tracks are."""
