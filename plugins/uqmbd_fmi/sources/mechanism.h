/* Memory of a mechanism, and functions of its contacts. */
#ifndef UQMBD_MECHANISM_H
#define UQMBD_MECHANISM_H

#include "model.h"

#include <string.h>

#include "motion.h"

enum {
    CROWD = 100, /* number of events that count as a crowd */
    STATE = MOTION_WIDTH + 2,
    ARGUMENTS = STATE + MOTION_BLOCK,
};

typedef struct {
    double inputs[MOTION_INPUTS + 1];
    double commands[MOTION_COMMANDS + 1];
    double parameters[MOTION_PARAMETERS + 1];
    double time, tolerance, floor;
    double wanted, fresh;             /* size of the next step; whether an input has changed */
    double state[MOTION_WIDTH];       /* state of the integration */
    double shown[MOTION_WIDTH];       /* this state, projected onto the constraints, for outputs */
    double rate[MOTION_WIDTH];
    double moved;                     /* whether an input has moved the constraints */
    double known;                     /* whether the outputs belong to the inputs and the state */
    double turned[MOTION_OUTPUTS];    /* unwrapped angles at the last communication point */
    double counted;                   /* whether there was such a point */
    double warned;                    /* whether inaccurate accelerations were reported */
    double begun, dirty;              /* whether the start was computed; whether a parameter has changed since */
    int64_t mode[MOTION_EVENTS + 1], resting[2 * MOTION_EVENTS + 1], happened, noted; /* of contacts, see events.h */
    double heading[MOTION_DIRECTIONS + 1], internal[MOTION_DIRECTIONS + 1], rise[2 * MOTION_EVENTS + 1];
    double length, slow, fastest;     /* size of the mechanism, speed that counts as zero, fastest impact */
    double coarser, crowd[CROWD];     /* factor of that speed in a crowd of events, and times of the last events */
    int64_t crowded;                  /* their number */
    double starting, turned_at;       /* speed that counts as zero when slip starts; last turn of its direction */
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

/* Find the contacts that are closed at the start of the motion, and whether they last. */
void start_contacts(Motion *of, double time, Report *to);

/* Prepare the guards of contacts at the start of a step, at a time in it; inputs may have changed. */
void begin_contacts(Motion *of, double time, double *wanted, Report *to);

/* Process the event that the driver has found at `now`; `time` is inside of the interval, where functions of time do
   not jump. */
void decide_contact(Motion *of, double now, double time, double *wanted, Report *to);

/* Take the first samples of controllers with laws. */
void start_laws(Motion *of, Report *to);

/* Time of the next sample of a controller, or of commands that begin to act; infinity without laws. */
double next_sample(const Motion *of);

/* Take the samples that are due, and let commands act. */
void sample_laws(Motion *of, Report *to);

#endif
