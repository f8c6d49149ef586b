/* Equations of motion of a projected ensemble (Galerkin): states are coefficients in a basis, and their accelerations
   and multipliers x those of

       Psi^T W A_k Psi x = Psi^T W b_k

   with a system A_k, b_k at each node.  Values at eight nodes are the lanes of a vector in a work array, of which there is
   one for each eight nodes; coefficients of eight terms are the lanes of a vector, of which there are `blocks` for each
   entry of a state, one after the other.  Lanes without a term are zero; those without a node are copies of the last.

   With a phase in place of the time as the independent variable each node has a time of its own, and a pace: its time per
   phase, with which b_k is multiplied; accelerations and multipliers are those per phase then. */
#ifndef UQMBD_COUPLED_H
#define UQMBD_COUPLED_H

#include "program.h"

enum { KRYLOV = 60 }; /* most iterations of GMRES */

/* What was done so far, and for how many further systems iterations are not tried. */
enum { SYSTEMS, ITERATIONS, DIRECT, KRYLOVS, AVOIDED, COUNTS };

/* LAPACK's dgesv. */
typedef void Gesv(int32_t *size, int32_t *rights, double *matrix, int32_t *leading, int32_t *pivots, double *right,
                  int32_t *leading_right, int32_t *info);

/* Solves the systems at the nodes where no program does. */
enum { FACTORISE, SOLVE };
typedef void Outside(int64_t what);

typedef struct {
    int64_t terms, nodes;
    int64_t width;       /* of a state */
    int64_t coordinates; /* unknowns that are accelerations, the first ones */
    int64_t size;        /* unknowns */
    int64_t rates;       /* auxiliary states with a rate */
    const V *psi;        /* (term, eight nodes): the basis */
    const V *adjoint;    /* (node, eight terms): Psi^T W, from values to coefficients */
    /* at eight nodes: a state (width), the time, zero and the parameters stand in the first rows */
    V *work;                /* (eight nodes, rows) */
    int64_t rows, time;     /* of a work array; row of the time */
    Program values;         /* state -> entries of the system */
    Program drift;          /* state -> residuals of the constraints */
    Program factor;         /* entries -> factors */
    Program solve;          /* factors and right-hand side -> solution */
    Outside *outside;       /* in place of `factor` and `solve`, if it is not null */
    int64_t right, guess;   /* first row of the right-hand side, and of an unknown vector (size each) */
    const int64_t *solution;                   /* rows of the solution (size) */
    const int64_t *starts, *columns, *entries; /* of each row of a system; columns and rows of its entries */
    const int64_t *motion, *constraints;       /* rows of the right-hand sides (size), (2, size); -1: zero */
    const int64_t *rate;                       /* rows of the rates of auxiliary states */
    double tolerance;       /* relative size of the last change of the accelerations */
    double tolerance_drift; /* the same of what exceeds the constraints */
    double worth;           /* iterations that take as long as a factorisation of the whole system; < 0: it is too large */
    Gesv *gesv;
    int64_t *counts; /* COUNTS */
    V *correction;   /* by what the last solution differed from the projected nodal ones (size) */
    V *memory;       /* coupled_memory */
    const V *times, *paces; /* of eight nodes each; null: all have the time of the state, and the pace 1 */
} Coupled;

/* Vectors of the work arrays, and of `memory`. */
int64_t coupled_memory(const Coupled *coupled);

/* Evaluate the systems of a state: its coefficients, then the time. */
void coupled_place(const Coupled *coupled, const V *state);

/* Accelerations and multipliers (size), then rates of auxiliary states: all coefficients; NaN where nothing converges. */
void coupled_rate(const void *coupled, const V *state, V *results);

/* By what coordinates and velocities of the state that was placed exceed the projected constraints (2 coordinates). */
void coupled_excess(const void *coupled, const V *state, V *results);

#endif
