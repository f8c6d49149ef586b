/* Decisions about events of one realisation: where `advance` leaves them to its caller, and Python decides otherwise. */
#include "waiting.h"

/* Load a realisation into the first lane. */
static void load_waiting(const Problem *p, const Pool *pool, Group *g, Most *most, int64_t member, double *workspace) {
    g->most = most;
    place(p, g, workspace);
    g->pool = pool;
    g->work[p->time + 1] = g->size = splat(0.0);
    for (int64_t l = 0; l < LANES; l++) load_lane(p, pool, g, l, member, l == 0);
    g->end[0] = INFINITY; /* the decision may be at the end; functions of time are evaluated before it, at g->high */
}

int decide_waiting(const Problem *p, const Pool *pool, int64_t member, double *workspace) {
    Group g;
    Most most;
    int64_t guards[LANES];
    Mask left = {-1};
    load_waiting(p, pool, &g, &most, member, workspace);
    for (int64_t l = 0; l < LANES; l++) guards[l] = pool->encounters->happened[member];
    left = decide_events(p, &g, left, guards);
    store_lane(p, pool, &g, 0);
    return !any(left);
}

int decide_push(const Problem *p, const Pool *pool, int64_t member, double *workspace) {
    const Encounters *e = pool->encounters;
    const int64_t k = e->happened[member] / 2;
    Group g;
    Most most;
    Outcome outcomes[LANES];
    Limit limit;
    Mask which = {-1};
    int64_t guards[LANES];
    int closed = 0;
    load_waiting(p, pool, &g, &most, member, workspace);
    for (int64_t l = 0; l < LANES; l++) {
        guards[l] = 2 * k;
        outcomes[l].hits = outcomes[l].turns = 0;
        outcomes[l].pushed = 1;
    }
    copy(g.work, g.z, p->width);
    copy(g.next, g.z, p->width);
    g.work[p->time] = smaller(larger(g.now, g.low), g.high);
    look(p, &g, which, guards);
    if (decide_blows(p, &g, 0, k, outcomes) != LANDS) return 0;
    copy(g.work, g.next, p->width);
    look(p, &g, which, guards);
    if (!decide_all_modes(p, &g, 0, k, LANDS, outcomes, &closed, &limit)) return 0;
    copy(g.z, g.next, p->width);
    if (closed) settle(p, &g, which, outcomes);
    e->since[member] = pool->now[member];
    e->restarts[member]++;
    e->arming[member] = 1;
    store_lane(p, pool, &g, 0);
    return 1;
}
