"""Write the animation of the README: a slider-crank with 25 realisations, and bands of the position of its slider.

``python studies/pictures/readme.py docs/slider_crank.gif`` takes about a minute.
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
from PIL import Image, ImageSequence

import uqmbd.report
from uqmbd_montecarlo import MonteCarlo

sys.path.insert(0, str(Path(__file__).parents[1]))
from slider_crank import study

FRAMES, SECONDS, COLOURS, DPI = 50, 4.0, 48, 100


def mechanism() -> list[Image.Image]:
    """Draw the mechanism with its realisations at each time."""
    motion = uqmbd.report.motion(study, samples=25, frames=FRAMES)
    with tempfile.TemporaryDirectory() as folder:
        film = uqmbd.report.animate(motion, Path(folder, "film.gif"), seconds=SECONDS, width=5.4)
        return [frame.convert("RGB") for frame in ImageSequence.Iterator(Image.open(film))]


def bands(height: int) -> list[Image.Image]:
    """Draw the bands with a cursor at each time."""
    tree = study.with_propagators([MonteCarlo(samples=500, seed=1)]).run()
    pictures = []
    with plt.rc_context({"font.size": 8}):
        figure, axes = plt.subplots(figsize=(3.6, height / DPI), dpi=DPI, layout="constrained")
        uqmbd.report.bands(tree, "slider_x", ax=axes)
        bottom, top = axes.get_ylim()
        axes.set_ylim(bottom, top + 0.4 * (top - bottom))  # room for the legend
        legend = axes.get_legend()
        assert legend is not None
        legend.set(loc="upper center")
        line = axes.axvline(0.0, color="0.2", linewidth=1.0)
        for frame in range(FRAMES):
            time = study.times[-1] * frame / (FRAMES - 1)
            line.set_xdata([time, time])
            written = io.BytesIO()
            figure.savefig(written, dpi=DPI)
            pictures.append(Image.open(written).convert("RGB"))
        plt.close(figure)
    return pictures


def main(target: Path) -> None:
    """Write mechanism and bands, next to each other, as an animated GIF."""
    left = mechanism()
    right = bands(left[0].height)
    frames = []
    for one, other in zip(left, right, strict=True):
        whole = Image.new("RGB", (one.width + other.width, one.height), "white")
        whole.paste(one, (0, 0))
        whole.paste(other, (one.width, 0))
        frames.append(whole.quantize(COLOURS, dither=Image.Dither.NONE))
    frames[0].save(target, save_all=True, append_images=frames[1:], duration=round(1000 * SECONDS / FRAMES), loop=0)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
