/* Half of mass times the accelerometer's reading behind a low-pass: the force of the front axle. */
#include "gripbench_method.h"

#include <stdlib.h>

typedef struct {
    double mass, time_constant, smooth, before;
} State;

void *gripbench_start(const double *vehicle, const double *settings, double step) {
    (void)step; /* every sample carries its time */
    State *state = calloc(1, sizeof(State));
    if (state) {
        state->mass = vehicle[0];
        state->time_constant = settings[0];
    }
    return state;
}

int gripbench_update(void *given, const double *sample, double *estimates) {
    State *state = given;
    const double accel_x = sample[0], time = sample[1];
    const double elapsed = time - state->before;
    if (accel_x != accel_x || !(elapsed >= 0.0)) return 0; /* missing: the last estimate holds */
    state->before = time;
    if (elapsed > 0.0)
        state->smooth += elapsed / (state->time_constant + elapsed) * (accel_x - state->smooth);
    estimates[0] = 0.5 * state->mass * state->smooth;
    return 0;
}

void gripbench_end(void *state) { free(state); }
