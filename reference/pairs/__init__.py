"""Gaps between shapes in closed form, with their first and second derivatives along a motion."""
