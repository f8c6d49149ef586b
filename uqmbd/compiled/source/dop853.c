/* Length: one method, whose parts share what a group of lanes holds. */
#include "group.h"

int64_t advance_workspace(const Problem *p) {
    int64_t rows = p->rows + (3 + ALL_STAGES + DENSE + NODES) * p->width + 2 * p->coordinates + NODES;
    return rows * LANES + (p->contacts ? contact_workspace(p->contacts) : 0);
}

static void place(const Problem *p, Group *g, double *workspace) {
    V *at = (V *)workspace;
    int64_t width = p->width;
    g->work = at;
    at += p->rows;
    g->z = at;
    at += width;
    g->next = at;
    at += width;
    g->last = at;
    at += width;
    g->rates = at;
    at += ALL_STAGES * width;
    g->dense = at;
    at += DENSE * width;
    g->nodes = at;
    at += NODES * width;
    g->surplus = at;
    at += 2 * p->coordinates;
    g->node_times = at;
    at += NODES;
    if (p->contacts) place_contacts(p->contacts, g, at);
    g->evaluations = 0;
}

/* -- lanes ---------------------------------------------------------------------------------------------------------- */

/* Times between which the equations are evaluated: at the ends of a leg forces may jump. */
static void bounds(const Problem *p, Group *g, int64_t l, int64_t leg) {
    double begin = g->begin[l], end = p->leg_ends[leg];
    double size = 1.0;
    if (begin > size) size = begin;
    if (-begin > size) size = -begin;
    if (end > size) size = end;
    g->end[l] = end;
    g->bound[l] = p->leg_longest[leg];
    g->low[l] = begin + 1e-12 * size;
    g->high[l] = end - 1e-12 * size;
}

/* Put a row of entries into a lane, and the rows of further terms beside it; where there is no term they are zero. */
static void load_entries(const Problem *p, const double *rows, V *x, int64_t l, int64_t m, int64_t running) {
    int64_t entries = p->width / p->blocks;
    for (int64_t b = 0; b < p->blocks; b++) {
        int64_t row = m + b * LANES;
        for (int64_t i = 0; i < entries; i++)
            x[i * p->blocks + b][l] = !p->terms || (running && row < p->terms) ? rows[row * entries + i] : 0.0;
    }
}

static void store_entries(const Problem *p, double *rows, int64_t stride, const V *x, int64_t l, int64_t m) {
    int64_t entries = p->width / p->blocks;
    for (int64_t b = 0; b < p->blocks; b++) {
        int64_t row = m + b * LANES;
        if (p->terms && row >= p->terms) return;
        for (int64_t i = 0; i < entries; i++) rows[row * stride + i] = x[i * p->blocks + b][l];
    }
}

static void load_lane(const Problem *p, const Pool *pool, Group *g, int64_t l, int64_t m, int64_t running) {
    int64_t width = p->width;
    g->member[l] = running ? m : -1;
    g->running[l] = running ? -1 : 0;
    load_entries(p, pool->z, g->z, l, m, running);
    load_entries(p, pool->rate, g->rates, l, m, running);
    for (int64_t i = 0; p->guarded && i < NODES * width; i++) g->nodes[i][l] = pool->nodes[m * NODES * width + i];
    for (int64_t i = 0; i < NODES; i++) g->node_times[i][l] = pool->node_times[m * NODES + i];
    V *parameters = g->work + p->time + 2;
    for (int64_t i = 0; i < p->parameters; i++) parameters[i][l] = pool->parameters[m * p->parameters + i];
    g->now[l] = pool->now[m];
    g->begin[l] = pool->begin[m];
    g->wanted[l] = pool->wanted[m];
    g->floor[l] = pool->floor[m];
    g->limit[l] = pool->limit[m];
    g->fresh[l] = running && pool->fresh[m] ? -1 : 0;
    g->touching[l] = running && p->contacts && touches(p->contacts, pool->encounters, m) ? -1 : 0;
    bounds(p, g, l, pool->leg[m] <= pool->last_leg[m] ? pool->leg[m] : pool->last_leg[m]);
}

static void store_lane(const Problem *p, const Pool *pool, Group *g, int64_t l) {
    int64_t width = p->width, m = g->member[l];
    store_entries(p, pool->z, width / p->blocks, g->z, l, m);
    store_entries(p, pool->rate, width / p->blocks, g->rates, l, m);
    for (int64_t i = 0; p->guarded && i < NODES * width; i++) pool->nodes[m * NODES * width + i] = g->nodes[i][l];
    for (int64_t i = 0; i < NODES; i++) pool->node_times[m * NODES + i] = g->node_times[i][l];
    pool->now[m] = g->now[l];
    pool->begin[m] = g->begin[l];
    pool->wanted[m] = g->wanted[l];
    pool->tried[m] = g->size[l];
    pool->fresh[m] = g->fresh[l] ? 1 : 0;
    g->member[l] = -1;
    g->running[l] = g->touching[l] = 0;
}

/* -- the method ----------------------------------------------------------------------------------------------------- */

/* Rate of the state in the work array. */
static void evaluate_rate(const Problem *p, Group *g, V time, V *rate) {
    g->work[p->time] = smaller(larger(time, g->low), g->high);
    run_program(&p->motion, g->work);
    for (int64_t i = 0; i < p->width; i++) rate[i] = g->work[p->rate[i]];
    if (any(g->touching)) add_forces(p, g, rate);
    g->evaluations++;
}

/* By what the state in the work array, whose rate or values were evaluated just now, exceeds the constraints. */
static void evaluate_surplus(const Problem *p, Group *g) {
    run_program(&p->drift, g->work);
    run_program(&p->place, g->work);
    run_program(&p->move, g->work);
}

static void find_surplus(const Problem *p, Group *g, V *surplus) {
    evaluate_surplus(p, g);
    for (int64_t i = 0; i < 2 * p->coordinates; i++) surplus[i] = g->work[p->surplus[i]];
}

/* target = base + size * (row of the tableau) . rates; rows have multiples of four terms, padded with zeros. */
static void accumulate(const Problem *p, const Group *g, int64_t row, V size, const V *base, V *target) {
    const Tableau *t = p->tableau;
    int64_t width = p->width;
    for (int64_t j = t->starts[row]; j < t->starts[row + 1]; j += 4) {
        const V *a = g->rates + t->index[j] * width, *b = g->rates + t->index[j + 1] * width;
        const V *c = g->rates + t->index[j + 2] * width, *d = g->rates + t->index[j + 3] * width;
        V wa = t->weights[j] * size, wb = t->weights[j + 1] * size;
        V wc = t->weights[j + 2] * size, wd = t->weights[j + 3] * size;
        for (int64_t i = 0; i < width; i++) target[i] = base[i] + (wa * a[i] + wb * b[i] + wc * c[i] + wd * d[i]);
        base = target;
    }
}

static void combine(const Problem *p, const Group *g, int64_t row, V *target) {
    accumulate(p, g, row, g->size, g->z, target);
}

/* A sum of each realisation: of its lane, or of all lanes. */
INLINE V folded(const Problem *p, V sum) {
    if (!p->terms) return sum;
    double found = 0.0;
    for (int64_t l = 0; l < LANES; l++) found += sum[l];
    return splat(found);
}

/* Size of an entry: of each lane, or of all terms together. */
INLINE V size_of(const Problem *p, const V *x, int64_t i) {
    if (!p->terms) return magnitude(x[i]);
    const V *entry = x + i / p->blocks * p->blocks;
    V sum = splat(0.0);
    for (int64_t b = 0; b < p->blocks; b++) sum += entry[b] * entry[b];
    return root(folded(p, sum));
}

INLINE V scaled_squares(const Problem *p, const Group *g, const V *x) {
    V sum = splat(0.0);
    for (int64_t i = 0; i < p->width; i++) {
        V part = x[i] / (g->floor + p->rtol * size_of(p, g->z, i));
        sum += part * part;
    }
    return folded(p, sum) / (double)(p->width / p->blocks);
}

/* Evaluate the rates of lanes that start anew, and guess the first step of those that have none (II.4 of the book). */
static void start(const Problem *p, Group *g) {
    int64_t width = p->width;
    copy(g->work, g->z, width);
    evaluate_rate(p, g, g->now, g->next);
    for (int64_t i = 0; i < width; i++) g->rates[i] = choose(g->fresh, g->next[i], g->rates[i]);
    Mask unknown = g->fresh & (g->wanted <= splat(0.0));
    g->fresh = (Mask){0};
    if (!any(unknown)) return;
    V size = root(scaled_squares(p, g, g->z)), slope = root(scaled_squares(p, g, g->rates));
    V guess = choose((size < splat(1e-5)) | (slope < splat(1e-5)), splat(1e-6), 0.01 * size / slope);
    guess = smaller(guess, g->end - g->now);
    for (int64_t i = 0; i < width; i++) g->work[i] = g->z[i] + guess * g->rates[i];
    evaluate_rate(p, g, g->now + guess, g->next);
    for (int64_t i = 0; i < width; i++) g->next[i] -= g->rates[i];
    V most = larger(slope, root(scaled_squares(p, g, g->next)) / guess);
    V second = root(root(root(0.01 / larger(most, splat(1e-300)))));
    second = choose(most <= splat(1e-15), larger(splat(1e-6), 1e-3 * guess), second);
    V first = smaller(100.0 * guess, second);
    first = choose(first < splat(1e300), first, 1e-6 * (g->end - g->now));
    g->wanted = choose(unknown, first, g->wanted);
}

static void attempt(const Problem *p, Group *g) {
    int64_t width = p->width;
    for (int64_t stage = 1; stage < STAGES; stage++) {
        combine(p, g, stage, g->work);
        if (stage == STAGES - 1) copy(g->last, g->work, width);
        evaluate_rate(p, g, g->now + p->tableau->moments[stage] * g->size, g->rates + stage * width);
    }
    combine(p, g, ROW_STEP, g->next);
    copy(g->work, g->next, width);
    evaluate_rate(p, g, g->now + g->size, g->rates + STAGES * width);
    V *five = g->dense, *three = g->dense + width, fifth = splat(0.0), third = splat(0.0);
    fill(five, 0.0, 2 * width);
    accumulate(p, g, ROW_FIFTH, splat(1.0), five, five);
    accumulate(p, g, ROW_THIRD, splat(1.0), three, three);
    for (int64_t i = 0; i < width; i++) {
        V scale = 1.0 / (g->floor + p->rtol * larger(size_of(p, g->z, i), size_of(p, g->next, i)));
        V a = five[i] * scale, b = three[i] * scale;
        fifth += a * a;
        third += b * b;
    }
    fifth = folded(p, fifth);
    third = folded(p, third);
    /* where both vanish so does the error; what is not finite stays so */
    g->error = g->size * fifth / root((fifth + 0.01 * third) * p->moving + 1e-300);
}

/* Coefficients of the interpolant of the last attempt. */
static void interpolant(const Problem *p, Group *g) {
    int64_t width = p->width;
    for (int64_t more = 0; more < 3; more++) {
        int64_t stage = STAGES + 1 + more;
        combine(p, g, ROW_MORE + more, g->work);
        evaluate_rate(p, g, g->now + p->tableau->moments[stage] * g->size, g->rates + stage * width);
    }
    fill(g->dense, 0.0, DENSE * width);
    for (int64_t r = 0; r < DENSE; r++) {
        V *part = g->dense + r * width;
        accumulate(p, g, ROW_DENSE + r, g->size, part, part);
    }
}

/* State at a part of the last attempt. */
static void interpolate(const Problem *p, const Group *g, V part, V *target) {
    int64_t width = p->width;
    V rest = 1.0 - part;
    for (int64_t i = 0; i < width; i++) {
        const V *d = g->dense + i;
        V sum = d[(DENSE - 1) * width];
#pragma clang loop unroll(full)
        for (int64_t r = DENSE - 2; r > 0; r -= 2) {
            sum = d[r * width] + part * sum;
            sum = d[(r - 1) * width] + rest * sum;
        }
        target[i] = g->z[i] + part * sum;
    }
}

/* Put the states in the work array onto the constraints. */
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
        rows[l] = (double *)g->last; /* needed no more: room for what is not wanted */
        if (!due[l]) continue;
        double *at = pool->result + column[l]++ * entries;
        rows[l] = at + g->member[l] * stride;
        if (p->terms) store_entries(p, at, stride, g->work, l, g->member[l]);
    }
    if (!p->terms) to_rows(rows, LANES, g->work, p->width);
}

/* Write the interpolated states at the output times up to `last`; `known`: so is the interpolant. */
static void write_outputs(const Problem *p, const Pool *pool, Group *g, Mask taken, V last, int64_t known) {
    int64_t column[LANES];
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
        interpolate(p, g, larger(smaller((moment.all - g->now) / g->size, splat(1.0)), splat(0.0)), g->work);
        if (any(g->touching & due.mask)) {
            g->work[p->time] = smaller(larger(moment.all, g->low), g->high);
            put_on_constraints(p, g, due.mask & g->touching);
            put_on_contacts(p, g, due.mask);
        }
        write_results(p, pool, g, due.mask, column);
    }
    for (int64_t l = 0; l < LANES; l++)
        if (taken[l]) pool->column[g->member[l]] = column[l];
}

/* Lanes whose step leads farther off the constraints than tolerances do. */
static Mask strayed(const Problem *p, const Group *g) {
    int64_t n = p->coordinates;
    V sum = splat(0.0), most = splat(p->surplus_allowed * p->surplus_allowed * p->moving);
    for (int64_t i = 0; i < 2 * n; i++) sum += g->surplus[i] * g->surplus[i];
    Mask doubtful = ~(sum <= most * g->floor * g->floor);
    if (!any(doubtful & g->running)) return (Mask){0};
    sum = splat(0.0);
    for (int64_t i = 0; i < n; i++) {
        V q = g->surplus[i] / (g->floor + p->rtol * magnitude(g->z[i]));
        V v = g->surplus[n + i] / (g->floor + p->rtol * magnitude(g->z[p->velocities + i]));
        sum += q * q + v * v;
    }
    return doubtful & ~(sum <= most);
}

/* Whether stability limits the steps. */
static Mask looks_stiff(const Problem *p, const Group *g) {
    int64_t width = p->width;
    V change = splat(0.0), apart = splat(0.0);
    for (int64_t i = 0; i < width; i++) {
        V a = g->rates[STAGES * width + i] - g->rates[(STAGES - 1) * width + i], b = g->next[i] - g->last[i];
        change += a * a;
        apart += b * b;
    }
    return g->size * root(folded(p, change) / (folded(p, apart) + 1e-300)) > splat(p->stiff);
}

/* Remember the states that were reached. */
static void remember(const Problem *p, Group *g, Mask taken) {
    int64_t width = p->width;
    for (int64_t k = 0; k + 1 < NODES; k++) {
        g->node_times[k] = choose(taken, g->node_times[k + 1], g->node_times[k]);
        for (int64_t i = 0; i < width; i++)
            g->nodes[k * width + i] = choose(taken, g->nodes[(k + 1) * width + i], g->nodes[k * width + i]);
    }
    V *newest = g->nodes + (NODES - 1) * width;
    g->node_times[NODES - 1] = choose(taken, g->now, g->node_times[NODES - 1]);
    for (int64_t i = 0; i < width; i++) newest[i] = choose(taken, g->z[i], newest[i]);
}

/* Go on from the states that were reached, put on the constraints; their rates change by the same little. */
static void accept(const Problem *p, Group *g, Mask taken) {
    int64_t width = p->width, n = p->coordinates;
    const V *reached = g->rates + STAGES * width;
    for (int64_t i = 0; i < width; i++) {
        g->z[i] = choose(taken, g->next[i], g->z[i]);
        g->rates[i] = choose(taken, reached[i], g->rates[i]);
    }
    if (!p->surplus) return;
    for (int64_t i = 0; i < n; i++) {
        V q = g->surplus[i], v = g->surplus[n + i];
        q = choose(taken & (q == q), q, splat(0.0));
        v = choose(taken & (v == v), v, splat(0.0));
        g->z[i] -= q;
        g->z[p->velocities + i] -= v;
        g->rates[i] -= v;
    }
}

/* Choose the sizes of the next steps. */
static void choose_sizes(const Pool *pool, Group *g) {
    for (int64_t l = 0; l < LANES; l++) {
        if (!g->running[l]) {
            g->size[l] = 0.0;
            continue;
        }
        double left = g->end[l] - g->now[l], size = g->wanted[l];
        if (left < size) size = left;
        if (g->bound[l] < size) size = g->bound[l];
        if (g->limit[l] < size) size = g->limit[l];
        if (size > left - 0.1 * size) size = left; /* no tiny last step */
        g->size[l] = size;
        pool->attempts[g->member[l]]++;
    }
}

/* Decide about the attempts of all lanes; the lanes whose steps are taken, and the status of those that wait. */
static Mask decide(const Problem *p, const Pool *pool, Group *g, int64_t *status) {
    V shrink = 0.9 / root(root(root(g->error)));
    Mask taken = {0};
    for (int64_t l = 0; l < LANES; l++) {
        status[l] = RUNNING;
        if (!g->running[l]) continue;
        int64_t m = g->member[l];
        double span = g->end[l] - g->begin[l], now = g->now[l] < 0 ? -g->now[l] : g->now[l];
        double least = 1e-13 * (now > span ? now : span);
        if ((double)pool->attempts[m] > (double)p->attempts + span / g->bound[l]) {
            status[l] = MANY;
        } else if (g->size[l] < least) {
            status[l] = SMALL;
        } else if (g->error[l] < 1.0) {
            taken[l] = -1;
        } else {
            g->wanted[l] = g->size[l] * (g->error[l] < 1e300 && shrink[l] > 0.2 ? shrink[l] : 0.2);
            pool->rejected[m] = 1;
            int64_t most = pool->steps[m] ? p->refusals : 2 * p->refusals; /* the first size is a guess */
            if (++pool->refused[m] % most == 0 && p->guarded) status[l] = REFUSED;
        }
    }
    return taken;
}

/* What follows from a step that was taken: the next size, the end of a leg, the end. */
static int64_t advance_lane(const Problem *p, const Pool *pool, Group *g, int64_t l, double error, int stiff) {
    int64_t m = g->member[l];
    double factor = 5.0;
    if (error > 1e-10) {
        double part = 0.9 / __builtin_sqrt(__builtin_sqrt(__builtin_sqrt(error)));
        if (part < factor) factor = part;
    }
    if (pool->rejected[m] && factor > 1.0) factor = 1.0;
    g->wanted[l] = g->size[l] * factor;
    pool->rejected[m] = pool->refused[m] = pool->trusted[m] = 0;
    pool->steps[m]++;
    if (pool->known[m] < NODES) pool->known[m]++;
    pool->stiff[m] = stiff ? pool->stiff[m] + 1 : 0;
    if (pool->stiff[m] >= p->patience) return STIFF;
    if (g->now[l] < g->end[l] - (g->low[l] - g->begin[l])) return pool->told[m] ? STEPPED : RUNNING;
    int64_t leg = pool->leg[m]++;
    g->now[l] = g->begin[l] = g->end[l];
    pool->attempts[m] = 0;
    if (leg == pool->last_leg[m]) return DONE;
    pool->known[m] = 1;
    g->fresh[l] = -1;
    bounds(p, g, l, leg + 1);
    if (g->wanted[l] > g->end[l] - g->begin[l]) g->wanted[l] = g->end[l] - g->begin[l];
    return p->leg_jumps[leg] ? JUMP : RUNNING;
}

/* Events: go on from parts of the step that were taken, put on the constraints and on contacts that last. */
static void stop(const Problem *p, Group *g, Mask stopped, V until) {
    interpolate(p, g, until, g->work);
    g->work[p->time] = smaller(larger(g->now + until * g->size, g->low), g->high);
    put_on_constraints(p, g, stopped);
    put_on_contacts(p, g, stopped);
    for (int64_t i = 0; i < p->width; i++) g->z[i] = choose(stopped, g->work[i], g->z[i]);
    g->fresh |= stopped;
}

/* Put the states that were reached onto contacts that last; lanes where one has come to rest, and its guard. */
static Mask keep_contacts(const Problem *p, Group *g, Mask taken, V reached, int64_t *happened) {
    copy(g->work, g->z, p->width);
    g->work[p->time] = smaller(larger(reached, g->low), g->high);
    put_on_contacts(p, g, taken);
    Mask stopped = turn_headings(p, g, taken, happened);
    for (int64_t i = 0; i < p->width; i++) g->z[i] = choose(taken & g->touching, g->work[i], g->z[i]);
    g->fresh |= taken & g->touching;
    return stopped;
}

/* Park a lane with an event. */
static int64_t happen(const Pool *pool, Group *g, int64_t l, int64_t happened) {
    int64_t m = g->member[l];
    pool->encounters->happened[m] = happened;
    pool->rejected[m] = pool->refused[m] = 0;
    pool->steps[m]++;
    return EVENT;
}

/* Whether a step might bring more marks than there is room for. */
static int noted_many(const Problem *p, const Pool *pool, int64_t m) {
    int64_t noted = pool->encounters->noted[m];
    return noted && noted > pool->encounters->room - SAMPLES * p->contacts->events;
}

static void step(const Problem *p, const Pool *pool, Group *g, int64_t *status) {
    choose_sizes(pool, g);
    attempt(p, g);
    Mask taken = decide(p, pool, g, status);
    if (!any(taken)) return;
    if (p->surplus) find_surplus(p, g, g->surplus);
    if (p->surplus && p->guarded) {
        Mask astray = strayed(p, g) & taken;
        for (int64_t l = 0; l < LANES; l++) {
            if (!astray[l] || pool->trusted[g->member[l]]) continue;
            taken[l] = 0;
            status[l] = STRAYED;
            g->wanted[l] = g->size[l];
        }
    }
    Mask stiff = looks_stiff(p, g);
    V reached = choose(g->size >= g->end - g->now, g->end, g->now + g->size), last = reached;
    double end = p->times[p->instants - 1];
    for (int64_t l = 0; l < LANES; l++) {
        double off = end - last[l], near = 1e-12 * (end > 1.0 ? end : end < -1.0 ? -end : 1.0);
        if (off < near && -off < near) last[l] = end;
    }
    Mask stopped = {0};
    int64_t watched = p->contacts && pool->encounters->watched, happened[LANES];
    V until = splat(1.0);
    if (watched) {
        interpolant(p, g);
        stopped = find_events(p, g, taken, &until, happened);
        reached = choose(stopped, g->now + until * g->size, reached);
        /* an output time that differs from that of an event by rounding is that of the event */
        last = choose(stopped, reached - 1e-13 * larger(splat(1.0), magnitude(reached)), last);
    }
    write_outputs(p, pool, g, taken, last, watched);
    if (any(stopped)) stop(p, g, stopped, until);
    accept(p, g, taken & ~stopped);
    if (any(g->touching)) stopped |= keep_contacts(p, g, taken & ~stopped, reached, happened);
    g->now = choose(taken, reached, g->now);
    if (p->guarded) remember(p, g, taken);
    for (int64_t l = 0; l < LANES; l++) {
        if (!taken[l]) continue;
        if (stopped[l])
            status[l] = happen(pool, g, l, happened[l]);
        else
            status[l] = advance_lane(p, pool, g, l, g->error[l], stiff[l] != 0);
        if (watched && status[l] == RUNNING && noted_many(p, pool, g->member[l])) status[l] = NOTED;
    }
}

int64_t advance(const Problem *p, const Pool *pool, const int64_t *queue, int64_t count, double *workspace,
                int64_t budget) {
    Group g;
    place(p, &g, workspace);
    g.pool = pool;
    g.work[p->time + 1] = splat(0.0);
    int64_t next = 0, running = 0;
    for (int64_t l = 0; l < LANES; l++) {
        while (next < count && pool->status[queue[next]] != RUNNING) next++;
        /* a lane without a member computes something harmless */
        load_lane(p, pool, &g, l, queue[next < count ? next : 0], next < count);
        running += next < count;
        if (next < count) next++;
    }
    while (running) {
        if (g.evaluations >= budget) {
            for (int64_t l = 0; l < LANES; l++)
                if (g.member[l] >= 0) store_lane(p, pool, &g, l);
            return g.evaluations;
        }
        if (any(g.fresh)) start(p, &g);
        int64_t status[LANES];
        step(p, pool, &g, status);
        for (int64_t l = 0; l < LANES; l++) {
            if (status[l] == RUNNING) continue;
            pool->status[g.member[l]] = status[l];
            store_lane(p, pool, &g, l);
            while (next < count && pool->status[queue[next]] != RUNNING) next++;
            if (next < count)
                load_lane(p, pool, &g, l, queue[next++], 1);
            else
                running--;
        }
    }
    return g.evaluations;
}
