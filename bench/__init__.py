"""Measurements, run by hand; the results are committed as the Markdown tables in this folder."""
