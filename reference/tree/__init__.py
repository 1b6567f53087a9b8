"""Dynamics of any scene of bodies on joints by kernels that are compiled once: a model is a table in the parameters."""
