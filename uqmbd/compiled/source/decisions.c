/* Decisions about events of lanes with one closed contact: impacts, rest, lift-off, and the ends of sticking and sliding.

   The impulse of an impact, and the state of the contact after it, solve one set-valued problem: Newton's law of
   restitution, Signorini's law of rest, and Coulomb's law of friction.  A decision is made only where one solution is
   clear of all limits.  The caller decides about all other events: several contacts, sliding in space that an impact
   does not stop, and states near the limits of the laws. */
#include "group.h"

static const double TOUCHES = 1e-9;  /* gap, relative to the size of the mechanism, that counts as closed */
static const double HELD = 1e-6;    /* the same of a contact that has persisted so far */
static const double CLEAR = 1e-6;   /* least relative distance from the limit of friction, and least relative pivot */
static const double EXACT = 1e-10;  /* largest violation of the laws, relative to the size of impulses */
static const double FED = 1e-12;    /* energy, relative to impulses times speeds, that counts as zero */
static const double FLIGHT = 2.05;  /* first step after an impact, relative to the estimated flight time */
static const double STARTING = 10.0; /* speed that counts as zero at the start of slip, over the tolerance */
static const double BOUNCES = 1e-6; /* impact speed, relative to the fastest one before, below which bodies stay together */
static const double COARSER = 4.0, COARSEST = 1e4; /* by what a cluster of events raises that, and the most */
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

enum { MOST_DIRECTIONS = 3 };

/* One contact of a lane: rates of the speeds per force, and without forces, and speeds. */
typedef struct {
    int64_t count; /* directions with friction; one without */
    double matrix[MOST_DIRECTIONS][MOST_DIRECTIONS], natural[MOST_DIRECTIONS], speed[MOST_DIRECTIONS];
    double restitution, friction, gap;
} Touch;

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

static double greatest(double a, double b) { return a > b ? a : b; }

/* Solve matrix x = right by elimination, without pivots; whether all pivots exceed `least` times the trace. */
static int solve_small(const Touch *t, const double *right, double least, double *x) {
    double a[MOST_DIRECTIONS][MOST_DIRECTIONS], trace = 0.0;
    int64_t n = t->count;
    for (int64_t i = 0; i < n; i++) {
        trace += t->matrix[i][i];
        x[i] = right[i];
        for (int64_t j = 0; j < n; j++) a[i][j] = t->matrix[i][j];
    }
    for (int64_t k = 0; k < n; k++) {
        if (!(a[k][k] > least * trace)) return 0;
        for (int64_t i = k + 1; i < n; i++) {
            double factor = a[i][k] / a[k][k];
            for (int64_t j = k + 1; j < n; j++) a[i][j] -= factor * a[k][j];
            x[i] -= factor * x[k];
        }
    }
    for (int64_t k = n - 1; k >= 0; k--) {
        for (int64_t j = k + 1; j < n; j++) x[k] -= a[k][j] * x[j];
        x[k] /= a[k][k];
        if (!(x[k] - x[k] == 0.0)) return 0;
    }
    return 1;
}

/* Whether an impulse satisfies the laws of impact with a normal speed `rebound` after it, and adds no energy. */
static int satisfies(const Touch *t, double rebound, const double *impulse) {
    double after[MOST_DIRECTIONS], wanted[MOST_DIRECTIONS], diagonal = 1e-300, added = 0.0, worked = 0.0;
    int64_t n = t->count;
    for (int64_t i = 0; i < n; i++) {
        diagonal = greatest(diagonal, __builtin_fabs(t->matrix[i][i]));
        after[i] = t->speed[i];
        for (int64_t j = 0; j < n; j++) after[i] += t->matrix[i][j] * impulse[j];
    }
    wanted[0] = greatest(0.0, impulse[0] - (after[0] - rebound) / diagonal);
    double length = 0.0, most = t->friction * wanted[0], size = 0.0, off = 0.0;
    for (int64_t i = 1; i < n; i++) {
        wanted[i] = impulse[i] - after[i] / diagonal;
        length += wanted[i] * wanted[i];
    }
    length = __builtin_sqrt(length);
    for (int64_t i = 0; i < n; i++) {
        if (i && length > most) wanted[i] *= most / length;
        size = greatest(size, __builtin_fabs(impulse[i]) * diagonal);
        off = greatest(off, __builtin_fabs(impulse[i] - wanted[i]) * diagonal);
        added += 0.5 * impulse[i] * (t->speed[i] + after[i]);
        worked += __builtin_fabs(impulse[i] * t->speed[i]);
        if (!(impulse[i] - impulse[i] == 0.0)) return 0;
    }
    size = greatest(size, greatest(__builtin_fabs(t->speed[0]), 1e-300));
    return off <= EXACT * size && added <= FED * worked && impulse[0] > 0.0;
}

/* The impulse of an approaching contact with a restitution: the first one of stick, slip on and slip back that satisfies
   the laws; in space, stick alone.  Whether one does. */
static int impulse_of(const Touch *t, double restitution, double *impulse) {
    double rebound = greatest(0.0, -restitution * t->speed[0]), right[MOST_DIRECTIONS];
    double jump = rebound - t->speed[0];
    if (t->count == 1) {
        impulse[0] = -(1.0 + restitution) * t->speed[0] / t->matrix[0][0];
        return restitution >= 0.0 && restitution <= 1.0 && impulse[0] > 0.0 && impulse[0] - impulse[0] == 0.0;
    }
    right[0] = jump;
    for (int64_t i = 1; i < t->count; i++) right[i] = -t->speed[i];
    if (solve_small(t, right, 1e-14, impulse) && satisfies(t, rebound, impulse)) return 1;
    if (t->count > 2) return 0;
    double sense = __builtin_copysign(t->friction, t->speed[1]);
    for (int64_t back = 0; back < 2; back++) {
        double share = back ? sense : -sense;
        impulse[0] = jump / (t->matrix[0][0] + t->matrix[0][1] * share);
        impulse[1] = share * impulse[0];
        if (satisfies(t, rebound, impulse)) return 1;
    }
    return 0;
}

/* The impulse of an impact, and the normal speed after it; whether it is known.  In the plane, an impact is without
   restitution if no impulse with restitution satisfies the laws. */
static int solve_impact(const Touch *t, double *impulse, double *after) {
    if (!impulse_of(t, t->restitution, impulse) && (t->count != 2 || !impulse_of(t, 0.0, impulse))) return 0;
    *after = t->speed[0];
    for (int64_t j = 0; j < t->count; j++) *after += t->matrix[0][j] * impulse[j];
    return 1;
}

/* The mode of a closed contact, the direction in which it slides if it slips, and whether a slide begins against its small
   speed; -1 unless one solution is clear of all limits.  Speeds up to `slow` count as zero. */
static int64_t mode_of(const Touch *t, int64_t tangents, double slow, double *heading, int *turns) {
    double size = t->matrix[0][0], fast = 0.0, across = 0.0, along = 0.0, force[MOST_DIRECTIONS], right[MOST_DIRECTIONS];
    int pressed = t->natural[0] < 0.0;
    *turns = 0;
    for (int64_t i = 0; i <= tangents; i++)
        if (!(t->natural[i] - t->natural[i] == 0.0)) return -1;
    if (!(__builtin_fabs(t->speed[0]) <= slow && size > 0.0)) return -1;
    if (t->count == 1) return pressed ? SMOOTH : OPEN;
    for (int64_t i = 1; i < t->count; i++) fast += t->speed[i] * t->speed[i];
    fast = __builtin_sqrt(fast);
    if (fast > slow) {
        for (int64_t i = 1; i < t->count; i++) {
            heading[i - 1] = t->speed[i] / fast;
            along += t->matrix[0][i] * heading[i - 1];
        }
        if (!(size - t->friction * along > CLEAR * size)) return -1;
        return pressed ? SLIP : OPEN;
    }
    for (int64_t i = 0; i < t->count; i++) right[i] = -t->natural[i];
    if (!solve_small(t, right, CLEAR, force)) return -1;
    for (int64_t i = 1; i < t->count; i++) {
        across += t->matrix[0][i] * t->matrix[0][i];
        along += force[i] * force[i];
    }
    if (!(size - t->friction * __builtin_sqrt(across) > CLEAR * size)) return -1; /* Painleve: perhaps another motion */
    double friction = __builtin_sqrt(along), most = t->friction * force[0];
    if (force[0] > 0.0 && friction < (1.0 - CLEAR) * most) return STICK;
    if (t->count > 2 || !pressed || (force[0] > 0.0 && friction < (1.0 + CLEAR) * most)) return -1;
    /* in the plane, the contact begins to slide as it would without friction */
    double sense = __builtin_copysign(1.0, t->natural[1]), share = t->friction * sense;
    double divisor = size - share * t->matrix[0][1];
    if (!(divisor > CLEAR * size)) return -1;
    double slides = t->natural[1] - (t->matrix[1][0] - share * t->matrix[1][1]) * t->natural[0] / divisor;
    if (!(sense * slides > CLEAR * __builtin_fabs(t->natural[1]))) return -1;
    heading[0] = sense;
    *turns = t->speed[1] * sense < 0.0;
    return SLIP;
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
            if (e->held[m * c->events + k]) e->resting[at + 1] = mode == STICK;
            e->held[m * c->events + k] = 0;
        }
    }
}

/* -- decisions of lanes --------------------------------------------------------------------------------------------- */

enum { UNDECIDED, REBOUNDS, LANDS, LIFTS, STOPS, STARTS };

/* What the event of a lane may be; the contact is closed alone, or is open with all others. */
static int64_t kind_of(const Problem *p, const Group *g, int64_t l, int64_t guard) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l], k = guard / 2, own = e->mode[m * c->events + k], lasting = 0;
    if (e->total[m] > MOST || e->stalled[m] > AT_ONCE || g->now[l] <= e->later[m]) return UNDECIDED;
    if (g->now[l] >= g->end[l] - (g->low[l] - g->begin[l])) return UNDECIDED; /* the caller ends the interval */
    if (c->first[k + 1] - c->first[k] > MOST_DIRECTIONS) return UNDECIDED;
    for (int64_t i = 0; i < c->events; i++) lasting += e->mode[m * c->events + i] != OPEN;
    if (lasting != (own != OPEN)) return UNDECIDED;
    if (guard % 2 == 0) return own == OPEN ? LANDS : LIFTS;
    return own == SLIP ? STOPS : own == STICK && c->first[k + 1] - c->first[k] == 2 ? STARTS : UNDECIDED;
}

/* Whether all other contacts of a lane are open, and the contact itself has a motion of its own. */
static int is_alone(const Problem *p, const Group *g, int64_t l, int64_t k) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t n = p->coordinates, moves = 0;
    for (int64_t i = 0; i < c->events; i++)
        if (i != k && c->first[i + 1] > c->first[i] && g->work[c->gap[i]][l] <= TOUCHES * e->length[g->member[l]]) return 0;
    for (int64_t i = 0; i < n; i++) moves |= g->work[c->slope[c->first[k] * n + i]][l] != 0.0;
    return moves != 0;
}

/* Evaluate the contacts at the states in the work array, in the directions of the contacts of some lanes. */
static void look(const Problem *p, Group *g, Mask which, const int64_t *guards) {
    const Contacts *c = p->contacts;
    for (int64_t d = 0; d < c->directions; d++) g->needed[d] = 0;
    for (int64_t l = 0; l < LANES; l++)
        if (which[l])
            for (int64_t d = c->first[guards[l] / 2]; d < c->first[guards[l] / 2 + 1]; d++) g->needed[d] |= 1 << l;
    run_program(&c->contact, g->work);
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
static int64_t decide_impact(const Problem *p, Group *g, int64_t l, int64_t k, int *strikes) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l];
    Touch t = touch_of(p, g, l, k);
    double impulse[MOST_DIRECTIONS] = {0.0}, after = 0.0, approach = greatest(0.0, -t.speed[0]);
    if (!(t.matrix[0][0] > 0.0)) return UNDECIDED;
    e->fastest[m] = greatest(e->fastest[m], approach);
    double slow = slow_speed(e, m);
    if (approach > 1e-3 * slow && !solve_impact(&t, impulse, &after)) return UNDECIDED;
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
    *strikes = approach > slow && impulse[0] > 0.0;
    hit(p, g, l, k, &t, impulse, g->next);
    return LANDS;
}

/* Decide about lanes that land with states in the work array, or stop sliding: modes, and whether a slide turns. */
static void decide_modes(const Problem *p, Group *g, const int64_t *guards, const int *strikes, int64_t *kinds,
                         Mask *project, Mask *turns) {
    const Encounters *e = g->pool->encounters;
    for (int64_t l = 0; l < LANES; l++) {
        if (kinds[l] != LANDS && kinds[l] != STOPS) continue;
        int64_t m = g->member[l], k = guards[l] / 2, lands = kinds[l] == LANDS;
        int64_t tangents = p->contacts->first[k + 1] - p->contacts->first[k] - 1;
        double heading[MOST_DIRECTIONS], fast = 0.0, still = slow_speed(e, m);
        double slow = lands ? still : greatest(still, e->starting[m]);
        Touch t = touch_of(p, g, l, k);
        int turning;
        int64_t mode = mode_of(&t, tangents, slow, heading, &turning);
        int good = mode >= 0 && t.gap <= (lands ? TOUCHES : HELD) * e->length[m] && is_alone(p, g, l, k);
        if (!lands) { /* otherwise, as where sliding turns, the decision depends on the history of the contact */
            for (int64_t i = 1; i <= tangents; i++) fast += t.speed[i] * t.speed[i];
            fast = __builtin_sqrt(fast);
            good &= (mode == STICK && fast <= slow) || (mode == SLIP && fast <= still);
        }
        if (!good) {
            kinds[l] = UNDECIDED;
            continue;
        }
        keep_one(p->contacts, g, l, k, mode, heading);
        e->starting[m] = !lands && mode == SLIP ? STARTING * g->floor[l] : 0.0;
        if (lands && strikes[l]) note(e, m, g->now[l], k, AS_DECLARED);
        if (lands && mode != OPEN) note(e, m, g->now[l], k, BEGINS_RESTING);
        if (!lands && mode == STICK) note(e, m, g->now[l], k, BEGINS_STICKING);
        (*project)[l] = mode == OPEN ? 0 : -1;
        (*turns)[l] = mode == SLIP && turning ? -1 : 0;
        if (lands)
            for (int64_t i = 0; i < p->width; i++) g->z[i][l] = g->next[i][l];
    }
}

/* Start sliding along the direction that friction has resisted. */
static int64_t decide_start(const Problem *p, Group *g, int64_t l, int64_t k) {
    const Encounters *e = g->pool->encounters;
    int64_t m = g->member[l];
    Touch t = touch_of(p, g, l, k);
    double force[MOST_DIRECTIONS], right[MOST_DIRECTIONS] = {-t.natural[0], -t.natural[1]};
    if (t.count < 2 || !solve_small(&t, right, CLEAR, force) || !(force[0] > 0.0) || force[1] == 0.0) return UNDECIDED;
    double heading = -__builtin_copysign(1.0, force[1]);
    if (!(t.matrix[0][0] - t.friction * heading * t.matrix[0][1] > CLEAR * t.matrix[0][0])) return UNDECIDED;
    keep_one(p->contacts, g, l, k, SLIP, &heading);
    e->starting[m] = STARTING * g->floor[l];
    /* the caller decides about further events at this instant */
    e->later[m] = g->now[l] + e->together;
    note(e, m, g->now[l], k, BEGINS_SLIPPING);
    return STARTS;
}

/* Project the states of lanes onto their constraints and their new contacts. */
static void settle(const Problem *p, Group *g, Mask which, Mask turns, const int64_t *guards) {
    const Encounters *e = g->pool->encounters;
    int64_t events = p->contacts->events;
    if (!any(which)) return;
    /* a small speed against the direction in which a slide begins is removed, as if the contact would stick */
    for (int64_t l = 0; l < LANES; l++)
        if (turns[l]) e->mode[g->member[l] * events + guards[l] / 2] = STICK;
    copy(g->work, g->z, p->width);
    g->work[p->time] = smaller(larger(g->now, g->low), g->high);
    put_on_constraints(p, g, which);
    put_on_contacts(p, g, which);
    for (int64_t i = 0; i < p->width; i++) g->z[i] = choose(which & (g->work[i] == g->work[i]), g->work[i], g->z[i]);
    for (int64_t l = 0; l < LANES; l++)
        if (turns[l]) e->mode[g->member[l] * events + guards[l] / 2] = SLIP;
}

/* Decide about the events of lanes, and restart the motions; lanes whose events the caller has to decide. */
static Mask decide_events(const Problem *p, Group *g, Mask which, const int64_t *guards) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t kinds[LANES];
    int strikes[LANES] = {0};
    Mask some = {0}, landing = {0}, project = {0}, turns = {0}, left = {0};
    for (int64_t l = 0; l < LANES; l++) {
        kinds[l] = which[l] ? kind_of(p, g, l, guards[l]) : UNDECIDED;
        some[l] = kinds[l] == UNDECIDED ? 0 : -1;
    }
    if (any(some)) {
        copy(g->work, g->z, p->width);
        copy(g->next, g->z, p->width);
        g->work[p->time] = smaller(larger(g->now, g->low), g->high);
        look(p, g, some, guards);
        for (int64_t l = 0; l < LANES; l++) {
            int64_t k = guards[l] / 2, m = g->member[l];
            if (!some[l]) continue;
            if (!is_alone(p, g, l, k) ||
                (kinds[l] != LANDS && !(__builtin_fabs(g->work[c->speed[c->first[k]]][l]) <= slow_speed(e, m)))) {
                kinds[l] = UNDECIDED;
            } else if (kinds[l] == LANDS) {
                kinds[l] = decide_impact(p, g, l, k, strikes + l);
                landing[l] = kinds[l] == LANDS ? -1 : 0;
            } else if (kinds[l] == STARTS) {
                kinds[l] = decide_start(p, g, l, k);
            } else if (kinds[l] == LIFTS) {
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
        decide_modes(p, g, guards, strikes, kinds, &project, &turns);
        settle(p, g, project, turns, guards);
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
