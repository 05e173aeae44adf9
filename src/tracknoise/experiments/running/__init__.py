"""Plan, measure and resume runs. Only this package uses Dask."""
