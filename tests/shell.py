"""Calls the shell in this process, on a small simulated data set."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyramap as pm
from numpy.typing import NDArray
from PIL import Image
from pyramap.cli import app
from typer.testing import CliRunner

CAMERA = pm.PinholeCamera(width=80, height=60, fx=60, fy=60, cx=39.5, cy=29.5)
FRAMES = 12
RESOLUTION = "0.1"


class Said(NamedTuple):
    """What a command wrote, without the colours that CI services ask for."""

    stdout: str
    stderr: str


def run(*arguments: object, code: int = 0) -> Said:
    """Call the shell in this process and check its exit code."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exit_code == code, f"{result.output}\n{result.exception!r}"
    assert "Traceback" not in result.output
    return Said(*(re.sub(r"\x1b\[[0-9;]*m", "", text) for text in (result.stdout, result.stderr)))


def start_shell(arguments: Iterable[object]) -> subprocess.Popen[str]:
    """Start the shell in a process of its own."""
    command = [sys.executable, "-W", "error", "-m", "pyramap", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def json_of(result: Said) -> Any:
    """The one JSON object on stdout; nothing else may be there or, as no one watches, on stderr."""
    assert result.stderr == ""
    (line,) = result.stdout.splitlines()
    return json.loads(line)


def rows(matrix: NDArray[np.float64]) -> str:
    return "\n".join(" ".join(repr(float(value)) for value in row) for row in matrix) + "\n"


def png_bytes(path: Path) -> NDArray[np.uint8]:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def write_office(folder: Path) -> Path:
    """12 views of the simulated office in the layout of 7-Scenes."""
    folder.mkdir()
    scene = pm.scenes.office_loop()
    for n, pose in enumerate(scene.poses()[: FRAMES * 4 : 4]):
        millimetres = np.round(1000 * scene.render(CAMERA, pose)).astype(np.uint16)
        Image.fromarray(millimetres).save(folder / f"frame-{n:06d}.depth.png")
        (folder / f"frame-{n:06d}.pose.txt").write_text(rows(pose))
    k = [[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]]
    (folder / "camera-intrinsics.txt").write_text(rows(np.array(k)))
    return folder
