"""Runs on workers, and how they and their provenance are kept on disk."""
