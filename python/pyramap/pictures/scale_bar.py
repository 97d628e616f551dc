"""A length to compare with, below a picture taken with parallel rays."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from .rendering import BACKGROUND
from .views import View

_INK = (60, 60, 60)


def with_scale_bar(image: NDArray[np.uint8], view: View) -> NDArray[np.uint8]:
    """The image with a strip added below it, in which a bar says how long 1, 2 or 5 times a power of ten metres are.

    Args:
        image: (height, width, 3) as `mesh_image` drew it.
        view: The view that it drew; under perspective no one scale holds, and the image is returned as it is.

    Returns:
        (height + strip, width, 3) image.
    """
    if view.perspective:
        return image
    height, width = image.shape[:2]
    text_size = max(12, width // 64)
    metres = round_length(view.width / 5)
    pixels = round(metres / view.width * width)
    canvas = Image.new("RGB", (width, height + 3 * text_size), BACKGROUND)
    canvas.paste(Image.fromarray(image), (0, 0))
    draw = ImageDraw.Draw(canvas)
    left, middle, tick = text_size, height + 1.5 * text_size, text_size / 3
    draw.line([(left, middle), (left + pixels, middle)], fill=_INK, width=2)
    for x in (left, left + pixels):
        draw.line([(x, middle - tick), (x, middle + tick)], fill=_INK, width=2)
    font = ImageFont.load_default(size=text_size)
    draw.text((left + pixels + text_size / 2, middle), f"{metres:g} m", fill=_INK, font=font, anchor="lm")
    return np.asarray(canvas)


def round_length(about: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is at most `about`."""
    power = 10.0 ** math.floor(math.log10(about))
    return power * max(step for step in (1, 2, 5) if step * power <= about * (1 + 1e-9))
