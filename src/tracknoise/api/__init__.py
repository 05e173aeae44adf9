"""The Python API: a finished run, or measurements in memory, from the first table to the last figure."""
