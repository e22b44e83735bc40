"""Files of a scenario, vehicle or suite as people and fuzzers spoil them: one line each."""

import os
import random

import pytest

from gripbench.bench.catalogue.suites import load_suite
from gripbench.configuration import CONFIGS, read_toml
from gripbench.envs.vehicles import load_vehicle
from gripbench.envs.worlds import load_scenario
from gripbench.errors import GripbenchError, InputError

KINDS = {"scenarios": load_scenario, "vehicles": load_vehicle, "suites": load_suite}
FILES = [(kind, path) for kind in KINDS for path in sorted((CONFIGS / kind).glob("*.toml"))]
VALUES = (
    "[]", "{}", "[[]]", "''", "0", "-1", "nan", "inf", "true", "1e400", "9" * 5000, "'\\u0000'",
    '"\\u0000"', "[" * 3000, "[" * 3000 + "]" * 3000, '"a\\nb"', "1979-05-27", "{ a = 1 }",
    "'../../etc'", "'x.toml'", "[1, 2, 3]",
)  # fmt: skip
FRESH = os.environ.get("GRIPBENCH_FRESH")


def mutated(text, draw):
    lines = text.splitlines()
    at = draw.randrange(len(lines))
    how = draw.randrange(6)
    if how == 0:
        del lines[at]
    elif how == 1:
        lines[at] = lines[at].partition("=")[0] + "= " + draw.choice(VALUES)
    elif how == 2:
        lines.insert(at, draw.choice(lines))
    elif how == 3:
        cut = draw.randrange(len(lines[at]) + 1)
        lines[at] = lines[at][:cut] + chr(draw.randrange(0x250)) + lines[at][cut:]
    elif how == 4:
        lines[at] = lines[at][: draw.randrange(len(lines[at]) + 1)]
    else:
        lines.insert(at, f"{draw.choice('abcdef')} = {draw.choice(VALUES)}")
    return "\n".join(lines)


def held(count, seed, folder):
    draw = random.Random(seed)
    for number in range(count):
        kind, path = draw.choice(FILES)
        text = path.read_text(encoding="utf-8")
        for _ in range(draw.randrange(1, 4)):
            text = mutated(text, draw)
        place = folder / "spoilt.toml"
        place.write_text(text, encoding="utf-8")
        try:
            KINDS[kind](str(place))
        except GripbenchError as error:
            message = str(error)
            assert "\n" not in message
            assert "Value error" not in message
        except Exception as error:
            raise AssertionError(f"number {number} of {path.name}:\n{text[:2000]}") from error


def test_a_few_hundred_mutations_give_one_line_each(tmp_path):
    held(300, random.Random().random() if FRESH else 1, tmp_path)


@pytest.mark.slow
def test_thousands_of_mutations_give_one_line_each(tmp_path):
    held(6000, random.Random().random() if FRESH else 2, tmp_path)


KEYS = ("world", "vehicle", "integrator", "sensor_suite", "sensors")
ALLOWED = {("sensors", "{}"), ("sensor_suite", "''")}
WRONG = [(key, value) for key in KEYS for value in VALUES if (key, value) not in ALLOWED]


@pytest.mark.parametrize(("key", "value"), WRONG)
def test_a_name_of_a_wrong_type_is_named_with_its_file(tmp_path, key, value):
    lines = (CONFIGS / "scenarios" / "friction_step.toml").read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if line.partition("=")[0].strip() != key]
    place = tmp_path / "spoilt.toml"
    place.write_text("\n".join([f"{key} = {value}", *kept]), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_vehicle(load_scenario(str(place)).vehicle)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize("text", ["a = " + "[" * 5000, "a = " + "9" * 5000, "a = 1\na = 2", "\0"])
def test_what_the_parser_refuses_is_one_line(tmp_path, text):
    place = tmp_path / "spoilt.toml"
    place.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="not valid TOML"):
        read_toml(place)


def test_a_path_that_no_file_can_have_and_a_pipe(tmp_path):
    with pytest.raises(InputError, match=r"cannot be read|no such file"):
        load_scenario("a\0b.toml")
    pipe = tmp_path / "pipe.toml"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="is no plain file"):
        load_scenario(str(pipe))
