/* Tables of a surrogate, which data.c defines. */
#ifndef UQMBD_SURROGATE_H
#define UQMBD_SURROGATE_H

#include "model.h"

/* Maps of a standard variable z to an input: shift + scale z, shift + scale exp(mu + sigma z), or a table of quantiles
   at equidistant values of z. */
enum { AFFINE, EXPONENTIAL, QUANTILE };

typedef struct {
    int kind;
    double shift, scale, mu, sigma;
    double low, high; /* support of the input */
    double first, step;
    int knots;
    const double *values;
} Marginal;

/* Inputs m_k(sum_j factor[k, j] germ_j); rows in the order of conditioning use earlier germs only. */
typedef struct {
    int size;
    const int *columns, *order;
    const double *factor;
    const Marginal *marginals;
} Group;

/* Orthonormal polynomials of a germ: alpha and the square roots of beta of their recurrence. */
typedef struct {
    int degree;
    const double *alpha, *norm;
} Germ;

typedef struct {
    const double *lower, *upper; /* box: lower < germ <= upper */
    int terms;
    const int *degrees; /* (terms, inputs) */
    const Germ *germs;
    const double *coefficients; /* PLAIN: (terms, outputs, times) */
    int segments, powers;       /* SEGMENTS */
    const double *edges;        /* (terms, segments + 1) */
    const double *values;       /* (terms, segments, outputs, powers) */
    const double *frequencies;  /* HARMONICS: (terms, bases) */
    const double *constants, *drifts; /* (terms, outputs) */
    const double *cosines, *sines;    /* (terms, outputs, harmonics) */
} Element;

enum { PLAIN, SEGMENTS, HARMONICS };

typedef struct {
    int kind, outputs, elements;
    const Element *element;
    int bases, harmonics;
    const int *lattice; /* (harmonics, bases) */
    double origin;
} Part;

/* Outputs with the same times (scalar outputs: none); each output at each time belongs to a row of a part. */
typedef struct {
    int outputs, times;
    const double *time;
    int groups;
    const Group *group;
    int parts;
    const Part *part;
    const int *owner, *row; /* (outputs, times) */
} Surrogate;

/* Contents of a variable. */
enum { INPUT_VALUE, OUTPUT_VALUE, STATISTIC, STATED_ERROR, VALID, TIME_VALUE };

typedef struct {
    int what, surrogate, index;  /* number of the input or output */
    const double *table;         /* STATISTIC, STATED_ERROR: (times) */
    const double *between;       /* STATED_ERROR: errors of the interpolation (times - 1) */
} Content;

extern const Surrogate surrogates[];
extern const Content contents[];
extern const double start_values[];
extern const char *const input_names[];

#endif
