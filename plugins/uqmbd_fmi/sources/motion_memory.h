/* Memory of a mechanism, for its integration, contacts and controllers, and arguments of programs. */
#ifndef UQMBD_MOTION_MEMORY_H
#define UQMBD_MOTION_MEMORY_H

#include "model.h"

#include <string.h>

#include "motion.h"

enum {
    STATE = MOTION_WIDTH + 2,
    ARGUMENTS = STATE + MOTION_BLOCK,
};

typedef struct {
    double inputs[MOTION_INPUTS + 1];
    double commands[MOTION_COMMANDS + 1];
    double parameters[MOTION_PARAMETERS + 1];
    double time, tolerance, floor;
    double wanted;                    /* size of the next step */
    double state[MOTION_WIDTH];       /* state of the integration */
    double shown[MOTION_WIDTH];       /* this state, projected onto the constraints, for outputs */
    double rate[MOTION_WIDTH];
    double moved;                     /* whether an input has moved the constraints */
    double known;                     /* whether the outputs belong to the inputs and the state */
    double turned[MOTION_OUTPUTS];    /* unwrapped angles at the last communication point */
    double counted;                   /* whether there was such a point */
    double warned;                    /* whether inaccurate accelerations were reported */
    double begun, dirty;              /* whether the start was computed; whether a parameter has changed since */
    /* contacts, see events.h; `arming` also if inputs or commands have changed */
    int64_t mode[MOTION_EVENTS + 1], resting[2 * MOTION_EVENTS + 1], held[MOTION_EVENTS + 1], happened, noted, arming;
    int64_t total, restarts, stalled, clustered;
    double heading[MOTION_DIRECTIONS + 1], internal[MOTION_DIRECTIONS + 1], rise[2 * MOTION_EVENTS + 1];
    double length, slow, recent[CLUSTER], since, fastest, coarse, starting, turned_at, later;
    double origin, pending[MOTION_PENDING + 1];                       /* start; commands that do not act yet */
    int64_t sampled[MOTION_LAWS + 1], acted[MOTION_LAWS + 1]; /* number of the next sample that is taken, and acts */
    double outputs[MOTION_RESULTS];
    double measured[MOTION_MEASURED + 1];
    double work[MOTION_WORK];
} Motion;

/* Memory for programs, filled with zeros. */
double *cleared(Motion *of);

/* Arguments of the programs of a state: state, time, zero, parameters of the equations. */
void fill_arguments(const Motion *of, const double *state, double time, double *to);

#endif
