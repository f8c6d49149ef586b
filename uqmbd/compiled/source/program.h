/* What a mechanism computes, as data: kernels and sums on a work array whose rows are vectors. */
#ifndef UQMBD_PROGRAM_H
#define UQMBD_PROGRAM_H

#include "vectors.h"

typedef void Kernel(const V *arguments, V *results);

/* A function of more than its arguments. */
typedef void Method(const void *context, const V *arguments, V *results);

/* One kernel for `count` instances, or a method, or (both are null) `count` sums of rows. */
typedef struct {
    Kernel *code;
    const int64_t *reads;  /* rows: of all arguments of all instances, null: they stand from `first` on; or of all terms */
    const int64_t *starts; /* of sums: first of the terms of each, and the end */
    int64_t count, inputs, outputs;
    int64_t first; /* row of the arguments, where there is no table */
    int64_t to;    /* row of the results */
    Method *method;
    const void *context; /* of the method */
} Step;

typedef struct {
    const Step *steps;
    int64_t count;
    int64_t scratch; /* row from which arguments may be gathered */
} Program;

enum { SOURCES = 16 }; /* most of one call */

/* Where arguments of state number k stand: data[((k / divisor) % modulus) * stride + column], in row `to + column`. */
typedef struct {
    const double *data;
    int64_t stride, columns, divisor, modulus, to;
} Source;

void run_program(const Program *program, V *work);

/* Results (count, results) of states number first .. first + count - 1. */
void evaluate(const Program *program, V *work, const Source *sources, int64_t many, int64_t first, int64_t count,
              const int64_t *rows, int64_t results, double *out);

/* The largest magnitude (count / states, results) of the results of `states` states each; NaN counts as nothing.  There
   is room for `results` rows in `most`. */
void largest(const Program *program, V *work, V *most, const Source *sources, int64_t many, int64_t states,
             int64_t count, const int64_t *rows, int64_t results, double *out);

#endif
