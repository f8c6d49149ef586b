/* Functions of FMI 2.0.4 for co-simulation (https://fmi-standard.org): each checks its instance and calls instance.c. */
#include "model.h"

typedef void *Component;
typedef unsigned int Reference;

typedef void (*Log)(void *environment, const char *name, int status, const char *category, const char *message, ...);

typedef struct {
    Log logger;
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*finished)(void *environment, int status);
    void *environment;
} Callbacks;

enum { CO_SIMULATION = 1 };

#define CHECKED(component)                                        \
    Instance *instance = (Instance *)(component);                 \
    if (!instance_exists(instance)) return ERROR

static void say(const Instance *instance, int status, const char *text) {
    static const char *const CATEGORIES[] = {"logAll", "logStatusWarning", "logStatusDiscard", "logStatusError",
                                             "logStatusFatal"};
    char plain[1000];
    size_t k = 0;
    /* percent and number signs have a meaning in messages of FMI 2.0 */
    for (; text[k] && k + 1 < sizeof plain; k++) plain[k] = (char)(text[k] == '%' || text[k] == '#' ? '_' : text[k]);
    plain[k] = 0;
    if (instance->logger)
        ((Log)instance->logger)(instance->environment, instance->name ? instance->name : "", status,
                                CATEGORIES[status], plain);
}

EXPORT const char *fmi2GetTypesPlatform(void);
EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }

EXPORT const char *fmi2GetVersion(void);
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT int fmi2SetDebugLogging(Component c, int on, size_t count, const char *const categories[]);
EXPORT int fmi2SetDebugLogging(Component c, int on, size_t count, const char *const categories[]) {
    CHECKED(c);
    (void)on, (void)count, (void)categories;
    return OK;
}

EXPORT Component fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                                 const Callbacks *callbacks, int visible, int logging);
EXPORT Component fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                                 const Callbacks *callbacks, int visible, int logging) {
    (void)resources, (void)visible, (void)logging;
    if (type != CO_SIMULATION) {
        if (callbacks && callbacks->logger)
            callbacks->logger(callbacks->environment, name ? name : "", ERROR, "logStatusError",
                              "This FMU is for co-simulation only.");
        return NULL;
    }
    return instance_create(name, token, say, callbacks ? callbacks->environment : NULL,
                           callbacks ? (Logger)callbacks->logger : NULL);
}

EXPORT void fmi2FreeInstance(Component c);
EXPORT void fmi2FreeInstance(Component c) { instance_free(c); }

EXPORT int fmi2SetupExperiment(Component c, int tolerance_defined, double tolerance, double start, int stop_defined,
                               double stop);
EXPORT int fmi2SetupExperiment(Component c, int tolerance_defined, double tolerance, double start, int stop_defined,
                               double stop) {
    CHECKED(c);
    return instance_setup(instance, tolerance_defined, tolerance, start, stop_defined, stop);
}

EXPORT int fmi2EnterInitializationMode(Component c);
EXPORT int fmi2EnterInitializationMode(Component c) {
    CHECKED(c);
    return instance_initialise(instance);
}

EXPORT int fmi2ExitInitializationMode(Component c);
EXPORT int fmi2ExitInitializationMode(Component c) {
    CHECKED(c);
    return instance_initialised(instance);
}

EXPORT int fmi2Terminate(Component c);
EXPORT int fmi2Terminate(Component c) {
    CHECKED(c);
    return instance_terminate(instance);
}

EXPORT int fmi2Reset(Component c);
EXPORT int fmi2Reset(Component c) {
    CHECKED(c);
    return instance_reset(instance);
}

EXPORT int fmi2GetReal(Component c, const Reference *references, size_t count, double *values);
EXPORT int fmi2GetReal(Component c, const Reference *references, size_t count, double *values) {
    CHECKED(c);
    return instance_get(instance, REAL, references, count, values);
}

EXPORT int fmi2GetBoolean(Component c, const Reference *references, size_t count, int *values);
EXPORT int fmi2GetBoolean(Component c, const Reference *references, size_t count, int *values) {
    CHECKED(c);
    if (count && !values) return instance_refuse(instance, "Values were requested with a null pointer.");
    for (size_t k = 0; k < count; k++) {
        double value = 0.0;
        const int status = instance_get(instance, BOOLEAN, references ? references + k : NULL, 1, &value);
        if (status >= ERROR) return status;
        values[k] = value > 0.5;
    }
    return OK;
}

/* Functions for types that no variable has. */
static int none(Component c, size_t count, const char *type) {
    CHECKED(c);
    return count ? instance_refuse(instance, "There is no variable of the type %s.", type) : OK;
}

EXPORT int fmi2GetInteger(Component c, const Reference *references, size_t count, int *values);
EXPORT int fmi2GetInteger(Component c, const Reference *references, size_t count, int *values) {
    (void)references, (void)values;
    return none(c, count, "Integer");
}

EXPORT int fmi2GetString(Component c, const Reference *references, size_t count, const char **values);
EXPORT int fmi2GetString(Component c, const Reference *references, size_t count, const char **values) {
    (void)references, (void)values;
    return none(c, count, "String");
}

EXPORT int fmi2SetReal(Component c, const Reference *references, size_t count, const double *values);
EXPORT int fmi2SetReal(Component c, const Reference *references, size_t count, const double *values) {
    CHECKED(c);
    return instance_set(instance, REAL, references, count, values);
}

EXPORT int fmi2SetInteger(Component c, const Reference *references, size_t count, const int *values);
EXPORT int fmi2SetInteger(Component c, const Reference *references, size_t count, const int *values) {
    (void)references, (void)values;
    return none(c, count, "Integer");
}

EXPORT int fmi2SetBoolean(Component c, const Reference *references, size_t count, const int *values);
EXPORT int fmi2SetBoolean(Component c, const Reference *references, size_t count, const int *values) {
    CHECKED(c);
    const double first = count && values ? values[0] : 0.0;
    return count ? instance_set(instance, BOOLEAN, references, 1, values ? &first : NULL) : OK;
}

EXPORT int fmi2SetString(Component c, const Reference *references, size_t count, const char *const *values);
EXPORT int fmi2SetString(Component c, const Reference *references, size_t count, const char *const *values) {
    (void)references, (void)values;
    return none(c, count, "String");
}

EXPORT int fmi2GetFMUstate(Component c, void **state);
EXPORT int fmi2GetFMUstate(Component c, void **state) {
    CHECKED(c);
    return instance_save(instance, state);
}

EXPORT int fmi2SetFMUstate(Component c, void *state);
EXPORT int fmi2SetFMUstate(Component c, void *state) {
    CHECKED(c);
    return instance_restore(instance, state);
}

EXPORT int fmi2FreeFMUstate(Component c, void **state);
EXPORT int fmi2FreeFMUstate(Component c, void **state) {
    CHECKED(c);
    return instance_drop(instance, state);
}

EXPORT int fmi2SerializedFMUstateSize(Component c, void *state, size_t *size);
EXPORT int fmi2SerializedFMUstateSize(Component c, void *state, size_t *size) {
    CHECKED(c);
    return instance_state_size(instance, state, size);
}

EXPORT int fmi2SerializeFMUstate(Component c, void *state, char *bytes, size_t size);
EXPORT int fmi2SerializeFMUstate(Component c, void *state, char *bytes, size_t size) {
    CHECKED(c);
    return instance_serialise(instance, state, (unsigned char *)bytes, size);
}

EXPORT int fmi2DeSerializeFMUstate(Component c, const char *bytes, size_t size, void **state);
EXPORT int fmi2DeSerializeFMUstate(Component c, const char *bytes, size_t size, void **state) {
    CHECKED(c);
    return instance_deserialise(instance, (const unsigned char *)bytes, size, state);
}

EXPORT int fmi2GetDirectionalDerivative(Component c, const Reference *unknown, size_t unknowns, const Reference *known,
                                        size_t knowns, const double *seed, double *change);
EXPORT int fmi2GetDirectionalDerivative(Component c, const Reference *unknown, size_t unknowns, const Reference *known,
                                        size_t knowns, const double *seed, double *change) {
    CHECKED(c);
    return instance_differentiate(instance, unknown, unknowns, known, knowns, seed, change);
}

EXPORT int fmi2SetRealInputDerivatives(Component c, const Reference *references, size_t count, const int *orders,
                                       const double *values);
EXPORT int fmi2SetRealInputDerivatives(Component c, const Reference *references, size_t count, const int *orders,
                                       const double *values) {
    CHECKED(c);
    (void)references, (void)orders, (void)values;
    return count ? instance_refuse(instance, "Derivatives of inputs are not interpolated.") : OK;
}

EXPORT int fmi2GetRealOutputDerivatives(Component c, const Reference *references, size_t count, const int *orders,
                                        double *values);
EXPORT int fmi2GetRealOutputDerivatives(Component c, const Reference *references, size_t count, const int *orders,
                                        double *values) {
    CHECKED(c);
    (void)references, (void)orders, (void)values;
    return count ? instance_refuse(instance, "Derivatives of outputs over time are not provided.") : OK;
}

EXPORT int fmi2DoStep(Component c, double time, double step, int keeps);
EXPORT int fmi2DoStep(Component c, double time, double step, int keeps) {
    CHECKED(c);
    (void)keeps;
    return instance_step(instance, time, step);
}

EXPORT int fmi2CancelStep(Component c);
EXPORT int fmi2CancelStep(Component c) {
    CHECKED(c);
    return instance_refuse(instance, "CancelStep was called, but no step is pending.");
}

enum { DO_STEP_STATUS, PENDING_STATUS, LAST_SUCCESSFUL_TIME, IS_TERMINATED };

EXPORT int fmi2GetStatus(Component c, int kind, int *value);
EXPORT int fmi2GetStatus(Component c, int kind, int *value) {
    CHECKED(c);
    if (kind != DO_STEP_STATUS || !value) return instance_refuse(instance, "GetStatus knows the status of DoStep only.");
    *value = instance->phase == FAILED ? ERROR : OK;
    return OK;
}

EXPORT int fmi2GetRealStatus(Component c, int kind, double *value);
EXPORT int fmi2GetRealStatus(Component c, int kind, double *value) {
    CHECKED(c);
    if (kind != LAST_SUCCESSFUL_TIME || !value)
        return instance_refuse(instance, "GetRealStatus knows the last successful time only.");
    *value = instance->time;
    return OK;
}

EXPORT int fmi2GetIntegerStatus(Component c, int kind, int *value);
EXPORT int fmi2GetIntegerStatus(Component c, int kind, int *value) {
    CHECKED(c);
    (void)kind, (void)value;
    return instance_refuse(instance, "There is no status of the type Integer.");
}

EXPORT int fmi2GetBooleanStatus(Component c, int kind, int *value);
EXPORT int fmi2GetBooleanStatus(Component c, int kind, int *value) {
    CHECKED(c);
    if (kind != IS_TERMINATED || !value)
        return instance_refuse(instance, "GetBooleanStatus knows whether the model terminated the simulation only.");
    *value = 0;
    return OK;
}

EXPORT int fmi2GetStringStatus(Component c, int kind, const char **value);
EXPORT int fmi2GetStringStatus(Component c, int kind, const char **value) {
    CHECKED(c);
    if (kind != PENDING_STATUS || !value) return instance_refuse(instance, "GetStringStatus knows the pending status only.");
    *value = "";
    return OK;
}
