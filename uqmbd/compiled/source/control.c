/* Samples of controllers: lanes that have reached an instant continue with new commands and states. */
#include "group.h"

/* Put the numbers of a realisation into a lane. */
static void load_control(const Problem *p, Group *g, int64_t l, int64_t m) {
    const Control *c = p->control;
    V *numbers = g->control + p->time + 2;
    for (int64_t i = 0; i < c->numbers; i++) numbers[i][l] = c->values[m * c->numbers + i];
}

/* Whether a loop is a function of the caller. */
static int is_function(const Control *c, int64_t k) { return c->asked[k + 1] > c->asked[k]; }

/* Command or state of a lane after a sample. */
static double sampled_value(const Control *c, const V *work, int64_t k, int64_t i, int64_t l, int64_t m) {
    return is_function(c, k) ? c->answers[m * c->entries + i] : work[c->result[i]][l];
}

/* Write the measured values of a lane for the functions that are sampled; whether there is one. */
static int ask(const Control *c, const V *work, const int64_t *sampled, int64_t l, int64_t m) {
    int found = 0;
    for (int64_t k = 0; k < c->loops; k++) {
        if (sampled[k] < 0 || !is_function(c, k)) continue;
        found = 1;
        for (int64_t i = c->asked[k]; i < c->asked[k + 1]; i++)
            c->measured[m * c->asked[c->loops] + i] = work[c->seen[i]][l];
    }
    return found;
}

/* Whether measured accelerations of a lane are accurate. */
static int accurate(const Control *c, const V *work, const int64_t *sampled, int64_t l, int64_t m) {
    for (int64_t k = 0; k < c->loops; k++) {
        if (sampled[k] < 0 || c->residual[k] < 0 || (is_function(c, k) && c->answered[m])) continue;
        if (!(work[c->residual[k]][l] <= c->poor)) return 0;
    }
    return 1;
}

/* Whether the results of a lane are valid: finite, and with limits that are in order. */
static int valid_sample(const Control *c, const V *work, const int64_t *sampled, int64_t l, int64_t m) {
    for (int64_t k = 0; k < c->loops; k++) {
        if (sampled[k] < 0) continue;
        for (int64_t i = c->first[k]; i < c->first[k + 1]; i++) {
            double x = sampled_value(c, work, k, i, l, m);
            if (!(x - x == 0.0)) return 0;
            if (!(c->low[m * c->entries + i] <= c->high[m * c->entries + i])) return 0;
        }
    }
    return 1;
}

/* Put commands of a loop into a state; whether one has changed. */
static int act(const Control *c, Group *g, int64_t k, int64_t l, const double *commands) {
    int changed = 0;
    for (int64_t i = 0; i < c->commands[k]; i++) {
        V *z = g->z + c->held[c->first[k] + i];
        changed |= (*z)[l] != commands[i];
        (*z)[l] = commands[i];
    }
    return changed;
}

/* Commands within their limits, in their place. */
static void limit_commands(const Control *c, const V *work, int64_t k, int64_t l, int64_t m, double *commands) {
    const double *low = c->low + m * c->entries + c->first[k], *high = c->high + m * c->entries + c->first[k];
    for (int64_t i = 0; i < c->commands[k]; i++) {
        double x = sampled_value(c, work, k, c->first[k] + i, l, m);
        if (x < low[i]) x = low[i];
        if (x > high[i]) x = high[i];
        commands[i] = x;
    }
}

/* Apply the instant of a lane: first commands after their delay, then samples; whether the state has changed. */
static int apply_instant(const Problem *p, Group *g, int64_t l, int64_t m) {
    const Control *c = p->control;
    const int64_t *acting = c->acting + c->instant[m] * c->loops, *sampled = c->sampled + c->instant[m] * c->loops;
    double *pending = c->pending + m * c->places;
    int changed = 0;
    for (int64_t k = 0; k < c->loops; k++)
        if (acting[k] >= 0) changed |= act(c, g, k, l, pending + acting[k]);
    for (int64_t k = 0; k < c->loops; k++) {
        if (sampled[k] < 0) continue;
        for (int64_t i = c->first[k] + c->commands[k]; i < c->first[k + 1]; i++) {
            V *z = g->z + c->held[i];
            double x = sampled_value(c, g->control, k, i, l, m);
            changed |= (*z)[l] != x;
            (*z)[l] = x;
        }
        limit_commands(c, g->control, k, l, m, pending + sampled[k]);
        if (c->direct[k]) changed |= act(c, g, k, l, pending + sampled[k]);
    }
    return changed;
}

/* Apply the instants that lanes have reached.  Lanes whose samples are invalid keep their states, and wait. */
static void sample(const Problem *p, const Pool *pool, Group *g, int64_t *status) {
    const Control *c = p->control;
    copy(g->control, g->z, p->width);
    g->control[p->time] = g->now;
    g->control[p->time + 1] = splat(0.0);
    for (int64_t k = 0; k < c->loops; k++) {
        int64_t used = 0;
        for (int64_t l = 0; l < LANES; l++)
            if (g->due[l] && !(is_function(c, k) && c->answered[g->member[l]]))
                used |= c->sampled[c->instant[g->member[l]] * c->loops + k] >= 0;
        if (used) run_program(c->laws + k, g->control);
    }
    for (int64_t l = 0; l < LANES; l++) {
        if (!g->due[l]) continue;
        int64_t m = g->member[l];
        const int64_t *sampled = c->sampled + c->instant[m] * c->loops;
        if (!accurate(c, g->control, sampled, l, m)) {
            status[l] = UNSAMPLED;
            continue;
        }
        if (!c->answered[m] && ask(c, g->control, sampled, l, m)) {
            status[l] = ASKED;
            continue;
        }
        if (!valid_sample(c, g->control, sampled, l, m)) {
            status[l] = UNSAMPLED;
            continue;
        }
        c->answered[m] = 0;
        g->due[l] = 0;
        pool->stiff[m] = 0;
        int changed = apply_instant(p, g, l, m);
        c->instant[m] = -1;
        if (pool->leg[m] > pool->last_leg[m]) status[l] = DONE;
        if (!changed) continue;
        int64_t column = pool->column[m] - 1;
        double *found = pool->result + (m * p->instants + column) * p->width;
        int same = p->times[column] == g->now[l];
        for (int64_t i = 0; i < p->width; i++) {
            if (p->guarded) g->nodes[(NODES - 1) * p->width + i][l] = g->z[i][l];
            if (same) found[i] = g->z[i][l];
        }
    }
}
