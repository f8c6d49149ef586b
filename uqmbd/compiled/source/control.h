/* Sampled controllers, whose laws are programs or functions of the caller: commands and states change at instants that end integration intervals. */
#ifndef UQMBD_CONTROL_H
#define UQMBD_CONTROL_H

#include "program.h"

/* The rows of the work array of laws are a state, the time, zero, and the numbers of a realisation.  Held entries are
   the commands of each loop, then its states, loop by loop. */
typedef struct {
    int64_t rows, numbers;  /* of the work array; numbers of a realisation */
    int64_t loops, entries; /* controllers, and held entries of all */
    const Program *laws;    /* (loop): a state -> commands and states, or what the function of the caller measures */
    const int64_t *asked;   /* (loop + 1): first measured value of each function, and the end; laws have none */
    const int64_t *seen;    /* (measured): rows of the measured values of functions */
    const int64_t *first;   /* (loop + 1): first held entry of each loop, and the end */
    const int64_t *commands; /* (loop): number of commands */
    const int64_t *direct;  /* (loop): whether commands act at their sample */
    const int64_t *residual; /* (loop): row of the residual of measured accelerations; -1: there is none */
    double poor;            /* greatest residual */
    const int64_t *result;  /* (entry): rows of the results of laws */
    const int64_t *held;    /* (entry): their entries in a state */
    const int64_t *acting;  /* (instant, loop): place of the commands that begin to act; -1: there are none */
    const int64_t *sampled; /* (instant, loop): place for the commands of a sample; -1: the loop is not sampled */
    const int64_t *instants; /* instant at the end of each integration interval; -1: there is none */
    const double *values;   /* (member, numbers) */
    const double *low, *high; /* (member, entry): limits of commands */
    double *pending;        /* (member, places): commands that do not act yet */
    int64_t places;
    int64_t *instant;       /* (member): the instant that is due; -1: there is none */
    double *measured;       /* (member, measured): for functions */
    double *answers;        /* (member, entry): commands and states from functions */
    int64_t *answered;      /* (member): whether they are those of the instant */
} Control;

#endif
