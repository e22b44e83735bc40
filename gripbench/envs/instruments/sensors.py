"""Tables of sensors in, from a suite's TOML file or a scenario; sensors by channel out, checked."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from gripbench.configuration import CONFIGS, Configuration, named_file, parse, read_toml


class Sensor(Configuration):
    """Errors and sampling of one channel; an empty table is a perfect sensor.

    Attributes
    ----------
    source
        Truth that is measured; empty: the signal of the channel's own name.
    bias, bias_std
        Constant error, and the standard deviation of one that is drawn for each seed.
    bias_walk
        Drift of the bias: standard deviation after one second.
    scale, scale_std
        Scale factor, and the standard deviation of its error that is drawn for each seed.
    noise_std
        Standard deviation of white noise, one draw each sample.
    noise_hold
        Time [s] for which one draw of the noise is held; 0: a sample.
    lowpass
        Time constant [s] of a first-order low-pass behind the noise; 0: none.
    quantisation
        Step of the reading; 0: none.
    rate
        Samples a second, the reading is held between them and `<channel>_new` marks the new
        ones; 0: every sample.
    delay
        Age [s] of the truth in a reading.
    negative_scale
        Further scale factor of readings below zero: braking torque beside driving torque.
    cross, misalignment, misalignment_std
        Signal along the axis into which the instrument leans, by which angle [rad], and the
        standard deviation of one that is drawn for each seed.
    lever_x, lever_y
        Place of an accelerometer or speed sensor before and left of the centre of gravity [m].
    pulses
        Teeth of a wheel speed sensor's ring: the reading is the mean speed between the last tooth
        of this reading and that of the one before; 0: the speed itself.
    """

    source: str = ""
    bias: float = 0.0
    bias_std: float = Field(default=0.0, ge=0.0)
    bias_walk: float = Field(default=0.0, ge=0.0)
    scale: float = Field(default=1.0, gt=0.0)
    scale_std: float = Field(default=0.0, ge=0.0)
    noise_std: float = Field(default=0.0, ge=0.0)
    noise_hold: float = Field(default=0.0, ge=0.0)
    lowpass: float = Field(default=0.0, ge=0.0)
    quantisation: float = Field(default=0.0, ge=0.0)
    rate: float = Field(default=0.0, ge=0.0)
    delay: float = Field(default=0.0, ge=0.0, le=10.0)
    negative_scale: float = Field(default=1.0, gt=0.0)
    cross: str = ""
    misalignment: float = Field(default=0.0, ge=-0.5, le=0.5)
    misalignment_std: float = Field(default=0.0, ge=0.0, le=0.2)
    lever_x: float = Field(default=0.0, ge=-10.0, le=10.0)
    lever_y: float = Field(default=0.0, ge=-10.0, le=10.0)
    pulses: int = Field(default=0, ge=0, le=10000)

    @model_validator(mode="after")
    def _check_cross(self) -> Self:
        if (self.misalignment or self.misalignment_std) and not self.cross:
            raise ValueError("misalignment needs 'cross': the signal along the other axis")
        return self


class _SuiteFile(Configuration):
    name: str
    description: str
    sensors: dict[str, Sensor]


def load_sensor_suite(name: str) -> dict[str, Sensor]:
    """Return the sensors of a suite that ships, or of the path of a TOML file, by channel."""
    files = {path.stem: path for path in (CONFIGS / "sensors").glob("*.toml")}
    path = named_file("sensor suite", name, files)
    return parse(_SuiteFile, read_toml(path), path).sensors
