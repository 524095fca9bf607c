"""Measurements, run by hand; their results are the tables beside them."""
