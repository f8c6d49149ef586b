/* Events: position in a step at which guards fall through zero. */
#include "group.h"

static const double TINY = 1e-10;     /* permitted error of an interpolated gap, relative to the size of the mechanism */
static const double PROJECTED = 10.0; /* tolerances by which a projection may change a guard */
static const double NARROW = 1e-5;    /* accuracy of a minimum between two samples, relative to their distance */

/* Guards of the interpolant at a part of the step. */
static void find_guards(const Problem *p, Group *g, V part) {
    const Contacts *c = p->contacts;
    interpolate(p, g, part, g->work);
    g->work[p->time] = smaller(larger(g->now + part * g->size, g->low), g->high);
    run_program(&c->guards, g->work);
    for (int64_t k = 0; k < c->events; k++) {
        g->guards[2 * k] = g->work[c->guard[k]];
        g->guards[2 * k + 1] = splat(1.0);
    }
    if (!any(g->touching)) return;
    Lane s = lane_of(c, g);
    run_program(&c->contact, g->work);
    respond(p, g, g->touching);
    for (int64_t l = 0; l < LANES; l++) {
        if (!g->touching[l]) continue;
        const int64_t *mode = g->pool->encounters->mode + g->member[l] * c->events;
        const double *heading = g->pool->encounters->heading + g->member[l] * c->directions;
        const double *internal = g->pool->encounters->internal + g->member[l] * c->directions;
        answer(p, g, l, &s);
        find_forces(p, g, l, &s);
        for (int64_t k = 0, at = 0; k < c->events; k++) {
            if (mode[k] == OPEN) continue;
            int64_t tangents = mode[k] == SMOOTH ? 0 : c->first[k + 1] - c->first[k] - 1;
            double normal = s.force[at] + internal[c->first[k]], friction = 0.0, along = 0.0;
            for (int64_t t = 1; t <= tangents; t++) {
                double force = s.force[at + t] + internal[c->first[k] + t];
                friction += force * force;
                along += g->work[c->speed[c->first[k] + t]][l] * heading[c->first[k] + t];
            }
            g->guards[2 * k][l] = normal;
            if (mode[k] == STICK) /* by how much friction could be larger */
                g->guards[2 * k + 1][l] =
                    g->work[c->law[2 * k + 1]][l] * normal * (1 + 1e-9) - __builtin_sqrt(friction);
            if (mode[k] == SLIP) g->guards[2 * k + 1][l] = along;
            at += 1 + tangents;
        }
    }
}

/* Where a function of a guard, positive at the left, falls through zero: the guard itself, or more by `more`, or what
   it has risen since the beginning, over the time since, which is `rise` there. */
typedef struct {
    Mask sought, divided;
    V left, right, more, begin, rise;
} Bracket;

static V value_at(const Problem *p, Group *g, int64_t guard, const Bracket *b, V part) {
    find_guards(p, g, part);
    V value = g->guards[guard];
    V slope = choose(part <= splat(0.0), b->rise, (value - b->begin) / (part * g->size));
    return choose(b->divided, slope, value + b->more);
}

/* Roots in brackets by the method of T. R. Chandrupatla (Advances in Engineering Software 28 (1997) 145-149). */
static V root_of(const Problem *p, Group *g, int64_t guard, const Bracket *b) {
    V x1 = b->left, x2 = b->right, f1 = value_at(p, g, guard, b, x1), f2 = value_at(p, g, guard, b, x2);
    V x3 = x1, f3 = f1, best = x2, part = splat(0.5);
    V moment = magnitude(g->now + g->size);
    V fine = 1e-15 * larger(splat(1.0), moment) / larger(g->size, splat(1e-300));
    fine = larger(smaller(fine, splat(0.1)), splat(1e-16));
    Mask at_left = f1 <= splat(0.0), at_right = ~at_left & (f2 >= splat(0.0));
    Mask open = b->sought & ~at_left & ~at_right;
    best = choose(at_left, x1, best);
    for (int64_t k = 0; k < 100 && any(open); k++) {
        V x = x1 + part * (x2 - x1);
        V f = value_at(p, g, guard, b, x);
        Mask same = (f > splat(0.0)) == (f1 > splat(0.0));
        x3 = choose(same, x1, x2);
        f3 = choose(same, f1, f2);
        x2 = choose(same, x2, x1);
        f2 = choose(same, f2, f1);
        x1 = x;
        f1 = f;
        Mask first = magnitude(f1) < magnitude(f2);
        V nearest = choose(first, x1, x2), least = choose(first, f1, f2);
        best = choose(open, nearest, best);
        V limit = fine / magnitude(x2 - x1);
        open &= ~((limit > splat(0.5)) | (least == splat(0.0)) | (f != f));
        V xi = (x1 - x2) / (x3 - x2), phi = (f1 - f2) / (f3 - f2);
        Mask smooth = (phi * phi < xi) & ((1.0 - phi) * (1.0 - phi) < 1.0 - xi);
        V next = f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2);
        part = choose(smooth & (next == next), next, splat(0.5));
        part = smaller(larger(part, limit), 1.0 - limit);
    }
    return best;
}

/* Places between two parts of the step at which a guard is negative, if its lowest value is; `low` are values between. */
static Mask dips(const Problem *p, Group *g, int64_t guard, Mask sought, V left, V right, V *where) {
    const double golden = 0.3819660112501051;
    V middle = 0.5 * (left + right), narrow = NARROW * (right - left);
    find_guards(p, g, middle);
    V lowest = g->guards[guard];
    Mask found = sought & (lowest < splat(0.0)), open = sought & ~found;
    *where = middle;
    for (int64_t k = 0; k < 60 && any(open); k++) {
        Mask later = right - middle > middle - left;
        V x = middle + golden * choose(later, right - middle, left - middle);
        find_guards(p, g, x);
        V value = g->guards[guard];
        Mask lower = open & (value < lowest);
        /* the new point becomes the middle one, or an end */
        left = choose(open & lower & later, middle, choose(open & ~lower & ~later, x, left));
        right = choose(open & lower & ~later, middle, choose(open & ~lower & later, x, right));
        middle = choose(lower, x, middle);
        lowest = choose(lower, value, lowest);
        *where = choose(open, middle, *where);
        found |= open & (lowest < splat(0.0));
        open &= ~found & (right - left > narrow);
    }
    return found;
}

/* Parts of the step at which a guard falls through zero for the first time after sample `first`; lanes that have one.

   `dipping`: between two samples that are above zero it may be below. */
static Mask plain_fall(const Problem *p, Group *g, int64_t guard, Mask sought, const int64_t *first, Mask dipping,
                       V *part) {
    const Contacts *c = p->contacts;
    Bracket b = {.sought = {0}, .divided = {0}, .left = splat(0.0), .right = splat(1.0)};
    b.more = b.begin = b.rise = splat(0.0);
    const V *value = g->samples + guard;
    int64_t step = 2 * c->events;
    for (int64_t k = 1; k <= SAMPLES; k++) {
        Mask low = {0};
        for (int64_t l = 0; l < LANES; l++) {
            if (!sought[l] || b.sought[l] || k <= first[l]) continue;
            if (value[k * step][l] <= 0.0) {
                b.sought[l] = -1;
                b.left[l] = (double)(k - 1) / SAMPLES;
                b.right[l] = (double)k / SAMPLES;
            } else if (dipping[l] && k > first[l] + 1 && value[(k - 2) * step][l] >= value[(k - 1) * step][l] &&
                       value[(k - 1) * step][l] <= value[k * step][l]) {
                low[l] = -1;
            }
        }
        if (!any(low)) continue;
        V where;
        Mask below = dips(p, g, guard, low, splat((double)(k - 2) / SAMPLES), splat((double)k / SAMPLES), &where);
        b.sought |= below;
        b.left = choose(below, splat((double)(k - 2) / SAMPLES), b.left);
        b.right = choose(below, where, b.right);
    }
    if (any(b.sought)) *part = root_of(p, g, guard, &b);
    return b.sought;
}

/* Parts of the step at which a guard falls that rests at zero at the beginning: it has to rise before. */
static Mask resting_fall(const Problem *p, Group *g, int64_t guard, Mask sought, V tiny, V *part) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    Bracket b = {.sought = {0}, .divided = {0}, .left = splat(0.0), .right = splat(1.0)};
    b.more = b.begin = b.rise = splat(0.0);
    const V *value = g->samples + guard;
    int64_t step = 2 * c->events;
    for (int64_t l = 0; l < LANES; l++) {
        if (!sought[l]) continue;
        int64_t at = g->member[l] * step + guard, below = 0, above = 0;
        double rise = e->rise[at], start = value[0][l];
        for (int64_t k = 1; k <= SAMPLES && !below; k++) {
            double x = value[k * step][l], depth = tiny[l];
            if (rise > 0.0) { /* of a known rise, a fall below the beginning is no error of the interpolant */
                double risen = 1e-3 * rise * g->size[l] * (double)k / SAMPLES;
                if (risen < depth) depth = risen;
            }
            if (x - (rise > 0.0 ? start : 0.0) < -depth)
                below = k;
            else if (x > tiny[l])
                above = k;
        }
        if (above) e->resting[at] = 0;
        if (!below) continue;
        b.sought[l] = -1;
        b.left[l] = (double)above / SAMPLES;
        b.right[l] = (double)below / SAMPLES;
        if (above) continue;
        if (rise > 0.0) { /* it rises and falls within a part: what is divided by the time since falls only */
            e->resting[at] = 0;
            b.divided[l] = -1;
            b.begin[l] = start;
            b.rise[l] = rise;
        } else {
            b.more[l] = tiny[l];
        }
    }
    if (any(b.sought)) *part = root_of(p, g, guard, &b);
    return b.sought;
}

/* Whether the guard of a mark has fallen, and has not risen since, where a step begins.  Its value there differs from
   that where the last step ended by rounding and projection, which is no fall or rise; by more it has jumped. */
static int64_t has_fallen(const Group *g, int64_t l, int64_t fallen, double begin) {
    const Encounters *e = g->pool->encounters;
    double tiny = TINY * e->length[g->member[l]];
    if (tiny < PROJECTED * g->floor[l]) tiny = PROJECTED * g->floor[l];
    return fallen ? begin <= tiny : begin < -tiny;
}

/* Note an event that has happened, under its own label or what follows from it. */
static void note_mark(const Encounters *e, int64_t m, double time, int64_t event, int64_t label) {
    int64_t at = e->noted[m];
    if (at >= e->room) return;
    e->mark[m * e->room + at] = event;
    e->mark_labels[m * e->room + at] = label;
    e->mark_times[m * e->room + at] = time;
    e->noted[m]++;
}

/* Note the marks until parts of the step. */
static void note_marks(const Problem *p, Group *g, Mask taken, V until) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t step = 2 * c->events;
    for (int64_t k = 0; k < c->events; k++) {
        if (c->first[k + 1] > c->first[k]) continue;
        int64_t first[LANES] = {0}, fallen[LANES] = {0}; /* sample from which it may fall; whether it has fallen */
        double since[LANES] = {0};                       /* part of the step */
        const V *value = g->samples + 2 * k;
        Mask sought = taken, some = taken;
        for (int64_t l = 0; l < LANES; l++) {
            if (!taken[l]) continue;
            first[l] = fallen[l] = has_fallen(g, l, e->resting[g->member[l] * step + 2 * k], value[0][l]);
            since[l] = 0.0;
        }
        for (;;) {
            for (int64_t l = 0; l < LANES; l++) {
                if (!sought[l]) continue;
                while (first[l] && first[l] < SAMPLES && value[first[l] * step][l] <= 0.0) first[l]++;
                if (first[l] >= SAMPLES) sought[l] = 0;
            }
            if (!any(sought)) break;
            V part = splat(2.0);
            some = plain_fall(p, g, 2 * k, sought, first, taken, &part);
            for (int64_t l = 0; l < LANES; l++) {
                if (!some[l] || part[l] > until[l]) {
                    sought[l] = 0;
                    continue;
                }
                note_mark(e, g->member[l], g->now[l] + part[l] * g->size[l], k, AS_DECLARED);
                fallen[l] = 1;
                since[l] = part[l];
                while (first[l] <= SAMPLES && (double)first[l] / SAMPLES <= part[l]) first[l]++;
            }
        }
        for (int64_t l = 0; l < LANES; l++) {
            if (!taken[l]) continue;
            for (int64_t j = 1; j <= SAMPLES; j++) {
                double part = (double)j / SAMPLES;
                if (part > since[l] && part <= until[l] && value[j * step][l] > 0.0) fallen[l] = 0;
            }
            e->resting[g->member[l] * step + 2 * k] = fallen[l];
        }
    }
}

/* Lanes whose steps that are taken contain an event, the part of the step at which it is, and its guard; marks before
   are noted. */
static Mask find_events(const Problem *p, Group *g, Mask taken, V *until, int64_t *happened) {
    const Contacts *c = p->contacts;
    const Encounters *e = g->pool->encounters;
    int64_t step = 2 * c->events, marks = 0;
    Mask stopped = {0};
    *until = splat(1.0);
    for (int64_t k = 0; k <= SAMPLES; k++) {
        find_guards(p, g, splat((double)k / SAMPLES));
        copy(g->samples + k * step, g->guards, step);
    }
    for (int64_t guard = 0; guard < step; guard++) {
        int64_t k = guard / 2, second = guard % 2, none[LANES];
        if (c->first[k + 1] == c->first[k]) {
            marks = 1;
            continue;
        }
        Mask plain = {0}, resting = {0}, dipping = {0};
        V tiny = splat(0.0), part = splat(2.0);
        for (int64_t l = 0; l < LANES; l++) {
            none[l] = 0;
            if (!taken[l]) continue;
            int64_t m = g->member[l], mode = e->mode[m * c->events + k];
            if (second && (mode == OPEN || mode == SMOOTH)) continue;
            if (e->resting[m * step + guard])
                resting[l] = -1;
            else
                plain[l] = -1;
            dipping[l] = mode == OPEN ? -1 : 0;
            tiny[l] = mode == OPEN ? TINY * e->length[m] : second && mode == SLIP ? 0.1 * e->slow[m] : 0.0;
        }
        Mask at_once = plain & (g->samples[guard] <= splat(0.0)), found = at_once;
        V at = splat(0.0);
        plain &= ~at_once;
        if (any(plain)) {
            Mask some = plain_fall(p, g, guard, plain, none, dipping, &part);
            at = choose(some, part, at);
            found |= some;
        }
        if (any(resting)) {
            Mask some = resting_fall(p, g, guard, resting, tiny, &part);
            at = choose(some, part, at);
            found |= some;
        }
        for (int64_t l = 0; l < LANES; l++) {
            if (!found[l] || (stopped[l] && at[l] >= (*until)[l])) continue;
            stopped[l] = -1;
            (*until)[l] = at[l];
            happened[l] = guard;
        }
    }
    if (marks) note_marks(p, g, taken, *until);
    return stopped;
}
