/* Integration of a mechanism by the driver, which also decides about contacts. */
#ifndef UQMBD_INTEGRATION_H
#define UQMBD_INTEGRATION_H

#include "motion_memory.h"

enum { PAIR = 2 };

static const double FAR = 1000.0; /* residual of an interpolated state, in tolerances */

/* Find the contacts that are closed at the start of the motion, and whether they last. */
void start_contacts(Motion *of, Report *to);

/* Integrate to a time; controllers are not sampled before. */
void integrate(Motion *of, double end, Report *to);

#endif
