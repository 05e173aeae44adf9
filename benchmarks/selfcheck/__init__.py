"""Self-test: measurement of tracks whose true positions and errors are known."""
