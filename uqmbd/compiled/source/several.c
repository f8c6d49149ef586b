/* Decisions about events of lanes with several closed contacts, or with dry friction of joints. */
#include "group.h"

/* Add a contact to the closed ones of a lane; whether there is room.  The normal direction of dry friction has no motion. */
static int add_closed(const Problem *p, const Group *g, int64_t l, int64_t k, Closed *x) {
    const Contacts *c = p->contacts;
    int64_t n = p->coordinates, count = c->first[k + 1] - c->first[k], moves = 0;
    if (x->count == MOST_CLOSED || count > MOST_DIRECTIONS) return 0;
    for (int64_t i = 0; i < n; i++) moves |= g->work[c->slope[c->first[k] * n + i]][l] != 0.0;
    int64_t place = x->count++, first = x->first[place];
    x->given[place] = !moves;
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
    for (int64_t i = 0; i < x.count && o->pushed; i++) x.restitution[i] = 0.0;
    double approach = 0.0;
    for (int64_t i = 0; i < x.count; i++) approach = greatest(approach, -x.speed[x.first[i]]);
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

/* Note contacts of a lane that are hit, lift off, or begin to rest. */
static void note_contacts(const Contacts *c, const Group *g, int64_t l, const Outcome *o, const Closed *x,
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
}

/* Note contacts of a lane that begin to stick or to slip. */
static void note_slides(const Group *g, int64_t l, const Closed *x, const int64_t *before, const int64_t *mode) {
    for (int64_t i = 0; i < x->count; i++) {
        int64_t old = before[i], now = mode[i];
        if (old == OPEN || (now != STICK && now != SLIP) || (old == STICK) == (now == STICK)) continue;
        note(g->pool->encounters, g->member[l], g->now[l], x->event[i], now == STICK ? BEGINS_STICKING : BEGINS_SLIPPING);
    }
}

/* Put the closed contacts of a lane into their states. */
static void keep_lasting(const Contacts *c, Group *g, int64_t l, const Closed *x, const Lasting *s) {
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l], *mode = e->mode + m * c->events;
    double *heading = e->heading + m * c->directions, *internal = e->internal + m * c->directions;
    g->touching[l] = 0;
    for (int64_t i = 0; i < c->events; i++) mode[i] = OPEN;
    for (int64_t d = 0; d < c->directions; d++) heading[d] = internal[d] = 0.0;
    for (int64_t i = 0; i < x->count; i++) {
        mode[x->event[i]] = s->mode[i];
        if (s->mode[i] != OPEN) g->touching[l] = -1;
        for (int64_t j = x->first[i]; j < x->first[i + 1]; j++) {
            internal[x->direction[j]] = s->internal[j];
            if (s->mode[i] == SLIP && j > x->first[i]) heading[x->direction[j]] = s->heading[i][j - x->first[i] - 1];
        }
    }
}

/* Remove small speeds against slides that begin: the contacts whose speeds are removed. */
static void note_turns(const Closed *x, const Lasting *s, Outcome *o) {
    o->turns = 0;
    for (int64_t i = 0; i < x->count; i++) {
        double along = 0.0;
        for (int64_t j = x->first[i] + 1; s->mode[i] == SLIP && j < x->first[i + 1]; j++)
            along += s->heading[i][j - x->first[i] - 1] * x->speed[j];
        if (along < 0.0) o->turn[o->turns++] = x->event[i];
    }
}

/* Lasting contacts of a lane, after `look`; whether their number is within the bound. */
static int collect_lasting(const Problem *p, const Group *g, int64_t l, Closed *x) {
    const Contacts *c = p->contacts;
    x->count = x->first[0] = 0;
    for (int64_t i = 0; i < c->events; i++)
        if (g->pool->encounters->mode[g->member[l] * c->events + i] != OPEN && !add_closed(p, g, l, i, x)) return 0;
    return complete(p, g, l, x);
}

/* Contacts of a lane that are closed and have no normal speed, without one that leaves (-1: none). */
static int collect_closed(const Problem *p, const Group *g, int64_t l, double slow, int64_t leaving, Closed *x) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l];
    x->count = x->first[0] = 0;
    for (int64_t i = 0; i < c->events; i++) {
        if (c->first[i + 1] == c->first[i] || i == leaving) continue;
        double most = e->mode[m * c->events + i] == OPEN ? TOUCHES : HELD;
        if (!(g->work[c->gap[i]][l] <= most * e->length[m])) continue;
        if (!(__builtin_fabs(g->work[c->speed[c->first[i]]][l]) <= slow)) continue;
        if (!add_closed(p, g, l, i, x)) return 0;
    }
    return !x->count || complete(p, g, l, x);
}

/* Store the lasting contacts of a lane, and what is noted about it; whether there is room. */
static int store_lasting(const Contacts *c, const Group *g, int64_t l, Stored *x) {
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l];
    x->noted = e->noted[m];
    x->total = e->total[m];
    x->count = 0;
    for (int64_t k = 0; k < c->events; k++) {
        if (e->mode[m * c->events + k] == OPEN) continue;
        if (x->count == MOST_CLOSED || c->first[k + 1] - c->first[k] > MOST_DIRECTIONS) return 0;
        for (int64_t d = c->first[k]; d < c->first[k + 1]; d++) {
            x->heading[x->count][d - c->first[k]] = e->heading[m * c->directions + d];
            x->internal[x->count][d - c->first[k]] = e->internal[m * c->directions + d];
        }
        x->mode[x->count] = e->mode[m * c->events + k];
        x->event[x->count++] = k;
    }
    return 1;
}

/* Restore what was stored: a decision that the caller has to take changes nothing. */
static void restore_lasting(const Contacts *c, Group *g, int64_t l, const Stored *x) {
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l];
    e->noted[m] = x->noted;
    e->total[m] = x->total;
    for (int64_t k = 0; k < c->events; k++) e->mode[m * c->events + k] = OPEN;
    for (int64_t d = 0; d < c->directions; d++) e->heading[m * c->directions + d] = e->internal[m * c->directions + d] = 0.0;
    for (int64_t i = 0; i < x->count; i++) {
        int64_t first = c->first[x->event[i]];
        e->mode[m * c->events + x->event[i]] = x->mode[i];
        for (int64_t d = first; d < c->first[x->event[i] + 1]; d++) {
            e->heading[m * c->directions + d] = x->heading[i][d - first];
            e->internal[m * c->directions + d] = x->internal[i][d - first];
        }
    }
    g->touching[l] = x->count ? -1 : 0;
}

/* States of the lasting contacts of a lane so far, with their forces. */
static int lasting_so_far(const Contacts *c, const Group *g, int64_t l, const Closed *x, Lane *s, int with_internal,
                          Lasting *found) {
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l];
    for (int64_t i = 0; i < x->count; i++) {
        found->mode[i] = e->mode[m * c->events + x->event[i]];
        for (int64_t j = x->first[i] + 1; j < x->first[i + 1]; j++)
            found->heading[i][j - x->first[i] - 1] = e->heading[m * c->directions + x->direction[j]];
    }
    if (!find_lasting_forces(x, s, found)) return 0;
    if (!with_internal) return 1;
    for (int64_t j = 0; j < x->first[x->count]; j++) {
        found->force[j] -= found->internal[j];
        found->internal[j] = e->internal[m * c->directions + x->direction[j]];
        found->force[j] += found->internal[j];
    }
    return 1;
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

/* Decide what is left with the contacts of a lane a short time later: contacts at their limit, and which of them slip. */
static int prepare_limit(const Problem *p, const Group *g, int64_t l, int64_t k, Limit *x) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    Closed *now = &x->now;
    Lane s = lane_of(c, g);
    int64_t count = now->count, event[MOST_CLOSED], mode[MOST_CLOSED];
    for (int64_t i = 0; i < count; i++) {
        event[i] = now->event[i];
        mode[i] = x->before[i];
    }
    if (!collect_lasting(p, g, l, now) || !lasting_so_far(c, g, l, now, &s, 1, &x->lasting)) return 0;
    for (int64_t i = 0; i < now->count; i++) {
        double room = reserve_of(now, x->lasting.mode, i, x->lasting.force);
        int own = now->event[i] == k, cone = has_cone(now, x->lasting.mode, i);
        x->before[i] = OPEN;
        for (int64_t j = 0; j < count; j++)
            if (event[j] == now->event[i]) x->before[i] = mode[j];
        x->forced[i] = x->again && (own || e->held[g->member[l] * c->events + now->event[i]] == SLIDES);
        x->limited[i] = x->forced[i] || (own && now->count == 1) ||
                        (cone && room <= AT_LIMIT * now->friction[i] * x->lasting.force[now->first[i]]);
    }
    /* another distribution of forces may hold the bodies: then nothing slips */
    int reached = 0;
    for (int64_t i = 0; i < now->count; i++) reached |= now->event[i] == k && x->limited[i];
    for (int64_t i = 0; i < now->count && !reached; i++) x->limited[i] = 0;
    x->needed = 1;
    return 1;
}

/* Complete a decision on contacts at their limit, or on forces of redundant contacts, with the contacts a short time later
   in the work array; whether the laws have a solution. */
static int complete_limit(const Problem *p, Group *g, int64_t l, Limit *x, Outcome *o) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l], slides = 0, *held = e->held + m * c->events;
    double now = g->now[l];
    Lane s = lane_of(c, g);
    Closed later;
    if (!collect_lasting(p, g, l, &later) || later.first[later.count] != x->now.first[x->now.count]) return 0;
    for (int64_t i = 0; i < x->now.count; i++) slides |= x->limited[i];
    if (!slides)
        prolong(&later, &s, x);
    else if (!let_slip(&later, &s, x))
        return 0;
    keep_lasting(c, g, l, &x->now, &x->lasting);
    note_slides(g, l, &x->now, x->before, x->lasting.mode);
    note_turns(&x->now, &x->lasting, o);
    for (int64_t i = 0; i < c->events; i++) held[i] = 0;
    for (int64_t i = 0; i < x->now.count; i++)
        held[x->now.event[i]] = x->limited[i] ? HOLDS : x->forced[i] ? SLIDES : 0;
    e->later[m] = now + greatest(e->together, PROMPT * __builtin_fabs(now));
    if (slides) e->starting[m] = STARTING * g->floor[l];
    return 1;
}

/* Decide about a lane that lands with its state in the work array, stops or begins to slide in contact k, or in which
   this contact is not pressed any more: the states of all contacts.  Whether they are known; `project`: whether to project
   the state onto the contacts; `limit`: what is left to decide with the contacts a short time later. */
static int decide_all_modes(const Problem *p, Group *g, int64_t l, int64_t k, int64_t kind, Outcome *o, int *project,
                            Limit *limit) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l], *before = e->mode + m * c->events;
    int slips = 0, sticks = 0, closed = 0;
    double still = slow_speed(e, m), slow = kind == STOPS ? greatest(still, e->starting[m]) : still;
    Lane s = lane_of(c, g);
    Touch t = touch_of(p, g, l, k);
    *project = limit->needed = limit->stored = 0;
    limit->again = g->now[l] <= e->later[m];
    limit->starting = e->starting[m];
    if (kind == STOPS && length_along(&t, t.speed) > slow) { /* a fast slide has only changed its direction */
        turns_slide(g, l, &t, SLIP, e->heading + m * c->directions + c->first[k] + 1);
        return 1;
    }
    if (kind != STOPS) e->starting[m] = 0.0;
    Closed *x = &limit->now;
    Lasting *found = &limit->lasting;
    if (kind == LIFTS || (kind == STARTS && limit->again)) {
        if (!collect_lasting(p, g, l, x)) return 0;
        for (int64_t i = 0; i < x->count; i++) limit->before[i] = before[x->event[i]];
        if (kind == STARTS) return prepare_limit(p, g, l, k, limit);
        /* other forces of redundant contacts may press all of them */
        if (x->count > 1 && !limit->again && lasting_so_far(c, g, l, x, &s, 0, found) && has_internal(x, found) &&
            are_pressed(x, found, 0.0)) {
            for (int64_t i = 0; i < x->count; i++) limit->limited[i] = limit->forced[i] = 0;
            return limit->needed = 1;
        }
    }
    if (!collect_closed(p, g, l, slow, kind == LIFTS ? k : -1, x)) return 0;
    if (x->count && !find_lasting(x, slow, &s, found)) return 0;
    for (int64_t i = 0; i < x->count; i++) {
        limit->before[i] = before[x->event[i]];
        closed += found->mode[i] != OPEN;
        slips |= x->event[i] == k && found->mode[i] == SLIP;
        sticks |= x->event[i] == k && found->mode[i] == STICK;
    }
    if (kind == STOPS && are_as_before(c, before, x, found->mode)) {
        for (int64_t i = 0; i < x->count; i++)
            if (x->event[i] == k && turns_slide(g, l, &t, found->mode[i], found->heading[i])) {
                keep_lasting(c, g, l, x, found);
                return 1;
            }
    }
    limit->stored = kind == STARTS && sticks;
    if (limit->stored && !store_lasting(c, g, l, &limit->earlier)) return 0;
    note_contacts(c, g, l, o, x, found->mode);
    keep_lasting(c, g, l, x, found);
    note_turns(x, found, o);
    *project = closed > 0;
    if (limit->stored) {
        if (prepare_limit(p, g, l, k, limit)) return 1;
        restore_lasting(c, g, l, &limit->earlier);
        return *project = o->turns = 0;
    }
    note_slides(g, l, x, limit->before, found->mode);
    if (kind == STOPS) e->starting[m] = slips ? STARTING * g->floor[l] : 0.0;
    return 1;
}
