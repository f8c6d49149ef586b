/* Decisions about events of one realisation: where `advance` leaves them to its caller, and Python decides otherwise. */
#include "waiting.h"

enum { PROJECTIONS = 3 };

int decide_waiting(const Problem *p, const Pool *pool, int64_t member, double *workspace) {
    Group g;
    Most most;
    int64_t guards[LANES];
    Mask left = {0}, still = {0};
    g.most = &most;
    place(p, &g, workspace);
    g.pool = pool;
    g.work[p->time + 1] = g.size = splat(0.0);
    for (int64_t l = 0; l < LANES; l++) {
        load_lane(p, pool, &g, l, member, l == 0);
        guards[l] = pool->encounters->happened[member];
    }
    left[0] = -1;
    g.end[0] = INFINITY; /* functions of time are evaluated until g.high: only the decision passes the end */
    left = decide_events(p, &g, left, guards);
    /* steps project states onto persistent contacts to first order, which may leave small normal speeds */
    for (int64_t k = 0; k < PROJECTIONS && any(left & g.touching); k++) {
        settle(p, &g, left, still, guards);
        left = decide_events(p, &g, left, guards);
    }
    store_lane(p, pool, &g, 0);
    return !any(left);
}
