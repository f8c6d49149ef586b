/* Eight realisations on their way: what `advance` works with. */
#ifndef UQMBD_GROUP_H
#define UQMBD_GROUP_H

#include "dop853.h"

typedef struct {
    const Pool *pool;
    V *work, *z, *base, *next, *last, *sizes, *rates, *dense, *surplus, *nodes, *node_times; /* z: states; base, which are
                                            those, next, last, rates and dense: of what is stepped (turning.c) */
    V now, begin, end, low, high, bound, wanted, size, floor, limit, error;
    Mask running, fresh;
    int64_t member[LANES];
    int64_t evaluations;
    Mask touching;      /* contacts of theirs last */
    V *lengths, *shrink; /* factors of e' and w' (turning.c), for what is in the work array */
    V *guards, *samples;
    V *system, *answers; /* of contacts: the matrix of the index-1 system, and its solutions */
    /* of implicit steps (radau.c): stages, those of the step before, changes, a rate; matrices and sides of systems */
    V *stages, *history, *changes, *slope, *matrices, *inertia, *stiffness, *factors, *right, *solution, *shift;
    V before, contraction, growth;  /* size of the step before, of its iterations; a factor of the next size */
    double *numbers;    /* of one lane at a time */
    V *control;         /* work array of the laws of controllers */
    Mask due;           /* lanes that have reached an instant of controllers */
} Group;

/* State at a part of the last attempt. */
static void interpolate(const Problem *p, Group *g, V part, V *target);

#endif
