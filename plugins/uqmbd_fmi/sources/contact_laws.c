/* Contacts of a mechanism, one at a time: impacts with Newton's restitution and Coulomb's friction, and contacts that
   last, which stick or slip, until they open.

   The driver integrates between events and finds them; the decisions here are those of `uqmbd.simulate`. */
#include "contact_laws.h"

static const double CLOSED = 1e-9, LOST = 1e-6; /* a closed gap, also of a contact that lasted, relative to the size */
static const double DEEP = 1e-6;                /* an overlap of bodies that is an error */
static const double SLOWEST = 1e-6, STILL = 1e-12; /* slow rebounds, relative to the fastest impact, and to the size */
static const double FLIGHT = 2.05;              /* first step after an impact, relative to the time of flight */
static const double CROWDED = 2e-3;             /* time of a crowd of events, relative to the duration */
static const double COARSER = 4.0, COARSEST = 1e4; /* factor of the slow speed in crowds, and its limit */
static const double START = 10.0;               /* speed that counts as zero when slip starts, in tolerances */
static const double EXACT = 1e-10, FED = 1e-12; /* violation of the laws, and energy, that count as zero */
static const double RESTS = 1e-8;               /* acceleration along the surface that counts as zero */

enum {
    /* rows of the contact program: of each event, of directions, and of the index-1 system */
    LAW_ROWS = MOTION_EVENTS,
    SPEED_ROWS = 3 * MOTION_EVENTS,
    BIAS_ROWS = SPEED_ROWS + MOTION_DIRECTIONS,
    SLOPE_ROWS = BIAS_ROWS + MOTION_DIRECTIONS,
    VALUE_ROWS = SLOPE_ROWS + MOTION_DIRECTIONS * MOTION_COORDINATES,
    RIGHT_ROWS = VALUE_ROWS + MOTION_ENTRIES,
    CONTACT_ROWS = RIGHT_ROWS + MOTION_SYSTEM,
    /* without events, for compilers that look at loops which never run */
    UNKNOWNS = MOTION_SYSTEM > MOTION_COORDINATES ? MOTION_SYSTEM : MOTION_COORDINATES,
    FOUND_ROWS = CONTACT_ROWS + MOTION_COORDINATES + 1,
    MOST = 3,          /* directions of a contact */
    SAMPLED_ANGLES = 96 /* of directions of slip in space, whose equation has at most four solutions */
};

/* A contact at a state; direction 0 is the normal one. */
typedef struct {
    int event, directions; /* directions in which forces may act: one without friction */
    double gap, restitution, friction;
    double speed[MOST], rate[MOST];   /* relative velocities, and their rates without a force */
    double matrix[MOST][MOST];        /* rates of the relative velocities per force */
    double answer[UNKNOWNS][1 + MOST]; /* accelerations without a force, and per force */
    int regular;
} Touch;

/* Solve a system with several right-hand sides by elimination with pivots; return whether it is regular. */
static int eliminate_columns(double *a, double (*b)[1 + MOST], int size) {
    for (int k = 0; k < size; k++) {
        int best = k;
        for (int i = k + 1; i < size; i++)
            if (fabs(a[i * size + k]) > fabs(a[best * size + k])) best = i;
        if (!(fabs(a[best * size + k]) > 0)) return 0;
        for (int j = 0; j < size; j++) {
            const double kept = a[k * size + j];
            a[k * size + j] = a[best * size + j];
            a[best * size + j] = kept;
        }
        for (int j = 0; j <= MOST; j++) {
            const double kept = b[k][j];
            b[k][j] = b[best][j];
            b[best][j] = kept;
        }
        for (int i = k + 1; i < size; i++) {
            const double factor = a[i * size + k] / a[k * size + k];
            if (factor == 0.0) continue;
            for (int j = k; j < size; j++) a[i * size + j] -= factor * a[k * size + j];
            for (int j = 0; j <= MOST; j++) b[i][j] -= factor * b[k][j];
        }
    }
    for (int k = size - 1; k >= 0; k--)
        for (int j = 0; j <= MOST; j++) {
            for (int i = k + 1; i < size; i++) b[k][j] -= a[k * size + i] * b[i][j];
            b[k][j] /= a[k * size + k];
        }
    return 1;
}

static void evaluate_contacts(Motion *of, double time, double *found) {
    double arguments[ARGUMENTS + 1];
    fill_arguments(of, of->state, time, arguments);
    const Source source = {arguments, ARGUMENTS, ARGUMENTS, 1, 1, 0};
    evaluate(&motion_contacts.contact, (V *)cleared(of), &source, 1, 0, 1, motion_contact_rows, CONTACT_ROWS, found);
}

/* Number of directions of an event; none: it is a mark, which changes nothing. */
static int directions_of(int event) {
    return (int)(motion_contacts.first[event + 1] - motion_contacts.first[event]);
}

/* Describe a contact at the state whose contacts were evaluated. */
static void describe(const double *found, int event, Touch *to) {
    double a[UNKNOWNS * UNKNOWNS];
    const int first = (int)motion_contacts.first[event];
    const double *slopes = found + SLOPE_ROWS + first * MOTION_COORDINATES;
    memset(a, 0, sizeof a);
    memset(to, 0, sizeof *to);
    to->event = event;
    to->gap = found[event];
    to->restitution = found[LAW_ROWS + 2 * event];
    to->friction = found[LAW_ROWS + 2 * event + 1];
    to->directions = to->friction > 0 ? directions_of(event) : 1;
    for (int e = 0; e < MOTION_ENTRIES; e++)
        a[motion_contacts.rows[e] * MOTION_SYSTEM + motion_contacts.columns[e]] = found[VALUE_ROWS + e];
    for (int i = 0; i < MOTION_SYSTEM; i++) to->answer[i][0] = found[RIGHT_ROWS + i];
    for (int d = 0; d < to->directions; d++)
        for (int i = 0; i < MOTION_COORDINATES; i++) to->answer[i][1 + d] = slopes[d * MOTION_COORDINATES + i];
    to->regular = eliminate_columns(a, to->answer, MOTION_SYSTEM);
    for (int d = 0; d < to->directions; d++) {
        to->speed[d] = found[SPEED_ROWS + first + d];
        to->rate[d] = found[BIAS_ROWS + first + d];
        for (int i = 0; i < MOTION_COORDINATES; i++) {
            const double slope = slopes[d * MOTION_COORDINATES + i];
            to->rate[d] += slope * to->answer[i][0];
            for (int j = 0; j < to->directions; j++) to->matrix[d][j] += slope * to->answer[i][1 + j];
        }
        if (!isfinite(to->rate[d]) || !isfinite(to->matrix[d][0])) to->regular = 0;
    }
    if (!(to->matrix[0][0] > 0)) to->regular = 0;
}

static void look(Motion *of, double time, int event, Touch *to) {
    double found[FOUND_ROWS];
    evaluate_contacts(of, time, found);
    describe(found, event, to);
}

/* -- the laws of one contact --------------------------------------------------------------------------------------- */

static double length_along(const Touch *c, const double *x) {
    double sum = 0.0;
    for (int d = 1; d < c->directions; d++) sum += x[d] * x[d];
    return sqrt(sum);
}

/* Speeds (or accelerations) after impulses (or with forces). */
static void respond(const Touch *c, const double *before, const double *impulse, double *after) {
    for (int d = 0; d < c->directions; d++) {
        after[d] = before[d];
        for (int j = 0; j < c->directions; j++) after[d] += c->matrix[d][j] * impulse[j];
    }
}

/* Whether impulses satisfy the laws, and add no energy if `conserves`. */
static int satisfies(const Touch *c, const double *before, double wanted, const double *impulse, int conserves) {
    double after[MOST], mended[MOST], diagonal = 1e-300, size = 1e-300, off = 0.0, fed = 0.0, worked = 0.0;
    for (int d = 0; d < c->directions; d++) {
        if (!isfinite(impulse[d])) return 0;
        diagonal = fmax(diagonal, fabs(c->matrix[d][d]));
    }
    const double unit = 1.0 / diagonal;
    respond(c, before, impulse, after);
    mended[0] = fmax(0.0, impulse[0] - unit * (after[0] - wanted));
    for (int d = 1; d < c->directions; d++) mended[d] = impulse[d] - unit * after[d];
    const double tried = length_along(c, mended), most = c->friction * mended[0];
    for (int d = 1; d < c->directions; d++) mended[d] *= tried <= most ? 1.0 : most / tried;
    size = fmax(size, fabs(before[0]));
    for (int d = 0; d < c->directions; d++) {
        size = fmax(size, fabs(impulse[d]) / unit);
        off = fmax(off, fabs(impulse[d] - mended[d]) / unit);
        fed += 0.5 * impulse[d] * (before[d] + after[d]);
        worked += fabs(impulse[d] * before[d]);
    }
    return off <= EXACT * size && (!conserves || fed <= FED * worked);
}

/* Impulses of a slip in a direction along the surface. */
static void slip_impulses(const Touch *c, const double *before, double wanted, const double *direction, double *impulse) {
    double divisor = c->matrix[0][0];
    for (int d = 1; d < c->directions; d++) divisor -= c->friction * c->matrix[0][d] * direction[d];
    impulse[0] = (wanted - before[0]) / divisor;
    for (int d = 1; d < c->directions; d++) impulse[d] = -c->friction * impulse[0] * direction[d];
}

/* Slip across a direction in space, times the denominator of the normal impulse: zero for the direction of slip. */
static double slip_across(const Touch *c, const double *before, double wanted, double angle) {
    const double d[MOST] = {0.0, cos(angle), sin(angle)}, needed = wanted - before[0];
    double slip[MOST], divisor = c->matrix[0][0];
    for (int j = 1; j < MOST; j++) divisor -= c->friction * c->matrix[0][j] * d[j];
    for (int i = 1; i < MOST; i++) {
        slip[i] = before[i] * divisor + needed * c->matrix[i][0];
        for (int j = 1; j < MOST; j++) slip[i] -= needed * c->friction * c->matrix[i][j] * d[j];
    }
    return d[1] * slip[2] - d[2] * slip[1];
}

/* Directions of slip that are possible, the nearest one to the present slip first; return their number. */
static int slip_directions(const Touch *c, const double *before, double wanted, double (*to)[MOST]) {
    const double turn = 8.0 * atan(1.0);
    if (c->directions == 2) {
        to[0][1] = copysign(1.0, before[1]);
        to[1][1] = -to[0][1];
        return 2;
    }
    const double first = atan2(before[2], before[1]), part = turn / SAMPLED_ANGLES;
    double found[SAMPLED_ANGLES];
    int count = 0;
    for (int k = 0; k < SAMPLED_ANGLES; k++) {
        double left = (k - 0.5) * part, right = left + part;
        double low = slip_across(c, before, wanted, first + left), high = slip_across(c, before, wanted, first + right);
        if (!(low * high <= 0) || high == 0) continue;
        for (int step = 0; step < 60; step++) {
            const double middle = 0.5 * (left + right), value = slip_across(c, before, wanted, first + middle);
            if (low * value <= 0)
                right = middle;
            else
                left = middle, low = value;
        }
        const double angle = remainder(0.5 * (left + right), turn);
        int place = count++;
        while (place > 0 && fabs(found[place - 1]) > fabs(angle)) found[place] = found[place - 1], place--;
        found[place] = angle;
    }
    for (int k = 0; k < count; k++) {
        to[k][1] = cos(first + found[k]);
        to[k][2] = sin(first + found[k]);
    }
    return count;
}

/* Impulses that end all slip. */
static void stick_impulses(const Touch *c, const double *before, double wanted, double *impulse) {
    const double(*m)[MOST] = c->matrix;
    double a[MOST] = {wanted - before[0], -before[1], -before[2]};
    if (c->directions == 2) {
        const double whole = m[0][0] * m[1][1] - m[0][1] * m[1][0];
        impulse[0] = (m[1][1] * a[0] - m[0][1] * a[1]) / whole;
        impulse[1] = (m[0][0] * a[1] - m[1][0] * a[0]) / whole;
        return;
    }
    double minor[MOST][MOST], whole = 0.0;
    for (int i = 0; i < MOST; i++)
        for (int j = 0; j < MOST; j++) {
            const int k = (i + 1) % 3, l = (i + 2) % 3, p = (j + 1) % 3, q = (j + 2) % 3;
            minor[i][j] = m[k][p] * m[l][q] - m[k][q] * m[l][p];
        }
    for (int j = 0; j < MOST; j++) whole += m[0][j] * minor[0][j];
    for (int j = 0; j < MOST; j++)
        impulse[j] = (minor[0][j] * a[0] + minor[1][j] * a[1] + minor[2][j] * a[2]) / whole;
}

/* First impulses (or forces) that satisfy the laws: of stick, slip, and none; return whether there are some. */
static int solve_laws(const Touch *c, const double *before, double wanted, int conserves, double *impulse) {
    memset(impulse, 0, MOST * sizeof *impulse);
    if (c->directions == 1) {
        impulse[0] = (wanted - before[0]) / c->matrix[0][0];
        if (satisfies(c, before, wanted, impulse, conserves)) return 1;
    } else {
        double directions[SAMPLED_ANGLES][MOST];
        stick_impulses(c, before, wanted, impulse);
        if (satisfies(c, before, wanted, impulse, conserves)) return 1;
        const int count = slip_directions(c, before, wanted, directions);
        for (int k = 0; k < count; k++) {
            slip_impulses(c, before, wanted, directions[k], impulse);
            if (satisfies(c, before, wanted, impulse, conserves)) return 1;
        }
    }
    memset(impulse, 0, MOST * sizeof *impulse);
    return satisfies(c, before, wanted, impulse, conserves);
}

/* -- decisions ----------------------------------------------------------------------------------------------------- */

/* Speed that counts as zero, without the one at the start of slip. */
static double slow_speed(const Motion *of) {
    return fmax((1.0 + of->coarser) * SLOWEST * of->fastest, STILL * of->length);
}

/* Count an event: in a crowd of events, contacts last earlier. */
static void count_event(Motion *of, double now) {
    if (of->crowded && now - of->crowd[of->crowded - 1] > 10.0 * CROWDED * motion_duration) {
        of->coarser = 0.0;
        of->crowded = 0;
    }
    of->crowd[of->crowded++] = now;
    if (of->crowded < CROWD) return;
    if (of->crowd[CROWD - 1] - of->crowd[0] < CROWDED * motion_duration) {
        of->coarser = fmin((1.0 + of->coarser) * COARSER, COARSEST) - 1.0;
        of->crowd[0] = of->crowd[CROWD - 1];
        of->crowded = 1;
    } else {
        memmove(of->crowd, of->crowd + 1, (CROWD - 1) * sizeof *of->crowd);
        of->crowded = CROWD - 1;
    }
}

/* Store the mode of a contact, with its direction of slip. */
static void set_mode(Motion *of, int event, int mode, const double *heading) {
    const int64_t first = motion_contacts.first[event];
    of->mode[event] = mode;
    for (int d = 0; d < directions_of(event); d++) of->heading[first + d] = mode == SLIP && d ? heading[d] : 0.0;
}

/* Change coordinates so that the gap closes, and velocities so that slow relative velocities vanish. */
static void put_on_contact(Motion *of, const Touch *c, int sticks) {
    double impulse[MOST] = {-c->speed[0] / c->matrix[0][0]};
    double *velocities = of->state + MOTION_COORDINATES + MOTION_STATES;
    if (sticks && c->directions > 1) stick_impulses(c, c->speed, 0.0, impulse);
    for (int i = 0; i < MOTION_COORDINATES; i++) {
        of->state[i] -= c->answer[i][1] * c->gap / c->matrix[0][0];
        for (int d = 0; d < c->directions; d++) velocities[i] += c->answer[i][1 + d] * impulse[d];
    }
}

static int report_singular(const Touch *c, double time, Report *to) {
    if (c->regular) return 0;
    report(to, ERROR, "The contact of %s at t = %.6g s is not determined: the pose is singular.",
           motion_event_names[c->event], time);
    return 1;
}

/* Decide whether a closed contact lasts, and whether it sticks or slips then. */
static void settle(Motion *of, int event, double time, Report *to) {
    Touch c;
    double force[MOST] = {0}, after[MOST], heading[MOST] = {0}, largest = 0.0, most = 0.0;
    const double slow = fmax(slow_speed(of), of->starting);
    int mode = OPEN, holds = 0;
    look(of, time, event, &c);
    if (report_singular(&c, time, to)) return;
    const double allowed = (of->mode[event] == OPEN ? CLOSED : LOST) * of->length;
    if (!(c.gap <= allowed && fabs(c.speed[0]) <= slow)) {
        set_mode(of, event, OPEN, NULL);
        return;
    }
    const double fast = length_along(&c, c.speed);
    if (c.directions > 1 && fast > slow) {
        double divisor = c.matrix[0][0];
        for (int d = 1; d < c.directions; d++) {
            heading[d] = c.speed[d] / fast;
            divisor -= c.friction * c.matrix[0][d] * heading[d];
        }
        if (c.rate[0] < 0) mode = SLIP;
        if (mode == SLIP && !(divisor > 0)) {
            report(to, ERROR,
                   "%s: no force satisfies the laws of contact and friction at t = %.6g s. A sliding body is wedged "
                   "(Painleve's paradox). Lower the coefficient of friction, or use a compliant contact.",
                   motion_event_names[event], time);
            return;
        }
    } else {
        if (!solve_laws(&c, c.rate, 0.0, 0, force)) {
            report(to, ERROR, "%s: no force satisfies the laws of contact and friction at t = %.6g s.",
                   motion_event_names[event], time);
            return;
        }
        respond(&c, c.rate, force, after);
        for (int d = 0; d < c.directions; d++) {
            largest = fmax(largest, fabs(c.rate[d]));
            most = fmax(most, fabs(force[d]));
        }
        if (force[0] > EXACT * most) {
            mode = c.directions == 1 ? SMOOTH : length_along(&c, after) <= RESTS * largest ? STICK : SLIP;
            const double friction = length_along(&c, force);
            double along = 0.0;
            for (int d = 1; d < c.directions && mode == SLIP; d++) {
                heading[d] = -force[d] / friction;
                along += heading[d] * c.speed[d];
            }
            holds = mode == STICK || along < 0;
        }
    }
    set_mode(of, event, mode, heading);
    if (mode != OPEN) put_on_contact(of, &c, holds);
}

/* Bodies meet: an impact, after which they rebound or stay together. */
static void hit(Motion *of, int event, double time, Report *to) {
    Touch c;
    look(of, time, event, &c);
    if (report_singular(&c, time, to)) return;
    const double approach = fmax(0.0, -c.speed[0]);
    double impulse[MOST] = {0};
    of->fastest = fmax(of->fastest, approach);
    of->starting = 0.0;
    if (approach > 1e-3 * slow_speed(of)) {
        const double back = fmax(0.0, c.restitution * approach);
        if (!solve_laws(&c, c.speed, back, 1, impulse) && !solve_laws(&c, c.speed, 0.0, 1, impulse)) {
            report(to, ERROR,
                   "%s: no impulse satisfies the laws of impact at t = %.6g s. Check whether a driver pushes one body "
                   "into another.",
                   motion_event_names[event], time);
            return;
        }
    }
    for (int i = 0; i < MOTION_COORDINATES; i++) {
        of->state[i] -= c.answer[i][1] * c.gap / c.matrix[0][0];
        for (int d = 0; d < c.directions; d++)
            of->state[MOTION_COORDINATES + MOTION_STATES + i] += c.answer[i][1 + d] * impulse[d];
    }
    settle(of, event, time, to);
}

/* A contact that slips has come to rest, or the direction of slip has changed. */
static void stop_slip(Motion *of, int event, double time, Report *to) {
    Touch c;
    const double still = slow_speed(of);
    double heading[MOST] = {0};
    look(of, time, event, &c);
    if (report_singular(&c, time, to)) return;
    const double fast = length_along(&c, c.speed);
    for (int d = 1; d < c.directions && fast > 0; d++) heading[d] = c.speed[d] / fast;
    if (fast > fmax(still, of->starting)) {
        set_mode(of, event, SLIP, heading);
        return;
    }
    double before[MOTION_WIDTH];
    memcpy(before, of->state, sizeof before);
    settle(of, event, time, to);
    of->starting = of->mode[event] == SLIP ? START * of->floor : 0.0;
    /* the direction of a starting slip may turn in space; repeated stops would hold the bodies */
    if (of->mode[event] == SLIP && fast > still && time - of->turned_at > 1e-14 * fmax(1.0, fabs(time))) {
        of->turned_at = time;
        memcpy(of->state, before, sizeof before);
        set_mode(of, event, SLIP, heading);
    }
}

/* Friction has reached its limit: slip starts against it. */
static void start_slip(Motion *of, int event, double time, Report *to) {
    Touch c;
    double force[MOST] = {0}, heading[MOST] = {0};
    look(of, time, event, &c);
    of->starting = 0.0;
    if (report_singular(&c, time, to)) return;
    if (c.directions == 1) { /* an input has removed the friction */
        set_mode(of, event, SMOOTH, NULL);
        return;
    }
    stick_impulses(&c, c.rate, 0.0, force);
    const double friction = length_along(&c, force);
    for (int d = 1; d < c.directions; d++) heading[d] = friction > 0 ? -force[d] / friction : d == 1;
    set_mode(of, event, SLIP, heading);
    of->starting = START * of->floor;
}

void decide_contact(Motion *of, double now, double time, double *wanted, Report *to) {
    const int event = (int)(of->happened / 2), second = (int)(of->happened % 2);
    double found[FOUND_ROWS];
    if (!MOTION_EVENTS) return;
    count_event(of, now);
    evaluate_contacts(of, time, found);
    for (int j = 0; j < MOTION_EVENTS; j++)
        if (j != event && directions_of(j) && (of->mode[j] != OPEN || found[j] <= CLOSED * of->length)) {
            report(to, ERROR,
                   "%s and %s touch at the same time, t = %.6g s. uqmbd simulates such motions, this FMU does not.",
                   motion_event_names[event], motion_event_names[j], now);
            return;
        }
    if (of->mode[event] == OPEN) {
        hit(of, event, time, to);
    } else if (!second) {
        set_mode(of, event, OPEN, NULL);
        of->starting = 0.0;
    } else if (of->mode[event] == SLIP) {
        stop_slip(of, event, time, to);
    } else {
        start_slip(of, event, time, to);
    }
    if (to->status < ERROR) begin_contacts(of, time, wanted, to);
}

void start_contacts(Motion *of, double time, Report *to) {
    double found[FOUND_ROWS];
    int closed = -1;
    if (!MOTION_EVENTS) return;
    memset(of->mode, 0, sizeof of->mode);
    memset(of->heading, 0, sizeof of->heading);
    of->fastest = of->coarser = of->starting = 0.0;
    of->crowded = 0;
    of->turned_at = -INFINITY;
    evaluate_contacts(of, time, found);
    for (int k = 0; k < MOTION_EVENTS; k++) {
        if (!directions_of(k) || !(found[k] <= CLOSED * of->length)) continue;
        if (found[k] < -DEEP * of->length) {
            report(to, ERROR, "%s: the bodies overlap by %.3g m at t = %.6g s.", motion_event_names[k], -found[k],
                   of->time);
            return;
        }
        if (closed >= 0) {
            report(to, ERROR,
                   "%s and %s touch at the start, t = %.6g s. uqmbd simulates such motions, this FMU does not.",
                   motion_event_names[closed], motion_event_names[k], of->time);
            return;
        }
        closed = k;
    }
    if (closed >= 0) settle(of, closed, time, to);
}

void begin_contacts(Motion *of, double time, double *wanted, Report *to) {
    double found[FOUND_ROWS];
    int lasts = 0;
    if (!MOTION_EVENTS) return;
    memset(of->resting, 0, sizeof of->resting);
    memset(of->rise, 0, sizeof of->rise);
    evaluate_contacts(of, time, found);
    for (int k = 0; k < MOTION_EVENTS; k++) {
        if (!directions_of(k)) continue;
        if (found[k] < -DEEP * of->length) {
            report(to, ERROR, "%s: the bodies overlap by %.3g m at t = %.6g s.", motion_event_names[k], -found[k], time);
            return;
        }
        if (of->mode[k] != OPEN && found[k] > LOST * of->length) set_mode(of, k, OPEN, NULL);
        /* an input may have added friction */
        if (of->mode[k] == SMOOTH && found[LAW_ROWS + 2 * k + 1] > 0 && directions_of(k) > 1) settle(of, k, time, to);
        lasts |= of->mode[k] != OPEN;
    }
    const double slow = of->slow = fmax(slow_speed(of), of->starting);
    for (int k = 0; k < MOTION_EVENTS && to->status < ERROR; k++) {
        const int first = (int)motion_contacts.first[k];
        if (!directions_of(k)) continue;
        if (of->mode[k] == SLIP) {
            double along = 0.0;
            for (int d = 1; d < directions_of(k); d++) along += found[SPEED_ROWS + first + d] * of->heading[first + d];
            of->resting[2 * k + 1] = along <= slow;
        }
        if (of->mode[k] != OPEN || !(found[k] <= CLOSED * of->length)) continue;
        const double speed = found[SPEED_ROWS + first];
        if (speed < -slow) continue; /* the driver finds this impact in its first step */
        /* below the slow speed the gap does not rise: the contact was only released */
        of->resting[2 * k] = 1;
        of->rise[2 * k] = speed > slow ? speed : 0.0;
        if (lasts || !(speed > slow)) continue;
        Touch c;
        describe(found, k, &c);
        if (c.regular && c.rate[0] < 0) *wanted = fmin(*wanted, -FLIGHT * speed / c.rate[0]);
    }
}
