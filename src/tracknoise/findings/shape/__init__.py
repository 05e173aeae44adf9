"""What shape errors have: moments, tails, and what other densities gain over the Gaussian."""
