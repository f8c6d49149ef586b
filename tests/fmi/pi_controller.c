/* PI controller as a co-simulation FMU of FMI 2.0 and 3.0, for the tests of coupling and import.  A step samples the
   input at its start: u = kp (r - y) + i, then i += ki (r - y).  A step with |y| > limit fails with a message. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { Y, KP, KI, R, LIMIT, U, COUNT };
static const double STARTS[COUNT] = {0.0, 3.0, 0.1, 2.0, 1e9, 0.0};

typedef void (*Log2)(void *, const char *, int, const char *, const char *, ...);
typedef void (*Log3)(void *, int, const char *, const char *);

typedef struct {
    double values[COUNT], integral, time;
    void *environment;
    Log2 log2;
    Log3 log3;
} Pi;

static Pi *make(void *environment, Log2 log2, Log3 log3) {
    Pi *pi = calloc(1, sizeof *pi);
    if (!pi) return NULL;
    for (int k = 0; k < COUNT; k++) pi->values[k] = STARTS[k];
    pi->environment = environment, pi->log2 = log2, pi->log3 = log3;
    return pi;
}

static int fail(Pi *pi, const char *text) {
    if (pi->log2) pi->log2(pi->environment, "pi", 3, "logStatusError", "%s", text);
    if (pi->log3) pi->log3(pi->environment, 3, "logStatusError", text);
    return 3;
}

static int step(Pi *pi, double time, double size) {
    double *v = pi->values;
    if (fabs(time - pi->time) > 1e-9) return fail(pi, "The communication point is not the end of the last step.");
    if (fabs(v[Y]) > v[LIMIT]) return fail(pi, "The measured speed is above its limit.");
    v[U] = v[KP] * (v[R] - v[Y]) + pi->integral;
    pi->integral += v[KI] * (v[R] - v[Y]);
    pi->time = time + size;
    return 0;
}

static int put(Pi *pi, const unsigned *at, size_t count, const double *values) {
    for (size_t k = 0; k < count; k++) {
        if (at[k] >= U) return fail(pi, "The variable cannot be set.");
        pi->values[at[k]] = values[k];
    }
    return 0;
}

static int get(Pi *pi, const unsigned *at, size_t count, double *values) {
    for (size_t k = 0; k < count; k++) values[k] = pi->values[at[k]];
    return 0;
}

static int initialise(Pi *pi) { return pi->values[KP] < 0 ? fail(pi, "The gain kp is negative.") : 0; }

/* --- FMI 2.0 --- */
typedef struct {
    Log2 logger;
    void *allocate, *release, *finished, *environment;
} Callbacks;

EXPORT void *fmi2Instantiate(const char *n, int t, const char *g, const char *r, const Callbacks *c, int v, int l) {
    (void)n, (void)t, (void)g, (void)r, (void)v, (void)l;
    return make(c->environment, c->logger, NULL);
}
EXPORT void fmi2FreeInstance(void *c) { free(c); }
EXPORT int fmi2SetupExperiment(void *c, int d, double tolerance, double start, int e, double stop) {
    (void)d, (void)tolerance, (void)e, (void)stop;
    ((Pi *)c)->time = start;
    return 0;
}
EXPORT int fmi2EnterInitializationMode(void *c) { return initialise(c); }
EXPORT int fmi2ExitInitializationMode(void *c) { return (void)c, 0; }
EXPORT int fmi2Terminate(void *c) { return (void)c, 0; }
EXPORT int fmi2SetReal(void *c, const unsigned *at, size_t n, const double *x) { return put(c, at, n, x); }
EXPORT int fmi2GetReal(void *c, const unsigned *at, size_t n, double *x) { return get(c, at, n, x); }
EXPORT int fmi2DoStep(void *c, double time, double size, int keep) { return (void)keep, step(c, time, size); }
/* what importers expect to exist */
EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const *x) { return (void)c, (void)on, (void)n, (void)x, 0; }
EXPORT int fmi2Reset(void *c) {
    Pi *pi = c, fresh = *pi;
    for (int k = 0; k < COUNT; k++) fresh.values[k] = STARTS[k];
    fresh.integral = fresh.time = 0;
    *pi = fresh;
    return 0;
}

/* --- FMI 3.0 --- */
EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT void *fmi3InstantiateCoSimulation(const char *n, const char *g, const char *r, bool v, bool l, bool e, bool a,
                                         const unsigned *q, size_t m, void *environment, Log3 log, void *update) {
    (void)n, (void)g, (void)r, (void)v, (void)l, (void)e, (void)a, (void)q, (void)m, (void)update;
    return make(environment, NULL, log);
}
EXPORT void fmi3FreeInstance(void *c) { free(c); }
EXPORT int fmi3EnterInitializationMode(void *c, bool d, double tolerance, double start, bool e, double stop) {
    (void)d, (void)tolerance, (void)e, (void)stop;
    ((Pi *)c)->time = start;
    return initialise(c);
}
EXPORT int fmi3ExitInitializationMode(void *c) { return (void)c, 0; }
EXPORT int fmi3Terminate(void *c) { return (void)c, 0; }
EXPORT int fmi3SetFloat64(void *c, const unsigned *at, size_t n, const double *x, size_t m) { return (void)m, put(c, at, n, x); }
EXPORT int fmi3GetFloat64(void *c, const unsigned *at, size_t n, double *x, size_t m) { return (void)m, get(c, at, n, x); }
EXPORT int fmi3DoStep(void *c, double time, double size, bool keep, bool *event, bool *end, bool *early, double *last) {
    (void)keep;
    *event = *end = *early = false;
    *last = time + size;
    return step(c, time, size);
}

/* --- functions of the standard that these tests do not use; importers expect them --- */
#define NONE(name) \
    EXPORT int name(void) { return 3; }
NONE(fmi2CancelStep) NONE(fmi2DeSerializeFMUstate) NONE(fmi2FreeFMUstate) NONE(fmi2GetBoolean)
NONE(fmi2GetBooleanStatus) NONE(fmi2GetDirectionalDerivative) NONE(fmi2GetFMUstate) NONE(fmi2GetInteger)
NONE(fmi2GetIntegerStatus) NONE(fmi2GetRealOutputDerivatives) NONE(fmi2GetRealStatus) NONE(fmi2GetStatus)
NONE(fmi2GetString) NONE(fmi2GetStringStatus) NONE(fmi2SerializeFMUstate) NONE(fmi2SerializedFMUstateSize)
NONE(fmi2SetBoolean) NONE(fmi2SetFMUstate) NONE(fmi2SetInteger) NONE(fmi2SetRealInputDerivatives) NONE(fmi2SetString)
NONE(fmi3ActivateModelPartition) NONE(fmi3CompletedIntegratorStep) NONE(fmi3DeserializeFMUState)
NONE(fmi3EnterConfigurationMode) NONE(fmi3EnterContinuousTimeMode) NONE(fmi3EnterEventMode) NONE(fmi3EnterStepMode)
NONE(fmi3EvaluateDiscreteStates) NONE(fmi3ExitConfigurationMode) NONE(fmi3FreeFMUState) NONE(fmi3GetAdjointDerivative)
NONE(fmi3GetBinary) NONE(fmi3GetBoolean) NONE(fmi3GetClock) NONE(fmi3GetContinuousStateDerivatives)
NONE(fmi3GetContinuousStates) NONE(fmi3GetDirectionalDerivative) NONE(fmi3GetEventIndicators) NONE(fmi3GetFMUState)
NONE(fmi3GetFloat32) NONE(fmi3GetInt16) NONE(fmi3GetInt32) NONE(fmi3GetInt64) NONE(fmi3GetInt8)
NONE(fmi3GetIntervalDecimal) NONE(fmi3GetIntervalFraction) NONE(fmi3GetNominalsOfContinuousStates)
NONE(fmi3GetNumberOfContinuousStates) NONE(fmi3GetNumberOfEventIndicators) NONE(fmi3GetNumberOfVariableDependencies)
NONE(fmi3GetOutputDerivatives) NONE(fmi3GetShiftDecimal) NONE(fmi3GetShiftFraction) NONE(fmi3GetString)
NONE(fmi3GetUInt16) NONE(fmi3GetUInt32) NONE(fmi3GetUInt64) NONE(fmi3GetUInt8) NONE(fmi3GetVariableDependencies)
NONE(fmi3InstantiateModelExchange) NONE(fmi3InstantiateScheduledExecution) NONE(fmi3Reset) NONE(fmi3SerializeFMUState)
NONE(fmi3SerializedFMUStateSize) NONE(fmi3SetBinary) NONE(fmi3SetBoolean) NONE(fmi3SetClock)
NONE(fmi3SetContinuousStates) NONE(fmi3SetDebugLogging) NONE(fmi3SetFMUState) NONE(fmi3SetFloat32) NONE(fmi3SetInt16)
NONE(fmi3SetInt32) NONE(fmi3SetInt64) NONE(fmi3SetInt8) NONE(fmi3SetIntervalDecimal) NONE(fmi3SetIntervalFraction)
NONE(fmi3SetShiftDecimal) NONE(fmi3SetShiftFraction) NONE(fmi3SetString) NONE(fmi3SetTime) NONE(fmi3SetUInt16)
NONE(fmi3SetUInt32) NONE(fmi3SetUInt64) NONE(fmi3SetUInt8) NONE(fmi3UpdateDiscreteStates)
