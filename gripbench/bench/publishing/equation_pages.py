"""The sources of methods and plants in; out, a page that leads from a paper's equation to its code.

The index is read from the docstrings: a module names its paper, and its functions the equations
that they hold ("eq. 16-20", "eq. 9 and 12").
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import gripbench
from gripbench.bench.publishing.columns import Column, Table
from gripbench.bench.publishing.tables import markdown

PAPERS = {
    "Li, Du & Li (2014)": re.compile(r"Li, Du & Li \(2014\)"),
    "Yoon, Li & Ahn (2015)": re.compile(r"Yoon, Li & Ahn \(2015\)"),
    "Dakhlallah et al. (2008)": re.compile(r"Dakhlallah[^(]*\(2008\)"),
    "Anderson & Bevly (2004)": re.compile(r"Anderson & Bevly \(2004\)"),
}
_ROOMS = ("methods", "envs/plants", "envs/tyres")
_EQUATIONS = re.compile(r"\beqs?\. ((?:\d+[a-z]?(?:-\d+)?(?:, | and )?)+)")
_SUFFIX = re.compile(r"[a-z]")


@dataclass(frozen=True)
class Place:
    """Where an equation stands in the code.

    Attributes
    ----------
    paper
        The paper's short name.
    equation
        Its number.
    path
        File, relative to the package.
    name
        Function, class or method; empty: the module as a whole.
    """

    paper: str
    equation: int
    path: str
    name: str


@cache
def places() -> tuple[Place, ...]:
    """Return every place that a docstring gives an equation, by paper, equation and file."""
    root = Path(gripbench.__file__).parent
    found = {
        place
        for room in _ROOMS
        for path in sorted((root / room).rglob("*.py"))
        for place in _of_module(path, path.relative_to(root).as_posix())
    }
    order = list(PAPERS)
    key = lambda p: (order.index(p.paper), p.equation, p.name == "", p.path, p.name)  # noqa: E731
    return tuple(sorted(found, key=key))


def equations_page() -> str:
    """Return the index as Markdown."""
    parts = [
        "# From an equation to its code\n",
        "Read from the docstrings of methods, plants and tyres when this page is built. The same "
        "docstrings say which printed equation was corrected, and why.\n",
    ]
    columns = (Column("equation", "Eq."), Column("function", "In"), Column("file", "File"))
    for paper in PAPERS:
        rows = tuple(
            dict(zip(("equation", "function", "file"), line[1:], strict=True))
            for line in equation_lines()[1]
            if line[0] == paper
        )
        parts += [f"## {paper}\n", markdown(Table(columns, rows, "")), ""]
    return "\n".join(parts)


def equation_lines() -> tuple[tuple[str, ...], Sequence[tuple[str, ...]]]:
    """Return header and lines of the index: paper, equation, function and file."""
    # a module's summary is named where no function of it holds the equation
    held = {(place.paper, place.equation, place.path) for place in places() if place.name}
    lines = [
        (place.paper, f"({place.equation})", place.name or "the module", f"gripbench/{place.path}")
        for place in places()
        if place.name or (place.paper, place.equation, place.path) not in held
    ]
    return ("paper", "equation", "in", "file"), lines


def _of_module(path: Path, name: str) -> Iterator[Place]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    summary = ast.get_docstring(tree) or ""
    paper = _paper_of(summary)
    nodes: list[tuple[str, str]] = [("", summary)]
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            nodes.append((node.name, " ".join((ast.get_docstring(node) or "", _reference(node)))))
    for function, text in nodes:
        here = _paper_of(text) or paper
        if here:
            for equation in _numbers(text):
                yield Place(here, equation, name, function)


def _reference(node: ast.AST) -> str:
    """Return the `reference` that a method declares, paper and equations; empty: none."""
    for entry in getattr(node, "body", ()):
        if isinstance(entry, ast.Assign) and ast.unparse(entry.targets[0]) == "reference":
            return str(ast.literal_eval(entry.value))
    return ""


def _paper_of(text: str) -> str:
    """Return the first paper that a text names; empty: none."""
    flat = " ".join(text.split())
    hits = {paper: found.start() for paper, form in PAPERS.items() if (found := form.search(flat))}
    return min(hits, key=hits.__getitem__, default="")


def _numbers(text: str) -> Iterator[int]:
    for found in _EQUATIONS.finditer(" ".join(text.split())):
        for part in re.split(r", | and ", found[1]):
            ends = [int(_SUFFIX.sub("", end)) for end in part.split("-") if end]
            if ends:
                yield from range(ends[0], ends[-1] + 1)
