/* Eight realisations on their way: what `advance` works with. */
#ifndef UQMBD_GROUP_H
#define UQMBD_GROUP_H

#include "dop853.h"

enum { GROUPS = POINTS / LANES };

/* The largest residuals of realisations in the lanes so far, and their largest speeds. */
typedef struct {
    V *rows;
    int64_t member[LANES]; /* -1: of none */
} Most;

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
    V *system, *answers, *spare; /* of contacts: the matrix of the index-1 system, its solutions, and others */
    V *responses;       /* (direction, 1 + direction): rates of the speeds, without and per force */
    int64_t *needed;    /* (direction): lanes that need its responses, as bits */
    /* of implicit steps (radau.c): stages, those of the step before, changes, a rate; matrices and sides of systems */
    V *stages, *history, *changes, *slope, *matrices, *inertia, *factors, *right, *solution, *remainders;
    V before, contraction, growth;  /* size of the step before, of its iterations; a factor of the next size */
    double *numbers;    /* of one lane at a time */
    V enough[2], scale[2]; /* squares of distances from the constraints, in position and in velocity, that need no
                           projection, and of residuals over distances */
    V from, until;      /* times of a part of a step of one lane, */
    V *other;           /* its work array at several times */
    V *series, *shifts; /* Chebyshev coefficients (POINTS) of what is stepped, and of corrections of states */
    V *sums;            /* what values at the points of the tableau add to coefficients */
    Most *most;
    V *control;         /* work array of the laws of controllers */
    Mask arming;        /* lanes whose guards have to be found */
    Mask due;           /* lanes that have reached an instant of controllers */
    V *slopes;          /* rates of steps of order 5, and the states at their ends (brief.c) */
    Mask brief;         /* lanes whose last attempt was such a step */
} Group;

/* A row of all lanes, or one of its numbers in all lanes. */
INLINE V of_lane(const V *row, int64_t l) { return l < 0 ? *row : splat((*row)[l]); }

/* State at a part of the last attempt. */
static void interpolate(const Problem *p, Group *g, V part, V *target);

#endif
