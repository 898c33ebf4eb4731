/* A loop in which every call of an exported function waits for the one before it.

   Compiled with HEADER, REAL, FUNCTION and M (of a pose's coordinates), and TABLE where the function
   takes parameters. */

#define _POSIX_C_SOURCE 199309L

#include <time.h>

#include HEADER

#ifdef TABLE
#define CALL(state, forces) FUNCTION(state, (state) + M, (state) + 2 * M, TABLE, forces)
#else
#define CALL(state, forces) FUNCTION(state, (state) + M, (state) + 2 * M, forces)
#endif
#define EXPORTED __attribute__((visibility("default")))

EXPORTED int evaluate(const REAL *state, REAL *forces);
EXPORTED double latency(long count, long mask, const REAL *states, REAL zero, REAL *forces);

EXPORTED int evaluate(const REAL *state, REAL *forces)
{
    return CALL(state, forces);
}

/* Return the seconds a call; `states` has mask + 1 rows, a power of two. */
EXPORTED double latency(long count, long mask, const REAL *states, REAL zero, REAL *forces)
{
    struct timespec begin, end;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (long i = 0; i < count; i++) {
        const REAL *given = states + 3 * M * (i & mask), last = zero * forces[0];
        REAL state[3 * M];
        for (int j = 0; j < 3 * M; j++) state[j] = given[j] + last;
        (void)CALL(state, forces);
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    return ((double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec))
        / (double)count;
}
