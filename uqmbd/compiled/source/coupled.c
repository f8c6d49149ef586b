#include "coupled.h"

enum { PLAIN = 6, AGAIN = 50 };

static const double ROUNDING = 1e-14; /* of a row, relative to the sum of the magnitudes of its terms */

INLINE int64_t in_eights(int64_t count) { return (count + LANES - 1) / LANES; }

/* Number of vectors of all unknowns. */
INLINE int64_t length(const Coupled *c) { return c->size * in_eights(c->terms); }

int64_t coupled_memory(const Coupled *c) {
    int64_t unknowns = c->terms * c->size;
    int64_t dense = c->worth < 0 ? 0 : unknowns * (unknowns + 3) + c->terms * LANES * in_eights(c->terms);
    return length(c) * (KRYLOV + 6) + KRYLOV * (KRYLOV + 5) + in_eights(dense);
}

/* Vectors of the memory, by number. */
enum { FIRST, CHANGE, IMAGE, RIGHT, FOUND, BASIS };
INLINE V *vector(const Coupled *c, int64_t number) { return c->memory + number * length(c); }

/* -- dense products ------------------------------------------------------------------------------------------------- */

/* Values at eight nodes of `count` rows of coefficients; four rows at once do not wait for one another. */
static void spread_eight(const Coupled *c, const V *coefficients, int64_t count, const V *psi, V *to) {
    int64_t nodes = in_eights(c->nodes), stride = LANES * in_eights(c->terms), terms = c->terms, i = 0;
    const double *x = (const double *)coefficients;
    for (; i + 4 <= count; i += 4, x += 4 * stride) {
        V sum0 = splat(0.0), sum1 = sum0, sum2 = sum0, sum3 = sum0;
        for (int64_t j = 0; j < terms; j++) {
            V basis = psi[j * nodes];
            sum0 += basis * x[j];
            sum1 += basis * x[stride + j];
            sum2 += basis * x[2 * stride + j];
            sum3 += basis * x[3 * stride + j];
        }
        to[i] = sum0;
        to[i + 1] = sum1;
        to[i + 2] = sum2;
        to[i + 3] = sum3;
    }
    for (; i < count; i++, x += stride) {
        V sum = splat(0.0);
        for (int64_t j = 0; j < terms; j++) sum += psi[j * nodes] * x[j];
        to[i] = sum;
    }
}

/* Values at the nodes of `count` rows of coefficients, into rows from `to` on. */
static void spread(const Coupled *c, const V *coefficients, int64_t count, int64_t to) {
    for (int64_t k = 0; k < in_eights(c->nodes); k++)
        spread_eight(c, coefficients, count, c->psi + k, c->work + k * c->rows + to);
}

/* Coefficients of values at the nodes, of `count` rows: those of a table, or (it is null) from `first` on.  Four rows at
   once do not wait for one another. */
static void gather(const Coupled *c, const int64_t *table, int64_t first, int64_t count, V *coefficients) {
    int64_t terms = in_eights(c->terms), stride = LANES * c->rows, i = 0;
    for (; i < count; i += i + 4 <= count ? 4 : 1) {
        int64_t rows = i + 4 <= count ? 4 : 1;
        const double *values[4];
        for (int64_t r = 0; r < 4; r++) {
            int64_t row = r < rows ? i + r : i;
            values[r] = (const double *)(c->work + (table ? table[row] : first + row));
        }
        const double *x0 = values[0], *x1 = values[1], *x2 = values[2], *x3 = values[3];
        for (int64_t b = 0; b < terms; b++) {
            V sum0 = splat(0.0), sum1 = sum0, sum2 = sum0, sum3 = sum0, *to = coefficients + i * terms + b;
            for (int64_t k = 0; k < c->nodes; k++) {
                int64_t at = k / LANES * stride + k % LANES;
                V weight = c->adjoint[k * terms + b];
                sum0 += weight * x0[at];
                sum1 += weight * x1[at];
                sum2 += weight * x2[at];
                sum3 += weight * x3[at];
            }
            to[0] = sum0;
            if (rows == 1) continue;
            to[terms] = sum1;
            to[2 * terms] = sum2;
            to[3 * terms] = sum3;
        }
    }
}

/* -- vectors of coefficients ---------------------------------------------------------------------------------------- */

static double not_a_number(void) { return __builtin_nan(""); }

INLINE int finite(double x) { return x - x == 0.0; }

/* Largest magnitude; NaN if one is not finite. */
static double largest_of(const V *x, int64_t count) {
    V most = splat(0.0), wrong = splat(0.0);
    for (int64_t i = 0; i < count; i++) {
        most = larger(most, magnitude(x[i]));
        wrong += x[i] - x[i];
    }
    double found = 0.0;
    for (int64_t l = 0; l < LANES; l++) {
        if (most[l] > found) found = most[l];
        if (wrong[l] != 0.0) return not_a_number();
    }
    return found;
}

static double inner(const V *x, const V *y, int64_t count) {
    V sum = splat(0.0);
    for (int64_t i = 0; i < count; i++) sum += x[i] * y[i];
    double found = 0.0;
    for (int64_t l = 0; l < LANES; l++) found += sum[l];
    return found;
}

static void add(V *to, double factor, const V *x, int64_t count) {
    for (int64_t i = 0; i < count; i++) to[i] += factor * x[i];
}

/* -- systems at the nodes ------------------------------------------------------------------------------------------- */

void coupled_place(const Coupled *c, const V *state) {
    double time = state[c->width * in_eights(c->terms)][0];
    spread(c, state, c->width, 0);
    for (int64_t k = 0; k < in_eights(c->nodes); k++) {
        V *work = c->work + k * c->rows;
        work[c->time] = c->times ? c->times[k] : splat(time);
        run_program(&c->values, work);
        if (!c->outside) run_program(&c->factor, work);
    }
    if (c->outside) c->outside(FACTORISE);
}

/* A right-hand side of eight nodes, times their paces, if there are any. */
INLINE V at_pace(const V *paces, int64_t k, V value) { return paces ? paces[k] * value : value; }

/* Take right-hand sides from rows, times the paces of the nodes, if there are any; -1: zero. */
static void take_right(const Coupled *c, const int64_t *rows, const V *paces) {
    for (int64_t k = 0; k < in_eights(c->nodes); k++) {
        V *work = c->work + k * c->rows;
        for (int64_t i = 0; i < c->size; i++) {
            work[c->right + i] = rows[i] < 0 ? splat(0.0) : at_pace(paces, k, work[rows[i]]);
        }
    }
}

/* Right-hand sides of motion less the products of the systems with `x`; rows null: minus the products alone. */
static void take_defect(const Coupled *c, const int64_t *rows, const V *x) {
    spread(c, x, c->size, c->guess);
    for (int64_t k = 0; k < in_eights(c->nodes); k++) {
        V *work = c->work + k * c->rows;
        const V *guess = work + c->guess;
        for (int64_t i = 0; i < c->size; i++) {
            V sum = rows && rows[i] >= 0 ? at_pace(c->paces, k, work[rows[i]]) : splat(0.0);
            for (int64_t e = c->starts[i]; e < c->starts[i + 1]; e++) sum -= work[c->entries[e]] * guess[c->columns[e]];
            work[c->right + i] = sum;
        }
    }
}

/* Right-hand sides as large as rounding makes the defects of `x`, of signs as irregular as that has. */
static void take_rounding(const Coupled *c, const int64_t *rows, const V *x) {
    uint64_t draw = 1;
    spread(c, x, c->size, c->guess);
    for (int64_t k = 0; k < in_eights(c->nodes); k++) {
        V *work = c->work + k * c->rows;
        const V *guess = work + c->guess;
        for (int64_t i = 0; i < c->size; i++) {
            V sum = rows[i] >= 0 ? magnitude(at_pace(c->paces, k, work[rows[i]])) : splat(0.0);
            for (int64_t e = c->starts[i]; e < c->starts[i + 1]; e++)
                sum += magnitude(work[c->entries[e]] * guess[c->columns[e]]);
            for (int64_t l = 0; l < LANES; l++) {
                draw = draw * 6364136223846793005u + 1442695040888963407u;
                work[c->right + i][l] = draw >> 63 ? ROUNDING * sum[l] : -ROUNDING * sum[l];
            }
        }
    }
}

/* Coefficients of the solutions at the nodes. */
static void solve(const Coupled *c, V *found) {
    if (c->outside)
        c->outside(SOLVE);
    else
        for (int64_t k = 0; k < in_eights(c->nodes); k++) run_program(&c->solve, c->work + k * c->rows);
    gather(c, c->solution, 0, c->size, found);
}

/* Psi^T W A_k^-1 Psi of coefficients. */
static void precondition(const Coupled *c, const V *defect, V *found) {
    spread(c, defect, c->size, c->right);
    solve(c, found);
}

/* -- the projected system ------------------------------------------------------------------------------------------- */

/* `right` less the product of the projected system with `x`. */
static void projected_defect(const Coupled *c, const V *right, const V *x, V *defect) {
    take_defect(c, 0, x);
    gather(c, 0, c->right, c->size, defect);
    if (right) add(defect, 1.0, right, length(c));
}

/* Reduce the defect of `found` by GMRES with the nodal preconditioner until the change is below a tolerance (Saad and
   Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856-869); whether that was reached. */
static int krylov(const Coupled *c, const V *right, V *found, double tolerance) {
    int64_t count = length(c);
    V *image = vector(c, IMAGE), *basis = vector(c, BASIS);
    double *triangle = (double *)(basis + (KRYLOV + 1) * count); /* column k has k + 1 entries above its diagonal's */
    double *target = triangle + KRYLOV * (KRYLOV + 1), *cosines = target + KRYLOV + 1, *sines = cosines + KRYLOV;
    c->counts[KRYLOVS]++;
    projected_defect(c, right, found, image);
    precondition(c, image, basis);
    double beta = __builtin_sqrt(inner(basis, basis, count));
    if (!finite(beta)) return 0;
    if (beta <= tolerance) return 1;
    for (int64_t i = 0; i < count; i++) basis[i] /= beta;
    target[0] = beta;
    for (int64_t k = 0; k < KRYLOV; k++) {
        V *next = basis + (k + 1) * count;
        double *column = triangle + k * (KRYLOV + 1);
        c->counts[ITERATIONS]++;
        projected_defect(c, 0, basis + k * count, image);
        precondition(c, image, next);
        for (int64_t i = 0; i < count; i++) next[i] = -next[i];
        for (int64_t j = 0; j <= k; j++) column[j] = 0.0;
        for (int64_t twice = 0; twice < 2; twice++) /* a single pass loses digits */
            for (int64_t j = 0; j <= k; j++) {
                double part = inner(basis + j * count, next, count);
                add(next, -part, basis + j * count, count);
                column[j] += part;
            }
        double norm = __builtin_sqrt(inner(next, next, count));
        /* rotations make the column one of a triangle */
        for (int64_t j = 0; j < k; j++) {
            double a = column[j], b = column[j + 1];
            column[j] = cosines[j] * a + sines[j] * b;
            column[j + 1] = cosines[j] * b - sines[j] * a;
        }
        double size = __builtin_sqrt(column[k] * column[k] + norm * norm);
        if (!finite(size) || size == 0.0) return 0;
        cosines[k] = column[k] / size;
        sines[k] = norm / size;
        column[k] = size;
        target[k + 1] = -sines[k] * target[k];
        target[k] *= cosines[k];
        double left = target[k + 1] < 0 ? -target[k + 1] : target[k + 1];
        if (left > tolerance && norm > 1e-14 * beta) {
            for (int64_t i = 0; i < count; i++) next[i] /= norm;
            continue;
        }
        for (int64_t i = k; i >= 0; i--) {
            for (int64_t j = i + 1; j <= k; j++) target[i] -= triangle[j * (KRYLOV + 1) + i] * target[j];
            target[i] /= triangle[i * (KRYLOV + 1) + i];
            add(found, target[i], basis + i * count, count);
        }
        return 1;
    }
    return 0;
}

/* Assemble the projected system, and solve it by LAPACK; NaN where it is singular.  Unknown `row` of term `i` has the
   number row * terms + i. */
static void direct(const Coupled *c, const V *projected, V *found) {
    int64_t terms = c->terms, blocks = in_eights(terms), nodes = in_eights(c->nodes), size = terms * c->size;
    V *sums = vector(c, BASIS);
    double *matrix = (double *)(sums + terms * blocks), *right = matrix + size * size, *scale = right + size;
    int32_t *pivots = (int32_t *)(scale + size), all = (int32_t)size, one = 1, info = 0;
    c->counts[DIRECT]++;
    fill(found, 0.0, c->size * blocks); /* lanes without a term, too */
    for (int64_t i = 0; i < size * size; i++) matrix[i] = 0.0;
    for (int64_t row = 0; row < c->size; row++)
        for (int64_t e = c->starts[row]; e < c->starts[row + 1]; e++) {
            fill(sums, 0.0, terms * blocks);
            for (int64_t k = 0; k < c->nodes; k++) {
                double value = c->work[k / LANES * c->rows + c->entries[e]][k % LANES];
                for (int64_t j = 0; j < terms; j++) {
                    double part = value * c->psi[j * nodes + k / LANES][k % LANES];
                    for (int64_t b = 0; b < blocks; b++) sums[j * blocks + b] += part * c->adjoint[k * blocks + b];
                }
            }
            for (int64_t j = 0; j < terms; j++) {
                double *to = matrix + (c->columns[e] * terms + j) * size + row * terms;
                for (int64_t i = 0; i < terms; i++) to[i] += sums[j * blocks + i / LANES][i % LANES];
            }
        }
    /* rows of light bodies are scaled up: the pivots see comparable numbers */
    for (int64_t i = 0; i < size; i++) {
        scale[i] = 0.0;
        for (int64_t j = 0; j < size; j++) {
            double entry = matrix[j * size + i] < 0 ? -matrix[j * size + i] : matrix[j * size + i];
            if (entry > scale[i]) scale[i] = entry;
        }
        if (scale[i] == 0.0) scale[i] = 1.0;
        int64_t row = i / terms, term = i % terms;
        right[i] = projected[row * blocks + term / LANES][term % LANES] / scale[i];
    }
    for (int64_t j = 0; j < size; j++)
        for (int64_t i = 0; i < size; i++) matrix[j * size + i] /= scale[i];
    c->gesv(&all, &one, matrix, &all, pivots, right, &all, &info);
    for (int64_t i = 0; i < size; i++)
        found[i / terms * blocks + i % terms / LANES][i % terms % LANES] = info ? not_a_number() : right[i];
}

/* Solve if the plain iteration converges slowly, and record whether this pays. */
static void solve_slowly(const Coupled *c, const V *right, V *found, double tolerance) {
    int64_t before = c->counts[ITERATIONS];
    int good = krylov(c, right, found, tolerance) && finite(largest_of(found, length(c)));
    if (!good) fill(found, not_a_number(), length(c));
    if (c->worth < 0 || (good && (double)(c->counts[ITERATIONS] - before) <= c->worth)) return;
    c->counts[AVOIDED] = AGAIN;
    if (!good) direct(c, right, found);
}

/* Accelerations and multipliers: the nodal ones, projected, corrected until the change is small.

   The iteration starts from the correction of the last system.  A change after the last one would be smaller by the same
   factor as that was. */
static void solve_motion(const Coupled *c, V *found) {
    int64_t count = length(c), accelerations = c->coordinates * in_eights(c->terms), done = 0;
    V *first = vector(c, FIRST), *change = vector(c, CHANGE), *image = vector(c, IMAGE), *right = vector(c, RIGHT);
    c->counts[SYSTEMS]++;
    take_right(c, c->motion, c->paces);
    if (c->counts[AVOIDED] && c->nodes > c->terms) {
        c->counts[AVOIDED]--;
        gather(c, 0, c->right, c->size, right);
        direct(c, right, found);
        return;
    }
    if (c->nodes == c->terms) { /* no truncation */
        solve(c, found);
        return;
    }
    solve(c, first);
    for (int64_t i = 0; i < count; i++) found[i] = first[i] + c->correction[i];
    int guessed = largest_of(c->correction, count) > 0.0, converged = 0;
    double before = 0.0, moved = 0.0, wanted = 0.0;
    while (!converged && done < PLAIN) {
        take_defect(c, c->motion, found);
        gather(c, 0, c->right, c->size, image);
        precondition(c, image, change);
        c->counts[ITERATIONS]++;
        moved = largest_of(change, accelerations);
        if (guessed && !(moved <= largest_of(first, accelerations))) {
            /* the last correction belongs to a distant state, and is worse than none */
            copy(found, first, count);
            guessed = 0;
            continue;
        }
        guessed = 0;
        add(found, 1.0, change, count);
        if (!finite(moved)) {
            fill(found, not_a_number(), count);
            return;
        }
        /* over the size of the solution itself, never over that of the guess */
        wanted = c->tolerance * (largest_of(found, accelerations) + 1e-300);
        converged = moved <= wanted || (done && moved * (moved / before) <= 0.3 * wanted);
        if (done && moved > 0.5 * before) break; /* only rounding is left, or this iteration is too slow */
        before = moved;
        done++;
    }
    if (!converged) {
        take_rounding(c, c->motion, found);
        solve(c, change);
        double floor = largest_of(change, accelerations);
        converged = moved <= floor;
        if (wanted < floor) wanted = floor;
    }
    if (!converged) {
        take_right(c, c->motion, c->paces);
        gather(c, 0, c->right, c->size, right);
        solve_slowly(c, right, found, wanted);
    }
    if (!finite(largest_of(found, count))) return;
    for (int64_t i = 0; i < count; i++) c->correction[i] = found[i] - first[i];
}

/* Solve for any projected right-hand side, from zero. */
static void solve_any(const Coupled *c, const V *right, V *found) {
    int64_t count = length(c);
    V *change = vector(c, CHANGE), *image = vector(c, IMAGE);
    c->counts[SYSTEMS]++;
    precondition(c, right, found);
    double scale = largest_of(found, count) + 1e-300, before = 0.0;
    for (int64_t done = 0; done < PLAIN; done++) {
        projected_defect(c, right, found, image);
        precondition(c, image, change);
        c->counts[ITERATIONS]++;
        add(found, 1.0, change, count);
        double size = largest_of(change, count) / scale;
        if (size <= c->tolerance_drift) return;
        if ((done && size > 0.5 * before) || !finite(size)) break;
        before = size;
    }
    solve_slowly(c, right, found, c->tolerance_drift * scale);
}

void coupled_rate(const void *context, const V *state, V *results) {
    const Coupled *c = context;
    coupled_place(c, state);
    solve_motion(c, results);
    gather(c, c->rate, 0, c->rates, results + length(c));
}

void coupled_excess(const void *context, const V *state, V *results) {
    const Coupled *c = context;
    int64_t wanted = c->coordinates * in_eights(c->terms);
    V *right = vector(c, RIGHT), *found = vector(c, FOUND);
    (void)state; /* its values are in the work arrays */
    for (int64_t k = 0; k < in_eights(c->nodes); k++) run_program(&c->drift, c->work + k * c->rows);
    for (int64_t side = 0; side < 2; side++) {
        take_right(c, c->constraints + side * c->size, 0);
        if (c->nodes == c->terms) {
            solve(c, found);
        } else {
            gather(c, 0, c->right, c->size, right);
            if (largest_of(right, length(c)) == 0.0)
                fill(found, 0.0, length(c));
            else
                solve_any(c, right, found);
        }
        copy(results + side * wanted, found, wanted);
    }
}
