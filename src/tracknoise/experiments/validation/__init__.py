"""Self-test: measurement of errors of known size."""
