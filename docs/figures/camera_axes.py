"""The axes of a camera and of its image, and what depth and range are."""

from _style import BLUE, GREEN, GREY, VERMILION, figure, save
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Rectangle


def arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], colour: str, name: str) -> None:
    """A named arrow."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2})
    axes.annotate(name, end, (6, 5), textcoords="offset points", color=colour, annotation_clip=False)


drawn = figure(3.3)
camera, image, depth = drawn.subplots(1, 3, width_ratios=[0.9, 1.2, 1.4])

arrow(camera, (0, 0), (1, 0), VERMILION, "x right")
arrow(camera, (0, 0), (0, -1), GREEN, "y down")
arrow(camera, (0, 0), (0.6, 0.6), BLUE, "z forward")
camera.add_patch(Rectangle((-0.18, -0.12), 0.36, 0.24, color=GREY, zorder=-1))
camera.set(xlim=(-0.4, 1.9), ylim=(-1.3, 1.0), aspect="equal", title="camera axes")
camera.axis("off")

columns, rows = 5, 4
for u in range(columns):
    for v in range(rows):
        image.add_patch(Rectangle((u - 0.5, v - 0.5), 1, 1, fill=False, edgecolor=GREY))
        image.plot(u, v, ".", color=GREY, ms=4)
image.plot(0, 0, "o", color=VERMILION)
image.annotate("(0, 0)", (0, 0), (4, -12), textcoords="offset points", color=VERMILION)
image.plot(-0.5, -0.5, "s", color=BLUE)
image.annotate("(-0.5, -0.5)", (-0.5, -0.5), (4, 5), textcoords="offset points", color=BLUE)
image.set(xlim=(-0.7, columns - 0.3), ylim=(rows - 0.3, -1.2), aspect="equal", title="pixel centres are integers")
image.set(xlabel="column u", ylabel="row v", xticks=range(columns), yticks=range(rows))

depth.plot([-1.5, 1.5], [2, 2], color="black", lw=4)
depth.plot([0, 1.2], [0, 2], color=VERMILION)
depth.plot([1.2, 1.2], [0, 2], color=BLUE, ls="--")
depth.plot([0, 1.35], [0, 0], color=GREY, lw=0.8)
depth.add_patch(Circle((0, 0), 0.08, color="black"))
depth.text(0.5, 1.15, "range:\nalong the ray", color=VERMILION, ha="right")
depth.text(1.28, 0.8, "depth:\nalong z", color=BLUE)
depth.text(-1.5, 2.1, "wall")
depth.text(-0.1, -0.25, "camera", ha="center")
depth.set(xlim=(-1.7, 1.9), ylim=(-0.4, 2.4), aspect="equal", title="depth and range")
depth.axis("off")
save(drawn)
