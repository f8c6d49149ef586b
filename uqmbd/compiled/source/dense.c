/* Between the ends of a step: the interpolant, and states at output times. */
#include "group.h"

static const double NEGLIGIBLE = 1e-4; /* square of a residual over one that needs no projection */

enum { MANY_TIMES = 24 }; /* output times in a step above which polynomials between projected states cost less */

/* Coefficients of the interpolant of the last attempt. */
static void interpolant(const Problem *p, Group *g) {
    if (p->implicit) return; /* stages are enough */
    int64_t width = p->width;
    for (int64_t more = 0; more < 3 && any(g->running & ~g->brief); more++) {
        int64_t stage = STAGES + 1 + more;
        combine(p, g, ROW_MORE + more, g->work);
        to_stage(p, g, g->work);
        evaluate_rate(p, g, g->now + p->tableau->moments[stage] * g->size, g->rates + stage * width);
    }
    for (int64_t r = 0; r < DENSE; r++) accumulate(p, g, ROW_DENSE + r, g->size, 0, g->dense + r * width);
    if (any(g->brief)) interpolate_brief(p, g);
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
        if (stiff[l]) count_stiff(p, pool, m, 1, 1);
    }
    return coarse;
}

/* What is stepped at a part of the last attempt, of all lanes, or of lane l in all of them. */
INLINE void interpolate_steps(const Problem *p, const Group *g, int64_t l, V part, V *target) {
    int64_t width = p->width;
    if (p->implicit) {
        interpolate_stages(p, g, l, part, target);
        return;
    }
    V rest = 1.0 - part;
    for (int64_t i = 0; i < width; i++) {
        const V *d = g->dense + i;
        V sum = of_lane(d + (DENSE - 1) * width, l);
#pragma clang loop unroll(full)
        for (int64_t r = DENSE - 2; r > 0; r -= 2) {
            sum = of_lane(d + r * width, l) + part * sum;
            sum = of_lane(d + (r - 1) * width, l) + rest * sum;
        }
        target[i] = of_lane(g->base + i, l) + part * sum;
    }
}

/* State at a part of the last attempt. */
static void interpolate(const Problem *p, Group *g, V part, V *target) {
    interpolate_steps(p, g, -1, part, target);
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

/* Write the states in the work array into the results of lanes that are due. */
static void write_results(const Problem *p, const Pool *pool, Group *g, Mask due, const int64_t *column) {
    int64_t entries = p->width / p->blocks, stride = p->instants * entries;
    double *rows[LANES];
    for (int64_t l = 0; l < LANES; l++) {
        rows[l] = (double *)g->last; /* no longer needed: space for unused results */
        if (!due[l]) continue;
        double *at = pool->result + column[l] * entries;
        rows[l] = at + g->member[l] * stride;
        if (p->terms) store_entries(p, at, stride, g->work, l, g->member[l]);
    }
    if (!p->terms) to_rows(rows, LANES, g->work, p->width);
}

/* Parts of the last attempt at given times. */
INLINE V part_of(const Group *g, V moment) {
    return larger(smaller((moment - g->now) / g->size, splat(1.0)), splat(0.0));
}

/* Interpolate states at given times in the work array, and project them onto persistent contacts. */
static void interpolate_at(const Problem *p, Group *g, Mask which, V moment) {
    interpolate(p, g, part_of(g, moment), g->work);
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

/* Powers of a part of the way, as Chebyshev polynomials. */
INLINE void chebyshev_of(V part, V *power) {
    const V x = 2.0 * part - 1.0;
    power[0] = splat(1.0);
    power[1] = x;
#pragma clang loop unroll(full)
    for (int64_t c = 2; c < POINTS; c++) power[c] = 2.0 * x * power[c - 1] - power[c - 2];
}

/* Sums of polynomials, with (POINTS) coefficients for each of the results. */
INLINE void sum_series(int64_t count, const V *series, const V *power, int add, V *target) {
    const double *c = (const double *)series;
    for (int64_t i = 0; i < count; i++, c += POINTS) {
        V sum = add ? target[i] + c[0] : splat(c[0]);
#pragma clang loop unroll(full)
        for (int64_t k = 1; k < POINTS; k++) sum += c[k] * power[k];
        target[i] = sum;
    }
}

/* Add values in the lanes to the coefficients of polynomials. */
INLINE void add_to_series(const Group *h, int64_t group, V values, V *series) {
    const V *sums = h->sums + group * LANES * GROUPS;
#pragma clang loop unroll(full)
    for (int64_t l = 0; l < LANES; l++)
        for (int64_t c = 0; c < GROUPS; c++) series[c] += values[l] * sums[l * GROUPS + c];
}

/* The group whose lanes all are lane l, at several times. */
static Group only(const Problem *p, const Group *g, int64_t l, V last) {
    Group h = *g;
    const int64_t first = p->time + 1, end = first + 1 + p->parameters;
    h.work = g->other;
    for (int64_t i = first; i < end; i++) h.work[i] = splat(g->work[i][l]);
    h.now = splat(g->now[l]);
    h.size = splat(g->size[l]);
    h.low = splat(g->low[l]);
    h.high = splat(g->high[l]);
    for (int64_t k = 0; k < 2; k++) {
        h.enough[k] = splat(g->enough[k][l]);
        h.scale[k] = splat(g->scale[k][l]);
    }
    h.from = splat(g->now[l]);
    h.until = splat(last[l]);
    for (int64_t k = 0; k < LANES; k++) h.member[k] = g->member[l];
    h.touching = (Mask){0};
    return h;
}

/* Times at which the equations are evaluated at parts of the way. */
INLINE V time_of(const Group *h, V part) {
    return smaller(larger(h->from + part * (h->until - h->from), h->low), h->high);
}

/* States of a lane at parts of the way, in the work array. */
static void state_of_series(const Problem *p, Group *h, V part, int shifted) {
    V power[POINTS];
    chebyshev_of(part, power);
    sum_series(p->width, h->series, power, 0, h->work);
    to_state(p, h, h->work);
    if (shifted) sum_series(p->width, h->shifts, power, 1, h->work);
    h->work[p->time] = time_of(h, part);
}

/* Parts of the way: points of the tableau. */
INLINE V points_of(const double *points, int64_t group) {
    Lanes part;
    for (int64_t l = 0; l < LANES; l++) part.of[l] = points[group * LANES + l];
    return part.all;
}

/* Make polynomials of what a lane steps on the way, and of corrections of states from projections at a few points; return
   whether there are corrections of states that are no polynomials.  Residuals far below those that need no projection are
   rounding.  Scales of residuals are the least of the points and of the end of the step. */
static int find_series(const Problem *p, Group *h, int64_t l) {
    int shifted = 0, failed = 0;
    fill(h->series, 0.0, 2 * p->width * GROUPS);
    for (int64_t b = 0; b < GROUPS; b++) {
        const V part = points_of(p->tableau->points, b);
        V residuals[2], scales[2];
        interpolate_steps(p, h, l, (h->from - h->now + part * (h->until - h->from)) / h->size, h->work);
        for (int64_t i = 0; i < p->width; i++) add_to_series(h, b, h->work[i], h->series + i * GROUPS);
        if (!p->equations) continue;
        to_state(p, h, h->work);
        h->work[p->time] = time_of(h, part);
        copy(h->last, h->work, p->width);
        find_residuals(p, h->work, residuals);
        Mask rounding = ~(Mask){0};
        for (int64_t k = 0; k < 2; k++) rounding &= residuals[k] <= NEGLIGIBLE * h->enough[k] * h->scale[k];
        if (!any(~rounding)) continue;
        shifted = 1;
        failed |= any(correct_states(p, h->work));
        for (int64_t i = 0; i < p->width; i++) {
            h->last[i] = h->work[i] - h->last[i];
            add_to_series(h, b, h->last[i], h->shifts + i * GROUPS);
        }
        find_scales(p, residuals, h->last, p->velocities, scales);
        for (int64_t k = 0; k < 2; k++)
            for (int64_t i = 0; i < LANES; i++) h->scale[k] = smaller(h->scale[k], splat(scales[k][i]));
    }
    if (failed) h->scale[0] = splat(-1.0); /* states will be projected one by one */
    if (failed || p->turning || !shifted) return shifted && !failed;
    for (int64_t i = 0; i < p->width * GROUPS; i++) h->series[i] += h->shifts[i];
    return 0;
}

/* Whether states are close to the constraints between the points of the polynomials; their residuals are noted. */
static int are_close(const Problem *p, const Pool *pool, Group *h, int shifted) {
    for (int64_t b = 0; p->equations && b < GROUPS; b++) {
        V residuals[2];
        state_of_series(p, h, points_of(p->tableau->points + POINTS, b), shifted);
        find_residuals(p, h->work, residuals);
        for (int64_t k = 0; k < 2; k++)
            if (any(~(residuals[k] <= h->enough[k] * h->scale[k]))) return 0;
        note_off(p, pool, h->work, h->member, ~(Mask){0}, h->most);
    }
    return 1;
}

/* Write the states of one lane at `count` output times of a part of a step, from polynomials.  Parts with many times whose
   polynomials are inaccurate are halved. */
static void write_part(const Problem *p, const Pool *pool, Group *h, int64_t l, int64_t first, int64_t count) {
    const int shifted = find_series(p, h, l), close = are_close(p, pool, h, shifted);
    if (!close && count > 2 * MANY_TIMES) {
        const V until = h->until, middle = 0.5 * (h->from + until);
        int64_t before = 0;
        while (before < count && p->times[first + before] <= middle[0]) before++;
        h->until = middle;
        if (before) write_part(p, pool, h, l, first, before);
        h->from = middle;
        h->until = until;
        if (before < count) write_part(p, pool, h, l, first + before, count - before);
        return;
    }
    for (int64_t k = 0; k < count; k += LANES) {
        int64_t column[LANES];
        Lanes due, moment;
        for (int64_t i = 0; i < LANES; i++) {
            due.flag[i] = k + i < count ? -1 : 0;
            column[i] = first + k + i;
            moment.of[i] = p->times[first + (k + i < count ? k + i : count - 1)];
            if (close && due.flag[i]) pool->poor[h->member[0] * p->instants + column[i]] = STATE_CLOSE;
        }
        state_of_series(p, h, (moment.all - h->from) / (h->until - h->from), shifted);
        write_results(p, pool, h, due.mask, column);
    }
}

/* Write the interpolated states at the output times up to `last`; `known`: so is the interpolant.  Vectors are several
   times of a lane with many, which depend on nothing but the realisation, else lanes. */
static void write_outputs(const Problem *p, const Pool *pool, Group *g, Mask taken, V last, int64_t known) {
    int64_t left[LANES], most_left = 0;
    if (p->room) {
        if (!known) interpolant(p, g);
        known = 1;
        record(p, pool, g, taken, last);
    }
    for (int64_t l = 0; l < LANES; l++) {
        left[l] = 0;
        if (!taken[l]) continue;
        const int64_t column = pool->column[g->member[l]];
        while (column + left[l] < p->instants && p->times[column + left[l]] <= last[l]) left[l]++;
        if (left[l] && !known) interpolant(p, g);
        known |= left[l] > 0;
        if (left[l] > MANY_TIMES && !p->terms && !g->touching[l]) {
            Group h = only(p, g, l, last);
            write_part(p, pool, &h, l, pool->column[g->member[l]], left[l]);
            pool->column[g->member[l]] += left[l];
            left[l] = 0;
        }
        if (left[l] > most_left) most_left = left[l];
    }
    for (int64_t k = 0; k < most_left; k++) {
        int64_t column[LANES];
        Lanes due, moment = {g->now};
        for (int64_t l = 0; l < LANES; l++) {
            due.flag[l] = k < left[l] ? -1 : 0;
            if (!due.flag[l]) continue;
            column[l] = pool->column[g->member[l]]++;
            moment.of[l] = p->times[column[l]];
        }
        interpolate_at(p, g, due.mask, moment.all);
        write_results(p, pool, g, due.mask, column);
    }
}
