/* The smoothed force as a program: after a first line of JSON, records of float64 over pipes.
 *
 *     gcc -std=c99 -O2 -o smoothed_force smoothed_force.c
 *     gripbench run --scenario friction_step --method smoothed_force_records.py
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The number behind a key; a JSON library would do it better. */
static double number(const char *text, const char *key)
{
    const char *found = strstr(text, key);
    return found ? strtod(found + strlen(key), NULL) : NAN;
}

int main(void)
{
    char line[65536];
    double sample[2]; /* accel_x, time */
    double smooth = 0.0, before = 0.0, force = 0.0;
    if (!fgets(line, sizeof line, stdin))
        return 1;
    const double mass = number(line, "\"mass\": ");
    const double time_constant = number(line, "\"time_constant\": ");
    puts("{\"ready\": true}");
    fflush(stdout);
    while (fread(sample, sizeof sample, 1, stdin) == 1) {
        const double elapsed = sample[1] - before;
        if (!isnan(sample[0]) && elapsed >= 0.0) { /* a missing sample: the last estimate holds */
            before = sample[1];
            if (elapsed > 0.0)
                smooth += elapsed / (time_constant + elapsed) * (sample[0] - smooth);
            force = 0.5 * mass * smooth;
        }
        fwrite(&force, sizeof force, 1, stdout);
        fflush(stdout);
    }
    return 0;
}
