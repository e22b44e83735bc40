"""A picture of a drive from above: path, car, wheels, tyre forces and friction.

Above, the surroundings of the car in its own axes (x to the right, y up; a dot every 10 m of
ground), with the way of the left and the right wheels in the colour of their friction. Below, the
car alone with a circle of radius mu F_z at each wheel and the tyre's force in it: a force that
reaches its circle slides. A picture is drawn 25 times in a second of simulated time and held in
between, so that a video of 1000 samples a second costs no more than one of 25; what stands still
is drawn once.
"""

from __future__ import annotations

import logging
import math
import os
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from gripbench.envs.gym.arguments import ArgumentError, NotResetError
from gripbench.envs.gym.picture import AHEAD, DOTS, DPI, FRICTION, HEIGHT, WIDTH, lay_out
from gripbench.envs.gym.view import Body, View, turned, view_of
from gripbench.envs.scenarios import Scenario
from gripbench.envs.vehicles import load_vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RENDER_MODES = ("human", "rgb_array")
"""`rgb_array`: `render` returns a frame; `human`: a window that follows by itself."""

FRAME_TIME = 0.04
"""Simulated time [s] for which a picture is held."""

_MOST_TRAIL = 4000  # points of the way driven


def checked_mode(mode: str | None) -> str | None:
    """Return a render mode.

    Raises
    ------
    ArgumentError
        If there is no such mode.
    """
    if mode is not None and mode not in RENDER_MODES:
        known = ", ".join(RENDER_MODES)
        raise ArgumentError(f"render_mode is {mode!r}: known are {known} and None")
    return mode


class TopView:
    """The picture of one vehicle's drive.

    Parameters
    ----------
    scenario
        What is driven; its vehicle's file gives the size of the car.
    mode
        One of `RENDER_MODES`.
    """

    def __init__(self, scenario: Scenario, mode: str | None) -> None:
        self._title = scenario.name.replace("_", " ")
        self._body = Body.of(load_vehicle(scenario.vehicle).values())
        self._base = float(np.ptp(self._body.wheels[:, 0]))
        self._mode = mode
        self._figure: Figure | None = None
        self._parts: dict[str, Any] = {}
        self._still: Any = None  # what stands still, drawn
        self._now: View | None = None
        self._frame: npt.NDArray[np.uint8] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Leave the figure out: a copy draws its own."""
        return self.__dict__ | {"_figure": None, "_parts": {}, "_still": None}

    def begin(self, truth: np.void, path: npt.NDArray[np.float64]) -> None:
        """Start with the first sample of an episode and its path, north and west, shape (n, 2)."""
        self._now = view_of(truth, self._body)
        self._distance = 0.0
        self._heading = self._now.heading or 0.0
        self._path = turned(path, -self._heading)
        mu = self._now.mu.max()
        heaviest = self._body.loads.max() * (1.0 if math.isnan(mu) else mu)
        self._metres = 0.3 * self._base / heaviest  # length of a force in the picture over it
        self._trail: list[tuple[float, float, float]] = []
        self._added_at = self._drawn_at = -math.inf
        self._reason = ""
        self._refresh()

    def follow(self, truth: np.void, reason: str) -> None:
        """Take the next sample, and why the episode ends with it."""
        before, self._now = self._now, view_of(truth, self._body)
        assert before is not None
        mean = 0.5 * (before.speed_x + self._now.speed_x)
        self._distance += mean * (self._now.time - before.time)
        if reason:
            self._reason, self._added_at, self._drawn_at = reason, -math.inf, -math.inf
        self._refresh()

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Return the present frame, shape (HEIGHT, WIDTH, 3), read-only; None for a window.

        Raises
        ------
        NotResetError
            If no episode was started.
        """
        if self._now is None:
            raise NotResetError("call reset before render")
        if self._mode != "rgb_array":
            return None
        self._draw()
        return self._frame

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._figure is not None and self._mode == "human":
            from matplotlib import pyplot

            pyplot.close(self._figure)
        self._figure, self._parts, self._still = None, {}, None

    def _refresh(self) -> None:
        assert self._now is not None
        if self._now.time - self._added_at >= FRAME_TIME - 1e-9:
            self._add()
            if self._mode == "human":
                self._draw()

    def _add(self) -> None:
        """Put the places of the left and the right wheels on the trail."""
        now = self._now
        assert now is not None
        self._added_at = now.time
        sides = self._body.wheels[:2] * (0.0, 1.0)
        for side, (x, y) in enumerate(turned(sides, self._yaw()) + self._place()):
            self._trail.append((x, y, float(np.mean(now.mu[side::2]))))
        if len(self._trail) > _MOST_TRAIL:
            del self._trail[: _MOST_TRAIL // 4]  # long out of sight

    def _yaw(self) -> float:
        """Return the car's heading from that of the start [rad]."""
        assert self._now is not None
        return (self._now.heading or 0.0) - self._heading

    def _place(self) -> npt.NDArray[np.float64]:
        """Return the car's place in the axes of the start [m], shape (2,)."""
        assert self._now is not None
        if self._now.place is None:
            return np.array([self._distance, 0.0])
        return turned(np.array([self._now.place]), -self._heading)[0]

    def _draw(self) -> None:
        assert self._now is not None
        if self._frame is not None and self._now.time - self._drawn_at < FRAME_TIME - 1e-9:
            return
        if self._figure is None:
            self._figure = _figure(self._mode)
            self._parts = lay_out(self._figure, self._body)
            self._figure.canvas.mpl_connect("draw_event", self._keep)
        self._drawn_at = self._now.time
        canvas: Any = self._figure.canvas
        if self._still is None:
            canvas.draw()
        canvas.restore_region(self._still)
        self._update_map()
        self._update_car()
        for artist in self._parts["moving"]:
            self._figure.draw_artist(artist)
        if self._mode == "human":
            canvas.blit(self._figure.bbox)
            canvas.flush_events()
        else:
            self._frame = np.asarray(canvas.buffer_rgba())[:, :, :3].copy()
            self._frame.flags.writeable = False

    def _keep(self, event: Any) -> None:
        """Keep what stands still, whenever the figure is drawn anew (a window was resized)."""
        self._still = event.canvas.copy_from_bbox(event.canvas.figure.bbox)

    def _update_map(self) -> None:
        parts, now = self._parts, self._now
        assert now is not None
        place, yaw = self._place(), self._yaw()
        reach = 1.1 * AHEAD * self._base
        straight = np.array([[place[0] - 1e3, 0.0], [place[0] + 1e3, 0.0]])
        path = self._path if len(self._path) else straight
        parts["path"].set_data(*turned(path - place, -yaw).T)
        counts = [np.arange(math.ceil((at - reach) / DOTS), (at + reach) / DOTS) for at in place]
        dots = np.stack(np.meshgrid(*counts), axis=-1).reshape(-1, 2) * DOTS
        parts["dots"].set_data(*turned(dots - place, -yaw).T)
        trail = np.array(self._trail)
        parts["trail"].set_offsets(turned(trail[:, :2] - place, -yaw))
        parts["trail"].set_array(trail[:, 2])
        parts["velocity"].set_UVC([now.speed_x], [now.speed_y])
        title = f"{self._title}, {now.time:.2f} s, x {place[0]:.1f} m, y {place[1]:.1f} m"
        parts["title"].set_text(f"{title}: {self._reason}" if self._reason else title)

    def _update_car(self) -> None:
        parts, now = self._parts, self._now
        assert now is not None
        angles = np.array([now.steer, now.steer, 0.0, 0.0])
        colours = parts["colours"](np.clip(now.mu / FRICTION[1], 0.0, 1.0))
        length, width = self._body.wheel_length, 0.35 * self._body.wheel_length
        corners = 0.5 * np.array(
            [[length, width], [length, -width], [-length, -width], [-length, width]]
        )
        arrows = np.empty((4, 2))
        for i, (place, angle) in enumerate(zip(self._body.wheels, angles, strict=True)):
            parts["wheels"][i].set_xy(turned(corners, angle) + place)
            limit = 0.0 if math.isnan(now.mu[i]) else now.mu[i] * now.load[i] * self._metres
            parts["circles"][i].set_radius(limit)
            parts["circles"][i].set_edgecolor(colours[i])
            arrows[i] = turned(now.force[i : i + 1], angle)[0] * self._metres
        parts["forces"].set_UVC(*arrows.T)
        parts["text"].set_text(_words(now))


def _words(now: View) -> str:
    """Return the figures beside the car."""
    slip = math.degrees(math.atan2(now.speed_y, now.speed_x)) if now.speed_x > 0.1 else 0.0
    lines = [
        f"speed       {now.speed_x:7.2f} m/s",
        f"sideslip    {slip:7.2f}°",
        f"yaw rate    {math.degrees(now.yaw_rate):7.2f} °/s",
        f"steering    {math.degrees(now.steer):7.2f}°",
        "",
        "wheel  friction  used",
    ]
    for name, mu, used in zip(("FL", "FR", "RL", "RR"), now.mu, now.used, strict=True):
        shown = "no limit" if math.isnan(mu) else f"{mu:8.2f}"
        lines.append(f"{name:5s}  {shown}  {'' if math.isnan(used) else f'{used:4.0%}'}")
    return "\n".join(lines)


def _figure(mode: str | None) -> Figure:
    """Return an empty figure, in a window of its own in the mode `human`."""
    size = (WIDTH / DPI, HEIGHT / DPI)
    if mode == "rgb_array":
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=size, dpi=DPI)
        FigureCanvasAgg(figure)
        return figure
    from matplotlib import pyplot

    figure = pyplot.figure(figsize=size, dpi=DPI)
    if type(figure.canvas).required_interactive_framework is not None:
        figure.show()
    elif "MPLBACKEND" not in os.environ:
        logging.getLogger(__name__).warning(
            "render_mode 'human' finds no display and shows nothing; 'rgb_array' gives frames"
        )
    return figure
