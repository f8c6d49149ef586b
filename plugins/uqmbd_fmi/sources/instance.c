/* Life of an instance: phases, checks of arguments, saved states, and messages; the same for FMI 2.0 and 3.0. */
#include "model.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define INSTANCE_MARK 0x75716d62642d6931ULL
#define STATE_MARK 0x75716d62642d7331ULL

enum { ALIGNMENT = 64 };

static const char *const PHASES[] = {"free", "instantiated", "in initialisation mode", "in step mode", "terminated",
                                     "failed"};

void report(Report *to, int status, const char *format, ...) {
    va_list arguments;
    if (status <= to->status) return;
    to->status = status;
    va_start(arguments, format);
    vsnprintf(to->text, sizeof to->text, format, arguments);
    va_end(arguments);
}

void remark(Report *to, const char *format, ...) {
    va_list arguments;
    if (to->status != OK || to->remarked) return;
    to->remarked = 1;
    va_start(arguments, format);
    vsnprintf(to->text, sizeof to->text, format, arguments);
    va_end(arguments);
}

int instance_exists(const Instance *instance) { return instance && instance->mark == INSTANCE_MARK; }

static void say(const Instance *instance, int status, const char *text) {
    if (instance->say) instance->say(instance, status, text);
}

int instance_refuse(Instance *instance, const char *format, ...) {
    char text[1000];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    say(instance, ERROR, text);
    return ERROR;
}

/* Pass a report to the logger; an error ends the simulation if `ends`. */
static int finish(Instance *instance, const Report *from, int ends) {
    if (from->status != OK || from->remarked) say(instance, from->status != OK ? from->status : WARNING, from->text);
    if (from->status >= ERROR && ends) instance->phase = FAILED;
    return from->status;
}

static uint64_t token_number(void) {
    uint64_t found = 1469598103934665603ULL;
    for (const char *at = model_token; *at; at++) found = (found ^ (unsigned char)*at) * 1099511628211ULL;
    return found;
}

Instance *instance_create(const char *name, const char *token, Say speak, void *environment, Logger logger) {
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance) return NULL;
    instance->mark = INSTANCE_MARK;
    instance->say = speak;
    instance->environment = environment;
    instance->logger = logger;
    if (!name) name = "";
    const size_t length = strlen(name) + 1;
    instance->name = malloc(length);
    instance->allocated = calloc(1, model_bytes() + ALIGNMENT);
    if (!instance->name || !instance->allocated) {
        instance_free(instance);
        return NULL;
    }
    memcpy(instance->name, name, length);
    const uintptr_t first = ((uintptr_t)instance->allocated + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    instance->model = (void *)first;
    if (!token || strcmp(token, model_token) != 0) {
        instance_refuse(instance, "The GUID or instantiation token is %s; expected %s, as in modelDescription.xml.",
                        token ? token : "missing", model_token);
        instance_free(instance);
        return NULL;
    }
    instance->phase = CREATED;
    model_start(instance->model);
    return instance;
}

void instance_free(Instance *instance) {
    if (!instance_exists(instance)) return;
    instance->mark = 0;
    free(instance->allocated);
    free(instance->name);
    free(instance);
}

int instance_reset(Instance *instance) {
    memset(instance->model, 0, model_bytes());
    model_start(instance->model);
    instance->phase = CREATED;
    instance->time = instance->start = instance->stop = instance->tolerance = 0.0;
    return OK;
}

static int expect(Instance *instance, const char *call, int wanted) {
    if (instance->phase == wanted) return OK;
    return instance_refuse(instance, "%s was called, but the instance is %s; it must be %s.", call,
                           PHASES[instance->phase], PHASES[wanted]);
}

int instance_setup(Instance *instance, int tolerance_defined, double tolerance, double start, int stop_defined,
                   double stop) {
    if (expect(instance, "The setup of an experiment", CREATED)) return ERROR;
    if (!isfinite(start)) return instance_refuse(instance, "The start time is not a finite number.");
    if (stop_defined && !(stop > start))
        return instance_refuse(instance, "The stop time is %g s; expected a time after the start time %g s.", stop,
                               start);
    if (tolerance_defined && !(tolerance > 0 && tolerance < 1))
        return instance_refuse(instance, "The tolerance is %g; expected a number between 0 and 1.", tolerance);
    instance->start = instance->time = start;
    instance->stop = stop_defined ? stop : INFINITY;
    instance->tolerance = tolerance_defined ? tolerance : 0.0;
    return OK;
}

int instance_initialise(Instance *instance) {
    if (expect(instance, "EnterInitializationMode", CREATED)) return ERROR;
    instance->phase = INITIALISING;
    model_prepare(instance->model, instance->time, instance->tolerance);
    return OK;
}

int instance_initialised(Instance *instance) {
    Report found = {0};
    if (expect(instance, "ExitInitializationMode", INITIALISING)) return ERROR;
    model_initialise(instance->model, &found);
    if (found.status < ERROR) instance->phase = STEPPING;
    return finish(instance, &found, 1);
}

int instance_terminate(Instance *instance) {
    if (instance->phase != STEPPING && instance->phase != FAILED)
        return instance_refuse(instance, "Terminate was called, but the instance is %s; it must be in step mode.",
                               PHASES[instance->phase]);
    instance->phase = TERMINATED;
    return OK;
}

int instance_step(Instance *instance, double time, double step) {
    Report found = {0};
    if (expect(instance, "DoStep", STEPPING)) return ERROR;
    const double end = time + step, large = fmax(fabs(instance->time), fabs(end));
    if (!isfinite(time) || !isfinite(step) || step < 0)
        return instance_refuse(instance, "A step from %g s by %g s was requested; expected finite numbers, and a step of 0 or more.",
                               time, step);
    if (fabs(time - instance->time) > 1e-9 * fmax(large, 1e-6))
        return instance_refuse(instance, "A step from %.15g s was requested, but the time of the instance is %.15g s.", time,
                               instance->time);
    model_advance(instance->model, end, &found);
    if (found.status < DISCARD) instance->time = end;
    return finish(instance, &found, 1);
}

/* Return the variable with a value reference if it has a type, or report an error and return NULL. */
static const Variable *variable(Instance *instance, int type, unsigned reference) {
    if (reference >= model_variable_count) {
        instance_refuse(instance, "There is no variable with the value reference %u.", reference);
        return NULL;
    }
    if (model_variables[reference].type != type) {
        instance_refuse(instance, "The variable %s has another type.", model_variables[reference].name);
        return NULL;
    }
    return model_variables + reference;
}

int instance_get(Instance *instance, int type, const unsigned *references, size_t count, double *values) {
    Report found = {0};
    if (count && (!references || !values)) return instance_refuse(instance, "Values were requested with a null pointer.");
    for (size_t k = 0; k < count; k++) {
        const Variable *one = variable(instance, type, references[k]);
        if (!one) return ERROR;
        const int begun = instance->phase == STEPPING || instance->phase == TERMINATED || instance->phase == FAILED;
        if (instance->phase == CREATED && one->causality == OUTPUT)
            return instance_refuse(instance, "The output %s was requested, but the instance is instantiated; enter initialisation mode first.",
                                   one->name);
        if (one->causality == TIME)
            values[k] = instance->time;
        else
            values[k] = model_get(instance->model, references[k], begun, &found);
        if (found.status >= ERROR) break;
    }
    return finish(instance, &found, 0);
}

int instance_set(Instance *instance, int type, const unsigned *references, size_t count, const double *values) {
    Report found = {0};
    if (count && (!references || !values)) return instance_refuse(instance, "Values were set with a null pointer.");
    if (count && (instance->phase == TERMINATED || instance->phase == FAILED))
        return instance_refuse(instance, "A variable was set, but the instance is %s.", PHASES[instance->phase]);
    for (size_t k = 0; k < count; k++) {
        const Variable *one = variable(instance, type, references[k]);
        if (!one) return ERROR;
        if (one->causality != PARAMETER && one->causality != INPUT)
            return instance_refuse(instance, "The variable %s cannot be set; only parameters and inputs can.", one->name);
        if (!isfinite(values[k]))
            return instance_refuse(instance, "The variable %s was set to a number that is not finite.", one->name);
        if (instance->phase == STEPPING && one->causality == PARAMETER && !one->tunable)
            return instance_refuse(instance, "The parameter %s is fixed; it cannot be set in step mode.", one->name);
    }
    for (size_t k = 0; k < count && found.status < ERROR; k++)
        model_set(instance->model, references[k], values[k], &found);
    return finish(instance, &found, 0);
}

int instance_differentiate(Instance *instance, const unsigned *unknown, size_t unknowns, const unsigned *known,
                           size_t knowns, const double *seed, double *change) {
    Report found = {0};
    if ((unknowns && (!unknown || !change)) || (knowns && (!known || !seed)))
        return instance_refuse(instance, "A directional derivative was requested with a null pointer.");
    if (instance->phase != STEPPING && instance->phase != INITIALISING)
        return instance_refuse(instance, "A directional derivative was requested, but the instance is %s.",
                               PHASES[instance->phase]);
    for (size_t k = 0; k < unknowns; k++) {
        const Variable *one = variable(instance, REAL, unknown[k]);
        if (!one) return ERROR;
        if (one->causality != OUTPUT)
            return instance_refuse(instance, "A derivative of %s was requested, which is no output.", one->name);
    }
    for (size_t k = 0; k < knowns; k++) {
        const Variable *one = variable(instance, REAL, known[k]);
        if (!one) return ERROR;
        if (one->causality != PARAMETER && one->causality != INPUT)
            return instance_refuse(instance, "A derivative with respect to %s was requested; expected a parameter or an input.",
                                   one->name);
        if (!isfinite(seed[k])) return instance_refuse(instance, "A seed is not a finite number.");
    }
    model_differentiate(instance->model, unknown, unknowns, known, knowns, seed, change, &found);
    return finish(instance, &found, 0);
}

int instance_state_size(Instance *instance, const void *state, size_t *size) {
    (void)state;
    if (!size) return instance_refuse(instance, "The size of a state was requested with a null pointer.");
    *size = sizeof(Saved) + model_bytes();
    return OK;
}

static int right(Instance *instance, const Saved *state) {
    if (state->mark != STATE_MARK || state->token != token_number() || state->bytes != model_bytes() ||
        state->phase < CREATED || state->phase > FAILED)
        return instance_refuse(instance, "The saved state belongs to another model, or is damaged.") == OK;
    return 1;
}

int instance_save(Instance *instance, void **state) {
    if (!state) return instance_refuse(instance, "A state was requested with a null pointer.");
    if (*state && !right(instance, *state)) return ERROR;
    if (!*state) *state = malloc(sizeof(Saved) + model_bytes());
    if (!*state) return instance_refuse(instance, "There is no memory for a saved state.");
    const Saved head = {STATE_MARK, token_number(), model_bytes(), instance->phase, instance->time, instance->start,
                        instance->stop, instance->tolerance};
    memcpy(*state, &head, sizeof head);
    memcpy((unsigned char *)*state + sizeof head, instance->model, model_bytes());
    return OK;
}

int instance_restore(Instance *instance, const void *state) {
    Saved head;
    if (!state) return instance_refuse(instance, "A saved state is missing: the pointer is null.");
    memcpy(&head, state, sizeof head);
    if (!right(instance, &head)) return ERROR;
    instance->phase = (int)head.phase;
    instance->time = head.time;
    instance->start = head.start;
    instance->stop = head.stop;
    instance->tolerance = head.tolerance;
    memcpy(instance->model, (const unsigned char *)state + sizeof head, model_bytes());
    return OK;
}

int instance_drop(Instance *instance, void **state) {
    (void)instance;
    if (!state) return OK;
    free(*state);
    *state = NULL;
    return OK;
}

int instance_serialise(Instance *instance, const void *state, unsigned char *bytes, size_t size) {
    if (!state || !bytes) return instance_refuse(instance, "A state was serialised with a null pointer.");
    if (size < sizeof(Saved) + model_bytes())
        return instance_refuse(instance, "A state was serialised to %zu bytes; expected %zu bytes.", size,
                               sizeof(Saved) + model_bytes());
    memcpy(bytes, state, sizeof(Saved) + model_bytes());
    return OK;
}

int instance_deserialise(Instance *instance, const unsigned char *bytes, size_t size, void **state) {
    Saved head;
    if (!bytes || !state) return instance_refuse(instance, "A state was restored from a null pointer.");
    if (size != sizeof(Saved) + model_bytes())
        return instance_refuse(instance, "A serialised state has %zu bytes; expected %zu bytes.", size,
                               sizeof(Saved) + model_bytes());
    memcpy(&head, bytes, sizeof head);
    if (!right(instance, &head)) return ERROR;
    *state = malloc(size);
    if (!*state) return instance_refuse(instance, "There is no memory for a saved state.");
    memcpy(*state, bytes, size);
    return OK;
}
