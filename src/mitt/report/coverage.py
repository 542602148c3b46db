"""Where in the images the board's corners lay, and how well they fit."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from mitt.files.writing import write_atomically
from mitt.report.style import GREY, INK, RC
from mitt.signals import Array

#: Errors are shown this many times as long [1].
_STRETCH = 100.0
_COLOURS = "viridis_r"


def draw_coverage(
    path: Path, seen: dict[str, tuple[tuple[int, int], Array, Array]], cells: tuple[int, int]
) -> None:
    """Write a picture of the corners in each camera's image.

    Args:
        path: PNG file.
        seen: For each camera: size [px], corners, shape (n, 2), and seen minus predicted, (n, 2).
        cells: Cells across and down in which coverage is counted.
    """
    top = max(float(np.percentile(np.linalg.norm(r, axis=1), 98)) for _, _, r in seen.values())
    norm = Normalize(0.0, max(top, 1e-3))
    with matplotlib.rc_context(RC):
        figure = Figure(figsize=(4.9 * len(seen) + 0.9, 4.4), dpi=140, layout="constrained")
        canvas = FigureCanvasAgg(figure)
        panels = figure.subplots(1, len(seen), squeeze=False)[0]
        for axes, (name, (size, uv, r)) in zip(panels, seen.items(), strict=True):
            _panel(axes, name, size, uv, r, norm, cells)
        bar = figure.colorbar(ScalarMappable(norm, _COLOURS), ax=list(panels), shrink=0.75,
                              pad=0.02)  # fmt: skip
        bar.set_label(f"reprojection error [px]; lines: {_STRETCH:g} times as long", color=INK)
        bar.outline.set_visible(False)
        mark = {"Software": "mitt"}
        write_atomically(path, lambda temporary: canvas.print_png(temporary, metadata=mark))


def _panel(
    axes: Axes, name: str, size: tuple[int, int], uv: Array, r: Array, norm: Normalize,
    cells: tuple[int, int],
) -> None:  # fmt: skip
    """Draw the corners of one camera; cells without any are shaded."""
    width, height = size
    edges = [np.linspace(-0.5, n - 0.5, k + 1) for n, k in zip(size, cells, strict=True)]
    count = np.histogram2d(uv[:, 0], uv[:, 1], bins=edges)[0]
    for i, j in zip(*np.nonzero(count == 0), strict=True):
        axes.axvspan(edges[0][i], edges[0][i + 1], 1.0 - (edges[1][j] + 0.5) / height,
                     1.0 - (edges[1][j + 1] + 0.5) / height, color="#f3d9d0", lw=0, zorder=0,
                     )  # fmt: skip
    error = np.linalg.norm(r, axis=1)
    axes.quiver(uv[:, 0], uv[:, 1], _STRETCH * r[:, 0], _STRETCH * r[:, 1], color=GREY,
                alpha=0.35, angles="xy", scale_units="xy", scale=1.0, width=0.0015, headwidth=1,
                headlength=0, zorder=1)  # fmt: skip
    axes.scatter(uv[:, 0], uv[:, 1], c=error, cmap=_COLOURS, norm=norm, s=5, lw=0, zorder=2)
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal",
             xlabel="u [px]", ylabel="v [px]")  # fmt: skip
    for k, edge in enumerate(edges):
        (axes.set_xticks if k == 0 else axes.set_yticks)(np.rint(edge + 0.5))
    axes.set_title(f"{name}: rms {np.sqrt(np.mean(r**2)):.2f} px, corners in "
                   f"{int((count > 0).sum())} of {count.size} cells",
                   fontsize=9.5)  # fmt: skip
