/* Functions of a model for the interfaces fmi2.c and fmi3.c, and declarations that both interfaces share. */
#ifndef UQMBD_MODEL_H
#define UQMBD_MODEL_H

#include <stddef.h>
#include <stdint.h>

/* Outcome of a call; the numbers equal fmi2Status and fmi3Status. */
enum { OK, WARNING, DISCARD, ERROR, FATAL };

enum { REAL, BOOLEAN };

/* Causality of a variable. */
enum { TIME, PARAMETER, INPUT, OUTPUT };

typedef struct {
    const char *name;
    int type, causality;
    int tunable; /* whether a parameter can be set between steps */
} Variable;

/* Outcome of a call to a model, with a message for the logger. */
typedef struct {
    int status, remarked;
    char text[1000];
} Report;

/* Set the status and the message of a report; the status ERROR replaces any other. */
void report(Report *to, int status, const char *format, ...);

/* Set a message for the logger that changes no status: some programs stop at each status other than OK. */
void remark(Report *to, const char *format, ...);

extern const char model_token[];
extern const Variable model_variables[];
extern const unsigned model_variable_count;

/* Memory of a model in bytes.  It contains no pointers, so a copy of it is a saved state. */
size_t model_bytes(void);

/* Set all parameters and inputs to their start values. */
void model_start(void *model);

/* Set the start time, and a relative tolerance (0: the default). */
void model_prepare(void *model, double time, double tolerance);

/* Compute the start of the motion. */
void model_initialise(void *model, Report *to);

/* Advance to a time. */
void model_advance(void *model, double time, Report *to);

/* Set a parameter or an input; the caller has checked its causality, and that the value is finite. */
void model_set(void *model, unsigned variable, double value, Report *to);

/* Return the value of a variable; `begun` is 0 before the initialisation. */
double model_get(void *model, unsigned variable, int begun, Report *to);

/* Compute the changes of outputs due to changes (seeds) of parameters. */
void model_differentiate(void *model, const unsigned *unknown, size_t unknowns, const unsigned *known, size_t knowns,
                         const double *seed, double *change, Report *to);

/* --- the part that both interfaces share --- */

typedef enum { CREATED = 1, INITIALISING, STEPPING, TERMINATED, FAILED } Phase;

typedef struct Instance Instance;

/* Pass a message to the logger of the environment. */
typedef void (*Say)(const Instance *instance, int status, const char *text);

/* A function with the type of the logger in the standard. */
typedef void (*Logger)(void);

struct Instance {
    uint64_t mark;
    int phase;
    double time, start, stop, tolerance;
    char *name;
    Say say;
    void *environment;
    Logger logger;
    void *model;
    void *allocated; /* memory of the model, before its alignment */
};

/* A saved state: this header, and a copy of the memory of the model. */
typedef struct {
    uint64_t mark, token, bytes;
    int64_t phase;
    double time, start, stop, tolerance;
} Saved;

Instance *instance_create(const char *name, const char *token, Say say, void *environment, Logger logger);
void instance_free(Instance *instance);
int instance_reset(Instance *instance);
int instance_setup(Instance *instance, int tolerance_defined, double tolerance, double start, int stop_defined,
                   double stop);
int instance_initialise(Instance *instance);
int instance_initialised(Instance *instance);
int instance_terminate(Instance *instance);
int instance_step(Instance *instance, double time, double step);
int instance_get(Instance *instance, int type, const unsigned *references, size_t count, double *values);
int instance_set(Instance *instance, int type, const unsigned *references, size_t count, const double *values);
int instance_differentiate(Instance *instance, const unsigned *unknown, size_t unknowns, const unsigned *known,
                           size_t knowns, const double *seed, double *change);
int instance_save(Instance *instance, void **state);
int instance_restore(Instance *instance, const void *state);
int instance_drop(Instance *instance, void **state);
int instance_state_size(Instance *instance, const void *state, size_t *size);
int instance_serialise(Instance *instance, const void *state, unsigned char *bytes, size_t size);
int instance_deserialise(Instance *instance, const unsigned char *bytes, size_t size, void **state);

/* Whether a pointer is an instance. */
int instance_exists(const Instance *instance);

/* Report an error that leaves the instance as it is, and return ERROR. */
int instance_refuse(Instance *instance, const char *format, ...);

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#endif
