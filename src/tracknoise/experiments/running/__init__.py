"""Planning, measuring and resuming a run: the only place that knows Dask."""
