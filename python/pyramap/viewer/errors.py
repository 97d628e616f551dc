"""What keeps the viewer from being used."""

from __future__ import annotations


class ViewerError(Exception):
    """The viewer cannot be used; the message says what to do instead."""
