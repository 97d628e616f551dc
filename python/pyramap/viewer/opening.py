"""Where a recording goes: to the viewer on this screen, or into a file."""

from __future__ import annotations

import os
import shutil
import socket
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from .errors import ViewerError

if TYPE_CHECKING:
    import rerun

    from .recorder import Recorder

PORT = 9876
"""Where Rerun's viewer listens."""

_APPLICATION = "pyramap"
_SAVE_INSTEAD = (
    "Save the recording instead (`pyramap view --save`, `pyramap map --save-view`), and open the file where there is "
    "a display, with `rerun FILE.rrd`"
)
_SECONDS_TO_SEND = 10.0
"""How long the end waits for the viewer to take what is left; one that was closed never does."""


@contextmanager
def saving(path: str | os.PathLike[str], *, frames: bool = True) -> Iterator[Recorder]:
    """Record into a file, which `rerun FILE` or the viewer's menu opens.

    Args:
        path: Written while the recording goes on; complete when the block ends.
        frames: Whether frames will be shown too, so that there must be room for images.

    Raises:
        ViewerError: Rerun is not installed.
        OSError: The file cannot be written.
    """
    recorder = _recorder(frames)
    stream = recorder.stream
    path = Path(path)
    with path.open("wb"):
        pass  # Rerun has one message for all that keeps a file from being written; the system's own are better.
    stream.save(path, default_blueprint=recorder.blueprint)
    try:
        yield recorder
    finally:
        stream.disconnect()


@contextmanager
def live(*, frames: bool = True) -> Iterator[Recorder]:
    """Show in the viewer: the one that is open, or else one that is started, and stays when the block ends.

    Args:
        frames: Whether frames will be shown too, so that there must be room for images.

    Raises:
        ViewerError: Rerun is not installed, there is no display, or the viewer cannot be started.
    """
    recorder = _recorder(frames)
    stream = recorder.stream
    if not _is_listening():
        check_display(os.environ, sys.platform)
        _start_viewer(stream)
    stream.connect_grpc(f"rerun+http://127.0.0.1:{PORT}/proxy", default_blueprint=recorder.blueprint)
    try:
        yield recorder
    finally:
        # Who has closed the viewer knows; what was mapped meanwhile must not be lost for it.
        with suppress(RuntimeError):
            stream.flush(timeout_sec=_SECONDS_TO_SEND)
        stream.disconnect()


def check_display(environment: Mapping[str, str], platform: str) -> None:
    """Find out whether there is a screen to show something on.

    Raises:
        ViewerError: There is none.
    """
    if platform.startswith("linux") and not (environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")):
        raise ViewerError(f"no display: neither DISPLAY nor WAYLAND_DISPLAY is set. {_SAVE_INSTEAD}")


def _recorder(frames: bool) -> Recorder:
    try:
        import rerun
    except ImportError as error:
        raise ViewerError("this needs Rerun, which is not installed: pip install 'pyramap[viz]'") from error
    from .recorder import Recorder

    stream = rerun.RecordingStream(_APPLICATION)
    if not rerun.is_enabled(stream):
        raise ViewerError("Rerun is switched off: unset the environment variable RERUN")
    return Recorder(stream, frames)


def _start_viewer(stream: rerun.RecordingStream) -> None:
    import rerun

    # The package's own viewer comes first: recordings are not understood by viewers of other versions.
    places = os.pathsep.join([sysconfig.get_path("scripts"), os.environ.get("PATH", "")])
    program = shutil.which("rerun", path=places)
    if program is None:
        raise ViewerError("Rerun's viewer, the program `rerun`, is not found: pip install --force-reinstall rerun-sdk")
    rerun.spawn(port=PORT, connect=False, executable_path=program, recording=stream)
    if not _is_listening():
        raise ViewerError(f"the viewer ({program}) ended, or did not answer; it may have said why. {_SAVE_INSTEAD}")


def _is_listening() -> bool:
    with socket.socket() as probe:
        probe.settimeout(0.5)
        return probe.connect_ex(("127.0.0.1", PORT)) == 0
