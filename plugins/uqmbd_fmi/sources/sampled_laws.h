/* Sampled controllers with laws. */
#ifndef UQMBD_SAMPLED_LAWS_H
#define UQMBD_SAMPLED_LAWS_H

#include "motion_memory.h"

/* Take the first samples of controllers with laws. */
void start_laws(Motion *of, Report *to);

/* Time of the next sample of a controller, or of commands that begin to act; infinity without laws. */
double next_sample(const Motion *of);

/* Take the samples that are due, and let commands act. */
void sample_laws(Motion *of, Report *to);

#endif
