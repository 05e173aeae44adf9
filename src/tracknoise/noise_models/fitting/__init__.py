"""Fits of noise models to the sums of many scenes."""
