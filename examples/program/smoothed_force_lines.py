"""The program: one line of JSON in, one out. It knows nothing of gripbench."""

import json
import sys

start = json.loads(sys.stdin.readline())
mass, time_constant = start["vehicle"]["mass"], start["settings"]["time_constant"]
print(json.dumps({"ready": True}), flush=True)
smooth, before, force = 0.0, 0.0, 0.0
for line in sys.stdin:
    sample = json.loads(line)
    accel_x, elapsed = sample["accel_x"], sample["time"] - before
    if accel_x is not None and elapsed >= 0.0:
        before = sample["time"]
        if elapsed > 0.0:
            smooth += elapsed / (time_constant + elapsed) * (accel_x - smooth)
        force = 0.5 * mass * smooth
    print(json.dumps({"force_x_front": force}), flush=True)
