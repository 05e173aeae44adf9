"""Sizes and shapes of errors, by age, frame and aspect: moments, robust scales, changes, samples."""
