/* Integration by the driver from one time to another, which also finds the events of contacts and decides about them.

   The states of contacts change here only if inputs have changed the contacts between two steps. */
#include "integration.h"

enum {
    MOST_IMPACTS = 10000, /* largest number of events in a step */
    MOST_RETRIES = 200,   /* largest number of decisions of the driver in a step */
    CROWDED = 100,        /* events without progress in time, after which the driver decides nothing */
    LEGS = MOTION_BREAKS + MOTION_ADDED + MOTION_KNOTS + 1,
    /* rows of the contact program, of each event */
    FRICTION_ROWS = MOTION_EVENTS,
    SPEED_ROWS = 2 * MOTION_EVENTS,
    CONTACT_ROWS = 3 * MOTION_EVENTS,
};

static const double FARTHEST = 3e-3; /* limit of the residual of an interpolated state */
static const double BETWEEN = 3.0;   /* interpolation error that rejects a step */
static const double RELEVANT = 100.0; /* relevant deviation of a table from a cubic, in tolerances */
static const double CLOSED = 1e-9, LOST = 1e-6; /* a closed gap, also of a contact that lasted, relative to the size */
static const double DEEP = 1e-6;                /* an overlap of bodies that is an error */
static const double STILL = 1e-12;              /* speed that counts as zero at the start, relative to the size */
static const double ROUNDED = 1e-13;            /* normal speed, relative to its terms, that counts as zero */
static const double PUSHED = 10.0;              /* tolerances by which an input may change a normal speed without effect */
static const double CLUSTER_TIME = 2e-3;        /* time of a cluster of events, relative to the duration */
static const double TOGETHER = 1e-9;            /* duration of an instant, relative to the duration */

/* What the driver works with: a problem of one realisation. */
typedef struct {
    Problem problem;
    Pool pool;
    Encounters encounters;
    double times[PAIR], ends[LEGS], longest[LEGS];
    double now, begin, tried, floor, limit;
    double node_times[NODES], nodes[NODES * MOTION_WIDTH], result[PAIR * MOTION_WIDTH], off[MOTION_EQUATIONS + 1];
    int64_t jumps[LEGS], leg, last_leg, first, column, status, attempts, refused, stiff, fresh, rejected, allowed;
    int64_t trusted, told, steps, known, recorded;
    int8_t poor[PAIR];
} Run;

/* Ends of the parts of a step between which the equations are smooth; return their number. */
static int64_t find_legs(const Motion *of, double end, double *ends) {
    int64_t count = 0;
    for (int k = 0; k < LEGS - 1; k++) {
        const int knot = k - MOTION_BREAKS - MOTION_ADDED;
        const double at = k < MOTION_BREAKS ? of->parameters[motion_break_places[k]]
                          : knot < 0        ? motion_added_parameters[k - MOTION_BREAKS]
                                            : motion_knot_parameters[knot];
        const double near = 1e-12 * fmax(1.0, fabs(at));
        int64_t place = count;
        if (!(at > of->time + near && at < end - near)) continue;
        /* a knot at which the third derivative jumps by less than the tolerance is no end */
        if (knot >= 0 && !(motion_deviation_parameters[knot] > RELEVANT * of->tolerance)) continue;
        while (place > 0 && ends[place - 1] > at) place--;
        if (place > 0 && at - ends[place - 1] <= near) continue;
        for (int64_t i = count; i > place; i--) ends[i] = ends[i - 1];
        ends[place] = at;
        count++;
    }
    ends[count] = end;
    return count + 1;
}

static void prepare(Run *run, Motion *of, double end, Report *to) {
    memset(run, 0, sizeof *run);
    if (of->clustered < 0 || of->clustered >= CLUSTER) of->clustered = 0; /* of a damaged saved state */
    of->noted = 0; /* a model has no room for notes */
    run->times[0] = run->now = run->begin = run->node_times[NODES - 1] = of->time;
    run->times[1] = end;
    run->last_leg = find_legs(of, end, run->ends) - 1;
    for (int64_t k = 0; k <= run->last_leg; k++) run->longest[k] = motion_longest;
    run->floor = of->floor;
    run->limit = INFINITY;
    run->first = run->column = run->fresh = run->known = 1;
    run->status = RUNNING;
    run->allowed = INT64_MAX / 2;
    memcpy(run->nodes + (NODES - 1) * MOTION_WIDTH, of->state, sizeof of->state);
    memcpy(run->result, of->state, sizeof of->state);
    memcpy(run->result + MOTION_WIDTH, of->state, sizeof of->state);
    run->problem = motion_problem;
    run->problem.rtol = of->tolerance;
    run->problem.far = fmin(FAR * of->tolerance, FARTHEST);
    run->problem.between = BETWEEN * pow(of->tolerance, -1.0 / 8.0);
    run->problem.times = run->times;
    run->problem.leg_ends = run->ends;
    run->problem.leg_longest = run->longest;
    run->problem.leg_jumps = run->jumps;
    run->encounters = (Encounters){.mode = of->mode,
                                   .heading = of->heading,
                                   .internal = of->internal,
                                   .resting = of->resting,
                                   .rise = of->rise,
                                   .length = &of->length,
                                   .slow = &of->slow,
                                   .happened = &of->happened,
                                   .noted = &of->noted,
                                   .total = &of->total,
                                   .restarts = &of->restarts,
                                   .stalled = &of->stalled,
                                   .clustered = &of->clustered,
                                   .recent = of->recent,
                                   .since = &of->since,
                                   .fastest = &of->fastest,
                                   .coarse = &of->coarse,
                                   .starting = &of->starting,
                                   .turned = &of->turned_at,
                                   .later = &of->later,
                                   .held = of->held,
                                   .arming = &of->arming,
                                   .watched = 1,
                                   .decides = 1,
                                   .window = CLUSTER_TIME * motion_duration,
                                   .together = TOGETHER * motion_duration};
    run->pool = (Pool){.z = of->state,
                       .rate = of->rate,
                       .parameters = of->parameters,
                       .now = &run->now,
                       .begin = &run->begin,
                       .wanted = &of->wanted,
                       .tried = &run->tried,
                       .floor = &run->floor,
                       .limit = &run->limit,
                       .leg = &run->leg,
                       .last_leg = &run->last_leg,
                       .first = &run->first,
                       .column = &run->column,
                       .status = &run->status,
                       .attempts = &run->attempts,
                       .refused = &run->refused,
                       .stiff = &run->stiff,
                       .fresh = &run->fresh,
                       .rejected = &run->rejected,
                       .allowed = &run->allowed,
                       .trusted = &run->trusted,
                       .told = &run->told,
                       .steps = &run->steps,
                       .known = &run->known,
                       .node_times = run->node_times,
                       .nodes = run->nodes,
                       .result = run->result,
                       .off = run->off,
                       .poor = run->poor,
                       .recorded = &run->recorded,
                       .encounters = &run->encounters};
    if (advance_workspace(&run->problem) > MOTION_WORK)
        report(to, FATAL, "The workspace of the integration is too small; the FMU is damaged.");
}

/* -- contacts ------------------------------------------------------------------------------------------------------ */

/* Whether an event is a contact; otherwise it is a mark, which changes nothing. */
static int is_contact(int event) { return motion_contacts.first[event + 1] > motion_contacts.first[event]; }

static int has_tangents(int event) { return motion_contacts.first[event + 1] - motion_contacts.first[event] > 1; }

/* Rows of the contact program at a time inside of the interval, where no function of time jumps. */
static void evaluate_rows(const Run *run, Motion *of, const int64_t *rows, int64_t count, double *found) {
    double arguments[ARGUMENTS + 1];
    const double begin = run->begin, end = run->ends[run->leg <= run->last_leg ? run->leg : run->last_leg];
    const double near = 1e-12 * fmax(1.0, fmax(fabs(begin), fabs(end)));
    fill_arguments(of, of->state, fmin(fmax(run->now, begin + near), end - near), arguments);
    const Source source = {arguments, ARGUMENTS, ARGUMENTS, 1, 1, 0};
    evaluate(&motion_contacts.contact, (V *)cleared(of), &source, 1, 0, 1, rows, count, found);
}

/* Gaps, coefficients of friction and normal speeds of all events. */
static void evaluate_contacts(const Run *run, Motion *of, double *found) {
    evaluate_rows(run, of, motion_contact_rows, CONTACT_ROWS, found);
}

/* Size of the terms of the normal speed of a contact. */
static double find_terms_of_speed(const Run *run, Motion *of, int event) {
    double found[MOTION_COORDINATES + 1], size = 0.0;
    evaluate_rows(run, of, motion_contacts.slope + motion_contacts.first[event] * MOTION_COORDINATES, MOTION_COORDINATES,
                  found);
    for (int k = 0; k < MOTION_COORDINATES; k++)
        size += fabs(found[k] * of->state[MOTION_COORDINATES + MOTION_STATES + k]);
    return size;
}

/* Report overlapping bodies; return whether there are some. */
static int report_overlap(const Motion *of, double time, const double *found, Report *to) {
    for (int k = 0; k < MOTION_EVENTS; k++)
        if (is_contact(k) && found[k] < -DEEP * of->length) {
            report(to, ERROR, "%s: the bodies overlap by %.3g m at t = %.6g s.", motion_event_names[k], -found[k], time);
            return 1;
        }
    return 0;
}

static void report_endless(const Run *run, Report *to) {
    report(to, ERROR, "More than %d events of contacts occur in a step at t = %.6g s.", MOST_IMPACTS, run->now);
}

/* Report why the driver has not decided about an event. */
static void report_undecided(const Run *run, Motion *of, int event, Report *to) {
    double found[CONTACT_ROWS + 1];
    const char *const name = motion_event_names[event];
    if (of->stalled > CROWDED) {
        report(to, ERROR, "%s: more than %d events occur at t = %.6g s.", name, CROWDED, run->now);
        return;
    }
    if (of->total > MOST_IMPACTS) {
        report_endless(run, to);
        return;
    }
    evaluate_contacts(run, of, found);
    for (int k = 0; k < MOTION_EVENTS; k++)
        if (k != event && is_contact(k) && (of->mode[k] != OPEN || found[k] <= CLOSED * of->length)) {
            report(to, ERROR,
                   "%s and %s touch at the same time, t = %.6g s. This FMU cannot decide about this event; uqmbd.simulate may.",
                   name, motion_event_names[k], run->now);
            return;
        }
    report(to, ERROR,
           "%s: the laws of contact and friction do not determine the motion at t = %.6g s. Possible reasons: a "
           "sliding body is wedged (Painleve's paradox), friction is exactly at its limit, a driver pushes one body "
           "into another, or the pose is singular. Lower the coefficient of friction, or use a compliant contact.",
           name, run->now);
}

/* Let the driver decide about the event of a guard (see events.h), or report why it cannot. */
static void decide(Run *run, Motion *of, int guard, Report *to) {
    of->happened = guard;
    of->later = -INFINITY;
    if (!decide_waiting(&run->problem, &run->pool, 0, cleared(of))) report_undecided(run, of, guard / 2, to);
}

void start_contacts(Motion *of, Report *to) {
    Run run;
    double found[CONTACT_ROWS + 1];
    if (!MOTION_EVENTS) return;
    memset(of->mode, 0, sizeof of->mode);
    memset(of->heading, 0, sizeof of->heading);
    memset(of->internal, 0, sizeof of->internal);
    memset(of->held, 0, sizeof of->held);
    of->total = of->restarts = of->stalled = of->clustered = of->noted = 0;
    of->fastest = of->starting = 0.0;
    of->coarse = 1.0;
    of->since = of->turned_at = of->later = -INFINITY;
    of->arming = 1;
    prepare(&run, of, of->time + motion_duration, to);
    if (to->status >= ERROR) return;
    evaluate_contacts(&run, of, found);
    if (report_overlap(of, of->time, found, to)) return;
    for (int k = 0; k < MOTION_EVENTS; k++) {
        if (!is_contact(k) || found[k] > CLOSED * of->length) continue;
        /* bodies that approach each other collide in the first step */
        if (fabs(found[SPEED_ROWS + k]) > fmax(STILL * of->length, ROUNDED * find_terms_of_speed(&run, of, k))) continue;
        decide(&run, of, 2 * k, to);
        return;
    }
}

/* Decide about normal speeds of closed contacts that inputs have changed; return whether there are some. */
static int follow_push(Run *run, Motion *of, const double *found, Report *to) {
    int fastest = -1;
    for (int k = 0; k < MOTION_EVENTS; k++) {
        const double speed = found[SPEED_ROWS + k];
        if (of->mode[k] == OPEN) continue;
        if (fabs(speed) <= PUSHED * of->tolerance * (of->length + find_terms_of_speed(run, of, k))) continue;
        if (fastest < 0 || speed < found[SPEED_ROWS + fastest]) fastest = k;
    }
    if (fastest < 0) return 0;
    of->happened = 2 * fastest;
    of->later = -INFINITY;
    if (!decide_push(&run->problem, &run->pool, 0, cleared(of))) report_undecided(run, of, fastest, to);
    return 1;
}

/* Follow inputs that have changed contacts: bodies are moved, or pushed, or friction appears or vanishes. */
static void follow_contacts(Run *run, Motion *of, Report *to) {
    double found[CONTACT_ROWS + 1];
    evaluate_contacts(run, of, found);
    if (report_overlap(of, run->now, found, to) || !of->arming) return;
    for (int k = 0; k < MOTION_EVENTS; k++)
        if (found[k] > LOST * of->length) of->mode[k] = OPEN;
    if (follow_push(run, of, found, to)) return;
    for (int k = 0; k < MOTION_EVENTS && to->status < ERROR; k++) {
        const int rubs = has_tangents(k) && found[FRICTION_ROWS + k] > 0;
        if (of->mode[k] == OPEN) continue;
        if (!rubs) {
            of->mode[k] = SMOOTH;
        } else if (of->mode[k] == SMOOTH) { /* as at an end of sliding */
            of->mode[k] = SLIP;
            decide(run, of, 2 * k + 1, to);
        }
    }
}

/* Process an event that the driver has not decided in its step. */
static void process_event(Run *run, Motion *of, Report *to) {
    double found[CONTACT_ROWS + 1];
    const int event = (int)(of->happened / 2), second = (int)(of->happened % 2);
    evaluate_contacts(run, of, found);
    if (report_overlap(of, run->now, found, to)) return;
    if (second && !(found[FRICTION_ROWS + event] > 0)) { /* the friction has vanished */
        of->mode[event] = SMOOTH;
        of->arming = 1;
        of->restarts++;
    } else {
        decide(run, of, (int)of->happened, to);
    }
}

/* -- steps --------------------------------------------------------------------------------------------------------- */

/* Continue after an event, maybe in the next part of the step; return whether the end is reached. */
static int restart(Run *run, double end) {
    const double leg_end = run->ends[run->leg];
    run->fresh = 1;
    run->rejected = run->refused = 0;
    run->status = RUNNING;
    if (run->now >= end - 1e-12 * fmax(1.0, fabs(end))) return 1;
    if (run->now >= leg_end - 1e-12 * fmax(1.0, fabs(leg_end))) {
        run->now = run->begin = leg_end;
        run->leg++;
        run->attempts = 0;
    }
    return 0;
}

void integrate(Motion *of, double end, Report *to) {
    Run run;
    const int64_t member = 0;
    prepare(&run, of, end, to);
    if (to->status >= ERROR) return;
    of->restarts = of->total = 0;
    if (MOTION_EVENTS != 0) follow_contacts(&run, of, to);
    for (int retries = 0; run.status != DONE && to->status < ERROR; retries++) {
        if (run.status == REFUSED || (run.status == STRAYED && !run.trusted)) {
            run.trusted = run.status == STRAYED;
            run.status = RUNNING;
        }
        if (run.status == EVENT) {
            process_event(&run, of, to);
            if (to->status >= ERROR) return;
            if (restart(&run, end)) break;
            retries--;
        }
        if (of->restarts > MOST_IMPACTS) {
            report_endless(&run, to);
            return;
        }
        if (run.status != RUNNING || retries > MOST_RETRIES) {
            report(to, ERROR,
                   "The integration stopped at t = %.6g s: %s. Probably a singular pose, a stop, a stiff force, or a force "
                   "that grows without bound.",
                   run.now,
                   run.status == MANY      ? "too many steps"
                   : run.status == SMALL   ? "the step size has become too small"
                   : run.status == STRAYED ? "a step leads off the constraints"
                                           : "steps are refused");
            return;
        }
        advance(&run.problem, &run.pool, &member, 1, cleared(of), INT64_C(40000) * 8);
        if (run.status == RUNNING) retries--; /* the budget of the driver was spent */
    }
    if (to->status >= ERROR) return;
    of->time = end;
    if (MOTION_EVENTS != 0) {
        double found[CONTACT_ROWS + 1];
        evaluate_contacts(&run, of, found);
        if (report_overlap(of, end, found, to)) return;
    }
    memcpy(of->shown, of->state, sizeof of->shown);
    if (MOTION_EQUATIONS) {
        memcpy(run.result + MOTION_WIDTH, of->state, sizeof of->state);
        run.column = PAIR;
        project(&run.problem, &run.pool, &member, 1, cleared(of));
        memcpy(of->shown, run.result + MOTION_WIDTH, sizeof of->shown);
    }
    of->known = 0.0;
    for (int k = 0; k < MOTION_WIDTH; k++)
        if (!isfinite(of->state[k])) {
            report(to, ERROR, "The state is not finite at t = %.6g s.", end);
            return;
        }
}
