"""The mechanisms: each module holds the kernels of one, as `KERNELS`."""
