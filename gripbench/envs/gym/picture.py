"""The figure of a drive from above, its parts by name; `rendering` moves them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from gripbench.envs.gym.view import Body

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, HEIGHT, DPI = 800, 600, 100
"""Size of a frame [pixels], and how many of them a matplotlib inch has."""

FRICTION = (0.0, 1.2)
"""Range of the colours [-]."""

AHEAD = 22.0
"""How far the map reaches ahead of the car, in wheelbases."""

DOTS = 10.0
"""Distance between the dots on the ground [m]."""

_BEHIND, _ASIDE = 8.0, 6.0  # in wheelbases


def lay_out(figure: Figure, body: Body) -> dict[str, Any]:
    """Put the map, the car and the text into a figure.

    Returns
    -------
    The parts that move by name, all of them in the order of drawing as `moving`, and the map of
    `colours`.
    """
    from matplotlib import colormaps

    colours = colormaps["viridis"].with_extremes(bad="#808080")  # NaN: no limit
    parts: dict[str, Any] = {"colours": colours, "moving": []}
    _lay_out_map(figure, body, parts)
    _lay_out_car(figure, body, parts)
    parts["text"] = _moving(
        parts, figure.text(0.64, 0.43, "", family="monospace", size=8.5, va="top", linespacing=1.35)
    )
    return parts


def _moving(parts: dict[str, Any], artist: Any) -> Any:
    artist.set_animated(True)  # not drawn with what stands still
    parts["moving"].append(artist)
    return artist


def _lay_out_map(figure: Figure, body: Body, parts: dict[str, Any]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

    base = float(np.ptp(body.wheels[:, 0]))
    road = figure.add_axes((0.075, 0.53, 0.83, 0.42))
    road.set_facecolor("#efefef")
    road.set_aspect("equal", adjustable="box")
    road.set_xlabel("ahead of the car [m]", fontsize=8)
    road.set_ylabel("to its left [m]", fontsize=8)
    road.tick_params(labelsize=7)
    road.set_xlim(-_BEHIND * base, AHEAD * base)
    road.set_ylim(-_ASIDE * base, _ASIDE * base)
    parts["title"] = _moving(parts, road.set_title(" ", fontsize=10))
    dots = Line2D([], [], color="#9a9a9a", marker=".", ms=2.0, ls="")
    parts["dots"] = _moving(parts, road.add_line(dots))
    (path,) = road.plot([], [], color="black", lw=1.0, ls="--")
    parts["path"] = _moving(parts, path)
    trail = road.scatter(
        [], [], c=[], s=5.0, cmap=parts["colours"], vmin=FRICTION[0], vmax=FRICTION[1],
        plotnonfinite=True,
    )  # fmt: skip
    parts["trail"] = _moving(parts, trail)
    outline = Polygon(body.outline, closed=True, fc="#d55e00", ec="black", lw=0.6, alpha=0.85)
    _moving(parts, road.add_patch(outline))  # it stands still, but over the trail
    velocity = road.quiver(
        [0.0], [0.0], [0.0], [0.0], angles="xy", scale_units="xy", scale=1.0, width=0.003,
        color="#0072b2",
    )  # fmt: skip
    parts["velocity"] = _moving(parts, velocity)
    handles = [
        Line2D([], [], color="black", lw=1.0, ls="--", label="path"),
        Line2D([], [], color=parts["colours"](0.7), lw=3.0, label="driven, by friction"),
        Line2D([], [], color="#0072b2", lw=2.0, label="velocity (1 s of it)"),
    ]
    road.legend(handles=handles, loc="upper left", fontsize=7, ncols=3, frameon=True)
    bar = figure.colorbar(trail, cax=figure.add_axes((0.93, 0.56, 0.015, 0.36)))
    bar.set_label("friction [-]", fontsize=8)
    bar.ax.tick_params(labelsize=7)


def _lay_out_car(figure: Figure, body: Body, parts: dict[str, Any]) -> None:
    from matplotlib.patches import Circle, Polygon

    base = float(np.ptp(body.wheels[:, 0]))
    car = figure.add_axes((0.02, 0.03, 0.6, 0.43))
    car.set_aspect("equal")
    car.set_axis_off()
    car.set_xlim(-1.25 * base, 1.25 * base)
    car.set_ylim(-0.8 * base, 0.8 * base)
    car.add_patch(Polygon(body.outline, closed=True, fc="#f6d9c8", ec="#d55e00", lw=0.8))
    car.text(
        0.02, -0.02, "arrows: tyre forces; circles: friction times load", fontsize=7,
        transform=car.transAxes,
    )  # fmt: skip
    parts["circles"] = [
        _moving(parts, car.add_patch(Circle(tuple(place), 0.0, fill=False, lw=2.0)))
        for place in body.wheels
    ]
    parts["wheels"] = [
        _moving(parts, car.add_patch(Polygon(body.outline, closed=True, fc="#404040")))
        for _ in range(4)
    ]
    nothing = np.zeros(4)
    forces = car.quiver(
        body.wheels[:, 0], body.wheels[:, 1], nothing, nothing, angles="xy", scale_units="xy",
        scale=1.0, width=0.008, color="#cc0000",
    )  # fmt: skip
    parts["forces"] = _moving(parts, forces)
