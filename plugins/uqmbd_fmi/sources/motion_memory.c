/* Memory and arguments of programs of a mechanism. */
#include "motion_memory.h"

double *cleared(Motion *of) {
    memset(of->work, 0, sizeof of->work);
    return of->work;
}

void fill_arguments(const Motion *of, const double *state, double time, double *to) {
    memcpy(to, state, MOTION_WIDTH * sizeof(double));
    to[MOTION_WIDTH] = time;
    to[MOTION_WIDTH + 1] = 0.0;
    memcpy(to + STATE, of->parameters, MOTION_BLOCK * sizeof(double));
}
