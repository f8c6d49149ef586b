/* Projection of states at output times onto the constraints: positions first, then velocities, which depend on them. */
#include "dop853.h"

enum { CORRECTIONS = 3 };

/* The largest residuals of one realisation so far, and its largest speed, in each lane. */
typedef struct {
    int64_t member; /* -1: of none */
    V *rows;
} Most;

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
    V enough = splat(0.1 * p->rtol);
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

/* What was noted of a realisation counts for its row of residuals. */
static void collect_off(const Problem *p, const Pool *pool, Most *most) {
    if (most->member < 0) return;
    double *off = pool->off + most->member * (p->equations + 1);
    for (int64_t i = 0; i <= p->equations; i++)
        for (int64_t l = 0; l < LANES; l++)
            if (most->rows[i][l] > off[i]) off[i] = most->rows[i][l];
    most->member = -1;
}

/* Note the residuals of the states in the lanes, and their speeds. */
static void note_off(const Problem *p, const Pool *pool, const V *work, const int64_t *member, int64_t lanes, Most *most) {
    int same = 1;
    for (int64_t l = 1; l < lanes; l++) same &= member[l] == member[0];
    V speed = splat(0.0);
    for (int64_t i = 0; i < p->coordinates; i++) speed = larger(magnitude(work[p->velocities + i]), speed);
    if (!same || most->member != member[0]) collect_off(p, pool, most);
    if (!same) {
        for (int64_t l = 0; l < lanes; l++) {
            double *off = pool->off + member[l] * (p->equations + 1);
            for (int64_t i = 0; i <= p->equations; i++) {
                double x = i < p->equations ? magnitude(work[p->residuals[i]])[l] : speed[l];
                if (x > off[i]) off[i] = x;
            }
        }
        return;
    }
    if (most->member < 0) fill(most->rows, 0.0, p->equations + 1);
    most->member = member[0];
    /* lanes behind the last one are copies of it */
    for (int64_t i = 0; i < p->equations; i++) count_largest(most->rows + i, work[p->residuals[i]]);
    count_largest(most->rows + p->equations, speed);
}

/* Put the states in the lanes onto the constraints, and back; lanes behind the last one are copies of it. */
static void project_lanes(const Problem *p, const Pool *pool, V *work, const int64_t *member, const int64_t *column,
                          int64_t lanes, Most *most) {
    double *rows[LANES];
    for (int64_t l = 0; l < LANES; l++) {
        int64_t from = l < lanes ? l : lanes - 1;
        rows[l] = pool->result + (member[from] * p->instants + column[from]) * p->width;
        work[p->time][l] = p->times[column[from]];
    }
    to_lanes(work, (const double *const *)rows, p->width);
    Mask wrong = correct_states(p, work);
    note_off(p, pool, work, member, lanes, most);
    for (int64_t l = 0; l < lanes; l++) pool->poor[member[l] * p->instants + column[l]] = wrong[l] != 0;
    to_rows(rows, lanes, work, p->width);
}

void project(const Problem *p, const Pool *pool, const int64_t *queue, int64_t count, double *workspace) {
    V *work = (V *)workspace, *parameters = work + p->time + 2;
    int64_t member[LANES], column[LANES], held[LANES], lanes = 0;
    Most most = {-1, work + p->rows};
    for (int64_t l = 0; l < LANES; l++) held[l] = -1;
    fill(work, 0.0, p->time + 2 + p->parameters);
    if (!p->surplus) return;
    for (int64_t k = 0; k < count; k++) {
        int64_t m = queue[k];
        for (int64_t c = pool->first[m]; c < pool->column[m]; c++) {
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
