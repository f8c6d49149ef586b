/* Decisions about events of lanes with several closed contacts: impacts, and the ends of sliding. */
#include "group.h"

/* Add a contact to the closed ones of a lane; whether it has a motion, and there is room. */
static int add_closed(const Problem *p, const Group *g, int64_t l, int64_t k, Closed *x) {
    const Contacts *c = p->contacts;
    int64_t n = p->coordinates, count = c->first[k + 1] - c->first[k], moves = 0;
    if (x->count == MOST_CLOSED || count > MOST_DIRECTIONS) return 0;
    for (int64_t i = 0; i < n; i++) moves |= g->work[c->slope[c->first[k] * n + i]][l] != 0.0;
    if (!moves) return 0;
    int64_t place = x->count++, first = x->first[place];
    x->event[place] = k;
    x->restitution[place] = g->work[c->law[2 * k]][l];
    x->friction[place] = g->work[c->law[2 * k + 1]][l];
    if (!(x->friction[place] > 0.0)) count = 1;
    for (int64_t i = 0; i < count; i++) x->direction[first + i] = c->first[k] + i;
    x->first[place + 1] = first + count;
    return 1;
}

/* Quantities of the closed contacts of a lane, after `find_responses` in their directions; whether all are finite. */
static int complete(const Problem *p, const Group *g, int64_t l, Closed *x) {
    const Contacts *c = p->contacts;
    int finite = 1;
    for (int64_t i = 0; i < x->first[x->count]; i++) {
        const V *row = g->responses + x->direction[i] * (1 + c->directions);
        x->natural[i] = row[0][l];
        x->speed[i] = g->work[c->speed[x->direction[i]]][l];
        finite &= is_finite(x->natural[i]) && is_finite(x->speed[i]);
        for (int64_t j = 0; j < x->first[x->count]; j++) {
            x->matrix[i][j] = row[1 + x->direction[j]][l];
            finite &= is_finite(x->matrix[i][j]);
        }
    }
    for (int64_t k = 0; k < x->count; k++) finite &= x->matrix[x->first[k]][x->first[k]] > 0.0;
    return finite;
}

/* Decide about an impact of a lane, whose contacts are in the work array: LANDS, with a new state in g->next, or
   UNDECIDED. */
static int64_t decide_blows(const Problem *p, Group *g, int64_t l, int64_t k, Outcome *o) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l], own = 0;
    double impulse[MOST_ROWS], length = e->length[m];
    int hit[MOST_CLOSED];
    Lane s = lane_of(c, g);
    Closed x;
    x.count = x.first[0] = 0;
    for (int64_t i = 0; i < c->events; i++) {
        if (c->first[i + 1] == c->first[i]) continue;
        int lasts = e->mode[m * c->events + i] != OPEN;
        if (i == k) own = x.count;
        if ((i == k || lasts || g->work[c->gap[i]][l] <= TOUCHES * length) && !add_closed(p, g, l, i, &x)) return UNDECIDED;
    }
    if (!complete(p, g, l, &x)) return UNDECIDED;
    double approach = greatest(0.0, -x.speed[x.first[own]]);
    e->fastest[m] = greatest(e->fastest[m], approach);
    double slow = slow_speed(e, m), gap = g->work[c->gap[k]][l];
    if (!solve_blows(&x, 1e-3 * slow, &s, impulse, hit)) return UNDECIDED;
    for (int64_t i = 0; i < p->coordinates; i++) {
        g->next[i][l] -= change_of(p, g, l, i, c->first[k]) * gap / x.matrix[x.first[own]][x.first[own]];
        for (int64_t j = 0; j < x.first[x.count]; j++)
            g->next[p->velocities + i][l] += change_of(p, g, l, i, x.direction[j]) * impulse[j];
        if (!is_finite(g->next[i][l]) || !is_finite(g->next[p->velocities + i][l])) return UNDECIDED;
    }
    for (int64_t i = 0; i < x.count; i++)
        if (approach > slow && hit[i] && e->mode[m * c->events + x.event[i]] == OPEN) o->hit[o->hits++] = x.event[i];
    return LANDS;
}

/* Note what changes in a lane: contacts that are hit, lift off, begin to rest, to stick or to slip. */
static void note_changes(const Contacts *c, const Group *g, int64_t l, const Outcome *o, const Closed *x,
                         const int64_t *mode) {
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l];
    const int64_t *before = e->mode + m * c->events;
    for (int64_t i = 0; i < o->hits; i++) note(e, m, g->now[l], o->hit[i], AS_DECLARED);
    for (int64_t k = 0; k < c->events; k++) {
        int stays = 0;
        for (int64_t i = 0; i < x->count; i++) stays |= x->event[i] == k && mode[i] != OPEN;
        if (before[k] != OPEN && !stays) note(e, m, g->now[l], k, LIFTS_OFF);
    }
    for (int64_t i = 0; i < x->count; i++)
        if (before[x->event[i]] == OPEN && mode[i] != OPEN) note(e, m, g->now[l], x->event[i], BEGINS_RESTING);
    for (int64_t i = 0; i < x->count; i++) {
        int64_t old = before[x->event[i]], now = mode[i];
        if (old == OPEN || (now != STICK && now != SLIP) || (old == STICK) == (now == STICK)) continue;
        note(e, m, g->now[l], x->event[i], now == STICK ? BEGINS_STICKING : BEGINS_SLIPPING);
    }
}

/* Whether the closed contacts of a lane are those before, in the same states. */
static int are_as_before(const Contacts *c, const int64_t *before, const Closed *x, const int64_t *mode) {
    int64_t lasting = 0, same = 0;
    for (int64_t k = 0; k < c->events; k++) lasting += before[k] != OPEN;
    for (int64_t i = 0; i < x->count; i++) {
        int64_t old = before[x->event[i]];
        if (old == OPEN && mode[i] == OPEN) continue;
        if (old == OPEN || mode[i] == OPEN || (old == STICK) != (mode[i] == STICK)) return 0;
        same++;
    }
    return same == lasting;
}

/* Decide about a lane that lands with its state in the work array, or stops sliding in contact k: the states of all
   contacts; whether they are known, and whether to project the state onto the contacts. */
static int decide_all_modes(const Problem *p, Group *g, int64_t l, int64_t k, int lands, Outcome *o, int *project) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l], mode[MOST_CLOSED], *before = e->mode + m * c->events, slips = 0, turned = 0, closed = 0;
    double still = slow_speed(e, m), slow = lands ? still : greatest(still, e->starting[m]), heading[MOST_CLOSED][2];
    Lane s = lane_of(c, g);
    Touch t = touch_of(p, g, l, k);
    *project = 0;
    if (!lands && length_along(&t, t.speed) > slow) { /* a fast slide has only changed its direction */
        turns_slide(g, l, &t, SLIP, e->heading + m * c->directions + c->first[k] + 1);
        return 1;
    }
    Closed x;
    x.count = x.first[0] = 0;
    for (int64_t i = 0; i < c->events; i++) {
        if (c->first[i + 1] == c->first[i]) continue;
        double most = before[i] == OPEN ? TOUCHES : HELD;
        if (!(g->work[c->gap[i]][l] <= most * e->length[m])) continue;
        if (!(__builtin_fabs(g->work[c->speed[c->first[i]]][l]) <= slow)) continue;
        if (!add_closed(p, g, l, i, &x)) return 0;
    }
    if (x.count && !(complete(p, g, l, &x) && modes_of(&x, slow, &s, mode, heading))) return 0;
    for (int64_t i = 0; i < x.count; i++) {
        closed += mode[i] != OPEN;
        slips |= x.event[i] == k && mode[i] == SLIP;
    }
    if (!lands && are_as_before(c, before, &x, mode)) {
        for (int64_t i = 0; i < x.count; i++)
            if (x.event[i] == k) turned = turns_slide(g, l, &t, mode[i], heading[i]);
    }
    if (!turned) {
        note_changes(c, g, l, o, &x, mode);
        e->starting[m] = !lands && slips ? STARTING * g->floor[l] : 0.0;
        *project = closed > 0;
    }
    for (int64_t i = 0; i < c->events; i++) before[i] = OPEN;
    for (int64_t d = 0; d < c->directions; d++) e->heading[m * c->directions + d] = e->internal[m * c->directions + d] = 0.0;
    for (int64_t i = 0; i < x.count; i++) {
        double along = 0.0;
        before[x.event[i]] = mode[i];
        for (int64_t j = x.first[i] + 1; mode[i] == SLIP && j < x.first[i + 1]; j++) {
            double direction = heading[i][j - x.first[i] - 1];
            e->heading[m * c->directions + x.direction[j]] = direction;
            along += direction * x.speed[j];
        }
        if (along < 0.0) o->turn[o->turns++] = x.event[i];
    }
    g->touching[l] = closed ? -1 : 0;
    return 1;
}
