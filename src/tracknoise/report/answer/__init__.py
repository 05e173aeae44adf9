"""The first screen of the report: what was measured, how large the errors are, and how far that can be trusted."""
