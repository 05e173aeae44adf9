"""Whether an estimator gains from a noise model: small estimators, trials of noise assumptions, and controls."""
