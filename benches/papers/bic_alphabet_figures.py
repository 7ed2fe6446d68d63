"""Figures 4 to 7 of the alphabet paper on our scans; drawn by bic_alphabet_table.py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from alphabet_scans import ROOM_RESOLUTION, distinct, hall, room, street
from numpy.typing import NDArray

import surfabet as sb

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

ROOM: dict[str, Any] = {"min_range": 0.5, "angular_resolution": ROOM_RESOLUTION}
# The view: from the front, from above.
TURN, TILT = np.radians(30), np.radians(55)
FEW_WORDS = 10


def plot_bic(axes: Axes, model: sb.BicAlphabetModel) -> None:
    trace = np.array(model.report.objectives["bic"])
    axes.plot(np.arange(1, len(trace) + 1), trace / 1e3)
    axes.set(xlabel="iteration", ylabel="BIC (thousands)")


def plot_counts(axes: Axes, model: sb.BicAlphabetModel) -> None:
    counts = np.sort(model.counts)[::-1]
    axes.bar(np.arange(1, len(counts) + 1), counts)
    axes.set(xlabel="word", ylabel="occurrences", title=f"{len(counts)} words")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def save(out: Path, name: str, figure: Any) -> None:
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / f"{name}.png", dpi=110)
    plt.close(figure)


def plot(out: Path, name: str, model: sb.BicAlphabetModel, title: str) -> None:
    """The BIC against iterations (4b), and occurrences per word (6)."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    plot_bic(axes[0], model)
    axes[0].set(title=title)
    plot_counts(axes[1], model)
    save(out, name, figure)


def show(
    axes: Axes,
    points: NDArray[np.float32],
    title: str,
    marked: NDArray[np.bool_] | None = None,
    below: float | None = None,
) -> None:
    """Points seen obliquely from above, without the upper ones, which would hide the rest."""
    high = np.quantile(points[:, 2], 0.7) if below is None else below
    low = points[:, 2] < high
    x, y, z = points[low].astype(np.float64).T
    across = np.cos(TURN) * x + np.sin(TURN) * y
    away = np.cos(TURN) * y - np.sin(TURN) * x
    up = np.sin(TILT) * away + np.cos(TILT) * z
    order = np.argsort(-away + 1e-3 * z)
    colors: Any = z[order]
    kinds: dict[str, Any] = {"cmap": "viridis"}
    if marked is not None:
        colors, kinds = np.where(marked[low][order], "goldenrod", "royalblue"), {}
    axes.scatter(across[order], up[order], c=colors, s=0.25, linewidths=0, rasterized=True, **kinds)
    axes.set(title=title, aspect="equal")
    axes.set_axis_off()


def of_word(model: sb.BicAlphabetModel, word: int, decoded: NDArray[Any]) -> NDArray[np.bool_]:
    """Which of the decoded points are those of one word's occurrences."""
    poses = model.poses[model.words == word]
    points = model.alphabet.points[word]
    placed = np.einsum("mab,kb->mka", poses[:, :3, :3], points) + poses[:, None, :3, 3]
    distances, _ = sb.KdTree(placed.reshape(-1, 3).astype(np.float32)).query(decoded)
    return np.asarray(distances).reshape(-1) < 1e-4


def room_figures(out: Path, iterations: int) -> None:
    """The scan, its BIC, and what ten and all words decode to (4); the second scan (5)."""
    cloud = room(1)
    model = sb.learn_bic_alphabet(cloud, radius=0.1, iterations=iterations, **ROOM)
    few = model.alphabet.first(FEW_WORDS).describe(cloud, **ROOM)
    figure, axes = plt.subplots(2, 2, figsize=(10, 8), layout="constrained")
    show(axes[0, 0], distinct(cloud, ROOM["min_range"]), "(a) scan")
    plot_bic(axes[0, 1], model)
    axes[0, 1].set(title="(b) BIC")
    for axis, part, of in ((axes[1, 0], "c", few), (axes[1, 1], "d", model)):
        show(axis, of.decode().points, f"({part}) {len(of.alphabet)} words")
    save(out, "bic_alphabet_figure4", figure)

    other = room(2)
    rebuilt = model.alphabet.describe(other, **ROOM)
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    show(axes[0], distinct(other, ROOM["min_range"]), "second scan")
    show(axes[1], rebuilt.decode().points, "in the words of the first")
    save(out, "bic_alphabet_figure5", figure)


def figures(out: Path, iterations: int) -> None:
    """Draws figures 4 to 7 into a folder."""
    room_figures(out, iterations)

    model = sb.learn_bic_alphabet(hall(), radius=0.1, min_range=0.5, iterations=iterations)
    decoded = model.decode().points
    first = int(np.argmax(model.counts))
    figure, axes = plt.subplots(1, 2, figsize=(12, 5), layout="constrained", width_ratios=(2, 1))
    show(axes[0], decoded, "yellow: the most frequent word", of_word(model, first, decoded))
    plot_counts(axes[1], model)
    save(out, "bic_alphabet_figure6", figure)

    cloud = street()
    model = sb.learn_bic_alphabet(cloud, radius=0.25, min_range=2.5, iterations=iterations)
    decoded = model.decode().points
    assert cloud.viewpoints is not None
    middle = cloud.viewpoints[1]
    near = np.abs(decoded - middle).max(axis=1) < 40
    figure, axis = plt.subplots(figsize=(10, 6), layout="constrained")
    show(axis, decoded[near], "street, the second scan", below=middle[2] + 4)
    save(out, "bic_alphabet_figure7", figure)
