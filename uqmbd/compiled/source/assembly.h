/* Assembly: poses that satisfy the constraints, and speeds, by changes of the least norm. */
#ifndef UQMBD_ASSEMBLY_H
#define UQMBD_ASSEMBLY_H

#include "program.h"

/* Equations f(x) = 0 by their values and gradients: A, sparse, a row for each.

   The first `solved` of them are solved for, in the order in which A A^T is eliminated; of these the first `certain` are
   independent, the others may follow from them.  The rest is only looked at. */
typedef struct {
    Program program;
    int64_t rows;                              /* of its work array */
    int64_t equations, solved, certain, unknowns, entries, lower;
    const int64_t *values;                     /* row of the value of each equation; -1: zero */
    const int64_t *starts, *columns, *from;    /* entries of each row; column, -1: it only counts in the length; and row
                                                  of the value of each */
    const double *factors;                     /* by which that is multiplied */
    const int64_t *next;                       /* beside each entry those of its column in later rows that are solved: */
    const int64_t *ends, *others, *rows_of;    /* from `next` up to `ends`, their numbers, and their rows */
    const int64_t *first, *below;              /* columns of the triangle: the diagonal first, rows of the entries */
    const int64_t *changes, *places, *owners;  /* entries left of each diagonal: where they stand, and their columns */
    double shortest;                           /* length of a gradient from which on it is one */
} Equations;

/* Bodies whose turns are bounded: coordinates of each, and whether they may be changed. */
typedef struct {
    const int64_t *coordinates, *free;
    int64_t bodies, size;
    int64_t dimension; /* so many first coordinates tell how large the mechanism is */
} Turns;

/* Vectors of memory that both functions want. */
int64_t assembly_memory(const Equations *e);

/* Close constraints: damped Gauss-Newton from the coordinates that the sources give, of states k = 0 .. count - 1.
   `undecided` is 1 where that has to be decided elsewhere, else 0. */
void close_poses(const Equations *e, const Turns *turns, V *memory, const Source *sources, int64_t many, int64_t count,
                 double *coordinates, int64_t cosines, const int64_t *cosine, int64_t *undecided);

/* Speeds x of the least norm with A x + f = 0. */
void least_speeds(const Equations *e, V *memory, const Source *sources, int64_t many, int64_t count, double *speeds,
                  int64_t *undecided);

#endif
