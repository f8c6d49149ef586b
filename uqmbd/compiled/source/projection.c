/* Projection of states at output times onto the constraints: positions first, then velocities, which depend on them. */
#include "group.h"

static const double ENOUGH = 0.1; /* what may be left, in tolerances */

static const double GUESS = 1e-6; /* square of a residual over its distance, where both vanish */

enum { CORRECTIONS = 3 };

static V most_of(const V *work, const int64_t *rows, int64_t count) {
    V most = splat(0.0);
    for (int64_t i = 0; i < count; i++) most = larger(magnitude(work[rows[i]]), most);
    return most;
}

/* Take what is too much from the entries of a state that begin in row `to`; the largest change.  Where a pivot vanishes
   nothing is taken, and that is noted. */
static V take(const Problem *p, V *work, const int64_t *surplus, int64_t to, Mask which, Mask *wrong) {
    V most = splat(0.0);
    for (int64_t i = 0; i < p->coordinates; i++) {
        V much = work[surplus[i]];
        Mask known = much == much;
        much = choose(which & known, much, splat(0.0));
        work[to + i] -= much;
        most = larger(magnitude(much), most);
        *wrong |= ~known;
    }
    return most;
}

/* Put the states in the work array onto the constraints; lanes that were far off.

   What is left after a correction is, in proportion, what is left of the residual. */
static Mask correct_states(const Problem *p, V *work) {
    const int64_t *velocity_rows = p->residuals + p->positions;
    int64_t n = p->coordinates, velocities = p->equations - p->positions;
    Mask wrong = {0}, again = ~(Mask){0};
    V enough = splat(ENOUGH * p->rtol);
    run_program(&p->values, work);
    run_program(&p->drift, work);
    for (int64_t pass = 0; pass < CORRECTIONS && any(again); pass++) {
        Mask unknown = {0};
        V before = most_of(work, p->residuals, p->positions);
        run_program(&p->place, work);
        V shift = take(p, work, p->surplus, 0, again, &unknown);
        run_program(&p->drift, work);
        Mask more = shift * most_of(work, p->residuals, p->positions) > enough * before;
        before = most_of(work, velocity_rows, velocities);
        run_program(&p->move, work);
        V change = take(p, work, p->surplus + n, p->velocities, again, &unknown);
        run_program(&p->drift, work);
        more |= change * most_of(work, velocity_rows, velocities) > enough * before;
        if (!pass) wrong = unknown | (larger(shift, change) > splat(p->far));
        again &= ~wrong & more;
    }
    return wrong;
}

static V squares(const V *work, const int64_t *rows, int64_t count) {
    V sum = splat(0.0);
    for (int64_t i = 0; i < count; i++) {
        const V x = work[rows ? rows[i] : i];
        sum += x * x;
    }
    return sum;
}

/* Squares of residuals in position, and of those in velocity, of the state in the work array. */
static void find_residuals(const Problem *p, V *work, V *found) {
    run_program(&p->drift, work);
    found[0] = squares(work, p->residuals, p->positions);
    found[1] = squares(work, p->residuals + p->positions, p->equations - p->positions);
}

/* Squares of residuals over those of the corrections, of positions and of velocities; the guess where both vanish. */
static void find_scales(const Problem *p, const V *residuals, const V *corrections, int64_t second, V *found) {
    for (int64_t k = 0; k < 2; k++) {
        const V distance = squares(corrections + k * second, 0, p->coordinates);
        const Mask known = (residuals[k] > splat(0.0)) & (distance > splat(0.0));
        found[k] = choose(known, residuals[k] / distance, splat(GUESS));
    }
}

/* Residuals that need no projection: their distance from the constraints, which is taken to be proportional to them as at
   the end of the step, is below the tolerance of an entry of mean size. */
static void find_near(const Problem *p, Group *g) {
    V residuals[2], scales[2];
    find_residuals(p, g->work, residuals);
    find_scales(p, residuals, g->surplus, p->coordinates, scales);
    for (int64_t k = 0; k < 2; k++) {
        const V size = squares(g->next + k * p->velocities, 0, p->coordinates) / (double)p->coordinates;
        const V enough = ENOUGH * (g->floor + p->rtol * root(size));
        g->enough[k] = enough * enough;
        g->scale[k] = scales[k];
    }
}

/* What was noted of the lanes counts for the residuals of their realisations. */
static void collect_off(const Problem *p, const Pool *pool, Most *most) {
    for (int64_t l = 0; l < LANES; l++) {
        if (most->member[l] < 0) continue;
        double *off = pool->off + most->member[l] * (p->equations + 1);
        for (int64_t i = 0; i <= p->equations; i++)
            if (most->rows[i][l] > off[i]) off[i] = most->rows[i][l];
        most->member[l] = -1;
    }
    fill(most->rows, 0.0, p->equations + 1);
}

/* Note the residuals of the states in some lanes, and their speeds. */
static void note_off(const Problem *p, const Pool *pool, const V *work, const int64_t *member, Mask some, Most *most) {
    int same = 1;
    V speed = splat(0.0);
    for (int64_t l = 0; l < LANES; l++) same &= !some[l] || most->member[l] == member[l];
    if (!same) collect_off(p, pool, most);
    for (int64_t l = 0; l < LANES; l++)
        if (some[l]) most->member[l] = member[l];
    for (int64_t i = 0; i < p->coordinates; i++) speed = larger(magnitude(work[p->velocities + i]), speed);
    for (int64_t i = 0; i < p->equations; i++)
        count_largest(most->rows + i, choose(some, work[p->residuals[i]], splat(0.0)));
    count_largest(most->rows + p->equations, choose(some, speed, splat(0.0)));
}

/* Put the states in the lanes onto the constraints, and back; lanes behind the last one are copies of it. */
static void project_lanes(const Problem *p, const Pool *pool, V *work, const int64_t *member, const int64_t *column,
                          int64_t lanes, Most *most) {
    double *rows[LANES];
    Mask some;
    for (int64_t l = 0; l < LANES; l++) {
        int64_t from = l < lanes ? l : lanes - 1;
        some[l] = l < lanes ? -1 : 0;
        rows[l] = pool->result + (member[from] * p->instants + column[from]) * p->width;
        work[p->time][l] = p->times[column[from]];
    }
    to_lanes(work, (const double *const *)rows, p->width);
    Mask wrong = correct_states(p, work);
    note_off(p, pool, work, member, some, most);
    for (int64_t l = 0; l < lanes; l++) pool->poor[member[l] * p->instants + column[l]] = wrong[l] ? STATE_FAR : 0;
    to_rows(rows, lanes, work, p->width);
}

void project(const Problem *p, const Pool *pool, const int64_t *queue, int64_t count, double *workspace) {
    V *work = (V *)workspace, *parameters = work + p->time + 2;
    int64_t member[LANES], column[LANES], held[LANES], lanes = 0;
    Most most = {work + p->rows, {0}};
    for (int64_t l = 0; l < LANES; l++) held[l] = most.member[l] = -1;
    fill(most.rows, 0.0, p->equations + 1);
    fill(work, 0.0, p->time + 2 + p->parameters);
    if (!p->surplus) return;
    for (int64_t k = 0; k < count; k++) {
        int64_t m = queue[k];
        for (int64_t c = pool->first[m]; c < pool->column[m]; c++) {
            int8_t *poor = pool->poor + m * p->instants + c;
            if (*poor == STATE_CLOSE) {
                *poor = 0;
                continue;
            }
            member[lanes] = m;
            column[lanes] = c;
            if (held[lanes] != m)
                for (int64_t i = 0; i < p->parameters; i++) parameters[i][lanes] = pool->parameters[m * p->parameters + i];
            held[lanes++] = m;
            if (lanes < LANES) continue;
            project_lanes(p, pool, work, member, column, lanes, &most);
            lanes = 0;
        }
        pool->first[m] = pool->column[m];
    }
    for (int64_t l = lanes; lanes && l < LANES; l++)
        for (int64_t i = 0; i < p->parameters; i++) parameters[i][l] = parameters[i][lanes - 1];
    if (lanes) project_lanes(p, pool, work, member, column, lanes, &most);
    collect_off(p, pool, &most);
}
