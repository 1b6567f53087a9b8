"""Kernels of the delta robot: its equations, and those of its kinematics and controllers."""
