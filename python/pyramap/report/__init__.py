"""A map on one HTML page that needs no other file: what it is, slices, its surface to turn, and how it was made."""

from .geometry import MOST_FACES, Geometry, decimated
from .page import Report, make
from .statistics import Statistics, count

__all__ = ["MOST_FACES", "Geometry", "Report", "Statistics", "count", "decimated", "make"]
