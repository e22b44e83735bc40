"""What the name of a log's column says: a name in; signal, sign and usual unit out.

Only names that engineers give to these quantities are known. What a name alone does not settle,
such as a unit that nobody wrote, is marked by whoever uses the guess.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from gripbench.envs.signals import SIGNALS
from gripbench.logs.mapping.units import proposed_unit

REFERENCE_ALWAYS = ("sideslip", "speed_y", "yaw", "roll", "pitch", "position_x", "position_y")
"""Signals that no instrument of a method gives: they go to the reference."""


@dataclass(frozen=True)
class Guess:
    """What a name says.

    Attributes
    ----------
    signal
        The signal.
    sign
        -1 where the name tells the other direction.
    unit
        Unit that the tool behind the name always writes; empty: not told.
    reference
        Whether the name is that of a reference instrument, such as motion capture.
    offset
        What the tool's angle counts from, in `unit`.
    reason
        What was taken for granted; empty where the name says it all.
    """

    signal: str
    sign: int = 1
    unit: str = ""
    reference: bool = False
    offset: float = 0.0
    reason: str = ""


_TIME = re.compile(
    r"^(t|time|times|timestamps?|time stamp|utc|zeit|uhrzeit|date ?time|elapsed( time)?|"
    r"sec|seconds|"
    r"(log|session|test|lap|gps|system|unix|ros|bag|sample|rel|relative|abs|absolute) time|"
    r"t (rel|abs|s)|"
    r"time (s|ms|us|ns|sec|since start|elapsed|utc|abs|rel))( (s|ms|us|ns|sec|utc))?$"
)
_NEVER = re.compile(
    r"\b(susp\w*|damper\w*|shock\w*|travel|ride|potent\w*|pot|temp\w*|temperature|press\w*|jerk|"
    r"covariance|cov|std|sigma|variance|accuracy|quality|status|stat|valid\w*|ok|error|err|counter|"
    r"count|cnt|crc|checksum|sign|vz|offset|bias|calib\w*|target|desired|demand|cmd|command|setpoint|"
    r"request\w*|limit|max|min|torque|trq|moment|current|voltage|load|power|delta (t|time|v|p|s)|"
    r"dt|lap|beacon|odometer|distance|dist|mileage|fuel|throttle|pedal|gear|heave|camber|toe)\b|"
    r"\b(rate|velocity|speed|vel|geschw\w*) of (change|steer\w*)|\bsteer\w*\b.*\b(rate|vel\w*|"
    r"speed)\b|winkelgeschw|device update|slip ratio"
)
_REFERENCE = re.compile(
    r"\b(mocap|motion capture|optitrack|vicon|qualisys|motive|ground ?truth|gt|truth|reference|ref|"
    r"correvit|s motion|datron|rt ?3\d{3}|adma)\b"
)
_FL = r"(fl|lf|front left|left front|vl|l1|1l)"
_FR = r"(fr|rf|front right|right front|vr|r1|1r)"
_RL = r"(rl|lr|rear left|left rear|hl|l2|2l)"
_RR = r"(rr|rear right|right rear|hr|r2|2r)"
_SPIN = r"(wheels?|whl|ws|w|v|n|omega|speed|spd|vel|velocity|rpm|rad|raddrehz\w*|avy|rotation\w*)"
_ACC = r"(a|acc|accel\w*|acceleration|beschl\w*|linear acceleration|g force|force g|g)"
_GYR = r"(gyr\w*|omega|w|ang\w* (rate|vel\w*)|angular\w*|rates?|rotation rate|turn rate|imu w)"


def _of_wheel(place: str) -> str:
    return (
        rf"\b{_SPIN}\b.*\b{place}\b|\b{place}\b.*\b(wheels?|whl|ws|speed|spd|omega|rpm|rotation\w*)\b|"
        rf"^({_SPIN} ?){{1,3}}{place}$|\b(wheel|whl)(speed|spd)?{place}\b"
    )


_RULES: tuple[tuple[str, str, int], ...] = (
    (
        r"\bsteer(ing|ed)?\b(?!.*\b(rate|vel)\b)|^steer\w*$|\b(swa|lws|sas)\b|lenk(rad)?winkel|"
        r"^delta( f| front| sw| h| w| wheel| steer| road)?$|^road wheel angle$|"
        r"^steer\w* ?(angle|ang)",
        "steer_angle",
        1,
    ),
    (_of_wheel(_FL), "wheel_speed_front_left", 1),
    (_of_wheel(_FR), "wheel_speed_front_right", 1),
    (_of_wheel(_RL), "wheel_speed_rear_left", 1),
    (_of_wheel(_RR), "wheel_speed_rear_right", 1),
    (r"\bbeta\b|side ?slip|\bslip angle$|^slip ?angle$|schwimmwinkel|drift angle|float angle",
     "sideslip", 1),
    (r"\b(course|cog|kurs|bearing)\b|\btrack$|track angle|angle track|\btrk\b", "course", -1),
    (r"\b(gps|gnss)\b.*\b(speed|vel\w*|v)\b|\b(speed|vel\w*|v)\b.*\b(gps|gnss)\b|\bsog\b|"
     r"ground ?speed|speed over ground", "speed_gps", 1),
    (r"\b(yaw|gier)\w* ?(rate|vel\w*|speed|gyro|geschw\w*|dot)|gyro yaw|^yawrate$|gierrate|"
     r"\bpsi ?(dot|p|d)$|^avz$|"
     rf"\b{_GYR}\b.*\b(z|yaw|up)$|^(wz|gz|rz|gyr?o?z|omegaz|wu|r|r imu)$|z rate of rotation|"
     r"rate up$", "yaw_rate", 1),
    (rf"\b{_GYR}\b.*\bdown$|rate down$|gyr\w* down", "yaw_rate", -1),
    (rf"\b{_GYR}\b.*\b(x|roll|fwd|forward)$|roll ?rate|^(avx|wx|gx|wf)$|x rate of rotation|"
     r"rate forward$", "roll_rate", 1),
    (rf"\b{_GYR}\b.*\b(y|pitch|left)$|pitch ?rate|^(avy|wy|gy|wl)$|y rate of rotation",
     "pitch_rate", 1),
    (rf"\b{_ACC}\b.*\b(x|fwd|forward|long\w*|l[aä]ngs)( imu)?$|"
     r"\b(x|long\w*|forward|fwd|l[aä]ngs) ?(acc\w*|g|g force|beschl\w*|a)\b|"
     r"^(ax|af|accx|a ego|axs?)$|"
     r"l[aä]ngsbeschl\w*", "accel_x", 1),
    (rf"\b{_ACC}\b.*\b(y|left|lat\w*|quer)( imu)?$|"
     r"\b(y|lat\w*|quer) ?(acc\w*|g|g force|beschl\w*|a)\b|^(ay|al|accy|ays?)$|querbeschl\w*",
     "accel_y", 1),
    (rf"\b{_ACC}\b.*\bright$", "accel_y", -1),
    (rf"\b{_ACC}\b.*\b(z|up|vert\w*)( imu)?$|\b(z|vert\w*) ?(acc\w*|g|g force)\b|^(az|au|accz)$",
     "accel_z", 1),
    (rf"\b{_ACC}\b.*\bdown$", "accel_z", -1),
    (r"mag\w* ?(field )?(x|fwd)$", "magnetic_field_x", 1),
    (r"mag\w* ?(field )?(y|left)$", "magnetic_field_y", 1),
    (r"mag\w* ?(field )?right$", "magnetic_field_y", -1),
    (r"mag\w* ?(field )?(z|up)$", "magnetic_field_z", 1),
    (r"mag\w* ?(field )?down$", "magnetic_field_z", -1),
    (r"\b(v|vel\w*|speed)\b.*\b(x|fwd|forward|long\w*|l[aä]ngs)$|"
     r"\b(forward|long\w*) (speed|vel\w*)$|"
     r"^(vx|vf)$", "speed_x", 1),
    (r"\b(v|vel\w*|speed)\b.*\b(y|left|lat\w*|quer)$|\blat\w* (speed|vel\w*)$|^(vy|vl)$",
     "speed_y", 1),
    (r"\b(v|vel\w*|speed)\b.*\bright$", "speed_y", -1),
    (r"\b(v|vel\w*|speed)\b.*\bnorth$|^vn$", "velocity_north", 1),
    (r"\b(v|vel\w*|speed)\b.*\bwest$", "velocity_west", 1),
    (r"\b(v|vel\w*|speed)\b.*\beast$|^ve$", "velocity_west", -1),
    (r"\b(veh\w*|car|fzg|ego|vehicle|fahrzeug)\w* ?(speed|spd|sp|vel\w*|v|geschw\w*)\b|"
     r"\bv (ego|fzg|veh\w*|car)\b|^(speed|velocity|vel|v|vego|vehspd|vspd|geschwindigkeit|kph|kmh|"
     r"speed (kmh|kph|mph|mps)|velocity (kmh|kph|mph)|obd speed|can speed)$|speed average",
     "speed_x", 1),
    (r"\b(heading|compass|azimuth|hdg)\b", "yaw", -1),
    (r"^(yaw|psi|gierwinkel|yaw angle|psi angle)$", "yaw", 1),
    (r"^(roll|phi|roll angle|wankwinkel)$", "roll", 1),
    (r"^(pitch|pitch angle|nickwinkel)$", "pitch", 1),
)  # fmt: skip

# Tools whose columns tell the tool, and the tool the axes and units.
_CARSIM = {
    "Vx": ("speed_x", 1, "km/h"), "Vy": ("speed_y", 1, "km/h"), "AVz": ("yaw_rate", 1, "deg/s"),
    "AVx": ("roll_rate", 1, "deg/s"), "AVy": ("pitch_rate", 1, "deg/s"),
    "Ax": ("accel_x", 1, "g"), "Ay": ("accel_y", 1, "g"), "Az": ("accel_z", 1, "g"),
    "Steer_SW": ("steer_angle", 1, "deg"), "Beta": ("sideslip", 1, "deg"),
    "Yaw": ("yaw", 1, "deg"), "Roll": ("roll", 1, "deg"), "Pitch": ("pitch", 1, "deg"),
    "AVy_L1": ("wheel_speed_front_left", 1, "rpm"),
    "AVy_R1": ("wheel_speed_front_right", 1, "rpm"),
    "AVy_L2": ("wheel_speed_rear_left", 1, "rpm"), "AVy_R2": ("wheel_speed_rear_right", 1, "rpm"),
}  # fmt: skip
_OXTS_TURNED = ("speed_y", "accel_y", "sideslip", "pitch_rate")  # axes forward, right, down
_KITTI_NAMES = frozenset(("af", "al", "au", "wf", "wl", "wu", "navstat", "orimode"))


def guesses(names: Iterable[str]) -> dict[str, Guess]:
    """Return what the names of a log's columns say, for those that say something."""
    given = list(names)
    known = {_bare(name) for name in given}
    carsim = "AVz" in known or "Steer_SW" in known
    oxts = any(re.match(r"(AngleRateDown|VelForward|AccelForward|AngleTrack)$", n) for n in known)
    kitti = known >= _KITTI_NAMES
    vbox = {"sats", "velocity", "heading"} <= known
    found: dict[str, Guess] = {}
    for name in given:
        bare = _bare(name)
        if carsim and bare in _CARSIM:
            target, sign, unit = _CARSIM[bare]
            found[name] = Guess(target, sign, unit, reason=f"the units of CarSim: {unit}")
            continue
        guess = _guess(name)
        if guess is None:
            continue
        if vbox and bare in ("velocity", "heading"):
            guess = Guess("speed_gps") if bare == "velocity" else Guess("course", -1)
        if oxts and guess.signal in _OXTS_TURNED:
            guess = Guess(
                guess.signal, -1, reference=guess.reference, reason="OxTS axes: right is positive"
            )
        if kitti:
            if bare in ("wx", "wy", "wz", "ax", "ay", "az"):  # body axes; f, l, u are level
                continue
            if guess.signal == "yaw":
                guess = Guess("yaw", unit="rad", offset=1.5707963267948966,
                              reason="KITTI counts from east")  # fmt: skip
        found[name] = guess
    return found


def is_time(name: str) -> bool:
    """Whether a column's name is that of a time."""
    spaced = _spaced(_bare(name))
    last = spaced.rpartition(" ")[2]
    return _TIME.match(spaced) is not None or last in ("timestamp", "stamp", "time")


def written_unit(name: str) -> str | None:
    """Return the unit that a column's name ends in, such as `ms` of `time_ms`, or None."""
    ending = re.search(r"(?:[_ ]|\[|\()([^_\[\]() ]+(?: s\^-\d)?)[\])]?$", name)
    return proposed_unit(ending.group(1)) if ending else None


def _guess(name: str) -> Guess | None:
    bare = _bare(name)
    parts = [part for part in re.split(r"[./:]", bare) if part]
    names = [parts[-1], " ".join(parts[-2:]), bare] if len(parts) > 1 else [bare]
    reference = _REFERENCE.search(_spaced(bare)) is not None
    for one in names:
        plain = _without_unit(_spaced(one)).replace(" ", "_")
        if plain in SIGNALS and plain != "time":
            return Guess(plain, reference=reference)
    if _NEVER.search(_spaced(names[0])) or "covariance" in _spaced(bare):
        return None
    for one in names:
        text = _REFERENCE.sub("", _spaced(one)).strip()
        for pattern, target, sign in _RULES:
            if re.search(pattern, text) or re.search(pattern, _without_unit(text)):
                return Guess(target, sign, reference=reference)
    return None


def _bare(name: str) -> str:
    """Return a name without a unit in brackets and without a twin's number."""
    name = re.sub(r"#\d+'*$", "", name)
    found = re.search(r"\s*(\[[^\[\]]*\]|\(([^()]*)\))\s*$", name)
    if found and (found.group(2) is None or proposed_unit(found.group(2)) is not None):
        name = name[: found.start()]
    return name.strip()


def _spaced(name: str) -> str:
    """Return a name in lower case with its words apart."""
    spaced = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", " ", name)
    return re.sub(r"[^a-zäöüA-ZÄÖÜ0-9]+", " ", spaced).lower().strip()


def _without_unit(text: str) -> str:
    return re.sub(
        r" (mps2?|m s2?|m s 2|kmh|kph|mph|degs?|deg s|rads?|rad s|g|raw|ut|ms|us|ns|s|dps)$",
        "",
        text,
    )
