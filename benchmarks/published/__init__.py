"""The published benchmark: rounds, the command that measures them, and the page of their results."""
