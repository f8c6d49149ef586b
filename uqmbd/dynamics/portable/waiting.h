/* Decisions about events for programs that integrate one realisation without Python. */
#ifndef UQMBD_WAITING_H
#define UQMBD_WAITING_H

#include "dop853.h"

/* Decide about the event of a realisation, as `advance` does, but also at the start of a motion and at the end of an
   interval; whether it is decided.  `happened` and `later` of its encounters are those of the caller. */
int decide_waiting(const Problem *problem, const Pool *pool, int64_t member, double *workspace);

/* Decide about a jump of speeds from outside in closed contacts: those that are pressed stay closed, without restitution,
   and the others open.  `happened` is the first guard of the contact that approaches fastest. */
int decide_push(const Problem *problem, const Pool *pool, int64_t member, double *workspace);

#endif
