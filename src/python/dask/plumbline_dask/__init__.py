"""Runs the tasks of a plumbline plan on a Dask cluster: see `python -m plumbline_dask --help`."""
