/* Decisions about the contacts of a mechanism. */
#ifndef UQMBD_CONTACT_LAWS_H
#define UQMBD_CONTACT_LAWS_H

#include "motion_memory.h"

/* Find the contacts that are closed at the start of the motion, and whether they last. */
void start_contacts(Motion *of, double time, Report *to);

/* Prepare the guards of contacts at the start of a step, at a time in it; inputs may have changed. */
void begin_contacts(Motion *of, double time, double *wanted, Report *to);

/* Process the event that the driver has found at `now`; `time` is inside of the interval, where functions of time do
   not jump. */
void decide_contact(Motion *of, double now, double time, double *wanted, Report *to);

#endif
