/* Decisions about events of lanes: impacts, rest, lift-off, and the ends of sticking and sliding.

   Here are those about lanes with one closed contact; several.c decides about several ones, and about dry friction of
   joints.  The caller decides about events without a unique motion, and beyond the bounds of the enumerations.

   Length: eight lanes pass all parts of a decision together, from the evaluation of contacts to the restart. */
#include "group.h"

static const double TOUCHES = 1e-9;  /* gap, relative to the size of the mechanism, that counts as closed */
static const double HELD = 1e-6;    /* the same of a contact that has persisted so far */
static const double FLIGHT = 2.05;  /* first step after an impact, relative to the estimated flight time */
static const double STARTING = 10.0; /* speed that counts as zero at the start of slip, over the tolerance */
static const double BOUNCES = 1e-6; /* impact speed, relative to the fastest one before, below which bodies stay together */
static const double SPEED_ROUNDED = 1e-7; /* impact speed, relative to the terms of a normal speed, that counts as made: rounding */
static const double DEEP = 1e-6;    /* overlap, relative to the size of the mechanism, that the caller has to decide about */
static const double COARSER = 4.0, COARSEST = 1e4; /* by what a cluster of events raises that, and the most */
enum { PROJECTIONS = 3 }; /* most projections of a state with normal speeds */
static const double PROMPT = 1e-14; /* time between two turns of a slide, over the larger of the time and 1 s, that is none */
enum { HOLDS = 1, SLIDES = 2 }; /* decided at this instant: sticks without a reserve of friction, slips in any case */
static const int64_t MOST = 10000, AT_ONCE = 100;  /* events of a realisation, and those without progress in time */

/* -- numbers of a realisation --------------------------------------------------------------------------------------- */

/* The normal speed below which bodies stay together. */
static double slow_speed(const Encounters *e, int64_t m) {
    double slow = e->coarse[m] * BOUNCES * e->fastest[m], least = 1e-12 * e->length[m];
    return slow > least ? slow : least;
}

/* Count an event.  A cluster of events raises the speed below which bodies stay together, because friction in a corner
   may sustain bounces; a calm time resets it. */
static void count_event(const Encounters *e, int64_t m, double now) {
    double *recent = e->recent + m * CLUSTER, size = now > 1.0 ? now : now < -1.0 ? -now : 1.0;
    e->stalled[m] = now - e->since[m] <= 1e-14 * size ? e->stalled[m] + 1 : 0;
    int64_t count = e->clustered[m];
    if (count && now - recent[count - 1] > 10.0 * e->window) {
        e->coarse[m] = 1.0;
        count = 0;
    }
    recent[count++] = now;
    if (count == CLUSTER) {
        if (recent[CLUSTER - 1] - recent[0] < e->window) {
            e->coarse[m] = e->coarse[m] * COARSER < COARSEST ? e->coarse[m] * COARSER : COARSEST;
            recent[0] = recent[CLUSTER - 1];
            count = 1;
        } else {
            for (int64_t i = 1; i < CLUSTER; i++) recent[i - 1] = recent[i];
            count--;
        }
    }
    e->clustered[m] = count;
}

/* Count an event of a contact, and note it; the number of marks is not limited. */
static void note(const Encounters *e, int64_t m, double time, int64_t event, int64_t label) {
    e->total[m]++;
    note_mark(e, m, time, event, label);
}

/* Put the only contact of a realisation into a mode; `heading`: the direction of sliding, if it slips. */
static void keep_one(const Contacts *c, Group *g, int64_t l, int64_t k, int64_t mode, const double *heading) {
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l];
    for (int64_t i = 0; i < c->events; i++) e->mode[m * c->events + i] = OPEN;
    for (int64_t d = 0; d < c->directions; d++) e->heading[m * c->directions + d] = e->internal[m * c->directions + d] = 0.0;
    e->mode[m * c->events + k] = mode;
    g->touching[l] = mode == OPEN ? 0 : -1;
    if (mode != SLIP) return;
    for (int64_t d = c->first[k] + 1; d < c->first[k + 1]; d++)
        e->heading[m * c->directions + d] = heading[d - c->first[k] - 1];
}

/* -- one contact ---------------------------------------------------------------------------------------------------- */

/* The quantities of a contact of a lane, after `find_responses` in its directions. */
static Touch touch_of(const Problem *p, const Group *g, int64_t l, int64_t k) {
    const Contacts *c = p->contacts;
    Touch x = {.restitution = g->work[c->law[2 * k]][l], .friction = g->work[c->law[2 * k + 1]][l]};
    int64_t first = c->first[k];
    x.count = x.friction > 0.0 ? c->first[k + 1] - first : 1;
    x.gap = g->work[c->gap[k]][l];
    for (int64_t i = 0; i < c->first[k + 1] - first; i++) {
        const V *row = g->responses + (first + i) * (1 + c->directions);
        x.natural[i] = row[0][l];
        x.speed[i] = g->work[c->speed[first + i]][l];
        for (int64_t j = 0; j < c->first[k + 1] - first; j++) x.matrix[i][j] = row[1 + first + j][l];
    }
    return x;
}

/* -- guards --------------------------------------------------------------------------------------------------------- */

/* Activate the guards of all contacts of a realisation; the driver handles those of marks. */
static void rest_guards(const Contacts *c, const Encounters *e, int64_t m) {
    for (int64_t k = 0; k < c->events; k++)
        for (int64_t guard = 2 * k; guard < 2 * k + 2; guard++) {
            e->rise[m * 2 * c->events + guard] = 0.0;
            if (c->first[k + 1] > c->first[k]) e->resting[m * 2 * c->events + guard] = 0;
        }
}

static void limit_flight(Group *g, int64_t l, double rise, double rate) {
    if (rate < 0.0 && -FLIGHT * rise / rate < g->wanted[l]) g->wanted[l] = -FLIGHT * rise / rate;
}

/* Find the guards that are zero and rise, and estimate flight times, where a motion starts again. */
static void arm(const Problem *p, Group *g) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    Mask some = {0};
    copy(g->work, g->z, p->width);
    g->work[p->time] = smaller(larger(g->now, g->low), g->high);
    run_program(&c->contact, g->work);
    for (int64_t l = 0; l < LANES; l++) {
        if (!g->arming[l]) continue;
        int64_t m = g->member[l];
        double slow = slow_speed(e, m);
        e->slow[m] = e->starting[m] > slow ? e->starting[m] : slow;
        e->arming[m] = 0;
        rest_guards(c, e, m);
        for (int64_t k = 0; k < c->events; k++)
            if (c->first[k + 1] > c->first[k] &&
                (e->mode[m * c->events + k] != OPEN || g->work[c->gap[k]][l] <= TOUCHES * e->length[m]))
                some[l] = -1;
    }
    g->arming = (Mask){0};
    if (!any(some)) return;
    for (int64_t d = 0; d < c->directions; d++) g->needed[d] = 0;
    solve_lanes(p, g, some);
    for (int64_t k = 0; k < c->events; k++) {
        if (c->first[k + 1] == c->first[k]) continue;
        V natural = natural_rate(p, g, c->first[k]);
        for (int64_t l = 0; l < LANES; l++) {
            if (!some[l]) continue;
            int64_t m = g->member[l], mode = e->mode[m * c->events + k], at = m * 2 * c->events + 2 * k;
            const double *heading = e->heading + m * c->directions;
            int closed = g->work[c->gap[k]][l] <= TOUCHES * e->length[m];
            /* below the zero limit of speed the gap does not rise: the contact has only been released */
            double speed = g->work[c->speed[c->first[k]]][l], along = 0.0;
            double rise = mode == OPEN && speed > e->slow[m] ? speed : 0.0;
            e->resting[at] = mode == OPEN && closed;
            e->rise[at] = rise;
            if (closed && rise > 0.0 && !g->touching[l]) limit_flight(g, l, rise, natural[l]);
            if (mode == SLIP) {
                for (int64_t d = c->first[k] + 1; d < c->first[k + 1]; d++)
                    along += g->work[c->speed[d]][l] * heading[d];
                e->resting[at + 1] = along <= e->slow[m];
            }
            if (e->held[m * c->events + k] == HOLDS && g->now[l] <= e->later[m]) e->resting[at + 1] = mode == STICK;
        }
    }
}

/* -- decisions of lanes --------------------------------------------------------------------------------------------- */

enum { UNDECIDED, REBOUNDS, LANDS, LIFTS, STOPS, STARTS };

/* Outcome of a decision: contacts that are hit, and those whose small speed against their slide has to be removed;
   `pushed`: speeds have jumped from outside, and bodies that did not approach before do not rebound. */
typedef struct {
    int64_t hits, hit[MOST_CLOSED], turns, turn[MOST_CLOSED];
    int pushed;
} Outcome;

static int64_t decide_blows(const Problem *p, Group *g, int64_t l, int64_t k, Outcome *o);
static int decide_all_modes(const Problem *p, Group *g, int64_t l, int64_t k, int64_t kind, Outcome *o, int *project,
                            Limit *limit);
static int complete_limit(const Problem *p, Group *g, int64_t l, Limit *x, Outcome *o);
static void restore_lasting(const Contacts *c, Group *g, int64_t l, const Stored *x);

/* What the event of a lane may be. */
static int64_t kind_of(const Problem *p, const Group *g, int64_t l, int64_t guard) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l], k = guard / 2, own = e->mode[m * c->events + k];
    if (e->total[m] > MOST || e->stalled[m] > AT_ONCE) return UNDECIDED;
    if (g->now[l] >= g->end[l] - (g->low[l] - g->begin[l])) return UNDECIDED; /* the caller ends the interval */
    if (c->first[k + 1] - c->first[k] > MOST_DIRECTIONS) return UNDECIDED;
    if (guard % 2 == 0) return own == OPEN ? LANDS : LIFTS;
    return own == SLIP ? STOPS : own == STICK ? STARTS : UNDECIDED;
}

/* Whether all other contacts of a lane are open, and the contact itself has a motion of its own. */
static int is_alone(const Problem *p, const Group *g, int64_t l, int64_t k) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t n = p->coordinates, m = g->member[l], moves = 0;
    for (int64_t i = 0; i < c->events; i++) {
        if (i == k || c->first[i + 1] == c->first[i]) continue;
        if (e->mode[m * c->events + i] != OPEN || g->work[c->gap[i]][l] <= TOUCHES * e->length[m]) return 0;
    }
    for (int64_t i = 0; i < n; i++) moves |= g->work[c->slope[c->first[k] * n + i]][l] != 0.0;
    return moves != 0;
}

/* Whether the lasting contacts of a lane have no normal speed: otherwise the caller projects the state again. */
static int are_at_rest(const Problem *p, const Group *g, int64_t l) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l];
    double slow = slow_speed(e, m);
    for (int64_t k = 0; k < c->events; k++)
        if (e->mode[m * c->events + k] != OPEN && !(__builtin_fabs(g->work[c->speed[c->first[k]]][l]) <= slow)) return 0;
    return 1;
}

/* Size of the terms of the normal speed of a contact: a sum over velocities, and the rest. */
static double terms_of_speed(const Problem *p, const Group *g, int64_t l, int64_t k) {
    const Contacts *c = p->contacts;
    int64_t n = p->coordinates, first = c->first[k];
    double size = 0.0, rest = g->work[c->speed[first]][l];
    for (int64_t i = 0; i < n; i++) {
        double term = g->work[c->slope[first * n + i]][l] * g->work[p->velocities + i][l];
        size += __builtin_fabs(term);
        rest -= term;
    }
    return size + __builtin_fabs(rest);
}

/* Evaluate the contacts at the states in the work array, in the directions of the closed contacts of some lanes. */
static void look(const Problem *p, Group *g, Mask which, const int64_t *guards) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    run_program(&c->contact, g->work);
    for (int64_t d = 0; d < c->directions; d++) g->needed[d] = 0;
    for (int64_t l = 0; l < LANES; l++) {
        if (!which[l]) continue;
        int64_t m = g->member[l];
        for (int64_t k = 0; k < c->events; k++)
            if (k == guards[l] / 2 || e->mode[m * c->events + k] != OPEN || g->work[c->gap[k]][l] <= TOUCHES * e->length[m]) {
                for (int64_t d = c->first[k]; d < c->first[k + 1]; d++) g->needed[d] |= 1 << l;
                /* rounding errors of speeds are no speeds, also of a small mechanism */
                if (c->first[k + 1] > c->first[k])
                    e->fastest[m] = greatest(e->fastest[m], SPEED_ROUNDED * terms_of_speed(p, g, l, k));
            }
    }
    find_responses(p, g, which);
}

/* Move a lane of the states in `z` out of a penetration, and change its velocities by an impulse. */
static void hit(const Problem *p, const Group *g, int64_t l, int64_t k, const Touch *t, const double *impulse, V *z) {
    int64_t first = p->contacts->first[k];
    double back = -t->gap / t->matrix[0][0];
    for (int64_t i = 0; i < p->coordinates; i++) {
        z[i][l] += change_of(p, g, l, i, first) * back;
        for (int64_t j = 0; j < t->count; j++) z[p->velocities + i][l] += change_of(p, g, l, i, first + j) * impulse[j];
    }
}

/* Decide about an impact of a lane, whose contact is in the work array: REBOUNDS, with a new state in g->z; LANDS, with a
   new state in g->next; or UNDECIDED. */
static int64_t decide_impact(const Problem *p, Group *g, int64_t l, int64_t k, Outcome *o) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l];
    Touch t = touch_of(p, g, l, k);
    Lane s = lane_of(c, g);
    double impulse[MOST_DIRECTIONS] = {0.0}, after = 0.0, approach = greatest(0.0, -t.speed[0]);
    if (!(t.matrix[0][0] > 0.0)) return UNDECIDED;
    e->fastest[m] = greatest(e->fastest[m], approach);
    double slow = slow_speed(e, m);
    if (approach > 1e-3 * slow && !solve_impact(&t, &s, impulse, &after)) return UNDECIDED;
    if (approach > slow && after > slow) {
        hit(p, g, l, k, &t, impulse, g->z);
        note(e, m, g->now[l], k, AS_DECLARED);
        /* the gap rises from zero; the acceleration before the impact affects the first step only */
        rest_guards(c, e, m);
        e->slow[m] = slow;
        e->resting[m * 2 * c->events + 2 * k] = 1;
        e->rise[m * 2 * c->events + 2 * k] = after;
        limit_flight(g, l, after, t.natural[0]);
        return REBOUNDS;
    }
    if (approach > slow && impulse[0] > 0.0) o->hit[o->hits++] = k;
    hit(p, g, l, k, &t, impulse, g->next);
    return LANDS;
}

/* Decide about a lane whose contact slides slowly, or has changed its direction; whether it still slides as before.  The
   direction of a starting slide may turn in space: repeated stops would hold the bodies. */
static int turns_slide(const Group *g, int64_t l, const Touch *t, int64_t mode, double *heading) {
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l];
    double fast = length_along(t, t->speed), now = g->now[l];
    if (!(mode == SLIP && fast > slow_speed(e, m))) return 0;
    if (fast <= greatest(slow_speed(e, m), e->starting[m])) {
        int at_once = now - e->turned[m] <= PROMPT * greatest(1.0, __builtin_fabs(now));
        e->starting[m] = STARTING * g->floor[l];
        if (at_once) return 0;
        e->turned[m] = now;
    }
    for (int64_t i = 1; i < t->count; i++) heading[i - 1] = t->speed[i] / fast;
    return 1;
}

/* Decide about lanes that land with states in the work array, or stop sliding: modes, and whether a slide turns; and about
   all lanes with several contacts. */
static void decide_modes(const Problem *p, Group *g, const int64_t *guards, const int *several, Outcome *outcomes,
                         int64_t *kinds, Mask *project, Limit *limits) {
    const Encounters *e = g->pool->encounters;
    Lane s = lane_of(p->contacts, g);
    for (int64_t l = 0; l < LANES; l++) {
        limits[l].needed = limits[l].stored = 0;
        if (kinds[l] == UNDECIDED || kinds[l] == REBOUNDS) continue;
        if (!several[l] && kinds[l] != LANDS && kinds[l] != STOPS) continue;
        int64_t m = g->member[l], k = guards[l] / 2, lands = kinds[l] == LANDS;
        Outcome *o = outcomes + l;
        if (several[l] || !is_alone(p, g, l, k)) {
            int closed = 0;
            if (!decide_all_modes(p, g, l, k, kinds[l], o, &closed, limits + l)) {
                kinds[l] = UNDECIDED;
                e->starting[m] = limits[l].starting;
                continue;
            }
            (*project)[l] = closed ? -1 : 0;
            for (int64_t i = 0; i < p->width && lands; i++) g->z[i][l] = g->next[i][l];
            continue;
        }
        double heading[MOST_DIRECTIONS], along = 0.0, still = slow_speed(e, m);
        double slow = lands ? still : greatest(still, e->starting[m]);
        Touch t = touch_of(p, g, l, k);
        /* a fast slide has only changed its direction */
        int turned = !lands && length_along(&t, t.speed) > slow;
        int64_t mode = turned ? SLIP : mode_of(&t, slow, &s, heading);
        int touches = turned || t.gap <= (lands ? TOUCHES : HELD) * e->length[m];
        if (mode < 0 || (mode == SMOOTH && !lands) || !touches) {
            kinds[l] = UNDECIDED;
            continue;
        }
        if (!lands && turns_slide(g, l, &t, mode, heading)) {
            keep_one(p->contacts, g, l, k, SLIP, heading);
            continue;
        }
        keep_one(p->contacts, g, l, k, mode, heading);
        e->starting[m] = !lands && mode == SLIP ? STARTING * g->floor[l] : 0.0;
        if (o->hits) note(e, m, g->now[l], k, AS_DECLARED);
        if (lands && mode != OPEN) note(e, m, g->now[l], k, BEGINS_RESTING);
        if (!lands && mode != SLIP) note(e, m, g->now[l], k, mode == OPEN ? LIFTS_OFF : BEGINS_STICKING);
        (*project)[l] = mode == OPEN ? 0 : -1;
        for (int64_t i = 1; i < t.count && mode == SLIP; i++) along += heading[i - 1] * t.speed[i];
        if (along < 0.0) o->turn[o->turns++] = k;
        if (lands)
            for (int64_t i = 0; i < p->width; i++) g->z[i][l] = g->next[i][l];
    }
}

/* Start sliding along the direction that friction has resisted. */
static int64_t decide_start(const Problem *p, Group *g, int64_t l, int64_t k) {
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l];
    Touch t = touch_of(p, g, l, k);
    Lane s = lane_of(p->contacts, g);
    double force[MOST_DIRECTIONS], heading[MOST_DIRECTIONS];
    if (t.count < 2) return UNDECIDED;
    stick(&t, t.natural, 0.0, &s, force);
    for (int64_t i = 0; i < t.count; i++)
        if (!is_finite(force[i])) return UNDECIDED;
    if (!(force[0] > 0.0 && length_along(&t, force) > 0.0)) return UNDECIDED;
    against(&t, force, heading);
    if (!(sliding_response(&t, heading) > CLEAR * t.matrix[0][0])) return UNDECIDED;
    keep_one(p->contacts, g, l, k, SLIP, heading);
    e->starting[m] = STARTING * g->floor[l];
    for (int64_t i = 0; i < p->contacts->events; i++) e->held[m * p->contacts->events + i] = i == k ? SLIDES : 0;
    e->later[m] = g->now[l] + greatest(e->together, PROMPT * __builtin_fabs(g->now[l]));
    note(e, m, g->now[l], k, BEGINS_SLIPPING);
    return STARTS;
}

/* Project the states of lanes onto their constraints and lasting contacts. */
static void put_on_all(const Problem *p, Group *g, Mask which) {
    copy(g->work, g->z, p->width);
    g->work[p->time] = smaller(larger(g->now, g->low), g->high);
    put_on_constraints(p, g, which);
    put_on_contacts(p, g, which);
    for (int64_t i = 0; i < p->width; i++) g->z[i] = choose(which & (g->work[i] == g->work[i]), g->work[i], g->z[i]);
}

/* Project the states of lanes onto their constraints and their new contacts. */
static void settle(const Problem *p, Group *g, Mask which, const Outcome *outcomes) {
    const Encounters *e = g->pool->encounters;
    int64_t events = p->contacts->events;
    if (!any(which)) return;
    /* a small speed against the direction in which a slide begins is removed, as if the contact would stick */
    for (int64_t l = 0; l < LANES; l++)
        for (int64_t i = 0; i < outcomes[l].turns; i++) e->mode[g->member[l] * events + outcomes[l].turn[i]] = STICK;
    put_on_all(p, g, which);
    for (int64_t l = 0; l < LANES; l++)
        for (int64_t i = 0; i < outcomes[l].turns; i++) e->mode[g->member[l] * events + outcomes[l].turn[i]] = SLIP;
}

/* Complete the decisions of some lanes with their contacts a short time later, with the present motion. */
static void look_ahead(const Problem *p, Group *g, const int64_t *guards, Limit *limits, Outcome *outcomes, int64_t *kinds,
                       Mask *project) {
    Mask some = {0};
    V span = splat(0.0);
    copy(g->next, g->z, p->width);
    for (int64_t l = 0; l < LANES; l++) {
        Limit *x = limits + l;
        if (!x->needed) continue;
        some[l] = -1;
        double most = AHEAD * g->pool->encounters->together, left = 0.5 * (g->end[l] - g->now[l]);
        span[l] = x->span = greatest(0.0, left < most ? left : most);
        for (int64_t i = 0; i < p->coordinates; i++) {
            double a = change_of(p, g, l, i, -1), v = g->z[p->velocities + i][l];
            for (int64_t j = 0; j < x->now.first[x->now.count]; j++)
                a += change_of(p, g, l, i, x->now.direction[j]) * x->lasting.force[j];
            g->next[i][l] += x->span * (v + 0.5 * x->span * a);
            g->next[p->velocities + i][l] += x->span * a;
        }
    }
    if (!any(some)) return;
    copy(g->work, g->z, p->width);
    g->work[p->time] = smaller(larger(g->now, g->low), g->high);
    if (p->velocities > p->coordinates) run_program(&p->motion, g->work);
    for (int64_t i = p->coordinates; i < p->velocities; i++) g->next[i] += span * g->work[p->rate[i]];
    for (int64_t i = 0; i < p->width; i++) g->work[i] = choose(some, g->next[i], g->z[i]);
    g->work[p->time] = smaller(larger(g->now + span, g->low), g->high);
    look(p, g, some, guards);
    for (int64_t l = 0; l < LANES; l++) {
        if (!some[l] || complete_limit(p, g, l, limits + l, outcomes + l)) continue;
        kinds[l] = UNDECIDED;
        (*project)[l] = outcomes[l].turns = 0;
        g->pool->encounters->starting[g->member[l]] = limits[l].starting;
        if (limits[l].stored) restore_lasting(p->contacts, g, l, &limits[l].earlier);
    }
}

/* Project the states of lanes whose lasting contacts have normal speeds: steps project them to first order only.  Their
   contacts are in the work array, before and after. */
static void bring_to_rest(const Problem *p, Group *g, Mask which, const int64_t *guards) {
    for (int64_t count = 0; count < PROJECTIONS; count++) {
        Mask moving = {0};
        for (int64_t l = 0; l < LANES; l++) moving[l] = which[l] && !are_at_rest(p, g, l) ? -1 : 0;
        if (!any(moving)) return;
        put_on_all(p, g, moving);
        copy(g->work, g->z, p->width);
        g->work[p->time] = smaller(larger(g->now, g->low), g->high);
        look(p, g, which, guards);
    }
}

/* Decide about the events of lanes, and restart the motions; lanes whose events the caller has to decide. */
static __attribute__((noinline)) Mask decide_events(const Problem *p, Group *g, Mask which, const int64_t *guards) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t kinds[LANES];
    int several[LANES] = {0};
    Outcome outcomes[LANES];
    Limit limits[LANES];
    Mask some = {0}, landing = {0}, project = {0}, left = {0};
    for (int64_t l = 0; l < LANES; l++) {
        outcomes[l].hits = outcomes[l].turns = outcomes[l].pushed = 0;
        kinds[l] = which[l] ? kind_of(p, g, l, guards[l]) : UNDECIDED;
        some[l] = kinds[l] == UNDECIDED ? 0 : -1;
    }
    if (any(some)) {
        copy(g->work, g->z, p->width);
        g->work[p->time] = smaller(larger(g->now, g->low), g->high);
        look(p, g, some, guards);
        bring_to_rest(p, g, some, guards);
        copy(g->next, g->z, p->width);
        for (int64_t l = 0; l < LANES; l++) {
            if (!some[l]) continue;
            int64_t k = guards[l] / 2, m = g->member[l];
            several[l] = !is_alone(p, g, l, k) || (kinds[l] == STARTS && g->now[l] <= e->later[m]);
            int deep = kinds[l] == LANDS && g->work[c->gap[k]][l] < -DEEP * e->length[m];
            if (deep || !are_at_rest(p, g, l)) {
                kinds[l] = UNDECIDED;
            } else if (kinds[l] == LANDS) {
                kinds[l] = several[l] ? decide_blows(p, g, l, k, outcomes + l) : decide_impact(p, g, l, k, outcomes + l);
                landing[l] = kinds[l] == LANDS ? -1 : 0;
            } else if (kinds[l] == STARTS && !several[l]) {
                kinds[l] = decide_start(p, g, l, k);
            } else if (kinds[l] == LIFTS && !several[l]) {
                e->starting[m] = 0.0;
                keep_one(c, g, l, k, OPEN, 0);
                note(e, m, g->now[l], k, LIFTS_OFF);
            }
        }
        /* lanes that stop sliding are evaluated where they are, and those that land after the impact */
        if (any(landing)) {
            for (int64_t i = 0; i < p->width; i++) g->work[i] = choose(landing, g->next[i], g->z[i]);
            look(p, g, some, guards);
        }
        decide_modes(p, g, guards, several, outcomes, kinds, &project, limits);
        look_ahead(p, g, guards, limits, outcomes, kinds, &project);
        settle(p, g, project, outcomes);
    }
    for (int64_t l = 0; l < LANES; l++) {
        if (!which[l]) continue;
        if (kinds[l] == UNDECIDED) {
            left[l] = -1;
            continue;
        }
        int64_t m = g->member[l];
        e->since[m] = g->now[l];
        e->restarts[m]++;
        if (kinds[l] == REBOUNDS) continue;
        e->arming[m] = 1;
        g->arming[l] = -1;
    }
    return left;
}
