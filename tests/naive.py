"""The brute-force twins live in rtcore.reports.oracle; here are their names as tests know them."""
from rtcore.reports.oracle import TWINS, Crossing, crossings, mp, nearest, vector

__all__ = ["TWINS", "Crossing", "crossings", "mp", "nearest", "vector"]
