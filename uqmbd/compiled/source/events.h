/* Events within steps: guards that fall through zero, and contacts that last, whose forces act on the motion.

   An event k with directions is a contact: its first direction is the normal one, the others are tangents.  One without
   directions is a mark: it changes nothing, and is noted.  A contact has two guards, number 2 k and 2 k + 1: while it is
   open the gap; while it lasts the normal force, and the reserve of friction (it sticks) or the speed along the direction
   in which it slides (it slips).  The guard of a mark is number 2 k. */
#ifndef UQMBD_EVENTS_H
#define UQMBD_EVENTS_H

#include "program.h"

enum { SAMPLES = 8 }; /* parts of a step at whose ends guards are looked at */

enum { CLUSTER = 100 }; /* events in a short time that count as a cluster */

enum { AS_DECLARED, BEGINS_STICKING, BEGINS_SLIPPING, BEGINS_RESTING, LIFTS_OFF }; /* what is noted: the label of the event itself, or what follows */

enum { OPEN, STICK, SLIP, SMOOTH }; /* what a contact does; smooth: it lasts, and has no friction */

typedef struct {
    int64_t events, directions;
    const int64_t *first;        /* of each event its first direction; then the end */
    Program guards;              /* a state -> its guards */
    const int64_t *guard;        /* rows (event) */
    Program contact;             /* a state -> what is known of its contacts, and the index-1 system */
    const int64_t *gap, *law;    /* rows (event), (event, 2): restitution, friction */
    const int64_t *speed, *bias; /* rows (direction): relative velocities, and their rates without accelerations */
    const int64_t *slope;        /* rows (direction, coordinate): how velocities enter the speeds */
    int64_t size, entries;       /* of the index-1 system */
    const int64_t *rows, *columns, *values; /* (entry): places, and rows of the work array */
    const int64_t *right;        /* rows (size) of the right-hand side */
    Program factor, solve;       /* the entries -> factors; they and a right-hand side -> solution; no steps: there is none */
    int64_t side;                /* first row of that right-hand side */
    const int64_t *solution;     /* rows (size) of that solution */
} Contacts;

/* Of all realisations, as rows of arrays. */
typedef struct {
    int64_t *mode;          /* (member, event) */
    double *heading;        /* (member, direction): in which a contact slides that slips */
    double *internal;       /* (member, direction): forces of redundant contacts that last, beside the least ones, which
                               move nothing */
    int64_t *resting;       /* (member, 2 event): a guard that is zero, or that of a mark which has fallen, has to rise
                               before it can fall */
    double *rise;           /* (member, 2 event): its rate then, where that is known */
    double *length, *slow;  /* (member): size of the mechanism, and a speed that is none */
    int64_t *happened;      /* (member): the guard that has fallen */
    int64_t *noted;         /* (member): number of events that are noted */
    int64_t *mark;          /* (member, room): which */
    double *mark_times;     /* (member, room) */
    int64_t *mark_labels;   /* (member, room): what has happened */
    /* of decisions, null unless they are made here (decisions.c) */
    int64_t *total, *restarts, *stalled; /* (member): events, restarts, and events without progress in time */
    int64_t *clustered;     /* (member): number of events in `recent` */
    double *recent;         /* (member, CLUSTER): times of the last events */
    double *since;          /* (member): time of the last restart */
    double *fastest, *coarse; /* (member): fastest impact, and a factor of the speed below which bodies stay together */
    double *starting;       /* (member): a speed that is none after the start of sliding */
    double *turned;         /* (member): when the direction of a starting slide has turned last */
    double *later;          /* (member): end of the instant of the last decision on friction at its limit */
    int64_t *held;          /* (member, event): by that decision a contact sticks without a reserve of friction (1), or
                               slips in any case (2) */
    int64_t *arming;        /* (member): guards have to be found before the next step */
    int64_t room;
    int64_t watched;        /* whether guards are looked at */
    int64_t decides, reports; /* whether decisions are made here (1), or events are counted here only (2); and whether
                                 lanes stop at each restart */
    double window, together; /* durations of a cluster, and of an instant */
} Encounters;

/* Number of doubles of the workspace. */
int64_t contact_workspace(const Contacts *contacts);

#endif
