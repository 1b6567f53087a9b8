"""Sweeps of many short runs: drawn from suites, bounded, resumable, the same whatever the number of workers.

spec       one run as plain data
draw       from a suite to specs
execute    from a spec to one row
store      rows on disk as they arrive
pools      who executes: processes here, or a dask cluster
"""
