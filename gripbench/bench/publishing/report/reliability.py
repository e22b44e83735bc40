"""A board of uncertainty in, its reliability diagram out: stated against observed shares.

The points are the stated intervals of 50, 90 and 95 %. Below the diagonal a method is
overconfident: its intervals hold the truth less often than it says.
"""

from __future__ import annotations

import html
import math

from gripbench.bench.publishing.figures.style import SERIES
from gripbench.bench.ranking.ranking import Board
from gripbench.bench.scoring.distributions import LEVELS

_SIZE, _MARGIN, _LINE = 360.0, 40.0, 18.0


def reliability_diagram(board: Board) -> str:
    """Return the diagram as SVG within a `div`, the board's target in `data-target`."""
    lines = board.lines[board.lines["score"].notna()].to_dict("records")
    head = f'<div class="reliability scroll" data-target="{html.escape(board.target)}">'
    curves = []
    for line in lines:
        shares = [float(line[f"coverage_{100 * level:.0f}"]) for level in LEVELS]
        points = [point for point in zip(LEVELS, shares, strict=True) if math.isfinite(point[1])]
        if points:
            curves.append((str(line["label"]), points))
    if not curves:
        return f"{head}</div>"
    height = max(_SIZE, 2.0 * _MARGIN + _LINE * len(curves))
    parts = [_line(_at(0.0), _at(1.0), _at(1.0), _at(0.0), "diagonal")]
    for level in (0.0, 0.5, 0.9, 1.0):
        x, y = _at(level), _at(1.0 - level)
        parts += [
            _line(x, _at(0.0), x, _at(1.0), "grid"),
            _line(_at(0.0), y, _at(1.0), y, "grid"),
            f'<text x="{x:.1f}" y="{_at(1.0) + 16.0:.1f}" text-anchor="middle">{level:g}</text>',
            f'<text x="{_at(0.0) - 6.0:.1f}" y="{y + 4.0:.1f}" text-anchor="end">{level:g}</text>',
        ]
    for number, (label, points) in enumerate(curves):
        color = SERIES[number % len(SERIES)].color
        path = " ".join(f"{_at(x):.1f},{_at(1.0 - y):.1f}" for x, y in [(0.0, 0.0), *points])
        y = _MARGIN + _LINE * number
        parts += [
            f'<polyline points="{path}" stroke="{color}"><title>{html.escape(label)}</title>'
            "</polyline>",
            *(
                f'<circle cx="{_at(x):.1f}" cy="{_at(1.0 - y_):.1f}" r="3" fill="{color}"/>'
                for x, y_ in points
            ),
            f'<line x1="{_SIZE + 6.0:.0f}" x2="{_SIZE + 26.0:.0f}" y1="{y - 4.0:.1f}" '
            f'y2="{y - 4.0:.1f}" stroke="{color}" stroke-width="2"/>',
            f'<text x="{_SIZE + 32.0:.0f}" y="{y:.1f}">{html.escape(label)}</text>',
        ]
    title = html.escape(f"Reliability: {board.title}")
    width = 2.2 * _SIZE
    return (
        f'{head}<svg viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" role="img" '
        f'aria-label="{title}">{"".join(parts)}</svg></div>'
    )


def _at(share: float) -> float:
    return _MARGIN + (_SIZE - 2.0 * _MARGIN) * share


def _line(x: float, y: float, to_x: float, to_y: float, name: str) -> str:
    return f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{to_x:.1f}" y2="{to_y:.1f}" class="{name}"/>'
