"""Intervals of every curve and number of a run: errors, changes, lifetimes, survival and outlier ratios."""
