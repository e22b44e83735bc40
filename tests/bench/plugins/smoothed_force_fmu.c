/* The smoothed force of examples/c as a unit of FMI 2 or, with -DFMI3, of FMI 3.
 *
 * Value references: 0 accel_x, 1 mass, 2 time_constant, 3 force_x_front. STUBS names the functions
 * of the standard that it has no use for. */
#include <stdlib.h>
#include <stddef.h>

typedef struct {
    double value[4], smooth;
} Unit;

static int set(Unit *u, const unsigned *r, size_t n, const double *v) {
    for (size_t i = 0; i < n; i++) u->value[r[i]] = v[i];
    return 0;
}

static int get(Unit *u, const unsigned *r, size_t n, double *v) {
    u->value[3] = 0.5 * u->value[1] * u->smooth;
    for (size_t i = 0; i < n; i++) v[i] = u->value[r[i]];
    return 0;
}

static int step(Unit *u, double elapsed) {
    if (u->value[2] < 0.0) return 3;
    u->smooth += elapsed / (u->value[2] + elapsed) * (u->value[0] - u->smooth);
    return 0;
}

static Unit *make(void) {
    Unit *u = calloc(1, sizeof(Unit));
    u->value[2] = 0.05;
    return u;
}

#ifdef FMI3
void *fmi3InstantiateCoSimulation(const char *a, const char *b, const char *c, int d, int e, int f,
                                  int g, const unsigned *h, size_t i, void *j, void *k, void *l) {
    return make();
}
int fmi3SetFloat64(void *u, const unsigned *r, size_t n, const double *v, size_t m) {
    return set(u, r, n, v);
}
int fmi3GetFloat64(void *u, const unsigned *r, size_t n, double *v, size_t m) {
    return get(u, r, n, v);
}
int fmi3DoStep(void *u, double t, double h, int f, char *event, char *end, char *early, double *to) {
    *event = *early = 0;
    *end = t > 1e6;
    *to = t + h;
    return step(u, h);
}
int fmi3EnterInitializationMode(void *u, char a, double b, double c, char d, double e) { return 0; }
int fmi3ExitInitializationMode(void *u) { return 0; }
int fmi3Terminate(void *u) { return 0; }
void fmi3FreeInstance(void *u) { free(u); }
#else
void *fmi2Instantiate(const char *a, int b, const char *c, const char *d, void *e, int f, int g) {
    return make();
}
int fmi2SetReal(void *u, const unsigned *r, size_t n, const double *v) { return set(u, r, n, v); }
int fmi2GetReal(void *u, const unsigned *r, size_t n, double *v) { return get(u, r, n, v); }
int fmi2DoStep(void *u, double t, double h, int f) { return step(u, h); }
int fmi2SetupExperiment(void *u, int a, double b, double c, int d, double e) { return 0; }
int fmi2EnterInitializationMode(void *u) { return 0; }
int fmi2ExitInitializationMode(void *u) { return 0; }
int fmi2Terminate(void *u) { return 0; }
void fmi2FreeInstance(void *u) { free(u); }
#endif

#define STUB(name) int name(void) { return 3; }
STUBS
