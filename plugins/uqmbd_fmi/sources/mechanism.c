/* A mechanism as a model: assembly for any parameters, steps from one communication point to the next, and outputs that
   are consistent with the equations of motion. */
#include "integration.h"
#include "sampled_laws.h"

/* Contents of a variable: the index of an input of the motion, of an output, or of a command of a controller. */
enum { INPUT_VALUE, OUTPUT_VALUE, TIME_VALUE, COMMAND_VALUE };

typedef struct {
    int what, index;
} Content;

extern const Content contents[];
extern const double start_values[];
extern const double start_commands[];
extern const double default_tolerance;

enum {
    PASSES = 4, /* projections onto constraints that inputs have moved */
};

static const double SHORTEST = 1e-12; /* shortest step of the integration, relative to the time */

size_t model_bytes(void) { return sizeof(Motion); }

void model_start(void *model) {
    Motion *of = model;
    memset(of, 0, sizeof *of);
    for (int k = 0; k < MOTION_INPUTS; k++) of->inputs[k] = start_values[k];
    for (int k = 0; k < MOTION_COMMANDS; k++) of->commands[k] = start_commands[k];
    of->dirty = 1.0;
}

/* Parameters of the equations from the inputs. */
static void find_parameters(Motion *of) {
    memcpy(of->parameters, motion_constant_parameters, MOTION_PARAMETERS * sizeof(double));
    if (MOTION_RANDOM) {
        double found[MOTION_RANDOM + 1];
        motion_parameters((const V *)of->inputs, (V *)found);
        for (int k = 0; k < MOTION_RANDOM; k++) of->parameters[motion_random_places[k]] = found[k];
    }
}

/* Report a parameter that is not finite or not possible. */
static void check_parameters(const Motion *of, Report *to) {
    for (int k = 0; k < MOTION_PARAMETERS; k++)
        if (!(fabs(of->parameters[k]) <= MOTION_LARGEST)) {
            report(to, ERROR, "A number of the mechanism is not finite, or larger than %g, at these parameters.",
                   MOTION_LARGEST);
            return;
        }
    for (int k = 0; k < MOTION_LIMITS; k++) {
        const Limit *limit = motion_limits + k;
        const double value = of->parameters[limit->index];
        if (value < limit->minimum || value > limit->maximum ||
            (limit->exclusive && (value == limit->minimum || value == limit->maximum))) {
            report(to, ERROR, "The %s is %g; expected a number from %g to %g%s.", limit->name[0], value, limit->minimum,
                   limit->maximum, limit->exclusive ? ", without the ends" : "");
            return;
        }
    }
    for (int k = 0; k < MOTION_TENSORS; k++) {
        /* half the trace minus the tensor has no negative principal value */
        const int64_t *at = motion_tensors[k].index;
        double j[6];
        for (int i = 0; i < 6; i++) j[i] = of->parameters[at[i]];
        const double half = (j[0] + j[1] + j[2]) / 2, a = half - j[0], b = half - j[1], c = half - j[2];
        const double small = 1e-9 * fabs(half), d = j[3], e = j[4], f = j[5];
        const double pairs[] = {a * b - d * d, a * c - e * e, b * c - f * f};
        const double whole = a * (b * c - f * f) - d * (d * c - f * e) - e * (d * f + b * e);
        int wrong = a < -small || b < -small || c < -small || whole < -small * half * half * 10;
        for (int i = 0; i < 3; i++) wrong |= pairs[i] < -small * fabs(half) * 10;
        if (wrong) {
            report(to, ERROR, "The inertia of body %s is not possible for any body.", motion_tensors[k].body[0]);
            return;
        }
    }
}

/* Report the equation with the largest residual in a pose. */
static void report_open(Motion *of, const double *arguments, Report *to) {
    double residuals[MOTION_CONSTRAINTS + 1];
    int64_t rows[MOTION_CONSTRAINTS + 1];
    int worst = 0;
    for (int k = 0; k < MOTION_CONSTRAINTS; k++)
        rows[k] = motion_equation_values[k] < 0 ? MOTION_WIDTH + 1 : motion_equation_values[k];
    const Source source = {arguments, ARGUMENTS, ARGUMENTS, 1, 1, 0};
    evaluate(&motion_closing.program, (V *)cleared(of), &source, 1, 0, 1, rows, MOTION_CONSTRAINTS, residuals);
    for (int k = 1; k < MOTION_CONSTRAINTS; k++)
        if (!(fabs(residuals[k]) <= fabs(residuals[worst]))) worst = k;
    if (!MOTION_CONSTRAINTS) return;
    report(to, ERROR,
           "The mechanism cannot be assembled at these parameters: equation %s keeps a residual of %.3g, or the pose is "
           "singular or a mirror image of the drawn one. Use parameters closer to the start values.",
           motion_equation_names[worst], residuals[worst]);
}

/* Set the commands of controllers, which are constant states of the motion. */
static void set_commands(const Motion *of, double *state) {
    for (int k = 0; k < MOTION_COMMANDS; k++) state[motion_command_places[k]] = of->commands[k];
}

/* Close the pose and find the velocities. */
static void assemble(Motion *of, Report *to) {
    double arguments[ARGUMENTS + MOTION_STATED + 1], found[MOTION_WIDTH + MOTION_CONSTRAINTS + 1];
    int64_t undecided = 0;
    memset(of->state, 0, sizeof of->state);
    for (int k = 0; k < MOTION_COORDINATES; k++) of->state[k] = of->parameters[motion_drawn_places[k]];
    fill_arguments(of, of->state, of->time, arguments);
    const Source source = {arguments, ARGUMENTS, ARGUMENTS, 1, 1, 0};
    if (MOTION_CONSTRAINTS) {
        close_poses(&motion_closing, &motion_turns, (V *)cleared(of), &source, 1, 1, found, MOTION_MIRRORS,
                    motion_mirror_rows, &undecided);
        memcpy(of->state, found, MOTION_COORDINATES * sizeof(double));
        fill_arguments(of, of->state, of->time, arguments);
        if (undecided) {
            report_open(of, arguments, to);
            return;
        }
    }
    if (MOTION_INITIAL) {
        evaluate(&motion_initial, (V *)cleared(of), &source, 1, 0, 1, motion_initial_rows, MOTION_INITIAL, found);
        for (int k = 0; k < MOTION_INITIAL; k++) of->state[MOTION_COORDINATES + motion_initial_places[k]] = found[k];
        fill_arguments(of, of->state, of->time, arguments);
    }
    if (MOTION_COMMANDS) {
        set_commands(of, of->state);
        fill_arguments(of, of->state, of->time, arguments);
    }
    if (MOTION_MOVES) {
        const int64_t count = ARGUMENTS + MOTION_STATED + 1;
        const Source all = {arguments, count, count, 1, 1, 0};
        for (int k = 0; k < MOTION_STATED; k++) arguments[ARGUMENTS + k] = -of->parameters[motion_stated_places[k]];
        arguments[ARGUMENTS + MOTION_STATED] = 1.0;
        least_speeds(&motion_speeds, (V *)cleared(of), &all, 1, 1, found, &undecided);
        memcpy(of->state + MOTION_COORDINATES + MOTION_STATES, found, MOTION_COORDINATES * sizeof(double));
        if (undecided)
            report(to, ERROR,
                   "The stated velocities contradict the constraints at these parameters, or the pose is singular.");
    }
}

/* Project the state onto constraints that inputs have moved; velocities change by impulses of the constraints. */
static void follow_inputs(Motion *of, Report *to) {
    if (of->moved == 0.0) return;
    of->moved = 0.0;
    of->known = 0.0;
    if (!MOTION_EQUATIONS) return;
    const double times[PAIR] = {of->time, of->time};
    double result[PAIR * MOTION_WIDTH], off[MOTION_EQUATIONS + 1];
    int64_t first = 0, column = 0;
    int8_t poor[PAIR] = {0};
    const int64_t member = 0;
    Problem problem = motion_problem;
    problem.rtol = of->tolerance;
    problem.far = INFINITY;
    problem.times = times;
    const Pool pool = {.parameters = of->parameters, .first = &first, .column = &column, .result = result, .off = off,
                       .poor = poor};
    memcpy(result, of->state, sizeof of->state);
    for (int pass = 0; pass < PASSES; pass++) {
        memset(off, 0, sizeof off);
        first = 0;
        column = 1;
        project(&problem, &pool, &member, 1, cleared(of));
    }
    for (int k = 0; k < MOTION_EQUATIONS; k++)
        if (poor[0] || !(off[k] <= 1e-9 + FAR * of->tolerance * fmax(1.0, off[MOTION_EQUATIONS]))) {
            report(to, ERROR,
                   "The constraints cannot follow the inputs at t = %.6g s: the pose is singular or out of reach, or an "
                   "input jumped too far.",
                   of->time);
            return;
        }
    memcpy(of->state, result, sizeof of->state);
    memcpy(of->shown, result, sizeof of->shown);
}

/* Outputs at the shown state; angles continue from the last communication point. */
static void find_outputs(Motion *of, Report *to) {
    double arguments[ARGUMENTS + MOTION_INPUTS + 1];
    follow_inputs(of, to);
    if (of->known != 0.0) return;
    fill_arguments(of, of->shown, of->time, arguments);
    memcpy(arguments + ARGUMENTS, of->inputs, MOTION_INPUTS * sizeof(double));
    const int64_t count = ARGUMENTS + MOTION_INPUTS;
    const Source source = {arguments, count, count, 1, 1, 0};
    for (int k = 0; k < MOTION_MEASURED; k++) {
        double found[MOTION_MOST_MEASURED + 1];
        const int64_t place = motion_measured_places[k];
        const Measurement *by = motion_measurements + place / MOTION_MOST_MEASURED;
        evaluate(&by->program, (V *)cleared(of), &source, 1, 0, 1, by->rows, by->count, found);
        of->measured[k] = found[place % MOTION_MOST_MEASURED];
    }
    evaluate(&motion_outputs, (V *)cleared(of), &source, 1, 0, 1, motion_output_rows, MOTION_RESULTS, of->outputs);
    if (MOTION_RESULTS > MOTION_OUTPUTS && of->warned == 0.0 && !(of->outputs[MOTION_RESULTS - 1] <= MOTION_POOR)) {
        of->warned = 1.0;
        remark(to,
               "Accelerations and reactions may be inaccurate from t = %g s on: an equation has a large relative residual, "
               "as in a singular pose, or where all its terms vanish. This is reported once.",
               of->time);
    }
    for (int k = 0; k < MOTION_OUTPUTS; k++) {
        const double turn = motion_output_turns[k];
        if (!(turn > 0) || !isfinite(of->outputs[k])) continue;
        const double before = of->counted != 0.0 ? of->turned[k] : motion_output_references[k];
        if (of->counted == 0.0 || !motion_output_counted[k])
            of->outputs[k] -= turn * rint((of->outputs[k] - before) / turn);
        else /* the integration makes the angle continuous; only the turns of the start count */
            of->outputs[k] -= turn * of->turned[k];
    }
    of->known = 1.0;
}

/* Store the angles of a communication point. */
static void keep_angles(Motion *of, Report *to) {
    find_outputs(of, to);
    for (int k = 0; k < MOTION_OUTPUTS; k++)
        if (motion_output_turns[k] > 0 && !motion_output_counted[k] && isfinite(of->outputs[k]))
            of->turned[k] = of->outputs[k];
    of->counted = 1.0;
}

/* Set the turns that are subtracted from angles that the integration counts. */
static void count_turns(Motion *of) {
    double arguments[ARGUMENTS + MOTION_INPUTS + 1], found[MOTION_RESULTS];
    fill_arguments(of, of->shown, of->time, arguments);
    memcpy(arguments + ARGUMENTS, of->inputs, MOTION_INPUTS * sizeof(double));
    const int64_t count = ARGUMENTS + MOTION_INPUTS;
    const Source source = {arguments, count, count, 1, 1, 0};
    evaluate(&motion_outputs, (V *)cleared(of), &source, 1, 0, 1, motion_output_rows, MOTION_RESULTS, found);
    for (int k = 0; k < MOTION_OUTPUTS; k++)
        if (motion_output_turns[k] > 0 && motion_output_counted[k])
            of->turned[k] = rint((found[k] - motion_output_references[k]) / motion_output_turns[k]);
}

void model_prepare(void *model, double time, double tolerance) {
    Motion *of = model;
    of->time = time;
    of->tolerance = tolerance > 0 ? tolerance : default_tolerance;
}

void model_initialise(void *model, Report *to) {
    Motion *of = model;
    double largest = 0.0;
    of->begun = 0.0;
    find_parameters(of);
    check_parameters(of, to);
    if (to->status >= ERROR) return;
    assemble(of, to);
    if (to->status >= ERROR) return;
    for (int k = 0; k < MOTION_COORDINATES; k++) largest = fmax(largest, fabs(of->state[k]));
    of->floor = of->tolerance * fmin(1.0, fmax(1e-3, largest));
    of->wanted = 0.0;
    of->length = fmin(1.0, fmax(1e-3, largest));
    start_contacts(of, to);
    if (to->status >= ERROR) return;
    memcpy(of->shown, of->state, sizeof of->shown);
    start_laws(of, to);
    if (to->status >= ERROR) return;
    of->known = of->counted = 0.0;
    of->begun = 1.0;
    of->dirty = of->moved = 0.0;
    count_turns(of);
    keep_angles(of, to);
    for (int k = 0; k < MOTION_OUTPUTS; k++)
        if (!isfinite(of->outputs[k])) {
            report(to, WARNING, "An output is not finite at the start: undefined, or undetermined in a singular pose.");
            break;
        }
}

void model_advance(void *model, double end, Report *to) {
    Motion *of = model;
    follow_inputs(of, to);
    while (end > of->time && to->status < ERROR) {
        const double next = next_sample(of), near = 1e-12 * fmax(1.0, fabs(end));
        const double target = next < end - near && next > of->time ? next : end;
        if (target - of->time >= SHORTEST * fmax(fabs(of->time), fabs(target)))
            integrate(of, target, to);
        else if (target < end)
            of->time = target;
        else
            break; /* times that programs add up differ by rounding; the next step covers this one */
        if (to->status < ERROR) keep_angles(of, to);
        if (MOTION_LAWS && to->status < ERROR) sample_laws(of, to);
    }
}

void model_set(void *model, unsigned variable, double value, Report *to) {
    Motion *of = model;
    if (contents[variable].what == COMMAND_VALUE) {
        of->commands[contents[variable].index] = value;
        if (of->begun != 0.0) {
            set_commands(of, of->state);
            set_commands(of, of->shown);
            of->known = 0.0;
            of->arming = 1;
        } else {
            of->dirty = 1.0;
        }
        return;
    }
    of->inputs[contents[variable].index] = value;
    of->dirty = 1.0;
    if (model_variables[variable].causality == INPUT && of->begun != 0.0) {
        find_parameters(of);
        check_parameters(of, to);
        of->known = 0.0;
        of->arming = 1;
        for (int k = 0; k < MOTION_MOVING; k++)
            if (motion_moving_places[k] == contents[variable].index) of->moved = 1.0;
    }
}

double model_get(void *model, unsigned variable, int begun, Report *to) {
    Motion *of = model;
    const Content *content = contents + variable;
    if (content->what == INPUT_VALUE) return of->inputs[content->index];
    if (content->what == COMMAND_VALUE) return of->commands[content->index];
    if (!begun && of->dirty != 0.0) { /* in initialisation mode, outputs belong to the parameters so far */
        model_initialise(of, to);
        if (to->status >= ERROR) return NAN;
    }
    if (of->begun == 0.0) {
        report(to, ERROR, "There are no outputs, because the mechanism was not assembled.");
        return NAN;
    }
    find_outputs(of, to);
    return content->index < MOTION_OUTPUTS ? of->outputs[content->index] : of->measured[content->index - MOTION_OUTPUTS];
}

void model_differentiate(void *model, const unsigned *unknown, size_t unknowns, const unsigned *known, size_t knowns,
                         const double *seed, double *change, Report *to) {
    (void)model, (void)unknown, (void)unknowns, (void)known, (void)knowns, (void)seed, (void)change;
    report(to, ERROR, "This FMU provides no directional derivatives.");
}
