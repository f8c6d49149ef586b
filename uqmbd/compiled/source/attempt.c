/* An attempted step: stages, new state, and error estimate. */
#include "group.h"

/* Rate of the state in the work array, of what is stepped. */
static void evaluate_rate(const Problem *p, Group *g, V time, V *rate) {
    g->work[p->time] = smaller(larger(time, g->low), g->high);
    run_program(&p->motion, g->work);
    for (int64_t i = 0; i < p->width; i++) rate[i] = g->work[p->rate[i]];
    if (any(g->touching)) add_forces(p, g, rate);
    turn_rate(p, g, g->work, rate);
    g->evaluations++;
}

/* Constraint residuals of the state in the work array, whose rate or values were just evaluated. */
static void evaluate_surplus(const Problem *p, Group *g) {
    run_program(&p->drift, g->work);
    run_program(&p->place, g->work);
    run_program(&p->move, g->work);
}

static void find_surplus(const Problem *p, Group *g, V *surplus) {
    evaluate_surplus(p, g);
    for (int64_t i = 0; i < 2 * p->coordinates; i++) surplus[i] = g->work[p->surplus[i]];
}

/* target = base + size * (row of the tableau) . rates, without a base where there is none; rows have multiples of four
   terms, padded with zeros. */
static void accumulate(const Problem *p, const Group *g, int64_t row, V size, const V *base, V *target) {
    const Tableau *t = p->tableau;
    int64_t width = p->width;
    for (int64_t j = t->starts[row]; j < t->starts[row + 1]; j += 4) {
        const V *a = g->rates + t->index[j] * width, *b = g->rates + t->index[j + 1] * width;
        const V *c = g->rates + t->index[j + 2] * width, *d = g->rates + t->index[j + 3] * width;
        V wa = t->weights[j] * size, wb = t->weights[j + 1] * size;
        V wc = t->weights[j + 2] * size, wd = t->weights[j + 3] * size;
        if (base)
            for (int64_t i = 0; i < width; i++) target[i] = base[i] + (wa * a[i] + wb * b[i] + wc * c[i] + wd * d[i]);
        else
            for (int64_t i = 0; i < width; i++) target[i] = wa * a[i] + wb * b[i] + wc * c[i] + wd * d[i];
        base = target;
    }
}

static void combine(const Problem *p, const Group *g, int64_t row, V *target) {
    accumulate(p, g, row, g->size, g->base, target);
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

/* Sizes of the entries of what is stepped, none smaller than those that are known if `more`.  That of an angular
   velocity is that of the vector, whatever the axes of the body are. */
static void find_sizes(const Problem *p, Group *g, const V *y, int more) {
    V *sizes = g->sizes;
    for (int64_t i = 0; i < p->width; i++) sizes[i] = more ? larger(sizes[i], size_of(p, y, i)) : size_of(p, y, i);
    for (int64_t b = 0; b < p->turning; b++) {
        int64_t first = p->velocities + p->turns[b];
        V speed = length_of(p->turn, y + first);
        for (int64_t i = first; i < first + p->turn; i++) sizes[i] = larger(sizes[i], speed);
    }
}

INLINE V scaled_squares(const Problem *p, const Group *g, const V *x) {
    V sum = splat(0.0);
    for (int64_t i = 0; i < p->width; i++) {
        V part = x[i] / (g->floor + p->rtol * g->sizes[i]);
        sum += part * part;
    }
    return folded(p, sum) / (double)(p->width / p->blocks);
}

/* Evaluate the rates of restarted lanes, and estimate the first step of those without one (II.4 of the book). */
static void start(const Problem *p, Group *g) {
    int64_t width = p->width;
    copy(g->work, g->z, width);
    for (int64_t b = 0; b < p->turning; b++) {
        g->lengths[b] = length_of(p->turn, g->z + p->turns[b]);
        g->shrink[b] = splat(1.0);
    }
    if (p->implicit) {
        g->before = choose(g->fresh, splat(0.0), g->before);
        g->contraction = choose(g->fresh, splat(0.5), g->contraction);
        if (!any(g->fresh & (g->wanted <= splat(0.0)))) {
            g->fresh = (Mask){0};
            return;
        }
    }
    evaluate_rate(p, g, g->now, g->next);
    for (int64_t i = 0; i < width; i++) g->rates[i] = choose(g->fresh, g->next[i], g->rates[i]);
    Mask unknown = g->fresh & (g->wanted <= splat(0.0));
    g->fresh = (Mask){0};
    if (!any(unknown)) return;
    copy(g->base, g->z, width);
    from_state(p, g->base);
    find_sizes(p, g, g->base, 0);
    V size = root(scaled_squares(p, g, g->base)), slope = root(scaled_squares(p, g, g->rates));
    V guess = choose((size < splat(1e-5)) | (slope < splat(1e-5)), splat(1e-6), 0.01 * size / slope);
    guess = smaller(guess, g->end - g->now);
    for (int64_t i = 0; i < width; i++) g->work[i] = g->base[i] + guess * g->rates[i];
    to_state(p, g, g->work);
    evaluate_rate(p, g, g->now + guess, g->next);
    for (int64_t i = 0; i < width; i++) g->next[i] -= g->rates[i];
    V most = larger(slope, root(scaled_squares(p, g, g->next)) / guess);
    V second = root(root(0.01 / larger(most, splat(1e-300))));
    if (!p->implicit) second = root(second);
    second = choose(most <= splat(1e-15), larger(splat(1e-6), 1e-3 * guess), second);
    V first = smaller(100.0 * guess, second);
    first = choose(first < splat(1e300), first, 1e-6 * (g->end - g->now));
    g->wanted = choose(unknown, first, g->wanted);
}

static void attempt(const Problem *p, Group *g) {
    int64_t width = p->width;
    copy(g->base, g->z, width);
    from_state(p, g->base);
    for (int64_t stage = 1; stage < STAGES; stage++) {
        combine(p, g, stage, g->work);
        if (stage == STAGES - 1) copy(g->last, g->work, width);
        to_stage(p, g, g->work);
        evaluate_rate(p, g, g->now + p->tableau->moments[stage] * g->size, g->rates + stage * width);
    }
    combine(p, g, ROW_STEP, g->next);
    copy(g->work, g->next, width);
    to_state(p, g, g->work);
    evaluate_rate(p, g, g->now + g->size, g->rates + STAGES * width);
    V *five = g->dense, *three = g->dense + width, fifth = splat(0.0), third = splat(0.0);
    accumulate(p, g, ROW_FIFTH, splat(1.0), 0, five);
    accumulate(p, g, ROW_THIRD, splat(1.0), 0, three);
    find_sizes(p, g, g->base, 0);
    find_sizes(p, g, g->next, 1);
    for (int64_t i = 0; i < width; i++) {
        V scale = 1.0 / (g->floor + p->rtol * g->sizes[i]);
        V a = five[i] * scale, b = three[i] * scale;
        fifth += a * a;
        third += b * b;
    }
    fifth = folded(p, fifth);
    third = folded(p, third);
    /* if both vanish, so does the error; NaN and infinity are preserved */
    g->error = g->size * fifth / root((fifth + 0.01 * third) * p->moving + 1e-300);
}

/* Whether stability limits the steps: their size times a rate of the equations, from the last two stages.

   Without auxiliary states, changes of accelerations follow from those of positions and of velocities, a = K q + C v.
   Then neither an oscillation nor a decay has a rate below both |a| / |v| and root(|a| / |q|), for every phase.  With
   auxiliary states, the ratio of all changes is used, which depends on the phase. */
static Mask looks_stiff(const Problem *p, const Group *g) {
    int64_t width = p->width, n = p->coordinates, first = p->velocities;
    V places = splat(0.0), speeds = splat(0.0), states = splat(0.0), change = splat(0.0), other = splat(0.0);
    for (int64_t i = 0; i < width; i++) {
        V a = g->rates[STAGES * width + i] - g->rates[(STAGES - 1) * width + i], b = g->next[i] - g->last[i];
        if (i < n)
            places += b * b;
        else if (i < first)
            states += b * b;
        else
            speeds += b * b;
        if (i < first)
            other += a * a;
        else
            change += a * a;
    }
    places = folded(p, places);
    speeds = folded(p, speeds);
    change = folded(p, change);
    V rate = smaller(change / (speeds + 1e-300), root(change / (places + 1e-300)));
    if (first > n) rate = (change + folded(p, other)) / (places + speeds + folded(p, states) + 1e-300);
    return g->size * root(rate) > splat(p->stiff);
}

/* Count a step; whether there were enough that look stiff: in a row, or, for an early decision, without CALM others in
   a row between them.  Where stability limits the steps, their sizes vary about the limit. */
static int count_stiff(const Problem *p, const Pool *pool, int64_t m, int stiff, int shortened) {
    int64_t *count = pool->stiff + m, calm = p->early ? CALM : 1;
    if (stiff)
        *count = (*count / calm + 1) * calm;
    else if (!shortened && *count && (calm == 1 || ++*count % calm == 0))
        *count = 0;
    return *count / calm >= p->patience;
}

/* Count refused attempts that look stiff.  Fast motions may decay in shorter steps, which then do not look stiff: the
   next one is longer, unstable, and refused.  Sizes before the first step are guesses. */
static void count_refused(const Problem *p, const Pool *pool, const Group *g, Mask stiff, int64_t *status) {
    for (int64_t l = 0; l < LANES; l++)
        if (g->running[l] && stiff[l] && status[l] == RUNNING && pool->steps[g->member[l]] &&
            count_stiff(p, pool, g->member[l], 1, 0))
            status[l] = STIFF;
}
