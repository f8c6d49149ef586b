/* Decisions about events of one realisation: where `advance` leaves them to its caller, and Python decides otherwise. */
#include "waiting.h"

/* Project the state of the first lane onto its constraints and persistent contacts. */
static void project_lane(const Problem *p, Group *g) {
    const Mask which = {-1};
    copy(g->work, g->z, p->width);
    g->work[p->time] = smaller(larger(g->now, g->low), g->high);
    put_on_constraints(p, g, which);
    put_on_contacts(p, g, which);
    for (int64_t i = 0; i < p->width; i++) g->z[i] = choose(which & (g->work[i] == g->work[i]), g->work[i], g->z[i]);
}

int decide_waiting(const Problem *p, const Pool *pool, int64_t member, double *workspace) {
    Group g;
    Most most;
    int64_t guards[LANES];
    Mask left = {-1};
    g.most = &most;
    place(p, &g, workspace);
    g.pool = pool;
    g.work[p->time + 1] = g.size = splat(0.0);
    for (int64_t l = 0; l < LANES; l++) {
        load_lane(p, pool, &g, l, member, l == 0);
        guards[l] = pool->encounters->happened[member];
    }
    g.end[0] = INFINITY; /* the decision may be at the end; functions of time are evaluated before it, at g.high */
    left = decide_events(p, &g, left, guards);
    /* steps project states onto persistent contacts to first order, which may leave small normal speeds */
    for (int64_t k = 0; k < PROJECTIONS && any(left & g.touching); k++) {
        project_lane(p, &g);
        left = decide_events(p, &g, left, guards);
    }
    store_lane(p, pool, &g, 0);
    return !any(left);
}
