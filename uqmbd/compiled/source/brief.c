/* Steps of order 5 over whole integration intervals.

   Controllers end an interval at each sample, often far earlier than the error requires.  There a step of order 5, with
   half of the evaluations, is accurate enough (J. R. Dormand, P. J. Prince, Journal of Computational and Applied
   Mathematics 6 (1980) 19-26; interpolant of order 4 of the book of Hairer, Norsett and Wanner, II.6).  Its error has to be
   a small part of the tolerance: intervals are many, and their errors add up.  Otherwise the step is repeated with order 8. */
#include "group.h"

static const double BRIEF = 1e-2; /* greatest error of a step of order 5, in tolerances */

enum {
    SLOPES = 7,
    PAUSE = 15, /* intervals after an error that is too large in which no such step is tried */
};

static const double BRIEF_MOMENTS[SLOPES] = {0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0};
static const double BRIEF_WEIGHTS[SLOPES][SLOPES - 1] = {
    {0.0},
    {0.2},
    {3.0 / 40.0, 9.0 / 40.0},
    {44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0},
    {19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0},
    {9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0},
    {35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0},
};
static const double BRIEF_ERROR[SLOPES] = {71.0 / 57600.0,      0.0,          -71.0 / 16695.0, 71.0 / 1920.0,
                                           -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0};
static const double BRIEF_DENSE[SLOPES] = {-12715105075.0 / 11282082432.0, 0.0,
                                           87487479700.0 / 32700410799.0,  -10690763975.0 / 1880347072.0,
                                           701980252875.0 / 199316789632.0, -1453857185.0 / 822651844.0,
                                           69997945.0 / 29380423.0};

/* Rows of the workspace: slopes, and the state at the end. */
static int64_t brief_rows(const Problem *p) { return p->brief ? (SLOPES + 1) * p->width : 0; }

/* Lanes whose step is a whole interval, of those for which order 5 may be enough. */
static Mask find_brief(const Problem *p, const Pool *pool, const Group *g) {
    Mask found = {0};
    if (!p->brief || p->implicit || p->terms || p->contacts) return found;
    for (int64_t l = 0; l < LANES; l++) {
        if (!g->running[l] || g->now[l] != g->begin[l] || g->size[l] < g->end[l] - g->now[l]) continue;
        int64_t *pause = pool->pause + g->member[l];
        if (*pause)
            (*pause)--;
        else
            found[l] = -1;
    }
    return found;
}

/* target = base + size * sum of the first slopes. */
INLINE void add_slopes(const Problem *p, const Group *g, const double *weights, int64_t count, V size, const V *base,
                       V *target) {
    int64_t width = p->width;
    for (int64_t i = 0; i < width; i++) {
        V sum = weights[0] * g->slopes[i];
#pragma clang loop unroll(full)
        for (int64_t k = 1; k < count; k++)
            if (weights[k] != 0.0) sum += weights[k] * g->slopes[k * width + i];
        target[i] = base ? base[i] + size * sum : size * sum;
    }
}

/* Attempt steps of order 5 in all lanes; those whose errors are small enough.  Errors of the others are unknown. */
static Mask attempt_brief(const Problem *p, const Pool *pool, Group *g, Mask tried) {
    int64_t width = p->width;
    V *end = g->slopes + SLOPES * width, sum = splat(0.0);
    copy(g->base, g->z, width);
    from_state(p, g->base);
    copy(g->slopes, g->rates, width);
#pragma clang loop unroll(full)
    for (int64_t stage = 1; stage < SLOPES; stage++) {
        add_slopes(p, g, BRIEF_WEIGHTS[stage], stage, g->size, g->base, g->work);
        if (stage == SLOPES - 1) {
            copy(end, g->work, width);
            to_state(p, g, g->work);
        } else {
            to_stage(p, g, g->work);
        }
        evaluate_rate(p, g, g->now + BRIEF_MOMENTS[stage] * g->size, g->slopes + stage * width);
    }
    find_sizes(p, g, g->base, 0);
    find_sizes(p, g, end, 1);
    add_slopes(p, g, BRIEF_ERROR, SLOPES, g->size, 0, g->next);
    for (int64_t i = 0; i < width; i++) {
        V part = g->next[i] / (g->floor + p->rtol * g->sizes[i]);
        sum += part * part;
    }
    g->error = root(sum / p->moving);
    Mask found = tried & (g->error <= splat(BRIEF));
    for (int64_t l = 0; l < LANES; l++)
        if (tried[l] && !found[l]) pool->pause[g->member[l]] = PAUSE;
    copy(g->next, end, width);
    copy(g->rates + STAGES * width, g->slopes + (SLOPES - 1) * width, width);
    return found;
}

/* Attempt steps of all lanes, those of whole intervals with order 5 first. */
static void attempt_all(const Problem *p, const Pool *pool, Group *g) {
    Mask tried = find_brief(p, pool, g);
    g->brief = (Mask){0};
    if (any(tried)) g->brief = attempt_brief(p, pool, g, tried);
    if (any(tried) && !any(g->running & ~g->brief)) return;
    V error = g->error;
    attempt(p, g);
    if (!any(g->brief)) return;
    for (int64_t i = 0; i < p->width; i++)
        g->next[i] = choose(g->brief, g->slopes[SLOPES * p->width + i], g->next[i]);
    g->error = choose(g->brief, error, g->error);
    copy(g->work, g->next, p->width);
    to_state(p, g, g->work);
    evaluate_rate(p, g, g->now + g->size, g->rates + STAGES * p->width);
}

/* Coefficients of the interpolant of lanes with steps of order 5. */
static void interpolate_brief(const Problem *p, Group *g) {
    int64_t width = p->width;
    const V *end = g->slopes + SLOPES * width;
    add_slopes(p, g, BRIEF_DENSE, SLOPES, g->size, 0, g->work);
    for (int64_t i = 0; i < width; i++) {
        V change = end[i] - g->base[i], first = g->size * g->slopes[i] - change;
        V last = change - g->size * g->slopes[(SLOPES - 1) * width + i] - first;
        const V found[DENSE] = {change, first, last, g->work[i]};
        for (int64_t r = 0; r < DENSE; r++) g->dense[r * width + i] = choose(g->brief, found[r], g->dense[r * width + i]);
    }
}
