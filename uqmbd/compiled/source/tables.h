/* Splines: which interval of a table an argument lies in, and the numbers there: where it begins, and coefficients. */
#ifndef UQMBD_TABLES_H
#define UQMBD_TABLES_H

#include "vectors.h"

/* Look up the arguments of some lanes.

   edges (knots):                        where the intervals begin, ascending
   rows (knots + 1, 1 + terms, numbers): numbers below the table, in its intervals and beyond: a constant, and the
                                         factors of some terms
   period:                               of the table, or zero
   x (1 + terms, lanes):                 arguments, then what the factors belong to
   found (numbers, lanes):               sums of the numbers */
void look_up(const double *edges, const double *rows, int64_t knots, int64_t terms, int64_t numbers, double period,
             int64_t lanes, const double *x, double *found);

/* Sampled path of one realisation: a cubic B-spline with equal steps. */
typedef struct {
    double step;   /* distance of knots, which are its multiples */
    int64_t begin; /* number of the first knot */
    int64_t count; /* number of coefficients; none: the path has no values yet */
    const double *coefficients;
} Path;

/* Look up paths for some lanes; each lane has a path of its own.

   x (2, lanes):     arguments, then addresses of paths; zero: a path of zeros
   found (5, lanes): the knot before the argument, and the coefficients of the cubic about it; NaN beyond the ends */
void look_up_path(int64_t lanes, const double *x, double *found);

#endif
