"""Figures of the papers by number: what a figure is, and how a paper's set is written."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gripbench.bench.publishing.figures.runs import Runs
from gripbench.bench.publishing.figures.style import save, style
from gripbench.errors import InputError, unknown
from gripbench.writing import write_atomically

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAPERS = ("anderson2004", "dakhlallah2008", "li2014", "yoon2015")
"""Papers whose figures can be drawn; each is a module of this package."""


@dataclass(frozen=True)
class PaperFigure:
    """A figure.

    Attributes
    ----------
    label
        Its number in the paper, or the name of a figure that the paper does not have.
    title
        What is shown.
    caption
        What to see in it.
    draw
        Draws it from runs; called within `style.style`.
    """

    label: str
    title: str
    caption: str
    draw: Callable[[Runs], Figure]

    @property
    def stem(self) -> str:
        """Name of its files without suffix."""
        return f"figure_{int(self.label):02d}" if self.label.isdigit() else self.label


def paper_figures(paper: str) -> tuple[PaperFigure, ...]:
    """Return the figures of a paper.

    Raises
    ------
    InputError
        If there is no such paper.
    """
    if paper not in PAPERS:
        raise unknown("paper", paper, PAPERS)
    module = importlib.import_module(f"gripbench.bench.papers.{paper}.figures")
    figures: tuple[PaperFigure, ...] = module.FIGURES
    return figures


def choose(paper: str, labels: Iterable[str]) -> tuple[PaperFigure, ...]:
    """Return the figures of a paper with these labels, all where none is given.

    Raises
    ------
    InputError
        If the paper has no such result figure.
    """
    figures = {figure.label: figure for figure in paper_figures(paper)}
    wanted = tuple(labels)
    for label in wanted:
        if label not in figures:
            raise InputError(f"{paper} has no figure '{label}'; there are {', '.join(figures)}")
    return tuple(figures[label] for label in wanted) or tuple(figures.values())


def write_figures(
    paper: str,
    directory: Path,
    labels: Iterable[str] = (),
    dpi: int = 150,
    advance: Callable[[], None] = lambda: None,
) -> list[Path]:
    """Draw figures of a paper as PNG and PDF, and an index of all of them with their captions.

    Parameters
    ----------
    paper
        Name of the paper.
    directory
        Where they go.
    labels
        Which; none: all.
    dpi
        Resolution of the PNG files.
    advance
        Called after each figure, for a progress bar.
    """
    runs = Runs()
    paths = []
    for figure in choose(paper, labels):
        with style():
            paths += save(figure.draw(runs), directory, figure.stem, dpi)
        advance()
    index = directory / "README.md"
    write_atomically(index, _index(paper, directory))
    return [*paths, index]


def _index(paper: str, directory: Path) -> str:
    """Return Markdown that shows the figures that lie in a directory, each with its caption."""
    parts = [f"# Figures of {paper}\n", f"Drawn by `gripbench figures {paper}`.\n"]
    for figure in paper_figures(paper):
        if (directory / f"{figure.stem}.png").is_file():
            name = f"Figure {figure.label}" if figure.label.isdigit() else figure.label.capitalize()
            parts.append(f"## {name}. {figure.title}\n")
            parts.append(f"![{figure.title}]({figure.stem}.png)\n")
            parts.append(f"{figure.caption} [PDF]({figure.stem}.pdf)\n")
    return "\n".join(parts)
