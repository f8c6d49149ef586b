/* Laws of one contact: the impulse of an impact, and the state of a closed contact.

   The impulse of an impact, or the forces of a closed contact at rest, and the speeds or accelerations after it, solve
   one set-valued problem: Newton's law of restitution, Signorini's law of contact, and Coulomb's law of friction.  The
   first solution in the order stick, slip on, other slips, no impulse is used. */
#include "group.h"

static const double CLEAR = 1e-6;   /* least relative response of a sliding contact, and least relative pivot */
static const double EXACT = 1e-10;  /* largest violation of the laws, relative to the size of impulses */
static const double FED = 1e-12;    /* energy, relative to impulses times speeds, that counts as zero */
static const double RESTS = 1e-8;   /* acceleration along the surface, relative to all accelerations, that counts as zero */

enum {
    MOST_DIRECTIONS = 3,
    DIRECTIONS = 4, /* most directions of slip in space */
    BISECTIONS = 60,
};

static const double FIFTH[2] = {0.30901699437494745, 0.9510565162951535}; /* cosine and sine of a fifth of a turn */

/* One contact of a lane: rates of the speeds per force, and without forces, and speeds; direction 0 is the normal one. */
typedef struct {
    int64_t count; /* directions with friction; one without */
    double matrix[MOST_DIRECTIONS][MOST_DIRECTIONS], natural[MOST_DIRECTIONS], speed[MOST_DIRECTIONS];
    double restitution, friction, gap;
} Touch;

static double greatest(double a, double b) { return a > b ? a : b; }

static int is_finite(double x) { return x - x == 0.0; }

/* Length of the part of a vector along the surface. */
static double length_along(const Touch *t, const double *x) {
    double sum = 0.0;
    for (int64_t i = 1; i < t->count; i++) sum += x[i] * x[i];
    return __builtin_sqrt(sum);
}

/* Speeds after impulses, or accelerations with forces. */
static void respond_to(const Touch *t, const double *before, const double *impulse, double *after) {
    for (int64_t i = 0; i < t->count; i++) {
        after[i] = before[i];
        for (int64_t j = 0; j < t->count; j++) after[i] += t->matrix[i][j] * impulse[j];
    }
}

/* What is known when impulses are sought: the largest jump of a speed in earlier collisions at the same instant, whose
   rounding errors remain in the speeds, and the energy that they have exchanged; negative: forces may add energy. */
typedef struct {
    double jump, energy;
} Earlier;

static const Earlier NONE = {0.0, 0.0}, FORCES = {0.0, -1.0};

/* Whether impulses satisfy the laws with a normal speed of at least `rebound` after them, and add no energy. */
static int satisfies(const Touch *t, const double *before, double rebound, const double *impulse, Earlier earlier) {
    double after[MOST_DIRECTIONS], wanted[MOST_DIRECTIONS], diagonal = 1e-300, added = 0.0, worked = 0.0;
    double size = greatest(greatest(__builtin_fabs(before[0]), earlier.jump), 1e-300), off = 0.0;
    for (int64_t i = 0; i < t->count; i++) {
        if (!is_finite(impulse[i])) return 0;
        diagonal = greatest(diagonal, __builtin_fabs(t->matrix[i][i]));
    }
    respond_to(t, before, impulse, after);
    wanted[0] = greatest(0.0, impulse[0] - (after[0] - rebound) / diagonal);
    for (int64_t i = 1; i < t->count; i++) wanted[i] = impulse[i] - after[i] / diagonal;
    double length = length_along(t, wanted), most = t->friction * wanted[0];
    for (int64_t i = 0; i < t->count; i++) {
        if (i && length > most) wanted[i] *= most / length;
        size = greatest(size, __builtin_fabs(impulse[i]) * diagonal);
        off = greatest(off, __builtin_fabs(impulse[i] - wanted[i]) * diagonal);
        added += 0.5 * impulse[i] * (before[i] + after[i]);
        worked += __builtin_fabs(impulse[i] * before[i]);
    }
    return off <= EXACT * size && (earlier.energy < 0.0 || added <= FED * greatest(worked, earlier.energy));
}

/* Solve matrix x = right by elimination, without pivots; whether all pivots are clear of zero. */
static int solve_small(const Touch *t, const double *right, double *x) {
    double a[MOST_DIRECTIONS][MOST_DIRECTIONS], trace = 0.0;
    int64_t n = t->count;
    for (int64_t i = 0; i < n; i++) {
        trace += t->matrix[i][i];
        x[i] = right[i];
        for (int64_t j = 0; j < n; j++) a[i][j] = t->matrix[i][j];
    }
    for (int64_t k = 0; k < n; k++) {
        if (!(a[k][k] > CLEAR * trace)) return 0;
        for (int64_t i = k + 1; i < n; i++) {
            double factor = a[i][k] / a[k][k];
            for (int64_t j = k + 1; j < n; j++) a[i][j] -= factor * a[k][j];
            x[i] -= factor * x[k];
        }
    }
    for (int64_t k = n - 1; k >= 0; k--) {
        for (int64_t j = k + 1; j < n; j++) x[k] -= a[k][j] * x[j];
        x[k] /= a[k][k];
    }
    return 1;
}

/* Impulses that end all slip; the least ones, if a direction has no motion. */
static void stick(const Touch *t, const double *before, double rebound, Lane *s, double *impulse) {
    double right[MOST_DIRECTIONS] = {rebound - before[0]};
    int64_t n = t->count;
    for (int64_t i = 1; i < n; i++) right[i] = -before[i];
    if (solve_small(t, right, impulse)) return;
    for (int64_t i = 0; i < n; i++) {
        s->unit[i] = 1.0;
        s->right[i] = right[i];
        for (int64_t j = 0; j < n; j++) s->inner[i * n + j] = t->matrix[i][j];
    }
    least_solution(s, n);
    for (int64_t i = 0; i < n; i++) impulse[i] = s->found[i];
}

/* Change of the normal speed per normal impulse of a slip in a direction (tangent). */
static double sliding_response(const Touch *t, const double *direction) {
    double found = t->matrix[0][0];
    for (int64_t i = 1; i < t->count; i++) found -= t->friction * t->matrix[0][i] * direction[i - 1];
    return found;
}

static void turn_by(const double *turn, double *direction) {
    double x = direction[0], y = direction[1];
    direction[0] = turn[0] * x - turn[1] * y;
    direction[1] = turn[1] * x + turn[0] * y;
}

/* Slip across a direction in space, times the response of a slip in it: zero for the direction of slip. */
static double slip_across(const Touch *t, const double *before, double jump, const double *direction) {
    double slip[2], response = sliding_response(t, direction);
    for (int64_t i = 0; i < 2; i++) {
        const double *row = t->matrix[i + 1];
        double friction = t->friction * (row[1] * direction[0] + row[2] * direction[1]);
        slip[i] = before[i + 1] * response + jump * (row[0] - friction);
    }
    return direction[0] * slip[1] - direction[1] * slip[0];
}

/* Value of a polynomial with coefficients of ascending powers. */
static double value_of(const double *c, int64_t degree, double x) {
    double sum = c[degree];
    for (int64_t i = degree - 1; i >= 0; i--) sum = sum * x + c[i];
    return sum;
}

/* Real roots of a polynomial of fourth degree, ascending; their number.  Those of each derivative separate those of the
   next one, so that close roots are found as well. */
static int64_t real_roots(const double *c, double *found) {
    double largest = 0.0, ends[6], derivative[5];
    int64_t count = 0;
    for (int64_t i = 0; i < 4; i++) largest = greatest(largest, __builtin_fabs(c[i] / c[4]));
    for (int64_t degree = 1; degree <= 4; degree++) {
        for (int64_t i = 0; i <= degree; i++) {
            derivative[i] = c[i + 4 - degree];
            for (int64_t k = 0; k < 4 - degree; k++) derivative[i] *= (double)(i + 1 + k);
        }
        ends[0] = -1.0 - largest; /* Cauchy's bound, also of the derivatives */
        for (int64_t i = 0; i < count; i++) ends[i + 1] = found[i];
        ends[count + 1] = 1.0 + largest;
        int64_t parts = count + 1;
        count = 0;
        for (int64_t k = 0; k < parts; k++) {
            double low = ends[k], high = ends[k + 1];
            double below = value_of(derivative, degree, low), above = value_of(derivative, degree, high);
            if (!(below * above <= 0.0) || above == 0.0) continue;
            for (int64_t step = 0; step < BISECTIONS; step++) {
                double middle = 0.5 * (low + high);
                int lower = below * value_of(derivative, degree, middle) > 0.0;
                *(lower ? &low : &high) = middle;
            }
            found[count++] = high;
        }
    }
    return count;
}

/* Directions of slip that are possible (DIRECTIONS, 2), the nearest one to the present slip first; their number.  The
   slip across them is zero: a polynomial in the tangent of half the angle from a direction, opposite to which this slip
   is large. */
static int64_t slip_directions(const Touch *t, const double *before, double jump, double (*found)[2]) {
    if (t->count == 2) {
        found[0][0] = __builtin_copysign(1.0, before[1]);
        found[1][0] = -found[0][0];
        return 2;
    }
    double fast = length_along(t, before), first[2] = {1.0, 0.0}, from[2] = {1.0, 0.0}, best[2] = {1.0, 0.0}, most = 0.0;
    for (int64_t i = 0; i < 2 && fast > 0.0; i++) first[i] = before[i + 1] / fast;
    for (int64_t k = 0; k < 5; k++) {
        double back[2] = {-from[0], -from[1]}, across = __builtin_fabs(slip_across(t, before, jump, back));
        if (across > most) {
            most = across;
            for (int64_t i = 0; i < 2; i++) best[i] = from[i];
        }
        turn_by(FIFTH, from);
    }
    if (!(most > 0.0)) return 0;
    /* slip, responses and friction in the axes of this direction and of the one perpendicular to it */
    double axes[2][2] = {{best[0], best[1]}, {-best[1], best[0]}}, natural[2], share[2], friction[2][2];
    for (int64_t i = 0; i < 2; i++) {
        natural[i] = share[i] = 0.0;
        for (int64_t a = 0; a < 2; a++) {
            natural[i] += axes[i][a] * (before[a + 1] * t->matrix[0][0] + jump * t->matrix[a + 1][0]);
            share[i] += axes[i][a] * t->matrix[0][a + 1];
        }
    }
    for (int64_t i = 0; i < 2; i++)
        for (int64_t j = 0; j < 2; j++) {
            double sum = 0.0;
            for (int64_t a = 0; a < 2; a++) {
                sum += axes[i][a] * before[a + 1] * share[j];
                for (int64_t b = 0; b < 2; b++) sum += axes[i][a] * jump * t->matrix[a + 1][b + 1] * axes[j][b];
            }
            friction[i][j] = t->friction * sum;
        }
    double on = -friction[1][0], off = friction[0][0] - friction[1][1], back = friction[0][1];
    double c[5] = {natural[1] + on, 2.0 * (off - natural[0]), 4.0 * back - 2.0 * on, -2.0 * (off + natural[0]),
                   on - natural[1]};
    double roots[4];
    int64_t count = real_roots(c, roots);
    for (int64_t k = 0; k < count; k++) {
        double x = roots[k], size = 1.0 + x * x, along = (1.0 - x * x) / size, across = 2.0 * x / size, direction[2];
        for (int64_t i = 0; i < 2; i++) direction[i] = along * axes[0][i] + across * axes[1][i];
        double near = direction[0] * first[0] + direction[1] * first[1];
        int64_t place = k;
        for (; place > 0 && found[place - 1][0] * first[0] + found[place - 1][1] * first[1] < near; place--)
            for (int64_t i = 0; i < 2; i++) found[place][i] = found[place - 1][i];
        for (int64_t i = 0; i < 2; i++) found[place][i] = direction[i];
    }
    return count;
}

/* The first impulses, or forces, that satisfy the laws; whether there are some. */
static int first_solution(const Touch *t, const double *before, double rebound, Earlier earlier, Lane *s,
                          double *impulse) {
    double directions[DIRECTIONS][2];
    stick(t, before, rebound, s, impulse);
    if (satisfies(t, before, rebound, impulse, earlier)) return 1;
    int64_t count = t->count > 1 ? slip_directions(t, before, rebound - before[0], directions) : 0;
    for (int64_t k = 0; k < count; k++) {
        impulse[0] = (rebound - before[0]) / sliding_response(t, directions[k]);
        for (int64_t i = 1; i < t->count; i++) impulse[i] = -t->friction * impulse[0] * directions[k][i - 1];
        if (satisfies(t, before, rebound, impulse, earlier)) return 1;
    }
    for (int64_t i = 0; i < t->count; i++) impulse[i] = 0.0;
    return satisfies(t, before, rebound, impulse, earlier);
}

/* The impulse of an impact, and the normal speed after it; whether it is known.  An impact is without restitution if no
   impulse with restitution satisfies the laws. */
static int solve_impact(const Touch *t, Lane *s, double *impulse, double *after) {
    double rebound = greatest(0.0, -t->restitution * t->speed[0]), speeds[MOST_DIRECTIONS];
    if (!first_solution(t, t->speed, rebound, NONE, s, impulse) && !first_solution(t, t->speed, 0.0, NONE, s, impulse))
        return 0;
    respond_to(t, t->speed, impulse, speeds);
    *after = speeds[0];
    return 1;
}

/* Direction in which a contact starts to slide: against its friction. */
static void against(const Touch *t, const double *force, double *heading) {
    double friction = length_along(t, force);
    for (int64_t i = 1; i < t->count; i++) heading[i - 1] = friction > 0.0 ? -force[i] / friction : i == 1;
}

/* The mode of a closed contact, and the direction in which it slides if it slips; -1 if no forces satisfy the laws, if
   several motions may do.  Speeds up to `slow` count as zero. */
static int64_t mode_of(const Touch *t, double slow, Lane *s, double *heading) {
    double response = t->matrix[0][0], force[MOST_DIRECTIONS], after[MOST_DIRECTIONS], largest = 0.0, most = 0.0;
    for (int64_t i = 0; i < t->count; i++) {
        if (!is_finite(t->natural[i])) return -1;
        largest = greatest(largest, __builtin_fabs(t->natural[i]));
    }
    if (!(__builtin_fabs(t->speed[0]) <= slow && response > 0.0)) return -1;
    if (t->count == 1) return t->natural[0] < 0.0 ? SMOOTH : OPEN;
    double fast = length_along(t, t->speed);
    if (fast > slow) {
        for (int64_t i = 1; i < t->count; i++) heading[i - 1] = t->speed[i] / fast;
        if (!(sliding_response(t, heading) > CLEAR * response)) return -1; /* Painleve's paradox */
        return t->natural[0] < 0.0 ? SLIP : OPEN;
    }
    /* a slip in the worst direction: otherwise another motion may satisfy the laws as well */
    if (!(response - t->friction * length_along(t, t->matrix[0]) > CLEAR * response)) return -1;
    if (!first_solution(t, t->natural, 0.0, FORCES, s, force)) return -1;
    respond_to(t, t->natural, force, after);
    for (int64_t i = 0; i < t->count; i++) most = greatest(most, __builtin_fabs(force[i]));
    if (force[0] <= EXACT * most) return OPEN;
    if (length_along(t, after) <= RESTS * largest) return STICK; /* at the limit of friction, it begins to slip at once */
    against(t, force, heading);
    return SLIP;
}
