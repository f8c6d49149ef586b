/* Persistent contacts: their forces, and the projection of states onto them. */
#include "group.h"

static const double SINGULAR = 1e-11; /* relative size of a singular value that counts as zero */
static const double DEFECT = 1e-9;    /* defect of a row of the index-1 system, relative to its terms, of a poor solution */
static const double ROUNDING_OF_ROWS = 1e-14; /* the same, relative to the largest terms of all rows */

/* Arrays of one lane, in the workspace of the caller. */
typedef struct {
    double *answer;   /* (direction, direction): rates of the speeds per force */
    double *free;     /* (direction): rates of the speeds without forces */
    double *force, *rate;
    double *spread;   /* (direction, row): forces per unknown */
    double *inner, *turn, *right, *unit, *found;
    int64_t *active, *held;
    int64_t count;    /* directions in which forces may act */
} Lane;

int64_t contact_workspace(const Contacts *c) {
    int64_t n = c->directions;
    int64_t vectors = 2 * c->events * (SAMPLES + 2) + c->size * c->size + (2 * c->size + n) * (1 + n);
    return vectors * LANES + 4 * n * n + 9 * n + LANES;
}

static void place_contacts(const Contacts *c, Group *g, V *at) {
    g->guards = at;
    at += 2 * c->events;
    g->samples = at;
    at += 2 * c->events * (SAMPLES + 1);
    g->system = at;
    at += c->size * c->size;
    g->answers = at;
    at += c->size * (1 + c->directions);
    g->spare = at;
    at += c->size * (1 + c->directions);
    g->responses = at;
    at += c->directions * (1 + c->directions);
    g->needed = (int64_t *)at;
    g->numbers = (double *)(g->needed + c->directions);
}

static Lane lane_of(const Contacts *c, const Group *g) {
    int64_t n = c->directions;
    Lane s;
    double *at = g->numbers;
    s.answer = at;
    at += n * n;
    s.spread = at;
    at += n * n;
    s.inner = at;
    at += n * n;
    s.turn = at;
    at += n * n;
    s.free = at;
    s.force = at + n;
    s.rate = at + 2 * n;
    s.right = at + 3 * n;
    s.unit = at + 4 * n;
    s.found = at + 5 * n;
    s.active = (int64_t *)(at + 6 * n);
    s.held = (int64_t *)(at + 7 * n);
    s.count = 0;
    return s;
}

/* Whether a member has persistent contacts. */
static int touches(const Contacts *c, const Encounters *e, int64_t m) {
    for (int64_t k = 0; k < c->events; k++)
        if (e->mode[m * c->events + k] != OPEN) return 1;
    return 0;
}

/* -- linear algebra of all lanes ------------------------------------------------------------------------------------ */

static void exchange(V *a, V *b, Mask which, int64_t count) {
    for (int64_t j = 0; j < count; j++) {
        V x = a[j];
        a[j] = choose(which, b[j], x);
        b[j] = choose(which, x, b[j]);
    }
}

/* Solve a x = b, with `columns` right-hand sides, by elimination with the row pivots of each lane; infinite or NaN: it is
   singular. */
static void eliminate(V *a, V *b, int64_t size, int64_t columns) {
    for (int64_t i = 0; i < size; i++) { /* rows of light bodies are scaled up */
        V most = splat(0.0);
        for (int64_t j = 0; j < size; j++) most = larger(magnitude(a[i * size + j]), most);
        V scale = choose(most > splat(0.0), 1.0 / most, splat(1.0));
        for (int64_t j = 0; j < size; j++) a[i * size + j] *= scale;
        for (int64_t j = 0; j < columns; j++) b[i * columns + j] *= scale;
    }
    for (int64_t k = 0; k < size; k++) {
        V most = magnitude(a[k * size + k]), best = splat((double)k);
        for (int64_t i = k + 1; i < size; i++) {
            Mask better = magnitude(a[i * size + k]) > most;
            most = choose(better, magnitude(a[i * size + k]), most);
            best = choose(better, splat((double)i), best);
        }
        for (int64_t i = k + 1; i < size; i++) {
            Mask which = best == splat((double)i);
            if (!any(which)) continue;
            exchange(a + k * size + k, a + i * size + k, which, size - k);
            exchange(b + k * columns, b + i * columns, which, columns);
        }
        V inverse = 1.0 / a[k * size + k];
        for (int64_t i = k + 1; i < size; i++) {
            V factor = a[i * size + k] * inverse;
            if (!any(factor != splat(0.0))) continue;
            for (int64_t j = k + 1; j < size; j++) a[i * size + j] -= factor * a[k * size + j];
            for (int64_t j = 0; j < columns; j++) b[i * columns + j] -= factor * b[k * columns + j];
        }
    }
    for (int64_t k = size - 1; k >= 0; k--) {
        for (int64_t i = k + 1; i < size; i++) {
            V x = a[k * size + i];
            if (!any(x != splat(0.0))) continue;
            for (int64_t j = 0; j < columns; j++) b[k * columns + j] -= x * b[i * columns + j];
        }
        for (int64_t j = 0; j < columns; j++) b[k * columns + j] /= a[k * size + k];
    }
}

/* Accelerations and multipliers without forces, and per force in each direction, by elimination with pivots. */
static void eliminate_lanes(const Problem *p, Group *g, V *found) {
    const Contacts *c = p->contacts;
    int64_t n = p->coordinates, size = c->size, columns = 1 + c->directions;
    fill(g->system, 0.0, size * size);
    for (int64_t e = 0; e < c->entries; e++) g->system[c->rows[e] * size + c->columns[e]] = g->work[c->values[e]];
    for (int64_t i = 0; i < size; i++) {
        found[i * columns] = g->work[c->right[i]];
        for (int64_t d = 0; d < c->directions; d++)
            found[i * columns + 1 + d] = i < n ? g->work[c->slope[d * n + i]] : splat(0.0);
    }
    eliminate(g->system, found, size, columns);
}

/* Lanes in which the solution of a right-hand side, both in the work array, has a defect.  Rounding is none, also where
   the terms of a row are themselves the rounding errors of others. */
static Mask defective(const Contacts *c, const V *work, V *sums, V *terms) {
    for (int64_t i = 0; i < c->size; i++) {
        sums[i] = -work[c->side + i];
        terms[i] = magnitude(sums[i]);
    }
    for (int64_t e = 0; e < c->entries; e++) {
        V term = work[c->values[e]] * work[c->solution[c->columns[e]]];
        sums[c->rows[e]] += term;
        terms[c->rows[e]] += magnitude(term);
    }
    V most = splat(0.0);
    Mask found = {0};
    for (int64_t i = 0; i < c->size; i++) most = larger(terms[i], most);
    for (int64_t i = 0; i < c->size; i++)
        found |= ~(magnitude(sums[i]) <= larger(DEFECT * terms[i], ROUNDING_OF_ROWS * most));
    return found;
}

/* Accelerations and multipliers without forces, and per force in the directions that are needed in some lane; the
   contacts are in the work array.  The order of elimination is that of the compiled solution; where a pivot is poor, the
   elimination chooses pivots. */
static void solve_lanes(const Problem *p, Group *g, Mask which) {
    const Contacts *c = p->contacts;
    int64_t n = p->coordinates, size = c->size, columns = 1 + c->directions;
    if (!c->solve.count) {
        eliminate_lanes(p, g, g->answers);
        return;
    }
    Mask poor = {0};
    V *side = g->work + c->side;
    run_program(&c->factor, g->work);
    for (int64_t d = -1; d < c->directions; d++) {
        if (d >= 0 && !g->needed[d]) continue;
        for (int64_t i = 0; i < size; i++)
            side[i] = d < 0 ? g->work[c->right[i]] : i < n ? g->work[c->slope[d * n + i]] : splat(0.0);
        run_program(&c->solve, g->work);
        for (int64_t i = 0; i < size; i++) g->answers[i * columns + 1 + d] = g->work[c->solution[i]];
        Lanes asks; /* a lane must not depend on what others ask for */
        for (int64_t l = 0; l < LANES; l++) asks.flag[l] = d < 0 || g->needed[d] >> l & 1 ? -1 : 0;
        poor |= defective(c, g->work, g->spare, g->spare + size) & asks.mask;
    }
    poor &= which;
    if (!any(poor)) return;
    eliminate_lanes(p, g, g->spare);
    for (int64_t i = 0; i < size * columns; i++) g->answers[i] = choose(poor, g->spare[i], g->answers[i]);
}

/* Rates of the speed in a direction without forces, after `solve_lanes`. */
static V natural_rate(const Problem *p, const Group *g, int64_t d) {
    const Contacts *c = p->contacts;
    V sum = g->work[c->bias[d]];
    for (int64_t i = 0; i < p->coordinates; i++)
        sum += g->work[c->slope[d * p->coordinates + i]] * g->answers[i * (1 + c->directions)];
    return sum;
}

/* Solve, and find the rates of the speeds, without and per force, in the directions that are needed. */
static void find_responses(const Problem *p, Group *g, Mask which) {
    const Contacts *c = p->contacts;
    int64_t n = p->coordinates, columns = 1 + c->directions;
    solve_lanes(p, g, which);
    for (int64_t d = 0; d < c->directions; d++) {
        if (!g->needed[d]) continue;
        V *row = g->responses + d * columns;
        row[0] = natural_rate(p, g, d);
        Mask still = ~(Mask){0};
        for (int64_t i = 0; i < n; i++) still &= g->work[c->slope[d * n + i]] == splat(0.0);
        for (int64_t k = 0; k < c->directions; k++) {
            if (!g->needed[k]) continue;
            V sum = splat(0.0);
            for (int64_t i = 0; i < n; i++) sum += g->work[c->slope[d * n + i]] * g->answers[i * columns + 1 + k];
            /* a direction without motion has the given normal force of dry friction */
            row[1 + k] = k == d ? choose(still, splat(1.0), sum) : sum;
        }
    }
}

/* Number of directions of a contact in which its mode lets forces act. */
INLINE int64_t acting(const Contacts *c, int64_t mode, int64_t k) {
    return mode == OPEN ? 0 : mode == SMOOTH ? 1 : c->first[k + 1] - c->first[k];
}

/* Rates of the speeds without and per force, in the directions in which forces act in some lane with contacts; the
   contacts are in the work array. */
static void respond(const Problem *p, Group *g, Mask which) {
    const Contacts *c = p->contacts;
    for (int64_t d = 0; d < c->directions; d++) g->needed[d] = 0;
    for (int64_t l = 0; l < LANES; l++) {
        if (!which[l]) continue;
        const int64_t *mode = g->pool->encounters->mode + g->member[l] * c->events;
        for (int64_t k = 0; k < c->events; k++)
            for (int64_t d = 0; d < acting(c, mode[k], k); d++) g->needed[c->first[k] + d] |= 1 << l;
    }
    find_responses(p, g, which);
}

/* Change per force in an acting direction of a lane, or without forces (-1), of an acceleration or multiplier. */
INLINE double change_of(const Problem *p, const Group *g, int64_t l, int64_t i, int64_t d) {
    return g->answers[i * (1 + p->contacts->directions) + 1 + d][l];
}

/* -- linear algebra of one lane ------------------------------------------------------------------------------------- */

/* Turn the columns of a matrix u (rows, size) until they are perpendicular to each other (one-sided Jacobi iteration);
   v (size, size) are the turns. */
static void turn_columns(double *u, double *v, int64_t rows, int64_t size) {
    for (int64_t i = 0; i < size; i++)
        for (int64_t j = 0; j < size; j++) v[i * size + j] = i == j;
    for (int64_t sweep = 0, turned = 1; sweep < 40 && turned; sweep++) {
        turned = 0;
        for (int64_t i = 0; i < size; i++)
            for (int64_t j = i + 1; j < size; j++) {
                double a = 0.0, b = 0.0, c = 0.0;
                for (int64_t k = 0; k < rows; k++) {
                    a += u[k * size + i] * u[k * size + i];
                    b += u[k * size + j] * u[k * size + j];
                    c += u[k * size + i] * u[k * size + j];
                }
                if (!(__builtin_fabs(c) > 1e-16 * __builtin_sqrt(a) * __builtin_sqrt(b))) continue;
                turned = 1;
                double zeta = (b - a) / (2.0 * c), size_of = __builtin_fabs(zeta) + __builtin_sqrt(1.0 + zeta * zeta);
                double tangent = (zeta < 0.0 ? -1.0 : 1.0) / size_of;
                double cosine = 1.0 / __builtin_sqrt(1.0 + tangent * tangent), sine = cosine * tangent;
                for (int64_t k = 0; k < rows; k++) {
                    double x = u[k * size + i];
                    u[k * size + i] = cosine * x - sine * u[k * size + j];
                    u[k * size + j] = sine * x + cosine * u[k * size + j];
                }
                for (int64_t k = 0; k < size; k++) {
                    double y = v[k * size + i];
                    v[k * size + i] = cosine * y - sine * v[k * size + j];
                    v[k * size + j] = sine * y + cosine * v[k * size + j];
                }
            }
    }
}

/* Solve inner x = right for the x of least length, each entry in its unit: contacts may be redundant (a table's legs). */
static void least_solution(Lane *s, int64_t size) {
    double *u = s->inner, *v = s->turn;
    if (size == 1) {
        s->found[0] = s->right[0] / u[0];
        return;
    }
    for (int64_t i = 0; i < size; i++)
        for (int64_t j = 0; j < size; j++) u[i * size + j] *= s->unit[i] * s->unit[j];
    turn_columns(u, v, size, size);
    double most = 0.0;
    for (int64_t j = 0; j < size; j++) {
        double square = 0.0;
        for (int64_t k = 0; k < size; k++) square += u[k * size + j] * u[k * size + j];
        if (!(square <= most)) most = square; /* keeps NaN */
        s->found[j] = 0.0;
    }
    for (int64_t j = 0; j < size; j++) {
        double square = 0.0, along = 0.0;
        for (int64_t k = 0; k < size; k++) {
            square += u[k * size + j] * u[k * size + j];
            along += u[k * size + j] * s->unit[k] * s->right[k];
        }
        if (square <= SINGULAR * SINGULAR * most) continue;
        for (int64_t i = 0; i < size; i++) s->found[i] += v[i * size + j] * (along / square);
    }
    for (int64_t i = 0; i < size; i++) s->found[i] *= s->unit[i];
}

/* -- persistent contacts of one lane -------------------------------------------------------------------------------- */

/* Rates of the speeds of a lane, without and per force; after `respond`. */
static void answer(const Problem *p, const Group *g, int64_t l, Lane *s) {
    const Contacts *c = p->contacts;
    const int64_t *mode = g->pool->encounters->mode + g->member[l] * c->events;
    s->count = 0;
    for (int64_t k = 0; k < c->events; k++)
        for (int64_t d = 0; d < acting(c, mode[k], k); d++) s->active[s->count++] = c->first[k] + d;
    int64_t count = s->count;
    for (int64_t j = 0; j < count; j++) {
        const V *row = g->responses + s->active[j] * (1 + c->directions);
        s->free[j] = row[0][l];
        for (int64_t k = 0; k < count; k++) s->answer[j * count + k] = row[1 + s->active[k]][l];
    }
}

static void set_units(Lane *s, int64_t size) {
    for (int64_t i = 0; i < size; i++) {
        double diagonal = __builtin_fabs(s->answer[s->held[i] * s->count + s->held[i]]);
        s->unit[i] = 1.0 / __builtin_sqrt(diagonal > 1e-300 ? diagonal : 1e-300);
    }
}

/* Forces of the persistent contacts of a lane, and the resulting rates of their speeds; after `answer`. */
static void find_forces(const Problem *p, const Group *g, int64_t l, Lane *s) {
    const Contacts *c = p->contacts;
    const int64_t *mode = g->pool->encounters->mode + g->member[l] * c->events;
    const double *heading = g->pool->encounters->heading + g->member[l] * c->directions;
    int64_t count = s->count, size = 0, at = 0;
    for (int64_t i = 0; i < count * count; i++) s->spread[i] = 0.0;
    for (int64_t k = 0; k < c->events; k++) {
        if (mode[k] == OPEN) continue;
        int64_t tangents = mode[k] == SMOOTH ? 0 : c->first[k + 1] - c->first[k] - 1;
        s->spread[at * count + size] = 1.0;
        s->held[size++] = at;
        if (mode[k] == STICK)
            for (int64_t t = 1; t <= tangents; t++) {
                s->spread[(at + t) * count + size] = 1.0;
                s->held[size++] = at + t;
            }
        if (mode[k] == SLIP) {
            /* the direction of sliding, continued through zero */
            double friction = g->work[c->law[2 * k + 1]][l], fast = 0.0, along = 0.0;
            for (int64_t t = 1; t <= tangents; t++) {
                double speed = g->work[c->speed[c->first[k] + t]][l];
                fast += speed * speed;
                along += speed * heading[c->first[k] + t];
            }
            fast = __builtin_sqrt(fast);
            for (int64_t t = 1; t <= tangents; t++) {
                double direction = heading[c->first[k] + t];
                if (tangents > 1 && fast > 1e-12)
                    direction = (along < 0.0 ? -1.0 : 1.0) * g->work[c->speed[c->first[k] + t]][l] / fast;
                s->spread[(at + t) * count + size - 1] = -friction * direction;
            }
        }
        at += 1 + tangents;
    }
    for (int64_t i = 0; i < size; i++) {
        s->right[i] = -s->free[s->held[i]];
        for (int64_t j = 0; j < size; j++) {
            double sum = 0.0;
            for (int64_t d = 0; d < count; d++) sum += s->answer[s->held[i] * count + d] * s->spread[d * count + j];
            s->inner[i * size + j] = sum;
        }
    }
    set_units(s, size);
    least_solution(s, size);
    for (int64_t d = 0; d < count; d++) {
        s->force[d] = 0.0;
        for (int64_t j = 0; j < size; j++) s->force[d] += s->spread[d * count + j] * s->found[j];
    }
    for (int64_t d = 0; d < count; d++) {
        s->rate[d] = s->free[d];
        for (int64_t j = 0; j < count; j++) s->rate[d] += s->answer[d * count + j] * s->force[j];
    }
}

/* Change coordinates (or velocities) of a lane, from row `to` on, so that gaps become zero; after `answer`. */
static void correct(const Problem *p, Group *g, int64_t l, Lane *s, int64_t to, int64_t size) {
    int64_t count = s->count;
    for (int64_t i = 0; i < size; i++)
        for (int64_t j = 0; j < size; j++) s->inner[i * size + j] = s->answer[s->held[i] * count + s->held[j]];
    set_units(s, size);
    least_solution(s, size);
    for (int64_t i = 0; i < p->coordinates; i++)
        for (int64_t j = 0; j < size; j++)
            g->work[to + i][l] += change_of(p, g, l, i, s->active[s->held[j]]) * s->found[j];
}

/* -- persistent contacts of all lanes ------------------------------------------------------------------------------- */

/* Add the forces of persistent contacts to the rate of the state in the work array. */
static void add_forces(const Problem *p, Group *g, V *rate) {
    Lane s = lane_of(p->contacts, g);
    run_program(&p->contacts->contact, g->work);
    respond(p, g, g->touching);
    for (int64_t l = 0; l < LANES; l++) {
        if (!g->touching[l]) continue;
        answer(p, g, l, &s);
        find_forces(p, g, l, &s);
        for (int64_t i = 0; i < p->coordinates; i++) {
            double a = change_of(p, g, l, i, -1);
            for (int64_t j = 0; j < s.count; j++) a += change_of(p, g, l, i, s.active[j]) * s.force[j];
            rate[p->velocities + i][l] = a;
        }
    }
}

/* Project the states in the work array onto the persistent contacts. */
static void put_on_contacts(const Problem *p, Group *g, Mask which) {
    const Contacts *c = p->contacts;
    which &= g->touching;
    if (!any(which)) return;
    Lane s = lane_of(c, g);
    run_program(&c->contact, g->work);
    respond(p, g, which);
    for (int64_t l = 0; l < LANES; l++) {
        if (!which[l]) continue;
        const int64_t *mode = g->pool->encounters->mode + g->member[l] * c->events;
        answer(p, g, l, &s);
        int64_t size = 0, at = 0;
        for (int64_t k = 0; k < c->events; k++) {
            if (mode[k] == OPEN) continue;
            s.right[size] = -g->work[c->gap[k]][l];
            s.held[size++] = at;
            at += mode[k] == SMOOTH ? 1 : c->first[k + 1] - c->first[k];
        }
        correct(p, g, l, &s, 0, size);
        size = at = 0;
        for (int64_t k = 0; k < c->events; k++) {
            if (mode[k] == OPEN) continue;
            int64_t held = mode[k] == STICK ? c->first[k + 1] - c->first[k] : 1;
            for (int64_t d = 0; d < held; d++) {
                s.right[size] = -g->work[c->speed[c->first[k] + d]][l];
                s.held[size++] = at + d;
            }
            at += mode[k] == SMOOTH ? 1 : c->first[k + 1] - c->first[k];
        }
        correct(p, g, l, &s, p->velocities, size);
    }
}

/* Follow the directions of sliding in space at the states in the work array; lanes where a contact has nearly come to
   rest, and its guard. */
static Mask turn_headings(const Problem *p, Group *g, Mask which, int64_t *happened) {
    const Contacts *c = p->contacts;
    Mask stopped = {0};
    which &= g->touching;
    if (!any(which)) return stopped;
    Lane s = lane_of(c, g);
    int64_t known = 0, solved_all = 0;
    for (int64_t l = 0; l < LANES; l++) {
        if (!which[l]) continue;
        const Encounters *e = g->pool->encounters;
        int64_t m = g->member[l], solved = 0;
        double *heading = e->heading + m * c->directions;
        for (int64_t k = 0, at = 0; k < c->events && !stopped[l]; k++) {
            int64_t mode = e->mode[m * c->events + k], tangents = c->first[k + 1] - c->first[k] - 1;
            if (mode == OPEN) continue;
            int64_t mine = at;
            at += mode == SMOOTH ? 1 : 1 + tangents;
            if (mode != SLIP || tangents < 2) continue;
            if (!known) run_program(&c->contact, g->work);
            known = 1;
            double fast = 0.0, along = 0.0, slower = 0.0;
            for (int64_t t = 1; t <= tangents; t++) {
                double speed = g->work[c->speed[c->first[k] + t]][l];
                fast += speed * speed;
                along += speed * heading[c->first[k] + t];
            }
            fast = __builtin_sqrt(fast);
            if (!(fast > 0.0)) continue;
            if (fast <= e->slow[m] && along >= 0.0) {
                if (!solved) {
                    if (!solved_all) respond(p, g, which);
                    solved_all = 1;
                    answer(p, g, l, &s);
                    find_forces(p, g, l, &s);
                    solved = 1;
                }
                for (int64_t t = 1; t <= tangents; t++)
                    slower += s.rate[mine + t] * g->work[c->speed[c->first[k] + t]][l];
                if (slower < 0.0) {
                    stopped[l] = -1;
                    happened[l] = 2 * k + 1;
                    continue;
                }
            }
            for (int64_t t = 1; t <= tangents; t++)
                heading[c->first[k] + t] = g->work[c->speed[c->first[k] + t]][l] / fast;
        }
    }
    return stopped;
}
