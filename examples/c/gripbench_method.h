/* What gripbench calls in a shared library: three functions.
 *
 * gcc -std=c99 -O2 -ffp-contract=off -shared -fPIC -o libsmoothed_force.so smoothed_force.c
 */
#ifndef GRIPBENCH_METHOD_H
#define GRIPBENCH_METHOD_H

#ifdef __cplusplus
extern "C" {
#endif

/* Return a new state, or NULL. `vehicle` holds the values of `vehicle_parameters`, `settings` those
 * of `parameters`, each in the order of the declaration; `step` is the nominal time between samples
 * [s]. All values are SI; the arrays are gone when the function has returned. */
void *gripbench_start(const double *vehicle, const double *settings, double step);

/* Take one sample: the declared `sensors` in their order, then the time [s]; a channel that is
 * missing is NaN. Write the declared `estimates` in their order, then the variances; what is not
 * written keeps its last value, at first zero. Return 0, or a number that ends the run. */
int gripbench_update(void *state, const double *sample, double *estimates);

/* Free the state. */
void gripbench_end(void *state);

#ifdef __cplusplus
}
#endif

#endif
