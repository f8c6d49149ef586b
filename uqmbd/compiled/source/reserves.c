/* Forces of redundant contacts (four legs of a table) are not unique.  Chosen are those with the largest least reserve to
   the limits of contact and friction, or those that stay in the friction cones longest.

   Both are second-order cone problems.  Newton's method minimises their logarithmic barrier, whose weight grows (S. Boyd,
   L. Vandenberghe, Convex Optimization, Cambridge University Press 2004, sections 9.6 and 11.3). */
#include "group.h"

static const double STICKS_UP_TO = 1 + 1e-9; /* largest friction of a sticking contact, relative to its limit */
static const double AT_LIMIT = 3e-9;   /* reserve of friction, relative to its limit, that counts as zero */
static const double ROUNDED = 1e-11;   /* error of a reserve, relative to the size of contact forces */
static const double MOTIONLESS = 1e-9; /* relative size of a singular value that counts as zero */
static const double MOST_INTERNAL = 1e3;     /* largest ratio of internal forces to the least forces */
static const double LONGEST = 10.0;    /* longest time of admissible forces, relative to that of a change by their size */
static const double NEARLY = 1e3;      /* least ratio of the time of admissible forces to the optimality gap */
static const double CENTRED = 1e-3;    /* square of the Newton decrement that counts as zero */
static const double FASTER = 10.0;     /* factor on the weight of the objective between barrier problems */

enum {
    MOST_CLOSED = 12,
    MOST_ROWS = MOST_CLOSED * MOST_DIRECTIONS,
    UNKNOWNS = MOST_ROWS + 1, /* combinations of forces, and the reserve */
    CONES = 2 * MOST_CLOSED,
    NEWTON_STEPS = 60,
};

/* Closed contacts of a lane, with rows for their directions: the normal one first, without friction alone.  Dry friction
   of a joint is `given`: its normal force is its limit, and its normal direction has no motion. */
typedef struct {
    int64_t count, event[MOST_CLOSED], first[MOST_CLOSED + 1], direction[MOST_ROWS];
    int given[MOST_CLOSED];
    double restitution[MOST_CLOSED], friction[MOST_CLOSED];
    double matrix[MOST_ROWS][MOST_ROWS], natural[MOST_ROWS], speed[MOST_ROWS];
} Closed;

/* Forces of all rows per unknown, and the row in which each unknown prevents motion. */
typedef struct {
    int64_t size, row[MOST_ROWS];
    double column[MOST_ROWS][MOST_ROWS];
} Spread;

/* Cones p >= |T| with (p, T) = begin + slope x; the last unknown is the reserve. */
typedef struct {
    int64_t cones, unknowns;
    double begin[CONES][MOST_DIRECTIONS], slope[CONES][MOST_DIRECTIONS][UNKNOWNS];
} Barrier;

static double magnitude_of(const double *x, int64_t count) {
    double most = 0.0;
    for (int64_t i = 0; i < count; i++)
        if (!(__builtin_fabs(x[i]) <= most)) most = __builtin_fabs(x[i]); /* keeps NaN */
    return most;
}

/* -- barrier -------------------------------------------------------------------------------------------------------- */

static double tangential(const double *cone) { return __builtin_sqrt(cone[1] * cone[1] + cone[2] * cone[2]); }

static void place_cone(const Barrier *b, int64_t k, const double *x, double *cone) {
    for (int64_t i = 0; i < MOST_DIRECTIONS; i++) {
        cone[i] = b->begin[k][i];
        for (int64_t j = 0; j < b->unknowns; j++) cone[i] += b->slope[k][i][j] * x[j];
    }
}

/* Room to the largest internal forces. */
static double room_of(const Barrier *b, const double *x) {
    double room = MOST_INTERNAL * MOST_INTERNAL;
    for (int64_t j = 0; j < b->unknowns - 1; j++) room -= x[j] * x[j];
    return room;
}

static int is_inside(const Barrier *b, const double *x) {
    double cone[MOST_DIRECTIONS];
    for (int64_t k = 0; k < b->cones; k++) {
        place_cone(b, k, x, cone);
        if (!(cone[0] - tangential(cone) > 0.0)) return 0;
    }
    return x[b->unknowns - 1] < 1.0 && room_of(b, x) > 0.0;
}

/* Solve a symmetric system, whose lower half is given, by elimination with row pivots; whether it is regular. */
static int solve_symmetric(int64_t n, double (*a)[UNKNOWNS], double *x) {
    double scale[UNKNOWNS];
    for (int64_t i = 0; i < n; i++) {
        if (!(a[i][i] > 0.0)) return 0;
        scale[i] = 1.0 / __builtin_sqrt(a[i][i]);
        x[i] *= scale[i];
    }
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j <= i; j++) a[i][j] = a[j][i] = a[i][j] * scale[i] * scale[j];
    for (int64_t k = 0; k < n; k++) {
        int64_t best = k;
        for (int64_t i = k + 1; i < n; i++)
            if (__builtin_fabs(a[i][k]) > __builtin_fabs(a[best][k])) best = i;
        if (!(__builtin_fabs(a[best][k]) > 0.0)) return 0;
        for (int64_t j = k; j < n; j++) {
            double own = a[k][j];
            a[k][j] = a[best][j];
            a[best][j] = own;
        }
        double own = x[k];
        x[k] = x[best];
        x[best] = own;
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
    for (int64_t i = 0; i < n; i++) x[i] *= scale[i];
    return 1;
}

/* Newton's step of objective and barrier; the square of its decrement, negative without a step. */
static double newton_step(const Barrier *b, const double *x, double weight, double *step) {
    static const double sign[MOST_DIRECTIONS] = {1.0, -1.0, -1.0};
    int64_t n = b->unknowns, last = n - 1;
    double hessian[UNKNOWNS][UNKNOWNS], gradient[UNKNOWNS] = {0.0}, decrement = 0.0;
    for (int64_t i = 0; i < n; i++)
        for (int64_t j = 0; j < n; j++) hessian[i][j] = 0.0;
    for (int64_t k = 0; k < b->cones; k++) {
        double cone[MOST_DIRECTIONS], rise[UNKNOWNS];
        place_cone(b, k, x, cone);
        double size = tangential(cone), product = (cone[0] - size) * (cone[0] + size);
        for (int64_t j = 0; j < n; j++) {
            rise[j] = 0.0;
            for (int64_t d = 0; d < MOST_DIRECTIONS; d++) rise[j] += 2.0 / product * sign[d] * cone[d] * b->slope[k][d][j];
            gradient[j] -= rise[j];
        }
        for (int64_t i = 0; i < n; i++)
            for (int64_t j = 0; j <= i; j++) {
                double sum = rise[i] * rise[j];
                for (int64_t d = 0; d < MOST_DIRECTIONS; d++)
                    sum -= 2.0 / product * sign[d] * b->slope[k][d][i] * b->slope[k][d][j];
                hessian[i][j] += sum;
            }
    }
    double top = 1.0 - x[last], room = room_of(b, x);
    gradient[last] += 1.0 / top - weight;
    hessian[last][last] += 1.0 / (top * top);
    for (int64_t i = 0; i < last; i++) {
        gradient[i] += 2.0 * x[i] / room;
        for (int64_t j = 0; j <= i; j++) hessian[i][j] += 4.0 * x[i] * x[j] / (room * room) + (i == j ? 2.0 / room : 0.0);
    }
    for (int64_t i = 0; i < n; i++) step[i] = -gradient[i];
    if (!solve_symmetric(n, hessian, step)) return -1.0;
    for (int64_t i = 0; i < n; i++) decrement -= gradient[i] * step[i];
    return decrement;
}

/* Minimise objective and barrier from a point inside.  The barrier is self-concordant: steps of this length descend. */
static void centre(const Barrier *b, double weight, double *x) {
    double step[UNKNOWNS], tried[UNKNOWNS];
    for (int64_t count = 0; count < NEWTON_STEPS; count++) {
        double decrement = newton_step(b, x, weight, step);
        if (!(decrement > CENTRED)) return;
        double length = decrement < 0.1 ? 1.0 : 1.0 / (1.0 + __builtin_sqrt(decrement));
        for (;; length *= 0.5) {
            for (int64_t i = 0; i < b->unknowns; i++) tried[i] = x[i] + length * step[i];
            if (is_inside(b, tried)) break;
            if (!(length > 1e-9)) return;
        }
        for (int64_t i = 0; i < b->unknowns; i++) x[i] = tried[i];
    }
}

/* -- contacts as cones ---------------------------------------------------------------------------------------------- */

static int has_cone(const Closed *c, const int64_t *mode, int64_t k) {
    return mode[k] == STICK && c->first[k + 1] > c->first[k] + 1;
}

/* Reserve of a contact, N: of friction to its limit, or the normal force. */
static double reserve_of(const Closed *c, const int64_t *mode, int64_t k, const double *force) {
    double along = 0.0;
    const double *own = force + c->first[k];
    if (!has_cone(c, mode, k)) return own[0];
    for (int64_t i = 1; i < c->first[k + 1] - c->first[k]; i++) along += own[i] * own[i];
    return STICKS_UP_TO * c->friction[k] * own[0] - __builtin_sqrt(along);
}

/* Size of the forces of contacts, without given limits of dry friction. */
static double size_of_forces(const Closed *c, const double *force) {
    double most = 0.0;
    for (int64_t k = 0; k < c->count; k++)
        for (int64_t i = c->first[k] + (c->given[k] ? 1 : 0); i < c->first[k + 1]; i++)
            most = greatest(most, __builtin_fabs(force[i]));
    return most;
}

/* Add the cone of a contact, relative to its size; `reserve`: by what it shrinks with the last unknown. */
static void add_cone(const Closed *c, const int64_t *mode, int64_t k, const double *force, double (*ways)[MOST_ROWS],
                     int64_t count, double size, Barrier *b) {
    int64_t at = b->cones++, first = c->first[k], rows = has_cone(c, mode, k) ? c->first[k + 1] - first : 1;
    for (int64_t i = 0; i < MOST_DIRECTIONS; i++) {
        double factor = (i ? 1.0 : rows > 1 ? STICKS_UP_TO * c->friction[k] : 1.0) / size;
        b->begin[at][i] = i < rows ? factor * force[first + i] : 0.0;
        for (int64_t j = 0; j < count; j++) b->slope[at][i][j] = i < rows ? factor * ways[j][first + i] : 0.0;
        b->slope[at][i][count] = 0.0;
    }
    b->unknowns = count + 1;
}

/* Scale combinations of forces to the largest force; whether all are finite. */
static int scale_ways(const Closed *c, double largest, double (*ways)[MOST_ROWS], int64_t count) {
    int64_t rows = c->first[c->count];
    for (int64_t j = 0; j < count; j++) {
        double size = magnitude_of(ways[j], rows);
        if (!(is_finite(size) && size > 0.0)) return 0;
        for (int64_t i = 0; i < rows; i++) ways[j][i] *= largest / size;
    }
    return 1;
}

static void add_ways(const Closed *c, double (*ways)[MOST_ROWS], int64_t count, const double *x, double *force) {
    for (int64_t i = 0; i < c->first[c->count]; i++)
        for (int64_t j = 0; j < count; j++) force[i] += ways[j][i] * x[j];
}

/* Change forces by combinations of `ways`, which cause no motion, so that the least reserve is largest. */
static void enlarge_reserves(const Closed *c, const int64_t *mode, double (*ways)[MOST_ROWS], int64_t count,
                             double *force) {
    double largest = magnitude_of(force, c->first[c->count]), x[UNKNOWNS] = {0.0}, least = 1.0;
    if (!(count && largest > 0.0 && is_finite(largest) && scale_ways(c, largest, ways, count))) return;
    Barrier b;
    b.cones = 0;
    b.unknowns = count + 1;
    for (int64_t k = 0; k < c->count; k++) {
        if (mode[k] == OPEN) continue;
        /* the reserve of contacts with unique forces cannot increase */
        double moved = 0.0;
        for (int64_t j = 0; j < count; j++)
            moved = greatest(moved, magnitude_of(ways[j] + c->first[k], has_cone(c, mode, k) ? c->first[k + 1] - c->first[k] : 1));
        if (!(moved > MOTIONLESS * largest)) continue;
        add_cone(c, mode, k, force, ways, count, greatest(__builtin_fabs(force[c->first[k]]), 1e-6 * largest), &b);
        double width = has_cone(c, mode, k) ? STICKS_UP_TO * c->friction[k] : 1.0;
        b.slope[b.cones - 1][0][count] = -width;
        double room = (b.begin[b.cones - 1][0] - tangential(b.begin[b.cones - 1])) / width;
        least = room < least ? room : least;
    }
    x[count] = least - 1.0;
    for (double weight = 1.0;; weight *= FASTER) {
        centre(&b, weight, x);
        double gap = (2.0 * (double)b.cones + 3.0) / weight, room = x[count];
        if (room > gap || room < -gap - AT_LIMIT || gap < ROUNDED) break;
    }
    add_ways(c, ways, count, x, force);
}

/* Change forces by combinations of `ways` so that they stay in the friction cones longest at a `rate`. */
static void prolong_forces(const Closed *c, const int64_t *mode, double (*ways)[MOST_ROWS], int64_t count,
                           const double *rate, double *force) {
    int64_t rows = c->first[c->count];
    double largest = magnitude_of(force, rows), fastest = magnitude_of(rate, rows), x[UNKNOWNS] = {0.0};
    if (!(count && largest > 0.0 && fastest > 0.0 && is_finite(largest) && is_finite(fastest))) return;
    if (!scale_ways(c, largest, ways, count)) return;
    Barrier b;
    b.cones = 0;
    b.unknowns = count + 1;
    for (int64_t later = 0; later < 2; later++)
        for (int64_t k = 0; k < c->count; k++) {
            if (mode[k] == OPEN) continue;
            double size = greatest(__builtin_fabs(force[c->first[k]]), 1e-6 * largest);
            add_cone(c, mode, k, force, ways, count, size, &b);
            int64_t at = b.cones - 1, first = c->first[k], own = has_cone(c, mode, k) ? c->first[k + 1] - first : 1;
            for (int64_t i = 0; i < own && later; i++) {
                double factor = i ? 1.0 : own > 1 ? STICKS_UP_TO * c->friction[k] : 1.0;
                b.slope[at][i][count] = factor * rate[first + i] * (LONGEST * largest / fastest) / size;
            }
        }
    if (!is_inside(&b, x)) return;
    for (double weight = 1.0;; weight *= FASTER) {
        centre(&b, weight, x);
        double gap = (2.0 * (double)b.cones + 3.0) / weight;
        if (x[count] > NEARLY * gap || gap < ROUNDED) break;
    }
    add_ways(c, ways, count, x, force);
}

/* -- forces of closed contacts in given states ---------------------------------------------------------------------- */

/* Direction in which a contact slides, which continues through zero. */
static void direction_of(const Closed *c, int64_t k, const double *heading, double *direction) {
    int64_t first = c->first[k], tangents = c->first[k + 1] - first - 1;
    double fast = 0.0, along = 0.0;
    for (int64_t i = 0; i < tangents; i++) {
        direction[i] = heading[i];
        fast += c->speed[first + 1 + i] * c->speed[first + 1 + i];
        along += c->speed[first + 1 + i] * heading[i];
    }
    fast = __builtin_sqrt(fast);
    for (int64_t i = 0; i < tangents && tangents > 1 && fast > 1e-12; i++)
        direction[i] = (along < 0.0 ? -1.0 : 1.0) * c->speed[first + 1 + i] / fast;
}

static void set_spread(const Closed *c, const int64_t *mode, double (*heading)[2], Spread *x) {
    int64_t rows = c->first[c->count];
    x->size = 0;
    for (int64_t k = 0; k < c->count; k++) {
        int64_t first = c->first[k], own = c->first[k + 1] - first;
        for (int64_t i = 0; i < (mode[k] == OPEN ? 0 : mode[k] == STICK ? own : 1); i++) {
            double *column = x->column[x->size];
            for (int64_t d = 0; d < rows; d++) column[d] = 0.0;
            column[first + i] = 1.0;
            x->row[x->size++] = first + i;
        }
        if (mode[k] != SLIP) continue;
        double direction[2];
        direction_of(c, k, heading[k], direction);
        for (int64_t i = 1; i < own; i++) x->column[x->size - 1][first + i] = -c->friction[k] * direction[i - 1];
    }
}

/* Unit of the force in a row. */
static double unit_of(const Closed *c, int64_t row) {
    return 1.0 / __builtin_sqrt(greatest(__builtin_fabs(c->matrix[row][row]), 1e-300));
}

/* The least forces without motion in the rows of the unknowns. */
static void least_forces(const Closed *c, const Spread *x, Lane *s, double *force) {
    int64_t rows = c->first[c->count];
    for (int64_t d = 0; d < rows; d++) force[d] = 0.0;
    if (!x->size) return;
    for (int64_t i = 0; i < x->size; i++) {
        s->unit[i] = unit_of(c, x->row[i]);
        s->right[i] = -c->natural[x->row[i]];
        for (int64_t j = 0; j < x->size; j++) {
            double sum = 0.0;
            for (int64_t d = 0; d < rows; d++) sum += c->matrix[x->row[i]][d] * x->column[j][d];
            s->inner[i * x->size + j] = sum;
        }
    }
    least_solution(s, x->size);
    for (int64_t d = 0; d < rows; d++)
        for (int64_t j = 0; j < x->size; j++) force[d] += x->column[j][d] * s->found[j];
}

static void respond_closed(const Closed *c, const double *force, double *rate) {
    int64_t rows = c->first[c->count];
    for (int64_t i = 0; i < rows; i++) {
        rate[i] = c->natural[i];
        for (int64_t j = 0; j < rows; j++) rate[i] += c->matrix[i][j] * force[j];
    }
}

/* Combinations of forces that cause no motion; their number. */
static int64_t find_ways(const Closed *c, const Spread *x, Lane *s, double (*ways)[MOST_ROWS]) {
    int64_t rows = c->first[c->count], size = x->size, count = 0;
    double scale[MOST_ROWS], square[MOST_ROWS], most = 0.0;
    for (int64_t j = 0; j < size; j++) {
        double sum = 0.0;
        for (int64_t d = 0; d < rows; d++) {
            double value = x->column[j][d] / unit_of(c, d);
            sum += value * value;
        }
        scale[j] = sum > 0.0 ? 1.0 / __builtin_sqrt(sum) : 1.0;
        for (int64_t k = 0; k < rows; k++) {
            sum = 0.0;
            for (int64_t d = 0; d < rows; d++) sum += c->matrix[k][d] * x->column[j][d];
            s->inner[k * size + j] = unit_of(c, k) * sum * scale[j];
        }
    }
    turn_columns(s->inner, s->turn, rows, size);
    for (int64_t j = 0; j < size; j++) {
        square[j] = 0.0;
        for (int64_t k = 0; k < rows; k++) square[j] += s->inner[k * size + j] * s->inner[k * size + j];
        most = greatest(most, square[j]);
    }
    for (int64_t j = 0; j < size; j++) {
        if (square[j] > MOTIONLESS * MOTIONLESS * most) continue;
        for (int64_t d = 0; d < rows; d++) {
            ways[count][d] = 0.0;
            for (int64_t i = 0; i < size; i++) ways[count][d] += x->column[i][d] * scale[i] * s->turn[i * size + j];
        }
        count++;
    }
    return count;
}
