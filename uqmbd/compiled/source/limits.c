/* Which contacts slip where friction reaches its limit in several contacts at once.

   At the limit, forces and accelerations are equal for sticking and slipping, and their rates decide.  For each contact at
   its limit, let r be the rate of the reserve of friction, and a that of the acceleration in the direction of the impending
   sliding: r >= 0, a >= 0, r a = 0.  This linear complementarity problem is solved by enumeration, at most 2^MOST_CLOSED
   combinations, the one with most slipping contacts first. */
#include "group.h"

static const double RESTS_AT_LIMIT = 1e-7; /* acceleration along a surface, over those that contact forces cause, that is none */
static const double NOISE = 1e-13;         /* relative noise in changes of accelerations */
static const double SLIPS = 1e-6;          /* least relevant change of an acceleration, relative to the largest one */
static const double AHEAD = 100.0;         /* time difference for rates of forces, relative to the duration of an instant */

enum { TURNS = 4 }; /* steps of Newton's method for the directions of sliding */

/* Lasting contacts of a lane, and the numbers of its events. */
typedef struct {
    int64_t count, event[MOST_CLOSED], mode[MOST_CLOSED], noted, total;
    double heading[MOST_CLOSED][MOST_DIRECTIONS], internal[MOST_CLOSED][MOST_DIRECTIONS];
} Stored;

/* A decision on lasting contacts of a lane: their states before it, contacts at their limit, and those of them that slip
   in any case; if `stored`, it has changed contacts, which were `earlier`; `starting`: the speed that was none before. */
typedef struct {
    int needed, again, stored, limited[MOST_CLOSED], forced[MOST_CLOSED];
    int64_t before[MOST_CLOSED];
    double span, starting;
    Stored earlier;
    Closed now;
    Lasting lasting;
} Limit;

/* Accelerations along the headings of contacts that are free to stick, if all contacts at their limit slip: without, and
   per reserve of friction of each; and the friction of all contacts across their headings. */
typedef struct {
    int64_t count, free[MOST_CLOSED];
    double rate[MOST_CLOSED], response[MOST_CLOSED][MOST_CLOSED], across[MOST_CLOSED];
} Rates;

static double product_of(const double *x, const double *y, int64_t count) {
    double sum = 0.0;
    for (int64_t i = 0; i < count; i++) sum += x[i] * y[i];
    return sum;
}

/* Rates of `c`, whose contacts and headings are those of the decision; whether they are finite. */
static int find_rates(const Closed *c, const Limit *x, double (*heading)[2], int with_free, Lane *s, Rates *found) {
    int64_t rows = c->first[c->count], size = 0, turning[MOST_CLOSED], mode[MOST_CLOSED];
    double held[MOST_ROWS][MOST_ROWS], unit[MOST_ROWS], along[MOST_CLOSED][MOST_ROWS], headings[MOST_CLOSED][2];
    Spread spread;
    found->count = 0;
    for (int64_t k = 0; k < c->count; k++) {
        mode[k] = x->limited[k] ? SMOOTH : x->lasting.mode[k];
        turning[k] = -1;
        for (int64_t i = 0; i < 2; i++) headings[k][i] = x->limited[k] ? heading[k][i] : x->lasting.heading[k][i];
    }
    set_spread(c, mode, headings, &spread);
    for (int64_t i = 0; i < spread.size; i++)
        for (int64_t d = 0; d < rows; d++) held[i][d] = d == spread.row[i];
    size = spread.size;
    for (int64_t k = 0; k < c->count; k++) {
        if (!x->limited[k]) continue;
        int64_t first = c->first[k], tangents = c->first[k + 1] - first - 1;
        for (int64_t i = 0; i < spread.size; i++)
            for (int64_t t = 0; t < tangents && spread.row[i] == first; t++)
                spread.column[i][first + 1 + t] = -c->friction[k] * headings[k][t];
        if (tangents == 2) {
            for (int64_t d = 0; d < rows; d++) held[size][d] = 0.0;
            held[size][first + 1] = -headings[k][1];
            held[size][first + 2] = headings[k][0];
            for (int64_t d = 0; d < rows; d++) spread.column[size][d] = held[size][d];
            turning[k] = size++;
        }
        if (!with_free || x->forced[k]) continue;
        for (int64_t d = 0; d < rows; d++) along[found->count][d] = 0.0;
        for (int64_t t = 0; t < tangents; t++) along[found->count][first + 1 + t] = headings[k][t];
        found->free[found->count++] = k;
    }
    double inner[MOST_ROWS][MOST_ROWS];
    for (int64_t i = 0; i < size; i++) {
        /* absolute values do not cancel: the scale of a row stays positive where its forces have no effect */
        double scale = 0.0;
        for (int64_t d = 0; d < rows; d++)
            for (int64_t e = 0; e < rows && held[i][d] != 0.0; e++)
                scale += __builtin_fabs(held[i][d] * c->matrix[d][e] * held[i][e]);
        unit[i] = 1.0 / __builtin_sqrt(greatest(scale, 1e-300));
        for (int64_t j = 0; j < size; j++) {
            inner[i][j] = 0.0;
            for (int64_t d = 0; d < rows; d++)
                if (held[i][d] != 0.0) inner[i][j] += held[i][d] * product_of(c->matrix[d], spread.column[j], rows);
        }
    }
    /* redundant contacts make the matrix singular: the forces are the least ones */
    for (int64_t side = -1; side < found->count; side++) {
        double natural[MOST_ROWS], force[MOST_ROWS];
        for (int64_t d = 0; d < rows; d++)
            natural[d] = side < 0 ? c->natural[d] : product_of(c->matrix[d], along[side], rows);
        for (int64_t i = 0; i < size; i++) {
            s->unit[i] = unit[i];
            s->right[i] = -product_of(held[i], natural, rows);
            for (int64_t j = 0; j < size; j++) s->inner[i * size + j] = inner[i][j];
        }
        if (size) least_solution(s, size);
        for (int64_t d = 0; d < rows; d++) {
            force[d] = 0.0;
            for (int64_t j = 0; j < size; j++) force[d] += spread.column[j][d] * s->found[j];
        }
        for (int64_t i = 0; i < found->count; i++) {
            double rate = product_of(along[i], natural, rows);
            for (int64_t d = 0; d < rows; d++)
                if (along[i][d] != 0.0) rate += along[i][d] * product_of(c->matrix[d], force, rows);
            if (!is_finite(rate)) return 0;
            *(side < 0 ? &found->rate[i] : &found->response[i][side]) = rate;
        }
        for (int64_t k = 0; k < c->count && side < 0; k++) found->across[k] = turning[k] < 0 ? 0.0 : s->found[turning[k]];
    }
    return 1;
}

/* Rates of accelerations of the first combination that satisfies the laws; whether there is one. */
static int solve_limits(const double *offset, double (*response)[MOST_CLOSED], int64_t count, Lane *s, double *after) {
    for (int64_t sticks = 0; sticks < (int64_t)1 << count; sticks++) {
        int64_t held[MOST_CLOSED], size = 0;
        double reserve[MOST_CLOSED] = {0.0}, most = 1.0;
        int valid = 1;
        for (int64_t i = 0; i < count; i++)
            if (sticks >> i & 1) held[size++] = i;
        for (int64_t i = 0; i < size; i++) {
            s->unit[i] = 1.0;
            s->right[i] = -offset[held[i]];
            for (int64_t j = 0; j < size; j++) s->inner[i * size + j] = response[held[i]][held[j]];
        }
        if (size) least_solution(s, size);
        for (int64_t i = 0; i < size; i++) {
            reserve[held[i]] = s->found[i];
            most = greatest(most, __builtin_fabs(s->found[i]));
            valid &= is_finite(s->found[i]);
        }
        for (int64_t i = 0; i < count && valid; i++) {
            after[i] = offset[i] + product_of(response[i], reserve, count);
            valid = reserve[i] >= -EXACT * most && after[i] >= -EXACT * most;
            valid &= !(sticks >> i & 1) || after[i] <= EXACT * most;
        }
        if (valid) return 1;
    }
    return 0;
}

/* Rotate headings so that contacts begin to slide along them: a small rotation uses little of the reserve of friction. */
static void turn_starts(const Closed *c, const Limit *x, Lane *s, double (*heading)[2]) {
    Rates rates;
    for (int64_t turn = 0; turn < TURNS; turn++) {
        if (!find_rates(c, x, heading, 0, s, &rates)) return;
        for (int64_t k = 0; k < c->count; k++) {
            double most = c->friction[k] * x->lasting.force[c->first[k]], across = rates.across[k], size = 0.0;
            if (!x->limited[k] || c->first[k + 1] - c->first[k] < 3 || !(__builtin_fabs(across) < most)) continue;
            double turned[2] = {most * heading[k][0] + across * heading[k][1],
                                most * heading[k][1] - across * heading[k][0]};
            for (int64_t i = 0; i < 2; i++) size += turned[i] * turned[i];
            for (int64_t i = 0; i < 2; i++) heading[k][i] = turned[i] / __builtin_sqrt(size);
        }
    }
}

/* Let contacts at their limit slip, as their rates require, at least one; `later` are the same contacts a short time
   later.  Whether a combination satisfies the laws. */
static int let_slip(const Closed *later, Lane *s, Limit *x) {
    const Closed *c = &x->now;
    int64_t rows = c->first[c->count], count = 0, limited = 0;
    double heading[MOST_CLOSED][2] = {{0.0}};
    int slips[MOST_CLOSED], chosen = 0;
    for (int64_t k = 0; k < c->count; k++) {
        slips[k] = x->limited[k];
        limited += x->limited[k];
        count += x->limited[k] && !x->forced[k];
        if (x->limited[k])
            start_against(x->lasting.force + c->first[k] + 1, c->first[k + 1] - c->first[k] - 1, 1.0, heading[k]);
    }
    if (count && limited > 1) {
        Rates now, ahead;
        double offset[MOST_CLOSED], unit[MOST_CLOSED], after[MOST_CLOSED], largest = 0.0;
        if (!find_rates(c, x, heading, 1, s, &now) || !find_rates(later, x, heading, 1, s, &ahead)) return 0;
        for (int64_t i = 0; i < count; i++) {
            int64_t k = now.free[i];
            double size = 0.0, change = ahead.rate[i] - now.rate[i];
            for (int64_t t = c->first[k] + 1; t < c->first[k + 1]; t++)
                for (int64_t d = 0; d < rows; d++)
                    size += __builtin_fabs(heading[k][t - c->first[k] - 1] * c->matrix[t][d] * x->lasting.force[d]);
            /* two evaluations of an acceleration differ by rounding, which is no change */
            if (__builtin_fabs(change) <= NOISE * size) change = 0.0;
            offset[i] = (__builtin_fabs(now.rate[i]) <= RESTS_AT_LIMIT * size ? 0.0 : now.rate[i]) + change;
            /* scaled by the diagonal of the response: light and heavy bodies are treated alike */
            unit[i] = 1.0 / __builtin_sqrt(greatest(__builtin_fabs(now.response[i][i]), 1e-300));
            offset[i] *= unit[i];
            largest = greatest(largest, __builtin_fabs(offset[i]));
        }
        if (largest > 0.0) { /* otherwise the limit and slipping are equivalent for all contacts */
            for (int64_t i = 0; i < count; i++) {
                offset[i] /= largest;
                for (int64_t j = 0; j < count; j++) now.response[i][j] *= unit[i] * unit[j];
            }
            if (!solve_limits(offset, now.response, count, s, after)) return 0;
            for (int64_t i = 0; i < count; i++) slips[now.free[i]] = after[i] > SLIPS;
            for (int64_t k = 0; k < c->count; k++) chosen |= slips[k];
            for (int64_t k = 0; k < c->count && !chosen; k++) slips[k] = x->limited[k];
        }
    }
    int at_limit[MOST_CLOSED];
    for (int64_t k = 0; k < c->count; k++) {
        at_limit[k] = x->limited[k];
        x->limited[k] = slips[k];
    }
    turn_starts(c, x, s, heading);
    for (int64_t k = 0; k < c->count; k++) {
        x->forced[k] = slips[k];
        x->limited[k] = at_limit[k] && !slips[k];
        if (!slips[k]) continue;
        x->lasting.mode[k] = SLIP;
        for (int64_t i = 0; i < 2; i++) x->lasting.heading[k][i] = heading[k][i];
    }
    return find_lasting_forces(c, s, &x->lasting);
}

/* Choose internal forces of redundant contacts that stay admissible longest under changing loads. */
static void prolong(const Closed *later, Lane *s, Limit *x) {
    const Closed *c = &x->now;
    double rate[MOST_ROWS], before[MOST_ROWS], ways[MOST_ROWS][MOST_ROWS];
    Spread spread;
    if (!has_internal(c, &x->lasting) || !(x->span > 0.0)) return;
    set_spread(later, x->lasting.mode, x->lasting.heading, &spread);
    least_forces(later, &spread, s, rate);
    set_spread(c, x->lasting.mode, x->lasting.heading, &spread);
    least_forces(c, &spread, s, before);
    for (int64_t i = 0; i < c->first[c->count]; i++) rate[i] = (rate[i] - before[i]) / x->span;
    int64_t count = find_ways(c, &spread, s, ways);
    prolong_forces(c, x->lasting.mode, ways, count, rate, x->lasting.force);
    for (int64_t i = 0; i < c->first[c->count]; i++) x->lasting.internal[i] = x->lasting.force[i] - before[i];
}
