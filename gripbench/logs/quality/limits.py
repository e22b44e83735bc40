"""What no vehicle does: series in, how far each is beyond what is possible out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gripbench.envs.signals import signal
from gripbench.logs.channels.series import Series
from gripbench.logs.quality.law_forms import Law
from gripbench.logs.quality.laws import WHEELS
from gripbench.logs.quality.speeds import speed_of

_MOVING = 2.0  # m/s
_LIMITS = {
    "sideslip": 1.0, "yaw_rate": 3.5, "roll_rate": 3.0, "pitch_rate": 3.0, "accel_x": 16.0,
    "accel_y": 20.0, "speed_x": 120.0, "speed_gps": 120.0, "speed_y": 25.0, "steer_angle": 0.9,
    "roll": 0.7, "pitch": 0.7, "velocity_north": 120.0, "velocity_west": 120.0,
    "road_bank": 0.7, "road_grade": 0.7, **dict.fromkeys(WHEELS, 500.0),
}  # fmt: skip
_MODEL_CAR = ("yaw_rate", "roll_rate", "pitch_rate", "accel_x", "accel_y", "sideslip")
_MODEL_CAR_FACTOR = 4.0


def limits_of(
    channels: dict[str, Series],
    reference: dict[str, Series],
    vehicle: dict[str, float],
) -> Iterator[Law]:
    """Yield for each series its magnitude over the largest that a road vehicle reaches.

    Single values that stand out are another check's: the 98th percentile counts. A vehicle whose
    wheelbase is below a metre is a model, whose rates and accelerations are larger.
    """
    speed = speed_of(channels, reference, vehicle)
    wheelbase = vehicle.get("cg_to_front", 0.0) + vehicle.get("cg_to_rear", 0.0)
    model = 0.0 < wheelbase < 1.0
    for source in (channels, reference):
        for name, highest in _LIMITS.items():
            series = source.get(name)
            if series is None or "derived" in series.key:
                continue
            values = np.abs(series.values)
            if name == "sideslip" and speed is not None:  # at rest it means nothing
                moving = np.interp(series.times, speed.times, np.abs(speed.values)) > _MOVING
                values = values[moving]
            if not len(values):
                continue
            if model and name in _MODEL_CAR:
                highest *= _MODEL_CAR_FACTOR
            reached = float(np.percentile(values, 98.0))
            text = (
                f"reaches {reached:.4g} {signal(name).unit}, more than the {highest:g} "
                "that a vehicle does"
            )
            yield Law(text, {series.key: 1}, reached / highest, limit=True)
