/* The explicit method of order 8 of Dormand and Prince (Hairer, Norsett, Wanner: Solving Ordinary Differential
   Equations I, II.5) with projection onto the constraints after each step, eight realisations at once.

   Each lane has a time, a step size and an error estimate of its own: what a realisation yields depends on nothing but
   the realisation.  A lane that is done, or needs a decision, is given to the next realisation.

   Or all lanes are one problem: its rows are terms of an expansion, which share the time, the step size and the norms
   of the error.  An entry of a state is then several vectors, one after the other, and lanes without a term are zero. */
#ifndef UQMBD_DOP853_H
#define UQMBD_DOP853_H

#include "control.h"
#include "events.h"
#include "radau.h"

enum { STAGES = 12, ALL_STAGES = 16, DENSE = 7, NODES = 5, PLACES = 8, POINTS = 8 };

/* Rows of the tableau without their zeros, but padded with such to multiples of four terms: row r has the terms
   starts[r] .. starts[r + 1] - 1. */
typedef struct {
    const int64_t *starts, *index;
    const double *weights;
    const double *moments; /* of all stages, as parts of a step */
    const double *points;  /* parts of a step (POINTS) at which states are projected, others (POINTS) at which the
                              interpolation between those is verified, and what a value at each of the former adds to
                              Chebyshev coefficients (POINTS, POINTS) */
} Tableau;

enum {
    ROW_STEP = STAGES,        /* rows 1 .. 11: the stages */
    ROW_MORE = STAGES + 1,    /* three further stages of the interpolant */
    ROW_DENSE = STAGES + 4,   /* its seven coefficients */
    ROW_FIFTH = STAGES + 11,  /* estimates of the error */
    ROW_THIRD = STAGES + 12,
    ROW_BETWEEN = STAGES + 13 /* by what the interpolant misses the last of the further stages */
};

/* What becomes of a realisation.  All but RUNNING wait for somebody to decide. */
enum {
    RUNNING,
    DONE,
    JUMP,    /* a leg has ended where something may jump */
    REFUSED, /* several steps in a row were refused */
    STRAYED, /* a step leads far off the constraints; it was not taken */
    STIFF,
    MANY,    /* more attempts than are allowed */
    SMALL,   /* the step size has become too small */
    STEPPED, /* a step was taken, and the caller asked for each */
    EVENT,   /* a guard has fallen through zero */
    NOTED,   /* there might not be room for the marks of another step */
    UNSAMPLED, /* a sample of a controller is invalid; it was not applied */
    ASKED     /* a sample needs functions of the caller */
};

/* Why the last attempt was refused: its error, or its interpolant.  Steps that the latter shortens do not look stiff, so
   that they do not end a row of stiff steps; nor does the step after. */
enum { INACCURATE = 1, COARSE, AFTER_COARSE };

enum { CALM = 6 }; /* steps in a row that do not look stiff after which those before do not count, for early decisions */

typedef struct {
    int64_t terms;                          /* 0: lanes are realisations; else the number of rows of one problem */
    int64_t blocks;                         /* vectors of each entry of a state */
    int64_t width, coordinates, velocities; /* of a state: vectors, first so many of coordinates, first of a velocity */
    int64_t parameters;
    int64_t time; /* row of the time; parameters stand from row time + 2 on, and the row between them is zero */
    int64_t rows; /* of the work array */
    Program motion;          /* a state -> its rate */
    const int64_t *rate;     /* rows of the rate (width) */
    int64_t turning, turn;   /* bodies that turn, and the entries of their quaternions; see turning.c */
    const int64_t *turns;    /* first entry of each of these quaternions */
    Program values;          /* the part of motion that comes before its solution */
    Program drift;           /* residuals of the constraints */
    Program place, move;     /* after motion, or values, and drift: by what coordinates, and velocities, exceed them */
    const int64_t *surplus;  /* rows of that (2 coordinates); null: there are no constraints */
    const int64_t *residuals; /* rows of the residuals: first so many in position, then those in velocity */
    int64_t positions, equations;
    const Tableau *tableau;
    double rtol, moving;     /* relative tolerance, number of entries of a state that change */
    double far;              /* an interpolated state that is farther off the constraints is noted */
    double surplus_allowed;  /* a step that leads farther off them, in tolerances, is not taken */
    double between;          /* greatest error of the interpolant of a step, in tolerances */
    double stiff;            /* step size times the size of the Jacobian from which stability limits the step */
    int64_t patience;        /* so many steps that look stiff: stiff */
    int64_t early;           /* whether others may be between them, and refused ones count */
    int64_t refusals;        /* so many refused steps in a row: somebody decides */
    int64_t attempts;        /* most of a leg */
    int64_t guarded;         /* whether somebody decides about refused steps, and those off the constraints */
    int64_t brief;           /* whether whole integration intervals are tried with order 5 (brief.c) */
    int64_t instants;        /* number of output times */
    const double *times;
    const double *leg_ends, *leg_longest; /* of all members, one after the other */
    const int64_t *leg_jumps;
    const Contacts *contacts; /* null: there are no events */
    const double *places;    /* parts of a step (PLACES) at which its states are recorded */
    int64_t room;            /* steps that can be recorded until somebody takes them; 0: none is */
    const Implicit *implicit; /* null: steps are explicit */
    const Control *control;  /* null: no controller is sampled here */
} Problem;

/* Interpolated states whose distance from the constraints is known: so far that they are computed again by steps that end
   there, and so close that `project` skips them. */
enum { STATE_FAR = 1, STATE_CLOSE = 2 };

/* All realisations: rows of arrays. */
typedef struct {
    double *z, *rate, *parameters; /* (member, width), the rate of what is stepped (turning.c), (member, parameter) */
    double *now, *begin, *wanted, *tried, *floor, *limit; /* (member) */
    int64_t *leg, *last_leg, *first, *column, *status, *attempts, *refused, *stiff;
    int64_t *fresh;    /* the rate is to be evaluated anew */
    int64_t *rejected; /* why the last attempt was refused; 0: it was not */
    int64_t *allowed;  /* so many attempts are left, of all legs */
    int64_t *trusted;  /* the next step may stray */
    int64_t *told;     /* stop after each step */
    int64_t *steps, *known; /* accepted steps; how many of the last states are known */
    int64_t *pause;         /* integration intervals in which no step of order 5 is tried (brief.c) */
    double *node_times, *nodes; /* (member, NODES), (member, NODES, width) */
    double *history;        /* (member, stages width + 2): stages of the last step, its size, and how fast its iteration was;
                               of implicit steps only */
    double *result; /* (member, instant, width) */
    double *off;    /* (member, equations + 1): largest residuals at the times that were projected, largest speed */
    int8_t *poor;   /* (member, instant): STATE_FAR, STATE_CLOSE, or 0 */
    double *path;        /* (room, PLACES, width): states of the steps that were taken, from begin to end */
    double *path_ends;   /* (room, 2): their begins and ends, s */
    int8_t *path_kept;   /* (room): whether contacts last there */
    int64_t *path_owner; /* (room): whose they are */
    int64_t *recorded;   /* how many there are, of all together */
    const Encounters *encounters;
} Pool;

/* Number of doubles of the workspace of `advance`, which must be aligned to 64 bytes. */
int64_t advance_workspace(const Problem *problem);

/* Integrate the members of a queue that are running, until none is or `budget` evaluations (of eight states each) are
   spent, or there is no room for what is recorded; return how many were. */
int64_t advance(const Problem *problem, const Pool *pool, const int64_t *queue, int64_t count, double *workspace,
                int64_t budget);

/* Put the states at the output times number first .. column - 1 of members that are not close to the constraints onto
   them; note which of them were far off, and what is left.  The workspace has the rows of the problem, and equations + 1 more. */
void project(const Problem *problem, const Pool *pool, const int64_t *queue, int64_t count, double *workspace);

#endif
