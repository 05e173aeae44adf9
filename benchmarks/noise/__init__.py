"""What noise models are worth: proofs, calibrations and tables, on runs and on simulated tracks."""
