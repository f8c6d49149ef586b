/* Functions of FMI 3.0.2 for co-simulation (https://fmi-standard.org): each checks its instance and calls instance.c. */
#include "model.h"

#include <stdbool.h>

typedef uint32_t Reference;
typedef void (*Log)(void *environment, int status, const char *category, const char *message);

#define CHECKED(pointer)                                          \
    Instance *instance = (Instance *)(pointer);                   \
    if (!instance_exists(instance)) return ERROR

/* Declare and define an exported function. */
#define FUNCTION(name, arguments) \
    EXPORT int name arguments;    \
    EXPORT int name arguments

static void say(const Instance *instance, int status, const char *text) {
    static const char *const CATEGORIES[] = {"logAll", "logStatusWarning", "logStatusDiscard", "logStatusError",
                                             "logStatusFatal"};
    if (instance->logger) ((Log)instance->logger)(instance->environment, status, CATEGORIES[status], text);
}

EXPORT const char *fmi3GetVersion(void);
EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

FUNCTION(fmi3SetDebugLogging, (void *c, bool on, size_t count, const char *const categories[])) {
    CHECKED(c);
    (void)on, (void)count, (void)categories;
    return OK;
}

EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                          bool logging, void *environment, Log logger);
EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                          bool logging, void *environment, Log logger) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    if (logger) logger(environment, ERROR, "logStatusError", "This FMU is for co-simulation only.");
    return NULL;
}

EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible,
                                               bool logging, void *environment, Log logger, void *update,
                                               void *lock, void *unlock);
EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible,
                                               bool logging, void *environment, Log logger, void *update,
                                               void *lock, void *unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)update, (void)lock, (void)unlock;
    if (logger) logger(environment, ERROR, "logStatusError", "This FMU is for co-simulation only.");
    return NULL;
}

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool events, bool early, const Reference *required,
                                         size_t count, void *environment, Log logger, void *update);
EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool events, bool early, const Reference *required,
                                         size_t count, void *environment, Log logger, void *update) {
    (void)resources, (void)visible, (void)logging, (void)early, (void)required, (void)count, (void)update;
    if (events) {
        if (logger) logger(environment, ERROR, "logStatusError", "This FMU has no event mode.");
        return NULL;
    }
    return instance_create(name, token, say, environment, (Logger)logger);
}

EXPORT void fmi3FreeInstance(void *c);
EXPORT void fmi3FreeInstance(void *c) { instance_free(c); }

FUNCTION(fmi3EnterInitializationMode,
         (void *c, bool tolerance_defined, double tolerance, double start, bool stop_defined, double stop)) {
    CHECKED(c);
    if (instance_setup(instance, tolerance_defined, tolerance, start, stop_defined, stop)) return ERROR;
    return instance_initialise(instance);
}

FUNCTION(fmi3ExitInitializationMode, (void *c)) {
    CHECKED(c);
    return instance_initialised(instance);
}

FUNCTION(fmi3Terminate, (void *c)) {
    CHECKED(c);
    return instance_terminate(instance);
}

FUNCTION(fmi3Reset, (void *c)) {
    CHECKED(c);
    return instance_reset(instance);
}

FUNCTION(fmi3GetFloat64, (void *c, const Reference *references, size_t count, double *values, size_t size)) {
    CHECKED(c);
    if (count != size) return instance_refuse(instance, "%zu values of %zu variables were requested.", size, count);
    return instance_get(instance, REAL, references, count, values);
}

FUNCTION(fmi3SetFloat64, (void *c, const Reference *references, size_t count, const double *values, size_t size)) {
    CHECKED(c);
    if (count != size) return instance_refuse(instance, "%zu values of %zu variables were set.", size, count);
    return instance_set(instance, REAL, references, count, values);
}

FUNCTION(fmi3GetBoolean, (void *c, const Reference *references, size_t count, bool *values, size_t size)) {
    CHECKED(c);
    if (count != size) return instance_refuse(instance, "%zu values of %zu variables were requested.", size, count);
    if (count && !values) return instance_refuse(instance, "Values were requested with a null pointer.");
    for (size_t k = 0; k < count; k++) {
        double value = 0.0;
        const int status = instance_get(instance, BOOLEAN, references ? references + k : NULL, 1, &value);
        if (status >= ERROR) return status;
        values[k] = value > 0.5;
    }
    return OK;
}

FUNCTION(fmi3SetBoolean, (void *c, const Reference *references, size_t count, const bool *values, size_t size)) {
    CHECKED(c);
    if (count != size) return instance_refuse(instance, "%zu values of %zu variables were set.", size, count);
    const double first = count && values ? values[0] : 0.0;
    return count ? instance_set(instance, BOOLEAN, references, 1, values ? &first : NULL) : OK;
}

/* Functions for types that no variable has. */
static int none(void *c, size_t count, const char *type) {
    CHECKED(c);
    return count ? instance_refuse(instance, "There is no variable of the type %s.", type) : OK;
}

#define NO_VARIABLES(name, type)                                                                              \
    FUNCTION(fmi3Get##name, (void *c, const Reference *references, size_t count, type *values, size_t size)) { \
        (void)references, (void)values, (void)size;                                                           \
        return none(c, count, #name);                                                                         \
    }                                                                                                         \
    FUNCTION(fmi3Set##name,                                                                                   \
             (void *c, const Reference *references, size_t count, const type *values, size_t size)) {         \
        (void)references, (void)values, (void)size;                                                           \
        return none(c, count, #name);                                                                         \
    }

NO_VARIABLES(Float32, float)
NO_VARIABLES(Int8, int8_t)
NO_VARIABLES(UInt8, uint8_t)
NO_VARIABLES(Int16, int16_t)
NO_VARIABLES(UInt16, uint16_t)
NO_VARIABLES(Int32, int32_t)
NO_VARIABLES(UInt32, uint32_t)
NO_VARIABLES(Int64, int64_t)
NO_VARIABLES(UInt64, uint64_t)

typedef const char *String;
typedef const unsigned char *Binary;
NO_VARIABLES(String, String)

FUNCTION(fmi3GetBinary, (void *c, const Reference *references, size_t count, size_t *sizes, Binary *values, size_t size)) {
    (void)references, (void)sizes, (void)values, (void)size;
    return none(c, count, "Binary");
}

FUNCTION(fmi3SetBinary,
         (void *c, const Reference *references, size_t count, const size_t *sizes, const Binary *values, size_t size)) {
    (void)references, (void)sizes, (void)values, (void)size;
    return none(c, count, "Binary");
}

FUNCTION(fmi3GetClock, (void *c, const Reference *references, size_t count, bool *values)) {
    (void)references, (void)values;
    return none(c, count, "Clock");
}

FUNCTION(fmi3SetClock, (void *c, const Reference *references, size_t count, const bool *values)) {
    (void)references, (void)values;
    return none(c, count, "Clock");
}

FUNCTION(fmi3GetNumberOfVariableDependencies, (void *c, Reference reference, size_t *count)) {
    CHECKED(c);
    (void)reference, (void)count;
    return instance_refuse(instance, "Dependencies are stated in modelDescription.xml only.");
}

FUNCTION(fmi3GetVariableDependencies, (void *c, Reference reference, size_t *of, Reference *independents, size_t *by,
                                       int *kinds, size_t count)) {
    CHECKED(c);
    (void)reference, (void)of, (void)independents, (void)by, (void)kinds, (void)count;
    return instance_refuse(instance, "Dependencies are stated in modelDescription.xml only.");
}

FUNCTION(fmi3GetFMUState, (void *c, void **state)) {
    CHECKED(c);
    return instance_save(instance, state);
}

FUNCTION(fmi3SetFMUState, (void *c, void *state)) {
    CHECKED(c);
    return instance_restore(instance, state);
}

FUNCTION(fmi3FreeFMUState, (void *c, void **state)) {
    CHECKED(c);
    return instance_drop(instance, state);
}

FUNCTION(fmi3SerializedFMUStateSize, (void *c, void *state, size_t *size)) {
    CHECKED(c);
    return instance_state_size(instance, state, size);
}

FUNCTION(fmi3SerializeFMUState, (void *c, void *state, unsigned char *bytes, size_t size)) {
    CHECKED(c);
    return instance_serialise(instance, state, bytes, size);
}

FUNCTION(fmi3DeserializeFMUState, (void *c, const unsigned char *bytes, size_t size, void **state)) {
    CHECKED(c);
    return instance_deserialise(instance, bytes, size, state);
}

FUNCTION(fmi3GetDirectionalDerivative,
         (void *c, const Reference *unknown, size_t unknowns, const Reference *known, size_t knowns, const double *seed,
          size_t seeds, double *change, size_t changes)) {
    CHECKED(c);
    if (seeds != knowns || changes != unknowns)
        return instance_refuse(instance, "A directional derivative has %zu seeds of %zu knowns, and %zu values of %zu unknowns.",
                               seeds, knowns, changes, unknowns);
    return instance_differentiate(instance, unknown, unknowns, known, knowns, seed, change);
}

/* Functions of capabilities that modelDescription.xml does not declare. */
#define WITHOUT(name, arguments, unused)                                                  \
    FUNCTION(name, arguments) {                                                           \
        CHECKED(c);                                                                       \
        unused;                                                                           \
        return instance_refuse(instance, "%s is not supported by this FMU.", #name);     \
    }

WITHOUT(fmi3GetAdjointDerivative,
        (void *c, const Reference *a, size_t n, const Reference *b, size_t m, const double *s, size_t k, double *d, size_t l),
        ((void)a, (void)n, (void)b, (void)m, (void)s, (void)k, (void)d, (void)l))
WITHOUT(fmi3EnterConfigurationMode, (void *c), (void)0)
WITHOUT(fmi3ExitConfigurationMode, (void *c), (void)0)
WITHOUT(fmi3EnterEventMode, (void *c), (void)0)
WITHOUT(fmi3EnterStepMode, (void *c), (void)0)
WITHOUT(fmi3EnterContinuousTimeMode, (void *c), (void)0)
WITHOUT(fmi3EvaluateDiscreteStates, (void *c), (void)0)
WITHOUT(fmi3UpdateDiscreteStates, (void *c, bool *a, bool *b, bool *d, bool *e, bool *f, double *g),
        ((void)a, (void)b, (void)d, (void)e, (void)f, (void)g))
WITHOUT(fmi3GetIntervalDecimal, (void *c, const Reference *a, size_t n, double *b, int *d),
        ((void)a, (void)n, (void)b, (void)d))
WITHOUT(fmi3GetIntervalFraction, (void *c, const Reference *a, size_t n, uint64_t *b, uint64_t *d, int *e),
        ((void)a, (void)n, (void)b, (void)d, (void)e))
WITHOUT(fmi3GetShiftDecimal, (void *c, const Reference *a, size_t n, double *b), ((void)a, (void)n, (void)b))
WITHOUT(fmi3GetShiftFraction, (void *c, const Reference *a, size_t n, uint64_t *b, uint64_t *d),
        ((void)a, (void)n, (void)b, (void)d))
WITHOUT(fmi3SetIntervalDecimal, (void *c, const Reference *a, size_t n, const double *b),
        ((void)a, (void)n, (void)b))
WITHOUT(fmi3SetIntervalFraction, (void *c, const Reference *a, size_t n, const uint64_t *b, const uint64_t *d),
        ((void)a, (void)n, (void)b, (void)d))
WITHOUT(fmi3SetShiftDecimal, (void *c, const Reference *a, size_t n, const double *b), ((void)a, (void)n, (void)b))
WITHOUT(fmi3SetShiftFraction, (void *c, const Reference *a, size_t n, const uint64_t *b, const uint64_t *d),
        ((void)a, (void)n, (void)b, (void)d))
WITHOUT(fmi3CompletedIntegratorStep, (void *c, bool a, bool *b, bool *d), ((void)a, (void)b, (void)d))
WITHOUT(fmi3SetTime, (void *c, double a), (void)a)
WITHOUT(fmi3SetContinuousStates, (void *c, const double *a, size_t n), ((void)a, (void)n))
WITHOUT(fmi3GetContinuousStateDerivatives, (void *c, double *a, size_t n), ((void)a, (void)n))
WITHOUT(fmi3GetEventIndicators, (void *c, double *a, size_t n), ((void)a, (void)n))
WITHOUT(fmi3GetContinuousStates, (void *c, double *a, size_t n), ((void)a, (void)n))
WITHOUT(fmi3GetNominalsOfContinuousStates, (void *c, double *a, size_t n), ((void)a, (void)n))
WITHOUT(fmi3GetNumberOfEventIndicators, (void *c, size_t *n), (void)n)
WITHOUT(fmi3GetNumberOfContinuousStates, (void *c, size_t *n), (void)n)
WITHOUT(fmi3GetOutputDerivatives,
        (void *c, const Reference *a, size_t n, const int32_t *b, double *d, size_t m),
        ((void)a, (void)n, (void)b, (void)d, (void)m))
WITHOUT(fmi3ActivateModelPartition, (void *c, Reference a, double b), ((void)a, (void)b))

FUNCTION(fmi3DoStep, (void *c, double time, double step, bool keeps, bool *events, bool *ends, bool *early,
                      double *reached)) {
    CHECKED(c);
    (void)keeps;
    const int status = instance_step(instance, time, step);
    if (events) *events = false;
    if (ends) *ends = false;
    if (early) *early = false;
    if (reached) *reached = instance->time;
    return status;
}
