"""The inverse sensor model along a ray, as the library computes it, and where its mesh would lie."""

import numpy as np
import pyramap as pm
from _style import BLUE, GREY, VERMILION, figure, save

READING, SIGMA = 2.0, 0.1

drawn = figure(3.4)
axes = drawn.subplots()
distances = np.linspace(1.4, 2.5, 600)
models = (pm.SensorModel(sigma=SIGMA), pm.SensorModel(sigma=SIGMA, surface_offset="centred"))
drawn_as = (("the paper's model", VERMILION, (-8, 6), "right"), ('surface_offset="centred"', BLUE, (8, -14), "left"))
for model, (name, colour, place, side) in zip(models, drawn_as, strict=True):
    log_odds = np.array([model.log_odds(z, READING) for z in distances])
    zero = distances[np.argmax(log_odds > 0)]
    axes.plot(distances, log_odds, color=colour, label=name)
    axes.plot(zero, 0, "o", color=colour)
    axes.annotate(f"mesh at {zero:.2f} m", (zero, 0), place, textcoords="offset points", color=colour, ha=side)
axes.axhline(0, color=GREY, lw=0.8)
axes.axvline(READING, color=GREY, ls="--", lw=1)
axes.text(READING + 0.01, -0.8, "the reading", color="#555555")
axes.text(1.42, -0.7, "free")
axes.text(2.42, 0.12, "unknown")
axes.set(xlabel="distance along the ray (m)", ylabel="log-odds that are added", xlim=(1.4, 2.5))
axes.set_title(f"One reading of {READING:g} m, k = $\\sigma$ = {SIGMA:g} m", loc="left")
axes.legend(loc="upper left")
save(drawn)
