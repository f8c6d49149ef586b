/* Between the ends of a step: the interpolant, and states at output times. */
#include "group.h"

/* Coefficients of the interpolant of the last attempt. */
static void interpolant(const Problem *p, Group *g) {
    if (p->implicit) return; /* stages are enough */
    int64_t width = p->width;
    for (int64_t more = 0; more < 3; more++) {
        int64_t stage = STAGES + 1 + more;
        combine(p, g, ROW_MORE + more, g->work);
        to_stage(p, g, g->work);
        evaluate_rate(p, g, g->now + p->tableau->moments[stage] * g->size, g->rates + stage * width);
    }
    for (int64_t r = 0; r < DENSE; r++) accumulate(p, g, ROW_DENSE + r, g->size, 0, g->dense + r * width);
}

/* Refuse steps whose interpolant is too inaccurate, and return them.  Their ends may be accurate:
   where stability limits the steps, fast modes have decayed at the end of a step, but not within it.  The error is that
   of the interpolant at its last further stage; it is of order 7, so that it exceeds that of the interpolant in short
   steps.  What is refused depends on no output time, so that the steps do not depend on them. */
static Mask refuse_coarse(const Problem *p, const Pool *pool, Group *g, Mask whole, Mask stiff) {
    accumulate(p, g, ROW_BETWEEN, g->size, 0, g->work);
    V off = root(scaled_squares(p, g, g->work) * ((double)(p->width / p->blocks) / p->moving)) / splat(p->between);
    Mask coarse = whole & (off > splat(1.0));
    if (!any(coarse)) return coarse;
    V shrink = 0.9 / root(root(root(off)));
    for (int64_t l = 0; l < LANES; l++) {
        int64_t m = g->member[l];
        if (!coarse[l]) continue;
        if (pool->trusted[m] || (p->guarded && pool->told[m])) { /* near a singular pose, the caller decides */
            coarse[l] = 0;
            continue;
        }
        g->wanted[l] = g->size[l] * (off[l] < 1e300 && shrink[l] > 0.2 ? shrink[l] : 0.2);
        pool->rejected[m] = COARSE;
        pool->stiff[m] += stiff[l] != 0;
    }
    return coarse;
}

/* State at a part of the last attempt. */
static void interpolate(const Problem *p, Group *g, V part, V *target) {
    int64_t width = p->width;
    if (p->implicit) {
        interpolate_stages(p, g, part, target);
        return;
    }
    V rest = 1.0 - part;
    for (int64_t i = 0; i < width; i++) {
        const V *d = g->dense + i;
        V sum = d[(DENSE - 1) * width];
#pragma clang loop unroll(full)
        for (int64_t r = DENSE - 2; r > 0; r -= 2) {
            sum = d[r * width] + part * sum;
            sum = d[(r - 1) * width] + rest * sum;
        }
        target[i] = g->base[i] + part * sum;
    }
    to_state(p, g, target);
}

/* Project the states in the work array onto the constraints. */
static void put_on_constraints(const Problem *p, Group *g, Mask which) {
    if (!p->surplus) return;
    run_program(&p->values, g->work);
    evaluate_surplus(p, g);
    for (int64_t i = 0; i < p->coordinates; i++) {
        V q = g->work[p->surplus[i]], v = g->work[p->surplus[p->coordinates + i]];
        g->work[i] -= choose(which & (q == q), q, splat(0.0));
        g->work[p->velocities + i] -= choose(which & (v == v), v, splat(0.0));
    }
}

/* Write the states in the work array into the results of lanes that are due, and count them. */
static void write_results(const Problem *p, const Pool *pool, Group *g, Mask due, int64_t *column) {
    int64_t entries = p->width / p->blocks, stride = p->instants * entries;
    double *rows[LANES];
    for (int64_t l = 0; l < LANES; l++) {
        rows[l] = (double *)g->last; /* no longer needed: space for unused results */
        if (!due[l]) continue;
        double *at = pool->result + column[l]++ * entries;
        rows[l] = at + g->member[l] * stride;
        if (p->terms) store_entries(p, at, stride, g->work, l, g->member[l]);
    }
    if (!p->terms) to_rows(rows, LANES, g->work, p->width);
}

/* Interpolate states at given times in the work array, and project them onto persistent contacts. */
static void interpolate_at(const Problem *p, Group *g, Mask which, V moment) {
    interpolate(p, g, larger(smaller((moment - g->now) / g->size, splat(1.0)), splat(0.0)), g->work);
    if (!any(g->touching & which)) return;
    g->work[p->time] = smaller(larger(moment, g->low), g->high);
    put_on_constraints(p, g, which & g->touching);
    put_on_contacts(p, g, which);
}

/* Record the states of the steps that are taken, up to `last`, on the constraints. */
static void record(const Problem *p, const Pool *pool, Group *g, Mask taken, V last) {
    double *rows[LANES];
    int64_t at[LANES];
    for (int64_t l = 0; l < LANES; l++) {
        if (!taken[l]) continue;
        at[l] = (*pool->recorded)++;
        pool->path_owner[at[l]] = g->member[l];
        pool->path_ends[2 * at[l]] = g->now[l];
        pool->path_ends[2 * at[l] + 1] = last[l];
        pool->path_kept[at[l]] = g->touching[l] != 0;
    }
    for (int64_t k = 0; k < PLACES; k++) {
        V moment = k + 1 < PLACES ? g->now + p->places[k] * (last - g->now) : last;
        interpolate_at(p, g, taken, moment);
        g->work[p->time] = smaller(larger(moment, g->low), g->high);
        put_on_constraints(p, g, taken & ~g->touching);
        for (int64_t l = 0; l < LANES; l++) {
            rows[l] = taken[l] ? pool->path + (at[l] * PLACES + k) * p->width : (double *)g->last;
        }
        to_rows(rows, LANES, g->work, p->width);
    }
}

/* Write the interpolated states at the output times up to `last`; `known`: so is the interpolant. */
static void write_outputs(const Problem *p, const Pool *pool, Group *g, Mask taken, V last, int64_t known) {
    int64_t column[LANES];
    if (p->room) {
        if (!known) interpolant(p, g);
        known = 1;
        record(p, pool, g, taken, last);
    }
    for (int64_t l = 0; l < LANES; l++) column[l] = taken[l] ? pool->column[g->member[l]] : p->instants;
    for (;;) {
        Lanes due, moment = {g->now}, until = {last};
        for (int64_t l = 0; l < LANES; l++) {
            int64_t here = column[l] < p->instants && p->times[column[l]] <= until.of[l];
            due.flag[l] = -here;
            if (here) moment.of[l] = p->times[column[l]];
        }
        if (!any(due.mask)) break;
        if (!known) interpolant(p, g);
        known = 1;
        interpolate_at(p, g, due.mask, moment.all);
        write_results(p, pool, g, due.mask, column);
    }
    for (int64_t l = 0; l < LANES; l++)
        if (taken[l]) pool->column[g->member[l]] = column[l];
}
