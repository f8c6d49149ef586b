/* Radau IIA methods (E. Hairer, G. Wanner: Solving Ordinary Differential Equations II, IV.5 and IV.8) for stiff motions,
   on the same equations, constraints and events as the explicit method.

   Stages are what the state changes by, Z (stages, width); they solve A^-1 Z / h = f(z + Z).  Newton's iteration solves

       sum_j (A^-1)_ij Dj / h - J_i D_i = R_i

   where J_i is the derivative of the rate at stage i.  One matrix for all stages would decouple them, but then the
   iteration converges in short steps only, where a stiff direction turns within a step.  So J_i is interpolated between
   four times of the step, as it is predicted.  From the derivatives of the equations of motion

       F(q, s, v, a, lambda) = M a - Q + h + D^T lambda = 0,   G(q, s, v, a) = D a - gamma = 0,   s' = g(q, s, v)

   follow sparse systems of blocks (stages, stages) for the velocities, auxiliary states and multipliers, as
   Dq = h A Dv: stages of coordinates are those of velocities, integrated, so that their remainders R_i vanish.  An entry that stands in M or D, another one in F_v, F_s, G_v, G_s, g_v, g_s or D^T, and a third
   one in F_q, G_q or g_q give the block

       A^-1 / h inertia_i + I plain_i + h A stiffness_i

   The estimate of the error solves (eta - J) x = r with the real eigenvalue eta h of A^-1 and J at the begin, which
   needs the same system with eta instead of A^-1 / h.

   All matrices are new in each step, so that a lane does not depend on the others. */
#ifndef UQMBD_RADAU_H
#define UQMBD_RADAU_H

#include "program.h"

enum { MOST_STAGES = 5, MATRICES = 4 };

typedef struct {
    int64_t stages;            /* 3 or 5 */
    const double *nodes;       /* (stages): as parts of a step; the last one is its end */
    const double *matrix, *inverse; /* (stages, stages): A, A^-1 */
    const double *between;     /* (stages, MATRICES): weights of the matrices at a stage */
    const double *error;       /* (stages): how stages enter the estimate of the error, after the rate / eigenvalue */
    double eigenvalue;         /* the real one of A^-1 */
    double tolerance;          /* of the iteration, as part of the tolerance of a step */
    int64_t iterations;        /* most of a step */
    Program motion;            /* a state -> accelerations and multipliers */
    const int64_t *solution;   /* rows of these (coordinates and multipliers) */
    Program gradients;         /* after motion: derivatives */
    const int64_t *rate;       /* rows of the rate (width) */
    int64_t multipliers;
    int64_t states;            /* auxiliary states */
    int64_t size, entries, given; /* of the systems: unknowns, entries with fill, entries that are given */
    int64_t moving;            /* given entries with inertia; these entries are the first ones */
    const int64_t *rows, *columns;                /* (given): row, column; these entries are the first ones */
    const int64_t *inertia, *plain, *stiffness;   /* (given): rows of the work array; -1: one */
    const int64_t *pivots, *pivot_rows, *pivot_columns; /* (size): entries, rows and columns in order of elimination */
    const int64_t *below_starts, *below, *below_rows;   /* of each pivot: entries of its column, and their rows */
    const int64_t *beside_starts, *beside, *beside_columns; /* entries of its row, and their columns */
    const int64_t *targets;    /* of all pairs of these, in order: entries that change */
    /* contacts that last add an equation and a force for each direction: given entries of the equations (direction,
       coordinate), of the forces, and on the diagonal (direction); -1: none, null: there are no contacts */
    const int64_t *along, *across, *alone;
} Implicit;

#endif
