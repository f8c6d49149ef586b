/* Laws of several contacts: the impulses of an impact, and the forces of closed contacts.

   The problem is that of one contact (coulomb.c) for all contacts together.  Its states (stick, slip on, slip back, no
   impulse) are enumerated, those of the last contact first, up to MOST_STATES combinations; impulses of redundant
   contacts are the least ones.  The first solution in this order is used.  Beyond this bound, and where directions of
   sliding in space are unknown, Newton's method solves the laws as equations, from impulses that end all slip, and from
   those of a number of relaxations (M. Jean, J. J. Moreau, Proceedings of the Contact Mechanics International Symposium
   1992, 31-48). */
#include "group.h"

static const double UNSTABLE = 1e-9; /* negative stiffness of contacts, relative to their own, that counts as zero */
static const double GROWN = 1e6;     /* entry of a matrix exponential that counts as unbounded */

enum {
    MOST_STATES = 64,
    ITERATIONS_OF_LAWS = 40,
    RELAXATIONS = 300, /* sweeps over all contacts */
    MOST_BLOWS = 200, /* collisions at an instant; after them, the impact is without restitution */
    TERMS = 16,       /* of the series of an exponential function */
    SQUARINGS = 35,   /* exp(34) for an eigenvalue of -UNSTABLE and a norm of one; rounding grows to 1e-5 */
};

/* Simultaneous collision, or forces: speeds before it, or accelerations without forces, and their changes. */
typedef struct {
    int64_t count, first[MOST_CLOSED + 1];
    int given[MOST_CLOSED];
    double friction[MOST_CLOSED], rebound[MOST_CLOSED], unit[MOST_ROWS];
    double matrix[MOST_ROWS][MOST_ROWS], before[MOST_ROWS];
} Collision;

/* Largest response of a contact in its directions. */
static double own_response(const Collision *x, int64_t k) {
    double found = 1e-300;
    for (int64_t i = x->first[k]; i < x->first[k + 1]; i++) found = greatest(found, __builtin_fabs(x->matrix[i][i]));
    return found;
}

/* Units of impulses that are equal in all directions of a contact, because masses may differ widely. */
static void set_own_units(Collision *x) {
    for (int64_t k = 0; k < x->count; k++)
        for (int64_t i = x->first[k]; i < x->first[k + 1]; i++) x->unit[i] = 1.0 / __builtin_sqrt(own_response(x, k));
}

static void respond_together(const Collision *x, const double *impulse, double *after) {
    int64_t rows = x->first[x->count];
    for (int64_t i = 0; i < rows; i++) {
        after[i] = x->before[i];
        for (int64_t j = 0; j < rows; j++) after[i] += x->matrix[i][j] * impulse[j];
    }
}

/* Whether impulses satisfy the laws in all contacts, and add no energy. */
static int satisfy_together(const Collision *x, const double *impulse, Earlier earlier) {
    double after[MOST_ROWS], size = greatest(earlier.jump, 1e-300), off = 0.0, added = 0.0, worked = 0.0;
    respond_together(x, impulse, after);
    for (int64_t k = 0; k < x->count; k++) {
        int64_t first = x->first[k], count = x->first[k + 1] - first;
        double wanted[MOST_DIRECTIONS], diagonal = own_response(x, k), along = 0.0;
        for (int64_t i = 0; i < count; i++) {
            if (!is_finite(impulse[first + i])) return 0;
            wanted[i] = impulse[first + i] - (after[first + i] - (i ? 0.0 : x->rebound[k])) / diagonal;
            if (i) along += wanted[i] * wanted[i];
        }
        wanted[0] = greatest(0.0, wanted[0]);
        along = __builtin_sqrt(along);
        size = greatest(size, __builtin_fabs(x->before[first]));
        for (int64_t i = 0; i < count; i++) {
            double value = impulse[first + i], most = x->friction[k] * wanted[0];
            if (i && along > most) wanted[i] *= most / along;
            size = greatest(size, __builtin_fabs(value) * diagonal);
            off = greatest(off, __builtin_fabs(value - wanted[i]) * diagonal);
            added += 0.5 * value * (x->before[first + i] + after[first + i]);
            worked += __builtin_fabs(value * x->before[first + i]);
        }
    }
    return off <= EXACT * size && (earlier.energy < 0.0 || added <= FED * greatest(worked, earlier.energy));
}

enum { STICKS, SLIPS_ON, SLIPS_BACK, WITHOUT }; /* the states of a contact; without friction only the first and last */

/* Impulses of contacts in given states, the least ones if contacts are redundant. */
static void impulses_of(const Collision *x, const int64_t *states, Lane *s, double *impulse) {
    double share[MOST_CLOSED] = {0.0}; /* friction of slip per normal impulse */
    int64_t rows = x->first[x->count], size = 0, held[MOST_ROWS], owner[MOST_ROWS];
    for (int64_t i = 0; i < rows; i++) impulse[i] = 0.0;
    for (int64_t k = 0; k < x->count; k++) {
        int64_t first = x->first[k], count = states[k] == STICKS ? x->first[k + 1] - first : 1;
        if (states[k] == WITHOUT) continue;
        if (states[k] != STICKS) {
            double on = __builtin_copysign(1.0, x->before[first + 1]);
            share[k] = -x->friction[k] * (states[k] == SLIPS_ON ? on : -on);
        }
        for (int64_t i = 0; i < count; i++) {
            held[size] = first + i;
            owner[size++] = k;
        }
    }
    if (!size) return;
    for (int64_t i = 0; i < size; i++) {
        int64_t row = held[i], normal = row == x->first[owner[i]];
        s->unit[i] = x->unit[row];
        s->right[i] = (normal ? x->rebound[owner[i]] : 0.0) - x->before[row];
        for (int64_t j = 0; j < size; j++) {
            double value = x->matrix[row][held[j]];
            if (share[owner[j]] != 0.0) value += x->matrix[row][held[j] + 1] * share[owner[j]];
            s->inner[i * size + j] = value;
        }
    }
    least_solution(s, size);
    for (int64_t j = 0; j < size; j++) {
        impulse[held[j]] = s->found[j];
        if (share[owner[j]] != 0.0) impulse[held[j] + 1] = share[owner[j]] * s->found[j];
    }
}

/* By what impulses exceed those that the laws require at the speeds after them: nothing in a solution.  `slope` are the
   derivatives (row, row). */
static void excess_of(const Collision *x, const double *impulse, double *rest, double (*slope)[MOST_ROWS]) {
    double after[MOST_ROWS];
    int64_t rows = x->first[x->count];
    respond_together(x, impulse, after);
    for (int64_t k = 0; k < x->count; k++) {
        int64_t n = x->first[k], count = x->first[k + 1] - n;
        double answer = 1.0 / own_response(x, k), along[2], size = 0.0;
        double normal = impulse[n] - answer * (after[n] - x->rebound[k]);
        for (int64_t i = 0; i < count; i++)
            for (int64_t j = 0; j < rows; j++) slope[n + i][j] = n + i == j;
        rest[n] = impulse[n] - greatest(0.0, normal);
        for (int64_t i = 1; i < count; i++) {
            along[i - 1] = impulse[n + i] - answer * after[n + i];
            size += along[i - 1] * along[i - 1];
        }
        size = __builtin_sqrt(size);
        double most = x->friction[k] * greatest(0.0, normal);
        for (int64_t i = 1; i < count; i++)
            rest[n + i] = impulse[n + i] - along[i - 1] * (size <= most ? 1.0 : most / size);
        if (normal <= 0.0) continue;
        for (int64_t j = 0; j < rows; j++) slope[n][j] = answer * x->matrix[n][j];
        for (int64_t i = 1; i < count; i++)
            for (int64_t j = 0; j < rows; j++) {
                if (size <= most) {
                    slope[n + i][j] = answer * x->matrix[n + i][j];
                    continue;
                }
                double direction = along[i - 1] / size, moved = (n == j) - answer * x->matrix[n][j];
                slope[n + i][j] -= x->friction[k] * direction * moved;
                for (int64_t a = 1; a < count; a++) {
                    double across = (a == i) - direction * along[a - 1] / size;
                    slope[n + i][j] -= most / size * across * ((n + a == j) - answer * x->matrix[n + a][j]);
                }
            }
    }
}

/* Size of impulses in the units of their contacts. */
static double scaled_size(const Collision *x, const double *impulse) {
    double sum = 0.0;
    for (int64_t i = 0; i < x->first[x->count]; i++) {
        double value = impulse[i] / (x->unit[i] * x->unit[i]);
        sum += value * value;
    }
    return __builtin_sqrt(sum);
}

/* Improve impulses by Newton's method: if no step is an improvement, by a relaxation of all contacts. */
static void improve(const Collision *x, Lane *s, double *impulse) {
    int64_t rows = x->first[x->count];
    double rest[MOST_ROWS], tried[MOST_ROWS], left[MOST_ROWS], slope[MOST_ROWS][MOST_ROWS], unused[MOST_ROWS][MOST_ROWS];
    excess_of(x, impulse, rest, slope);
    for (int64_t count = 0; count < ITERATIONS_OF_LAWS; count++) {
        double size = scaled_size(x, rest), length = 1.0;
        if (!(size > 1e-3 * EXACT * scaled_size(x, impulse))) return;
        for (int64_t i = 0; i < rows; i++) {
            double unit = x->unit[i] * x->unit[i];
            s->unit[i] = 1.0;
            s->right[i] = -rest[i] / unit;
            for (int64_t j = 0; j < rows; j++) s->inner[i * rows + j] = slope[i][j] * x->unit[j] * x->unit[j] / unit;
        }
        least_solution(s, rows);
        for (;; length *= 0.5) {
            for (int64_t i = 0; i < rows; i++) tried[i] = impulse[i] + length * x->unit[i] * x->unit[i] * s->found[i];
            excess_of(x, tried, left, unused);
            if (scaled_size(x, left) < (1.0 - 0.1 * length) * size) break;
            if (length > 0.2) continue;
            for (int64_t i = 0; i < rows; i++) tried[i] = impulse[i] - rest[i] / (double)x->count;
            break;
        }
        for (int64_t i = 0; i < rows; i++) impulse[i] = tried[i];
        excess_of(x, impulse, rest, slope);
    }
}

/* Relax the laws of one contact after the other. */
static void relax(const Collision *x, double *impulse) {
    for (int64_t i = 0; i < x->first[x->count]; i++) impulse[i] = 0.0;
    for (int64_t sweep = 0; sweep < RELAXATIONS; sweep++)
        for (int64_t k = 0; k < x->count; k++) {
            int64_t n = x->first[k], end = x->first[k + 1];
            double size = 0.0, widest = 1e-300;
            for (int64_t i = n; i < end; i++) {
                double after = x->before[i] - (i == n ? x->rebound[k] : 0.0);
                for (int64_t j = 0; j < x->first[x->count]; j++) after += x->matrix[i][j] * impulse[j];
                for (int64_t t = n + 1; t < end; t++) widest = greatest(widest, __builtin_fabs(x->matrix[t][t]));
                impulse[i] -= after / (i == n ? greatest(__builtin_fabs(x->matrix[n][n]), 1e-300) : widest);
                if (i == n) impulse[n] = greatest(0.0, impulse[n]);
                if (i > n) size += impulse[i] * impulse[i];
            }
            size = __builtin_sqrt(size);
            double most = x->friction[k] * impulse[n];
            for (int64_t i = n + 1; i < end && size > most; i++) impulse[i] *= most / size;
        }
}

/* Impulses that satisfy the laws, by iteration; whether there are some, -1 if none are found. */
static int solve_by_iteration(const Collision *x, Earlier earlier, Lane *s, double *impulse) {
    int64_t states[MOST_CLOSED] = {STICKS};
    for (int64_t k = 0; k < x->count; k++) states[k] = STICKS;
    impulses_of(x, states, s, impulse);
    improve(x, s, impulse);
    if (satisfy_together(x, impulse, earlier)) return 1;
    relax(x, impulse);
    improve(x, s, impulse);
    return satisfy_together(x, impulse, earlier) ? 1 : -1;
}

/* The first impulses that satisfy the laws; whether there are some; -1 if that is not known. */
static int solve_together(const Collision *x, Earlier earlier, Lane *s, double *impulse) {
    int64_t states[MOST_CLOSED] = {0}, combinations = 1;
    if (x->count == 1) {
        Touch t;
        t.count = x->first[1];
        t.friction = x->friction[0];
        for (int64_t i = 0; i < t.count; i++)
            for (int64_t j = 0; j < t.count; j++) t.matrix[i][j] = x->matrix[i][j];
        return first_solution(&t, x->before, x->rebound[0], earlier, s, impulse);
    }
    /* the friction of more than two contacts that begin to slide in space is not unique: the caller decides */
    for (int64_t k = 0; k < x->count; k++)
        if (x->first[k + 1] - x->first[k] > 2 && x->count > 2 && earlier.energy < 0.0) return -1;
    for (int64_t k = 0; k < x->count; k++) {
        int64_t tangents = x->first[k + 1] - x->first[k] - 1;
        combinations *= tangents > 1 ? MOST_STATES + 1 : tangents ? 4 : 2;
        if (combinations > MOST_STATES) return solve_by_iteration(x, earlier, s, impulse);
    }
    for (;;) {
        impulses_of(x, states, s, impulse);
        if (satisfy_together(x, impulse, earlier)) return 1;
        int64_t k = x->count - 1;
        while (k >= 0 && states[k] == WITHOUT) states[k--] = STICKS;
        if (k < 0) return 0;
        states[k] = x->first[k + 1] - x->first[k] > 1 ? states[k] + 1 : WITHOUT;
    }
}

/* Collision of some contacts with given speeds. */
static void set_collision(const Closed *c, const int64_t *some, int64_t count, const double *speed, Collision *x,
                          int64_t *rows) {
    int64_t size = 0;
    x->count = count;
    for (int64_t k = 0; k < count; k++) {
        x->first[k] = size;
        x->friction[k] = c->friction[some[k]];
        x->given[k] = c->given[some[k]];
        x->rebound[k] = 0.0;
        for (int64_t i = c->first[some[k]]; i < c->first[some[k] + 1]; i++) rows[size++] = i;
    }
    x->first[count] = size;
    for (int64_t i = 0; i < size; i++) {
        x->before[i] = speed[rows[i]];
        for (int64_t j = 0; j < size; j++) x->matrix[i][j] = c->matrix[rows[i]][rows[j]];
    }
    set_own_units(x);
}

/* Impulses of an impact, and which contacts are hit; whether they are known.  Contacts that approach collide at once;
   contacts that approach afterwards collide next.  Speeds up to `least` are no approach. */
static int solve_blows(const Closed *c, double least, Lane *s, double *total, int *hit) {
    double speed[MOST_ROWS], impulse[MOST_ROWS];
    int64_t rows = c->first[c->count], active[MOST_CLOSED], row[MOST_ROWS];
    for (int64_t i = 0; i < rows; i++) {
        speed[i] = c->speed[i];
        total[i] = 0.0;
    }
    for (int64_t k = 0; k < c->count; k++) hit[k] = 0;
    for (int64_t blow = 0; blow <= MOST_BLOWS; blow++) {
        int64_t count = 0, approaching = 0, last = blow == MOST_BLOWS, bounces = 0;
        for (int64_t k = 0; k < c->count; k++) {
            int approaches = speed[c->first[k]] < -least;
            approaching += approaches;
            if (approaches || last) active[count++] = k;
        }
        if (!approaching) break;
        Earlier earlier = {0.0, 0.0};
        for (int64_t i = 0; i < rows; i++) {
            earlier.jump = greatest(earlier.jump, __builtin_fabs(total[i] * c->matrix[i][i]));
            earlier.energy += __builtin_fabs(total[i] * c->speed[i]);
        }
        Collision x;
        set_collision(c, active, count, speed, &x, row);
        for (int64_t k = 0; k < count && !last; k++) {
            x.rebound[k] = greatest(0.0, -c->restitution[active[k]] * x.before[x.first[k]]);
            bounces |= x.rebound[k] > 0.0;
        }
        int found = solve_together(&x, earlier, s, impulse);
        if (!found && bounces) {
            for (int64_t k = 0; k < count; k++) x.rebound[k] = 0.0;
            found = solve_together(&x, earlier, s, impulse);
        }
        if (found != 1) return 0;
        for (int64_t j = 0; j < x.first[count]; j++) {
            total[row[j]] += impulse[j];
            for (int64_t i = 0; i < rows; i++) speed[i] += c->matrix[i][row[j]] * impulse[j];
        }
        for (int64_t k = 0; k < count; k++) hit[active[k]] |= impulse[x.first[k]] > 0.0;
    }
    return 1;
}

/* Problem of the forces of closed contacts; those that slide have the friction of their headings. */
static void set_forces(const Closed *c, const int *slides, double (*heading)[2], Collision *x) {
    int64_t size = 0, rows[MOST_ROWS];
    x->count = c->count;
    for (int64_t k = 0; k < c->count; k++) {
        x->first[k] = size;
        x->friction[k] = c->friction[k];
        x->given[k] = c->given[k];
        x->rebound[k] = 0.0;
        for (int64_t i = c->first[k]; i < (slides[k] ? c->first[k] + 1 : c->first[k + 1]); i++) rows[size++] = i;
    }
    x->first[c->count] = size;
    for (int64_t i = 0; i < size; i++) {
        x->before[i] = c->natural[rows[i]];
        for (int64_t j = 0; j < size; j++) x->matrix[i][j] = c->matrix[rows[i]][rows[j]];
        for (int64_t k = 0; k < c->count; k++)
            for (int64_t t = c->first[k] + 1; slides[k] && t < c->first[k + 1]; t++)
                x->matrix[i][x->first[k]] -= c->matrix[rows[i]][t] * c->friction[k] * heading[k][t - c->first[k] - 1];
    }
    set_own_units(x);
}

/* Whether no solution of x' = -a x grows: exp(-a t) by its series, squared until eigenvalues with a real part of -UNSTABLE
   have grown by far.  Redundant contacts have eigenvalues of zero, whose parts stay. */
static int decays(int64_t size, double (*a)[MOST_ROWS]) {
    double power[MOST_ROWS][MOST_ROWS], product[MOST_ROWS][MOST_ROWS], norm = 0.0;
    for (int64_t i = 0; i < size; i++) {
        double sum = 0.0;
        for (int64_t j = 0; j < size; j++) sum += __builtin_fabs(a[i][j]);
        norm = greatest(norm, sum);
        for (int64_t j = 0; j < size; j++) power[i][j] = i == j;
    }
    if (!(norm > 0.0)) return 1;
    for (int64_t term = TERMS; term > -SQUARINGS; term--) {
        /* Horner's rule, then squares */
        double largest = 0.0;
        for (int64_t i = 0; i < size; i++)
            for (int64_t j = 0; j < size; j++) {
                double sum = 0.0;
                for (int64_t k = 0; k < size; k++) sum += (term > 0 ? a[i][k] : power[i][k]) * power[k][j];
                product[i][j] = term > 0 ? (i == j) - sum / (norm * (double)term) : sum;
                largest = greatest(largest, __builtin_fabs(product[i][j]));
            }
        if (!(largest < GROWN)) return 0;
        for (int64_t i = 0; i < size; i++)
            for (int64_t j = 0; j < size; j++) power[i][j] = product[i][j];
    }
    return 1;
}

/* Whether compliant contacts in the place of those with a force return to them: no eigenvalue of the responses has a
   negative real part.  The symmetric part is sufficient.  Given normal forces do not respond. */
static int is_stable(const Collision *x, const double *force) {
    double a[MOST_ROWS][MOST_ROWS], half[MOST_ROWS][MOST_ROWS];
    int64_t held[MOST_ROWS], size = 0;
    for (int64_t k = 0; k < x->count; k++)
        for (int64_t i = x->first[k] + (x->given[k] ? 1 : 0); i < x->first[k + 1] && force[x->first[k]] > 0.0; i++)
            held[size++] = i;
    for (int64_t i = 0; i < size; i++)
        for (int64_t j = 0; j < size; j++) {
            double unit = x->unit[held[i]] * x->unit[held[j]];
            a[i][j] = x->matrix[held[i]][held[j]] * unit;
            half[i][j] = 0.5 * (a[i][j] + x->matrix[held[j]][held[i]] * unit) + (i == j ? UNSTABLE : 0.0);
        }
    int positive = 1;
    for (int64_t k = 0; k < size && positive; k++) {
        positive = half[k][k] > 0.0;
        for (int64_t i = k + 1; i < size; i++) {
            double factor = half[i][k] / half[k][k];
            for (int64_t j = k + 1; j < size; j++) half[i][j] -= factor * half[k][j];
        }
    }
    return positive || decays(size, a);
}
