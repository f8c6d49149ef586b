#include "assembly.h"

static const double CLOSED = 1e-12;     /* residual, over the length of its gradient and the size of the mechanism */
static const double TURN = 0.3;         /* largest change of a quaternion's entry: beyond, the linearisation is invalid */
static const double DEPENDENT = 1e-14;  /* squared length, of 1, that is left of a row that is independent */
static const double FOLLOWS = 1e-13;    /* ... of one that may follow from others: below it does, */
static const double ALONE = 1e-7;       /* above it does not */
static const double KEPT = 1e-11;       /* what speeds may leave of an equation, of the largest right-hand side or 1 */

enum { STEPS = 200, HALVINGS = 14 };

/* Data of the equations of eight realisations. */
typedef struct {
    V *work, *entries, *lengths, *residuals, *right, *lower, *inverses, *column, *x, *change, *trial;
} Memory;

int64_t assembly_memory(const Equations *e) {
    return e->rows + e->entries + 3 * e->equations + e->lower + 2 * e->solved + 3 * e->unknowns;
}

static Memory places(const Equations *e, V *memory) {
    Memory m;
    m.work = memory;
    m.entries = m.work + e->rows;
    m.lengths = m.entries + e->entries;
    m.residuals = m.lengths + e->equations;
    m.right = m.residuals + e->equations;
    m.lower = m.right + e->equations;
    m.inverses = m.lower + e->lower;
    m.column = m.inverses + e->solved;
    m.x = m.column + e->solved;
    m.change = m.x + e->unknowns;
    m.trial = m.change + e->unknowns;
    return m;
}

INLINE V value(const Equations *e, const Memory *m, int64_t row) {
    return e->values[row] < 0 ? splat(0.0) : m->work[e->values[row]];
}

/* Lengths of the gradients, of lanes that are `wanted`. */
static void measure(const Equations *e, const Memory *m, Mask wanted) {
    for (int64_t i = 0; i < e->equations; i++) {
        V sum = splat(0.0);
        for (int64_t k = e->starts[i]; k < e->starts[i + 1]; k++) {
            V entry = m->work[e->from[k]] * e->factors[k];
            sum += entry * entry;
        }
        sum = root(sum);
        m->lengths[i] = choose(wanted, choose(sum > e->shortest, sum, splat(1.0)), m->lengths[i]);
    }
}

/* Gradients of length one, and the triangle of their products: L D L^T = A A^T, without exchanges, which the product of a
   matrix with its transpose does not need.  Rows that follow from others count for nothing.  Lanes in which that is
   doubtful, or certain rows are dependent. */
static Mask factorise(const Equations *e, const Memory *m) {
    for (int64_t i = 0; i < e->equations; i++) {
        V inverse = splat(1.0) / m->lengths[i];
        for (int64_t k = e->starts[i]; k < e->starts[i + 1]; k++)
            m->entries[k] = m->work[e->from[k]] * e->factors[k] * inverse;
    }
    Mask doubtful = (Mask)splat(0.0);
    V *column = m->column;
    for (int64_t j = 0; j < e->solved; j++) {
        int64_t begin = e->first[j], end = e->first[j + 1];
        for (int64_t p = begin; p < end; p++) column[e->below[p]] = splat(0.0);
        for (int64_t k = e->starts[j]; k < e->starts[j + 1]; k++)
            for (int64_t o = e->next[k]; o < e->ends[k]; o++)
                column[e->rows_of[o]] += m->entries[k] * m->entries[e->others[o]];
        for (int64_t c = e->changes[j]; c < e->changes[j + 1]; c++) {
            int64_t place = e->places[c], owner = e->owners[c], last = e->first[owner + 1];
            V factor = m->lower[place] * m->lower[e->first[owner]];
            for (int64_t p = place; p < last; p++) column[e->below[p]] -= factor * m->lower[p];
        }
        V pivot = column[j], inverse = splat(1.0) / pivot;
        if (j < e->certain) {
            doubtful |= ~(pivot > DEPENDENT);
        } else {
            Mask follows = pivot < FOLLOWS;
            doubtful |= ~(follows | (pivot > ALONE));
            inverse = choose(follows, splat(0.0), inverse);
        }
        m->lower[begin] = pivot;
        m->inverses[j] = inverse;
        for (int64_t p = begin + 1; p < end; p++) m->lower[p] = column[e->below[p]] * inverse;
    }
    return doubtful;
}

/* Add the x of the least norm with A x = right, which is overwritten. */
static void add_least(const Equations *e, const Memory *m, V *right, V *x) {
    for (int64_t j = 0; j < e->solved; j++)
        for (int64_t p = e->first[j] + 1; p < e->first[j + 1]; p++) right[e->below[p]] -= m->lower[p] * right[j];
    for (int64_t j = e->solved - 1; j >= 0; j--) {
        V sum = right[j] * m->inverses[j];
        for (int64_t p = e->first[j] + 1; p < e->first[j + 1]; p++) sum -= m->lower[p] * right[e->below[p]];
        right[j] = sum;
        for (int64_t k = e->starts[j]; k < e->starts[j + 1]; k++)
            if (e->columns[k] >= 0) x[e->columns[k]] += m->entries[k] * sum;
    }
}

/* `right` minus A x of the first equations. */
static void defects(const Equations *e, const Memory *m, const V *right, const V *x, int64_t count, V *found) {
    for (int64_t i = 0; i < count; i++) {
        V sum = right[i];
        for (int64_t k = e->starts[i]; k < e->starts[i + 1]; k++)
            if (e->columns[k] >= 0) sum -= m->entries[k] * x[e->columns[k]];
        found[i] = sum;
    }
}

/* Values divided by the lengths of their gradients: displacements. */
static void displacements(const Equations *e, const Memory *m, V *found) {
    for (int64_t i = 0; i < e->equations; i++) found[i] = value(e, m, i) / m->lengths[i];
}

/* Shorten changes that turn a body too far. */
static void bound(const Equations *e, const Turns *turns, V *change) {
    V largest = splat(0.0);
    for (int64_t i = 0; i < turns->bodies * turns->size; i++)
        largest = larger(largest, magnitude(change[turns->coordinates[i]]));
    V factor = splat(1.0) / larger(splat(1.0), largest / TURN);
    for (int64_t i = 0; i < e->unknowns; i++) change[i] *= factor;
}

/* Normalise quaternions after a step. */
static void normalise(const Turns *turns, V *x) {
    for (int64_t b = 0; b < turns->bodies; b++) {
        const int64_t *coordinates = turns->coordinates + b * turns->size;
        if (!turns->free[b]) continue;
        V sum = splat(0.0);
        for (int64_t i = 0; i < turns->size; i++) sum += x[coordinates[i]] * x[coordinates[i]];
        V length = root(sum);
        Mask far = (magnitude(length - 1.0) > 1e-6) & (length > 0.1);
        V factor = choose(far, splat(1.0) / length, splat(1.0));
        for (int64_t i = 0; i < turns->size; i++) x[coordinates[i]] *= factor;
    }
}

static V norm(const V *x, int64_t count) {
    V sum = splat(0.0);
    for (int64_t i = 0; i < count; i++) sum += x[i] * x[i];
    return root(sum);
}

static V most(const V *x, int64_t count) {
    V found = splat(0.0);
    for (int64_t i = 0; i < count; i++) found = larger(magnitude(x[i]), found);
    return found;
}

/* Results of the first `lanes` lanes, from state number `first` on. */
static void store(const V *x, int64_t unknowns, Mask left, int64_t first, int64_t lanes, double *to, int64_t *undecided) {
    for (int64_t l = 0; l < lanes; l++) {
        double *row = to + (first + l) * unknowns;
        for (int64_t i = 0; i < unknowns; i++) row[i] = x[i][l];
        undecided[first + l] = left[l] ? 1 : 0;
    }
}

/* Close eight realisations whose coordinates are in the work array; return the undecided lanes. */
static Mask close_eight(const Equations *e, const Turns *turns, const Memory *m, int64_t cosines,
                        const int64_t *cosine) {
    int64_t n = e->unknowns;
    V *x = m->x, *trial = m->trial, *change = m->change;
    V size = larger(splat(1.0), most(m->work, turns->dimension)), closed = CLOSED * size;
    V before = splat(0.0), part = splat(1.0);
    Mask none = (Mask)splat(0.0), running = ~none, left = none, accepted = running;
    int64_t halvings[LANES] = {0};
    copy(x, m->work, n);
    copy(trial, x, n);
    for (int64_t step = 0; any(running); step++) {
        copy(m->work, trial, n);
        run_program(&e->program, m->work);
        if (step) {
            /* scaled by the gradient lengths of the last pose */
            displacements(e, m, m->right);
            V after = norm(m->right, e->equations);
            accepted = running & ((after < before) | (after < closed));
            Mask refused = running & ~accepted;
            for (int64_t l = 0; l < LANES; l++) {
                halvings[l] = refused[l] ? halvings[l] + 1 : 0;
                if (halvings[l] == HALVINGS) left[l] = -1;
            }
            part = choose(refused, 0.5 * part, splat(1.0));
        }
        V moved = splat(0.0);
        for (int64_t i = 0; i < n; i++) {
            moved = larger(magnitude(trial[i] - x[i]), moved);
            x[i] = choose(accepted, trial[i], x[i]);
        }
        if (any(accepted)) {
            measure(e, m, accepted);
            displacements(e, m, m->right);
            V residual = most(m->right, e->equations), sum = norm(m->right, e->equations);
            V lowest = splat(1.0);
            for (int64_t i = 0; i < cosines; i++) lowest = smaller(m->work[cosine[i]], lowest);
            Mask there = accepted & (residual <= closed) & (sum - sum == 0.0);
            left |= there & ~(lowest >= 0.0); /* a mirror image */
            left |= accepted & ~(sum - sum == 0.0);
            if (step) left |= accepted & ~there & (moved < 1e-16 * size);
            running &= ~(there | left);
            accepted &= running;
            before = choose(accepted, sum, before);
        }
        running &= ~left;
        if (step == STEPS) {
            left |= running;
            running = none;
        }
        if (any(accepted)) {
            for (int64_t i = 0; i < e->solved; i++) m->right[i] = -m->right[i];
            Mask doubtful = factorise(e, m) & accepted;
            fill(trial, 0.0, n);
            add_least(e, m, m->right, trial);
            bound(e, turns, trial);
            for (int64_t i = 0; i < n; i++) change[i] = choose(accepted, trial[i], change[i]);
            left |= doubtful;
            running &= ~doubtful;
        }
        for (int64_t i = 0; i < n; i++) trial[i] = x[i] + part * change[i];
        normalise(turns, trial);
    }
    return left;
}

void close_poses(const Equations *e, const Turns *turns, V *memory, const Source *sources, int64_t many, int64_t count,
                 double *coordinates, int64_t cosines, const int64_t *cosine, int64_t *undecided) {
    Memory m = places(e, memory);
    Cursor cursors[SOURCES];
    begin(cursors, sources, many, 0);
    for (int64_t k = 0; k < count; k += LANES) {
        int64_t lanes = count - k < LANES ? count - k : LANES;
        load(m.work, sources, cursors, many, lanes);
        fill(m.lengths, 1.0, e->equations);
        fill(m.change, 0.0, e->unknowns);
        Mask left = close_eight(e, turns, &m, cosines, cosine);
        store(m.x, e->unknowns, left, k, lanes, coordinates, undecided);
    }
}

void least_speeds(const Equations *e, V *memory, const Source *sources, int64_t many, int64_t count, double *speeds,
                  int64_t *undecided) {
    Memory m = places(e, memory);
    Cursor cursors[SOURCES];
    begin(cursors, sources, many, 0);
    for (int64_t k = 0; k < count; k += LANES) {
        int64_t lanes = count - k < LANES ? count - k : LANES;
        load(m.work, sources, cursors, many, lanes);
        run_program(&e->program, m.work);
        measure(e, &m, ~(Mask)splat(0.0));
        displacements(e, &m, m.residuals);
        for (int64_t i = 0; i < e->equations; i++) m.residuals[i] = -m.residuals[i];
        V largest = most(m.residuals, e->equations), sum = norm(m.residuals, e->equations);
        Mask rest = sum == 0.0, left = ~rest;
        fill(m.x, 0.0, e->unknowns);
        if (any(left)) {
            left &= factorise(e, &m);
            for (int64_t again = 0; again < 2; again++) { /* the second pass reduces rounding errors */
                defects(e, &m, m.residuals, m.x, e->solved, m.right);
                add_least(e, &m, m.right, m.x);
            }
            defects(e, &m, m.residuals, m.x, e->equations, m.right);
            V error = norm(m.right, e->equations);
            left |= ~rest & ~(error <= KEPT * larger(splat(1.0), largest));
            for (int64_t i = 0; i < e->unknowns; i++) m.x[i] = choose(rest, splat(0.0), m.x[i]);
        }
        store(m.x, e->unknowns, left, k, lanes, speeds, undecided);
    }
}
