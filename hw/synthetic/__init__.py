"""Logs of a rig that MuJoCo computed; they are no measurement."""
