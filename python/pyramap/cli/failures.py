"""Errors as one line on stderr and an exit code."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperGroup

from .._core import DeviceError, MapFullError
from ..viewer import ViewerError

FAILED = 1
DIFFERENT = 3
"""What was compared is not the same."""
INTERRUPTED = 130
"""128 plus the number of SIGINT, as shells have it."""

EXPECTED_ERRORS = (OSError, ValueError, MapFullError, DeviceError, ViewerError, MemoryError)
"""What bad input, full disks and missing displays raise. The rest are faults of the program: they keep a traceback."""


def explain(error: BaseException) -> str:
    """The message of an error, or at least its name."""
    return str(error) or type(error).__name__


class ExplainingGroup(TyperGroup):
    """Commands whose expected errors become a message instead of a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except EXPECTED_ERRORS as error:
            typer.echo(f"error: {explain(error)}", err=True)
            raise typer.Exit(FAILED) from error
        except KeyboardInterrupt:
            typer.echo("interrupted", err=True)
            raise typer.Exit(INTERRUPTED) from None
