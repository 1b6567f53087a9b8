"""The HTML report: pages, their sections, figures and tables."""
