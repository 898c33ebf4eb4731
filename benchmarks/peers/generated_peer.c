/* One function from pose, velocity and acceleration to forces, printed by CasADi, in a loop. */

#include <stddef.h>
#include <stdint.h>
#include <time.h>

#include CLOSED_FORM

void *create(void) { return (void *)&inverse; }

/* Fill the forces of a batch and return the seconds that it took. */
double sweep(void *peer, int64_t count, const double *pose, const double *velocity,
             const double *acceleration, double *forces) {
    struct timespec begin, end;
    (void)peer;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (int64_t i = 0; i < M * count; i += M) {
        const double *given[] = {pose + i, velocity + i, acceleration + i};
        double *found[] = {forces + i};
        inverse(given, found, NULL, NULL, 0);
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    return (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec);
}
