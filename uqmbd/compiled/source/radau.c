/* An attempted step of a Radau method: Newton's iteration, new state, and error estimate. */
#include "group.h"

static const double SLOWEST = 0.9;    /* contraction of the iteration above which the step is refused */
static const double DIVERGED = 1e200; /* error of a step whose iteration does not converge */
static const double SHORTEST = 0.25, SHORTER = 0.8; /* size of the next attempt then, relative to that of this one */
static const double CONTRACTION = 0.07; /* contraction of the iteration that sizes of steps aim at */
static const double GUESSED = 0.03;   /* tolerance of a first iteration, relative to that of the next ones */
static const double SHARE = 0.25;     /* error of a step, relative to its estimate, which is of a lower order */
static const double LONGER = 2.0;     /* most by which the size of a step grows */
static const double LEAST_PIVOT = 1e-9;  /* least pivot, relative to its row */
static const double YIELDING = 1e-12; /* compliance of contacts, as several may hold the same motion */

int64_t implicit_rows(const Problem *p) {
    const Implicit *m = p->implicit;
    int64_t s = m->stages;
    return (4 * s + 1) * p->width + 3 * MATRICES * m->given + s * m->moving + (s * s + 1) * m->entries + 2 * s * m->size;
}

static void place_implicit(const Problem *p, Group *g, V *at) {
    const Implicit *m = p->implicit;
    int64_t s = m->stages, all = s * p->width;
    g->stages = at;
    at += all;
    g->history = at;
    at += all;
    g->changes = at;
    at += all;
    g->slope = at;
    at += p->width;
    g->matrices = at; /* (MATRICES, 3, given) */
    at += 3 * MATRICES * m->given;
    g->inertia = at; /* (moving, stages) */
    at += s * m->moving;
    g->factors = at; /* (entries), then blocks (entries, stages, stages) */
    at += (s * s + 1) * m->entries;
    g->right = at; /* (size, stages) */
    at += s * m->size;
    g->solution = at; /* (size, stages) */
    at += s * m->size;
    g->remainders = at; /* (width, stages) */
}

/* -- linear systems of blocks (s, s) -------------------------------------------------------------------------------- */

/* Invert a block in place.  No pivots are exchanged: A, its inverse, and sums of them with positive factors are positive
   definite in a norm that weighs stages.  A pivot that vanishes in some pose is replaced by a small one: the iteration
   converges with matrices that are a little wrong. */
INLINE void invert_block(const int64_t s, V least, V *block) {
#pragma clang loop unroll(full)
    for (int64_t k = 0; k < s; k++) {
        V pivot = block[k * s + k], inverse = 1.0 / choose(magnitude(pivot) < least, least, pivot);
        block[k * s + k] = splat(1.0);
#pragma clang loop unroll(full)
        for (int64_t j = 0; j < s; j++) block[k * s + j] *= inverse;
#pragma clang loop unroll(full)
        for (int64_t i = 0; i < s; i++) {
            if (i == k) continue;
            V factor = block[i * s + k];
            block[i * s + k] = splat(0.0);
#pragma clang loop unroll(full)
            for (int64_t j = 0; j < s; j++) block[i * s + j] -= factor * block[k * s + j];
        }
    }
}

/* own = own b.  Rows are held in registers.  Blocks may be the same for the compiler, and rows are a loop: otherwise it
   loads whole blocks beforehand, for which there are not enough registers. */
INLINE void multiply_by(const int64_t s, V *own, const V *b) {
#pragma clang loop unroll(disable)
    for (int64_t i = 0; i < s; i++, own += s) {
        V row[MOST_STAGES];
#pragma clang loop unroll(full)
        for (int64_t j = 0; j < s; j++) row[j] = own[0] * b[j];
#pragma clang loop unroll(full)
        for (int64_t k = 1; k < s; k++)
#pragma clang loop unroll(full)
            for (int64_t j = 0; j < s; j++) row[j] += own[k] * b[k * s + j];
#pragma clang loop unroll(full)
        for (int64_t j = 0; j < s; j++) own[j] = row[j];
    }
}

/* to -= a b, of blocks. */
INLINE void subtract_product(const int64_t s, const V *a, const V *b, V *to) {
#pragma clang loop unroll(disable)
    for (int64_t i = 0; i < s; i++, a += s, to += s) {
        V row[MOST_STAGES];
#pragma clang loop unroll(full)
        for (int64_t j = 0; j < s; j++) row[j] = to[j];
#pragma clang loop unroll(full)
        for (int64_t k = 0; k < s; k++)
#pragma clang loop unroll(full)
            for (int64_t j = 0; j < s; j++) row[j] -= a[k] * b[k * s + j];
#pragma clang loop unroll(full)
        for (int64_t j = 0; j < s; j++) to[j] = row[j];
    }
}

/* to -= a x, of a block and columns. */
INLINE void subtract_column(const int64_t s, const V *a, const V *x, V *to) {
#pragma clang loop unroll(full)
    for (int64_t i = 0; i < s; i++) {
        V sum = to[i];
#pragma clang loop unroll(full)
        for (int64_t k = 0; k < s; k++) sum -= a[i * s + k] * x[k];
        to[i] = sum;
    }
}

INLINE void factorise_blocks(const Implicit *m, const int64_t s, const V *least, V *e) {
    const int64_t *target = m->targets, square = s * s;
    for (int64_t k = 0; k < m->size; k++) {
        V *pivot = e + m->pivots[k] * square;
        invert_block(s, least[m->pivot_rows[k]], pivot);
        const int64_t first = m->beside_starts[k], end = m->beside_starts[k + 1];
        for (int64_t b = m->below_starts[k]; b < m->below_starts[k + 1]; b++) {
            V *own = e + m->below[b] * square;
            multiply_by(s, own, pivot);
            for (int64_t j = first; j < end; j++)
                subtract_product(s, own, e + m->beside[j] * square, e + *target++ * square);
        }
    }
}

INLINE void solve_blocks(const Implicit *m, const int64_t s, const V *e, V *right, V *found) {
    const int64_t square = s * s;
    for (int64_t k = 0; k < m->size; k++) {
        const V *pivot = right + m->pivot_rows[k] * s;
        for (int64_t b = m->below_starts[k]; b < m->below_starts[k + 1]; b++)
            subtract_column(s, e + m->below[b] * square, pivot, right + m->below_rows[b] * s);
    }
    for (int64_t k = m->size - 1; k >= 0; k--) {
        V *sum = right + m->pivot_rows[k] * s, *to = found + m->pivot_columns[k] * s;
        for (int64_t j = m->beside_starts[k]; j < m->beside_starts[k + 1]; j++)
            subtract_column(s, e + m->beside[j] * square, found + m->beside_columns[j] * s, sum);
        const V *inverse = e + m->pivots[k] * square;
#pragma clang loop unroll(full)
        for (int64_t i = 0; i < s; i++) {
            V x = inverse[i * s] * sum[0];
#pragma clang loop unroll(full)
            for (int64_t j = 1; j < s; j++) x += inverse[i * s + j] * sum[j];
            to[i] = x;
        }
    }
}

static void factorise_single(const Implicit *m, const V *least, V *e) { factorise_blocks(m, 1, least, e); }
static void solve_single(const Implicit *m, const V *e, V *right, V *found) { solve_blocks(m, 1, e, right, found); }

/* -- matrices ------------------------------------------------------------------------------------------------------- */

/* Accelerations and multipliers of lanes with persistent contacts, at the state in the work array. */
static void solve_contacts(const Problem *p, Group *g) {
    const Implicit *m = p->implicit;
    Lane s = lane_of(p->contacts, g);
    run_program(&p->contacts->contact, g->work);
    respond(p, g, g->touching);
    for (int64_t l = 0; l < LANES; l++) {
        if (!g->touching[l]) continue;
        answer(p, g, l, &s);
        find_forces(p, g, l, &s);
        for (int64_t i = 0; i < p->coordinates + m->multipliers; i++) {
            double sum = change_of(p, g, l, i, -1);
            for (int64_t j = 0; j < s.count; j++) sum += change_of(p, g, l, i, s.active[j]) * s.force[j];
            g->work[m->solution[i]][l] = sum;
        }
    }
}

/* Put the persistent contacts of lanes into one of the matrices of a step.  Open contacts have forces of zero; the
   headings of those that slip are held. */
static void add_contacts(const Problem *p, Group *g, V *inertia, V *plain) {
    const Implicit *m = p->implicit;
    const Contacts *c = p->contacts;
    int64_t n = p->coordinates;
    for (int64_t d = 0; d < c->directions; d++) plain[m->alone[d]] = splat(1.0);
    for (int64_t l = 0; l < LANES; l++) {
        if (!g->touching[l]) continue;
        const int64_t *mode = g->pool->encounters->mode + g->member[l] * c->events;
        const double *heading = g->pool->encounters->heading + g->member[l] * c->directions;
        for (int64_t k = 0; k < c->events; k++) {
            int64_t first = c->first[k], end = c->first[k + 1];
            int64_t held = mode[k] == STICK ? end : mode[k] == OPEN ? first : first + 1;
            for (int64_t d = first; d < held; d++) {
                plain[m->alone[d]][l] = -YIELDING;
                for (int64_t i = 0; i < n; i++) {
                    if (m->along[d * n + i] < 0) continue;
                    double slope = g->work[c->slope[d * n + i]][l], force = slope;
                    for (int64_t t = first + 1; mode[k] == SLIP && t < end; t++)
                        force -= g->work[c->law[2 * k + 1]][l] * heading[t] * g->work[c->slope[t * n + i]][l];
                    inertia[m->along[d * n + i]][l] = slope;
                    plain[m->across[d * n + i]][l] = -force;
                }
            }
        }
    }
}

/* Evaluate one of the matrices of a step, at the state in the work array. */
static void evaluate_matrix(const Problem *p, Group *g, V time, int64_t number) {
    const Implicit *m = p->implicit;
    V *inertia = g->matrices + 3 * number * m->given, *plain = inertia + m->given, *stiffness = plain + m->given;
    g->work[p->time] = smaller(larger(time, g->low), g->high);
    run_program(&m->motion, g->work);
    if (any(g->touching)) solve_contacts(p, g);
    run_program(&m->gradients, g->work);
    for (int64_t i = 0; i < m->given; i++) {
        inertia[i] = m->inertia[i] < 0 ? splat(1.0) : g->work[m->inertia[i]];
        plain[i] = g->work[m->plain[i]];
        stiffness[i] = g->work[m->stiffness[i]];
    }
    if (m->along) add_contacts(p, g, inertia, plain);
    g->evaluations += 4;
}

/* One kind of entries, interpolated at the stages from the matrices of a step. */
INLINE void interpolate_entry(const Implicit *m, const int64_t s, const V *given, V *found) {
    V values[MATRICES];
#pragma clang loop unroll(full)
    for (int64_t k = 0; k < MATRICES; k++) values[k] = given[3 * k * m->given];
#pragma clang loop unroll(full)
    for (int64_t r = 0; r < s; r++) {
        V sum = m->between[r * MATRICES] * values[0];
#pragma clang loop unroll(full)
        for (int64_t k = 1; k < MATRICES; k++) sum += m->between[r * MATRICES + k] * values[k];
        found[r] = sum;
    }
}

/* Blocks of the systems of the stages; entries that are not given, but arise in the elimination, are zero. */
INLINE void put_blocks(const Implicit *m, Group *g, const int64_t s, V size, V *blocks) {
    const int64_t square = s * s;
    const V over = 1.0 / size;
    fill(blocks + m->given * square, 0.0, (m->entries - m->given) * square);
    for (int64_t i = 0; i < m->given; i++) {
        V *block = blocks + i * square;
        V plain[MOST_STAGES], stiffness[MOST_STAGES];
        const V *first = g->matrices + i;
        interpolate_entry(m, s, first + m->given, plain);
        interpolate_entry(m, s, first + 2 * m->given, stiffness);
#pragma clang loop unroll(full)
        for (int64_t r = 0; r < s; r++) {
            const V b = stiffness[r] * size;
#pragma clang loop unroll(full)
            for (int64_t k = 0; k < s; k++)
                block[r * s + k] = r == k ? m->matrix[r * s + k] * b + plain[r] : m->matrix[r * s + k] * b;
        }
        if (i >= m->moving) continue;
        V *inertia = g->inertia + i * s;
        interpolate_entry(m, s, first, inertia);
#pragma clang loop unroll(full)
        for (int64_t r = 0; r < s; r++) {
            const V a = inertia[r] * over;
#pragma clang loop unroll(full)
            for (int64_t k = 0; k < s; k++) block[r * s + k] += m->inverse[r * s + k] * a;
        }
    }
}

/* Factors of all systems for steps of these sizes. */
INLINE void factorise_systems(const Problem *p, Group *g, const int64_t s, V size) {
    const Implicit *m = p->implicit;
    const V *first = g->matrices, *plain = first + m->given, *stiffness = plain + m->given;
    V eta = m->eigenvalue / size, over = 1.0 / eta, *blocks = g->factors + m->entries;
    fill(g->factors + m->given, 0.0, m->entries - m->given);
    for (int64_t i = 0; i < m->given; i++) g->factors[i] = eta * first[i] + plain[i] + over * stiffness[i];
    /* sizes of the rows, which are far from those of the entries after elimination, but not by orders of 1e8 */
    V *least = g->right;
    over = 1.0 / size;
    fill(least, 0.0, m->size);
    for (int64_t i = 0; i < m->given; i++) {
        V x = over * magnitude(first[i]) + magnitude(plain[i]) + size * magnitude(stiffness[i]);
        least[m->rows[i]] = larger(LEAST_PIVOT * x, least[m->rows[i]]);
    }
    factorise_single(m, least, g->factors);
    put_blocks(m, g, s, size, blocks);
    factorise_blocks(m, s, least, blocks);
}

/* Solve (eta - J) x = r; r and x have the entries of a state. */
static void solve_filter(const Problem *p, Group *g, V size, const V *r, V *x) {
    const Implicit *m = p->implicit;
    int64_t n = p->coordinates, differential = n + m->states;
    const V *inertia = g->matrices, *stiffness = inertia + 2 * m->given;
    V over = size / m->eigenvalue;
    fill(g->right, 0.0, m->size);
    for (int64_t i = 0; i < m->given; i++) {
        int64_t c = m->columns[i];
        if (c < n)
            g->right[m->rows[i]] += inertia[i] * r[p->velocities + c] - over * stiffness[i] * r[c];
        else if (m->inertia[i] < 0)
            g->right[m->rows[i]] += r[c];
    }
    solve_single(m, g->factors, g->right, g->solution);
    for (int64_t i = 0; i < n; i++) {
        x[i] = over * (g->solution[i] + r[i]);
        x[p->velocities + i] = g->solution[i];
    }
    for (int64_t i = n; i < differential; i++) x[i] = g->solution[i];
}

/* Solve the systems of all stages: what they are to be changed by, for remainders (width, stages).  Those of coordinates
   vanish, as stages of coordinates follow from those of velocities. */
INLINE void solve_stages(const Problem *p, Group *g, const int64_t s, V size, V *x) {
    const Implicit *m = p->implicit;
    const int64_t n = p->coordinates, differential = n + m->states, width = p->width;
    const V *r = g->remainders, *inertia = g->inertia;
    V *right = g->right, *found = g->solution;
    fill(right, 0.0, s * m->size);
    for (int64_t i = 0; i < m->moving; i++, inertia += s) {
        const int64_t c = m->columns[i];
        const V *from = r + (c < n ? p->velocities + c : c) * s;
        V *to = right + m->rows[i] * s;
#pragma clang loop unroll(full)
        for (int64_t k = 0; k < s; k++) to[k] += inertia[k] * from[k];
    }
    solve_blocks(m, s, g->factors + m->entries, right, found);
    for (int64_t i = 0; i < n; i++, found += s)
#pragma clang loop unroll(full)
        for (int64_t k = 0; k < s; k++) {
            V sum = m->matrix[k * s] * found[0];
#pragma clang loop unroll(full)
            for (int64_t j = 1; j < s; j++) sum += m->matrix[k * s + j] * found[j];
            x[k * width + i] = size * sum;
            x[k * width + p->velocities + i] = found[k];
        }
    for (int64_t i = n; i < differential; i++, found += s)
        for (int64_t k = 0; k < s; k++) x[k * width + i] = found[k];
}

/* -- stages --------------------------------------------------------------------------------------------------------- */

/* Weights of the stages in the polynomial through them and the begin of the step, at a part of it. */
static void stage_weights(const Implicit *m, V part, V *weights) {
    for (int64_t j = 0; j < m->stages; j++) {
        V product = part / m->nodes[j];
        for (int64_t k = 0; k < m->stages; k++)
            if (k != j) product *= (part - m->nodes[k]) / (m->nodes[j] - m->nodes[k]);
        weights[j] = product;
    }
}

/* State at a part of the last attempt, of all lanes, or of lane l in all of them. */
INLINE void interpolate_stages(const Problem *p, const Group *g, int64_t l, V part, V *target) {
    const Implicit *m = p->implicit;
    int64_t width = p->width;
    V weights[MOST_STAGES];
    stage_weights(m, part, weights);
    for (int64_t i = 0; i < width; i++) {
        V sum = of_lane(g->base + i, l);
        for (int64_t j = 0; j < m->stages; j++) sum += weights[j] * of_lane(g->stages + j * width + i, l);
        target[i] = sum;
    }
}

/* Stages from what the polynomial of the step before changes by after its end; zero without one. */
static void predict(const Problem *p, Group *g, V size) {
    const Implicit *m = p->implicit;
    int64_t width = p->width;
    Mask known = g->before > splat(0.0);
    const V *last = g->history + (m->stages - 1) * width;
    for (int64_t s = 0; s < m->stages; s++) {
        V weights[MOST_STAGES], *stage = g->stages + s * width;
        stage_weights(m, 1.0 + m->nodes[s] * size / choose(known, g->before, splat(1.0)), weights);
        for (int64_t i = 0; i < width; i++) {
            V sum = -last[i];
            for (int64_t j = 0; j < m->stages; j++) sum += weights[j] * g->history[j * width + i];
            stage[i] = choose(known, sum, splat(0.0));
        }
    }
}

/* Stages of coordinates from those of velocities. */
static void integrate_stages(const Problem *p, Group *g, V size) {
    const Implicit *m = p->implicit;
    int64_t width = p->width, stages = m->stages;
    for (int64_t s = 0; s < stages; s++)
        for (int64_t i = 0; i < p->coordinates; i++) {
            V sum = splat(0.0), speed = g->base[p->velocities + i];
            for (int64_t j = 0; j < stages; j++)
                sum += m->matrix[s * stages + j] * (speed + g->stages[j * width + p->velocities + i]);
            g->stages[s * width + i] = size * sum;
        }
}

/* One iteration: the changes of all stages, and their size in tolerances. */
INLINE V iterate(const Problem *p, Group *g, const int64_t s, V size) {
    const Implicit *m = p->implicit;
    const int64_t width = p->width;
    V *rates = g->rates + width, *left = g->remainders, over = 1.0 / size, sum = splat(0.0);
    const V *stages = g->stages, *changes = g->changes;
    for (int64_t k = 0; k < s; k++) {
        const V *stage = stages + k * width;
        for (int64_t i = 0; i < width; i++) g->work[i] = g->base[i] + stage[i];
        evaluate_rate(p, g, g->now + m->nodes[k] * size, rates + k * width);
    }
    for (int64_t i = p->coordinates; i < width; i++) {
        V own[MOST_STAGES];
#pragma clang loop unroll(full)
        for (int64_t j = 0; j < s; j++) own[j] = over * stages[j * width + i];
#pragma clang loop unroll(full)
        for (int64_t k = 0; k < s; k++) {
            V part = rates[k * width + i];
#pragma clang loop unroll(full)
            for (int64_t j = 0; j < s; j++) part -= m->inverse[k * s + j] * own[j];
            left[i * s + k] = part;
        }
    }
    solve_stages(p, g, s, size, g->changes);
    for (int64_t i = 0; i < width; i++) {
        V squares = splat(0.0), scale = 1.0 / (g->floor + p->rtol * g->sizes[i]);
#pragma clang loop unroll(full)
        for (int64_t k = 0; k < s; k++) squares += changes[k * width + i] * changes[k * width + i];
        sum += squares * scale * scale;
    }
    return root(sum / (p->moving * (double)s));
}

/* The third root of numbers from 1e-30 to 1e30. */
static V third_root(V x) {
    V quarter = root(root(x)), y = quarter * root(root(quarter));
    for (int64_t k = 0; k < 6; k++) y = (2.0 * y + x / (y * y)) * (1.0 / 3.0);
    return y;
}

/* Factor by which the next step may be longer, from an error in tolerances. */
static V growth_of(const Implicit *m, V error) {
    V x = root(smaller(larger(error, splat(1e-12)), splat(1e12)));
    return 0.9 / (m->stages == 3 ? root(x) : third_root(x));
}

/* Size of the estimated error of the stages; `slope` is a rate at the begin. */
static V estimate(const Problem *p, Group *g, V size, const V *slope, V *error) {
    const Implicit *m = p->implicit;
    int64_t width = p->width;
    V eta = m->eigenvalue / size, *right = g->rates + width, sum = splat(0.0);
    for (int64_t i = 0; i < width; i++) {
        V x = splat(0.0);
        for (int64_t s = 0; s < m->stages; s++) x += m->error[s] * g->stages[s * width + i];
        right[i] = slope[i] + eta * x;
    }
    solve_filter(p, g, size, right, error);
    for (int64_t i = 0; i < width; i++) {
        V part = error[i] / (g->floor + p->rtol * g->sizes[i]);
        sum += part * part;
    }
    return SHARE * root(sum / p->moving);
}

INLINE void attempt_stages(const Problem *p, Group *g, const int64_t s) {
    const Implicit *m = p->implicit;
    int64_t width = p->width;
    V size = choose(g->size > splat(0.0), g->size, splat(1.0));
    copy(g->base, g->z, width);
    find_sizes(p, g, g->base, 0);
    predict(p, g, size);
    copy(g->work, g->z, width);
    evaluate_matrix(p, g, g->now, 0);
    for (int64_t i = 0; i < width; i++) g->rates[i] = g->work[m->rate[i]];
    for (int64_t k = 1; k < MATRICES; k++) {
        V part = splat((double)k / (MATRICES - 1));
        interpolate_stages(p, g, -1, part, g->work);
        evaluate_matrix(p, g, g->now + part * size, k);
    }
    integrate_stages(p, g, size);
    factorise_systems(p, g, s, size);
    Mask open = g->running, done = {0};
    V before = splat(0.0), contraction = g->contraction, count = splat(0.0), slowest = splat(1e-6);
    for (int64_t k = 0; k < m->iterations && any(open); k++) {
        V change = iterate(p, g, s, size);
        Mask tried = open;
        if (k) {
            contraction = choose(open, change / before, contraction);
            /* smaller changes may be rounding, whose contraction says nothing about the size */
            if (k < 3) slowest = choose(open & (change > splat(m->tolerance)), larger(contraction, slowest), slowest);
            open &= contraction < splat(k > 1 ? SLOWEST : 2.0);
        }
        slowest = choose(tried & ~(change < splat(DIVERGED)), splat(DIVERGED), slowest);
        open &= change < splat(DIVERGED);
        for (int64_t i = 0; i < s * width; i++) g->stages[i] += choose(open, g->changes[i], splat(0.0));
        /* what is left: the changes to come, as a geometric series */
        V left = choose(contraction < splat(SLOWEST), change * contraction / (1.0 - contraction), splat(DIVERGED));
        /* the contraction of a step before is a guess */
        Mask enough = open & ((left <= splat(k ? m->tolerance : GUESSED * m->tolerance)) | (change <= splat(1e-3 * m->tolerance)));
        count = choose(open, count + 1.0, count);
        done |= enough;
        open &= ~enough;
        V more = left;
        for (int64_t i = k + 1; i < m->iterations; i++) more *= contraction;
        if (k > 1) open &= more <= splat(m->tolerance); /* otherwise there are not enough iterations left */
        before = change;
    }
    /* slower than it seems from small changes, which are rounding */
    g->contraction = choose(done, smaller(larger(contraction, splat(1e-3)), splat(0.5)), splat(0.5));
    V *error = g->changes;
    V found = estimate(p, g, size, g->rates, error);
    Mask much = done & ~(found < splat(1.0));
    if (any(much)) { /* stiff parts of a large error are smaller than they seem */
        for (int64_t i = 0; i < width; i++) g->work[i] = g->base[i] + error[i];
        evaluate_rate(p, g, g->now, g->slope);
        V less = estimate(p, g, size, g->slope, error);
        found = choose(much & (less == less), less, found);
    }
    double most = (double)m->iterations;
    V growth = growth_of(m, found) * (2.0 * most + 1.0) / (2.0 * most + count);
    g->error = choose(done, choose(found == found, found, splat(DIVERGED)), splat(DIVERGED));
    /* The matrices are those of extrapolated stages.  Their error, and so the contraction, grows with a high power of
       the size.  Accepted steps do not shrink: a contraction that rounding causes does not fall with the size. */
    V possible = smaller(root(third_root(CONTRACTION / smaller(slowest, splat(1e6)))), splat(LONGER));
    V again = smaller(larger(possible, splat(SHORTEST)), splat(SHORTER));
    g->growth = choose(g->error < splat(DIVERGED), smaller(growth, larger(possible, splat(1.0))), again);
    const V *last = g->stages + (m->stages - 1) * width;
    for (int64_t i = 0; i < width; i++) g->work[i] = g->next[i] = g->base[i] + last[i];
    if (!p->surplus) return;
    g->work[p->time] = smaller(larger(g->now + size, g->low), g->high);
    run_program(&p->values, g->work);
}

static void attempt_three(const Problem *p, Group *g) { attempt_stages(p, g, 3); }

static void attempt_five(const Problem *p, Group *g) { attempt_stages(p, g, 5); }

static __attribute__((noinline)) void attempt_implicit(const Problem *p, Group *g) {
    if (p->implicit->stages == 3)
        attempt_three(p, g);
    else
        attempt_five(p, g);
}

/* Keep the stages of steps that were taken, for the next ones. */
static void keep_stages(const Problem *p, Group *g, Mask taken) {
    for (int64_t i = 0; i < p->implicit->stages * p->width; i++)
        g->history[i] = choose(taken, g->stages[i], g->history[i]);
    g->before = choose(taken, g->size, g->before);
}
