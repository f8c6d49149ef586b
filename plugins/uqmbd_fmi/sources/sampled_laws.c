/* Sampled controllers with laws, in the order of the driver: all laws measure the state, then waiting commands act, then
   the new ones. */
#include "sampled_laws.h"

static const double NEAR = 1e-9; /* distance of times that counts as zero, relative to the time between samples */

static double sample_time(const Motion *of, const Law *law, int64_t number) {
    return of->origin + (double)number / law->rate;
}

static int is_due(const Motion *of, const Law *law, double time) { return time <= of->time + NEAR / law->rate; }

/* Whether commands act at their sample. */
static int is_direct(const Law *law) { return !(law->delay * law->rate > NEAR); }

double next_sample(const Motion *of) {
    double next = INFINITY;
    for (int k = 0; k < MOTION_LAWS; k++) {
        const Law *law = motion_laws + k;
        next = fmin(next, sample_time(of, law, of->sampled[k]));
        if (!is_direct(law)) next = fmin(next, sample_time(of, law, of->acted[k]) + law->delay);
    }
    return next;
}

/* Evaluate a law; commands are within their limits. */
static void evaluate_law(Motion *of, const Law *law, double *results, Report *to) {
    double arguments[ARGUMENTS + MOTION_INPUTS + 1], found[MOTION_MOST_CONTROL + 2];
    double given[MOTION_MOST_CONTROL + MOTION_INPUTS + 2], limits[2 * MOTION_MOST_CONTROL + 1], random[2 * MOTION_MOST_CONTROL + 1];
    const Measurement *by = motion_measurements + law->measurement;
    const int64_t count = ARGUMENTS + MOTION_INPUTS, held = law->commands + law->states;
    fill_arguments(of, of->state, of->time, arguments);
    memcpy(arguments + ARGUMENTS, of->inputs, MOTION_INPUTS * sizeof(double));
    const Source source = {arguments, count, count, 1, 1, 0};
    evaluate(&by->program, (V *)cleared(of), &source, 1, 0, 1, by->rows, by->count, found);
    if (law->accelerates && !(found[by->count - 1] <= MOTION_POOR)) {
        report(to, ERROR, "The accelerations that controller %s measures at t = %.6g s are inaccurate, as in a singular pose.",
               law->name[0], of->time);
        return;
    }
    given[0] = of->time;
    memcpy(given + 1, found, (size_t)law->measured * sizeof(double));
    for (int64_t i = 0; i < law->states; i++) given[1 + law->measured + i] = of->state[law->held[law->commands + i]];
    memcpy(given + 1 + law->measured + law->states, of->inputs, MOTION_INPUTS * sizeof(double));
    law->law((const V *)given, (V *)results);
    memcpy(limits, law->limits, 2 * (size_t)law->commands * sizeof(double));
    if (law->random) law->find_limits((const V *)of->inputs, (V *)random);
    for (int64_t i = 0; i < law->random; i++) limits[law->random_limits[i]] = random[i];
    for (int64_t i = 0; i < held; i++) {
        int valid = isfinite(results[i]);
        if (i < law->commands) {
            const double low = limits[i], high = limits[law->commands + i];
            valid &= low <= high;
            results[i] = fmin(fmax(results[i], low), high);
        }
        if (!valid) {
            report(to, ERROR,
                   "Controller %s: a command or state is not finite at t = %.6g s, or a limit of a command is below the "
                   "other one.",
                   law->name[0], of->time);
            return;
        }
    }
}

/* Set an entry of the state, also of the state that outputs show. */
static void hold(Motion *of, int64_t entry, double value) {
    of->state[entry] = of->shown[entry] = value;
    of->arming = 1;
}

void sample_laws(Motion *of, Report *to) {
    double results[MOTION_LAWS + 1][MOTION_MOST_CONTROL + 1];
    int due[MOTION_LAWS + 1] = {0};
    for (int k = 0; k < MOTION_LAWS; k++) {
        const Law *law = motion_laws + k;
        due[k] = is_due(of, law, sample_time(of, law, of->sampled[k]));
        if (due[k]) evaluate_law(of, law, results[k], to);
        if (to->status >= ERROR) return;
    }
    for (int k = 0; k < MOTION_LAWS; k++) {
        const Law *law = motion_laws + k;
        while (!is_direct(law) && of->acted[k] < of->sampled[k] &&
               is_due(of, law, sample_time(of, law, of->acted[k]) + law->delay)) {
            const double *commands = of->pending + law->first + of->acted[k] % law->waiting * law->commands;
            for (int64_t i = 0; i < law->commands; i++) hold(of, law->held[i], commands[i]);
            of->acted[k]++;
        }
        if (!due[k]) continue;
        double *commands = of->pending + law->first + of->sampled[k] % law->waiting * law->commands;
        for (int64_t i = 0; i < law->states; i++)
            hold(of, law->held[law->commands + i], results[k][law->commands + i]);
        for (int64_t i = 0; i < law->commands; i++) {
            commands[i] = results[k][i];
            if (is_direct(law)) hold(of, law->held[i], commands[i]);
        }
        of->sampled[k]++;
    }
    of->known = 0.0;
}

void start_laws(Motion *of, Report *to) {
    of->origin = of->time;
    memset(of->sampled, 0, sizeof of->sampled);
    memset(of->acted, 0, sizeof of->acted);
    if (MOTION_LAWS) sample_laws(of, to);
}
