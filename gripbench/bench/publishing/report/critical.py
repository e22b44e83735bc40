"""A board in, its critical-difference diagram out: methods on an axis, bars over those that tie.

After Demsar, Statistical comparisons of classifiers over multiple data sets, J. Mach. Learn.
Res. 7, 2006; with this project's scores in place of mean ranks, and its tied groups in place of
one critical difference for all.
"""

from __future__ import annotations

import html
import math

from gripbench.bench.ranking.ranking import Board

_WIDTH, _LEFT, _RIGHT, _LINE = 900.0, 30.0, 870.0, 20.0


def critical_differences(board: Board) -> str:
    """Return the diagram as SVG within a `div`, the board's target in `data-target`."""
    lines = board.lines[board.lines["score"].notna()].to_dict("records")
    head = f'<div class="critical scroll" data-target="{html.escape(board.target)}">'
    if not lines:
        return f"{head}</div>"
    logs = [math.log(line["score"]) for line in lines]
    span = max(logs[-1] - logs[0], 1e-9)
    places = [_LEFT + (_RIGHT - _LEFT) * (value - logs[0]) / span for value in logs]
    bars = _bars([str(line["group"]) for line in lines])
    axis = 14.0 + 10.0 * len(bars)
    half = (len(lines) + 1) // 2
    height = axis + 20.0 + _LINE * half
    parts = [_line(_LEFT, axis, _RIGHT, axis)]
    for number, (first, last) in enumerate(bars):
        y = 8.0 + 10.0 * number
        parts.append(_line(places[first] - 3.0, y, places[last] + 3.0, y, "tied"))
    for i, (line, x) in enumerate(zip(lines, places, strict=True)):
        left = i < half
        y = axis + 18.0 + _LINE * (i if left else len(lines) - 1 - i)
        end = _LEFT if left else _RIGHT
        anchor = "start" if left else "end"
        text = html.escape(f"{line['rank']} {line['label']} {line['score']:.3g}")
        parts += [
            _line(x, axis - 4.0, x, y + 3.0),
            _line(x, y + 3.0, end, y + 3.0),
            f'<text x="{end:.1f}" y="{y:.1f}" text-anchor="{anchor}">{text}</text>',
        ]
    title = html.escape(f"Critical differences: {board.title}")
    return (
        f'{head}<svg viewBox="0 0 {_WIDTH:.0f} {height:.0f}" width="{_WIDTH:.0f}" role="img" '
        f'aria-label="{title}">{"".join(parts)}</svg></div>'
    )


def _bars(groups: list[str]) -> list[tuple[int, int]]:
    """Return first and last place of each tied group of two or more."""
    letters = dict.fromkeys(letter for group in groups for letter in group if letter.isalpha())
    found = []
    for letter in letters:
        members = [place for place, group in enumerate(groups) if letter in group]
        if len(members) > 1:
            found.append((members[0], members[-1]))
    return found


def _line(x: float, y: float, to_x: float, to_y: float, name: str = "") -> str:
    kind = f' class="{name}"' if name else ""
    return f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{to_x:.1f}" y2="{to_y:.1f}"{kind}/>'
