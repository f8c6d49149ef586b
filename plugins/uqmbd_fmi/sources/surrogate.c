/* Evaluation of a surrogate: germs from inputs, orthonormal polynomials, and outputs at the time of the instance.

   Between output times, outputs of fixed times are interpolated linearly; segments and harmonics are exact at any time. */
#include "surrogate.h"

#include <math.h>
#include <string.h>

#include "sizes.h"

typedef struct {
    double time;
    double inputs[INPUTS];
    double germs[INPUTS];        /* NaN: outside the support */
    double slopes[INPUTS];       /* change of the germs in a direction */
    double basis[MOST_TERMS], change[MOST_TERMS];
    double edges[MOST_EDGES], moving[MOST_EDGES];
    double polynomials[INPUTS][MOST_DEGREE + 1], derivatives[INPUTS][MOST_DEGREE + 1];
    double warned_after;         /* 1: a warning on a time after the last output time was given */
} Model;

size_t model_bytes(void) { return sizeof(Model); }

void model_start(void *model) {
    Model *of = model;
    memset(of, 0, sizeof *of);
    memcpy(of->inputs, start_values, sizeof of->inputs);
}

void model_prepare(void *model, double time, double tolerance) {
    (void)tolerance;
    ((Model *)model)->time = time;
}

void model_initialise(void *model, Report *to) { model_advance(model, ((Model *)model)->time, to); }

void model_advance(void *model, double time, Report *to) {
    Model *of = model;
    of->time = time;
    const Surrogate *first = surrogates;
    if (first->times && !of->warned_after) {
        const double last = first->time[first->times - 1];
        if (time > last + 1e-9 * fabs(last) || time < first->time[0] - 1e-9 * fabs(last)) {
            of->warned_after = 1;
            report(to, WARNING,
                   "The time is %g s; the surrogate has outputs from %g s to %g s. Outputs are not valid at other times.",
                   time, first->time[0], last);
        }
    }
}

void model_set(void *model, unsigned variable, double value, Report *to) {
    (void)to;
    ((Model *)model)->inputs[contents[variable].index] = value;
}

/* --- inputs to germs --- */

static double smaller(double a, double b) { return a < b ? a : b; }

static double larger(double a, double b) { return a > b ? a : b; }

static double secant(const Marginal *of, int k) {
    const int at = k < 0 ? 0 : k > of->knots - 2 ? of->knots - 2 : k;
    return (of->values[at + 1] - of->values[at]) / of->step;
}

/* Slope of the monotone cubic interpolant at a knot: five points, limited to three times the smaller secant next to it. */
static double slope(const Marginal *of, int k) {
    const double before = secant(of, k - 1), after = secant(of, k);
    double found = (before + after) / 2;
    if (k == 0 || k == of->knots - 1)
        found = k == 0 ? after : before;
    else if (k > 1 && k < of->knots - 2)
        found = (7 * (before + after) - (secant(of, k - 2) + secant(of, k + 1))) / 12;
    return larger(0.0, smaller(found, 3 * smaller(before, after)));
}

static double cubic(const Marginal *of, int cell, double offset, double first, double last) {
    const double t = offset / of->step, rise = of->values[cell + 1] - of->values[cell];
    return of->values[cell] + t * (first + t * ((3 * rise - 2 * first - last) + t * (first + last - 2 * rise)));
}

/* Value of the standard variable at which a table has a value, by bisection; beyond the ends, the table is linear. */
static double inverted(const Marginal *of, double y) {
    const double *values = of->values;
    const double inside = larger(values[0], smaller(y, values[of->knots - 1]));
    int low = 0, high = of->knots;
    while (low < high) { /* number of values up to y */
        const int middle = (low + high) / 2;
        if (values[middle] <= inside)
            low = middle + 1;
        else
            high = middle;
    }
    const int cell = low - 1 < 0 ? 0 : low - 1 > of->knots - 2 ? of->knots - 2 : low - 1;
    const double first = slope(of, cell) * of->step, last = slope(of, cell + 1) * of->step;
    double from = 0.0, to = of->step;
    for (int k = 0; k < 60; k++) {
        const double middle = (from + to) / 2;
        if (cubic(of, cell, middle, first, last) < inside)
            from = middle;
        else
            to = middle;
    }
    double found = of->first + cell * of->step + (from + (to - from) / 2);
    if (y != inside) found += (y - inside) / slope(of, y > inside ? of->knots - 1 : 0);
    return found;
}

static double to_germ(const Marginal *of, double x) {
    double found, slack = 0.0;
    if (isfinite(of->low)) slack = larger(slack, 1e-12 * fabs(of->low));
    if (isfinite(of->high)) slack = larger(slack, 1e-12 * fabs(of->high));
    if (isfinite(of->low) && isfinite(of->high)) slack = larger(slack, 1e-9 * (of->high - of->low));
    if (!(x >= of->low - slack && x <= of->high + slack)) return NAN;
    if (of->kind == AFFINE)
        found = (x - of->shift) / of->scale;
    else if (of->kind == EXPONENTIAL)
        found = (log((x - of->shift) / of->scale) - of->mu) / of->sigma;
    else
        found = inverted(of, larger(of->low, smaller(x, of->high)));
    return isfinite(found) ? found : NAN;
}

/* Derivative of an input with respect to its standard variable. */
static double steepness(const Marginal *of, double z, double x) {
    if (of->kind == AFFINE) return of->scale;
    if (of->kind == EXPONENTIAL) return of->sigma * (x - of->shift);
    const double end = of->first + (of->knots - 1) * of->step;
    int cell = (int)floor((z - of->first) / of->step);
    cell = cell < 0 ? 0 : cell > of->knots - 2 ? of->knots - 2 : cell;
    const double first = slope(of, cell) * of->step, last = slope(of, cell + 1) * of->step;
    const double rise = of->values[cell + 1] - of->values[cell];
    const double t = larger(0.0, smaller((smaller(z, end) - (of->first + cell * of->step)) / of->step, 1.0));
    return (first + t * (2 * (3 * rise - 2 * first - last) + 3 * t * (first + last - 2 * rise))) / of->step;
}

/* Compute the germs; with a direction of the inputs, also their change.  Return the number of the first input outside its
   support, or -1. */
static int find_germs(Model *of, const Surrogate *at, const double *direction) {
    int outside = -1;
    for (int g = 0; g < at->groups; g++) {
        const Group *group = at->group + g;
        const int size = group->size;
        for (int place = 0; place < size; place++) {
            const int row = group->order[place], column = group->columns[row];
            const Marginal *marginal = group->marginals + row;
            const double standard = to_germ(marginal, of->inputs[column]);
            double total = 0.0, moved = 0.0;
            for (int p = 0; p < place; p++) {
                const int other = group->order[p];
                const double factor = group->factor[row * size + other];
                if (factor == 0.0) continue;
                total += factor * of->germs[group->columns[other]];
                if (direction) moved += factor * of->slopes[group->columns[other]];
            }
            const double own = group->factor[row * size + row];
            of->germs[column] = (standard - total) / own;
            if (isnan(of->germs[column]) && outside < 0) outside = column;
            if (direction) {
                const double by = direction[column];
                const double steep = by == 0.0 ? 0.0 : by / steepness(marginal, standard, of->inputs[column]);
                of->slopes[column] = (steep - moved) / own;
            }
        }
    }
    return outside;
}

/* --- germs to the basis --- */

static const Element *element_at(const Model *of, const Part *part) {
    for (int e = 0; e < part->elements; e++) {
        const Element *one = part->element + e;
        int inside = 1;
        for (int k = 0; k < INPUTS && inside; k++) inside = of->germs[k] > one->lower[k] && of->germs[k] <= one->upper[k];
        if (inside) return one;
    }
    return NULL;
}

static void find_basis(Model *of, const Element *at, int differentiate) {
    for (int k = 0; k < INPUTS; k++) {
        const Germ *germ = at->germs + k;
        double *p = of->polynomials[k], *d = of->derivatives[k];
        const double x = of->germs[k];
        p[0] = 1.0;
        d[0] = 0.0;
        for (int n = 0; n < germ->degree; n++) {
            double next = (x - germ->alpha[n]) * p[n], slope = p[n] + (x - germ->alpha[n]) * d[n];
            if (n) {
                next -= germ->norm[n] * p[n - 1];
                slope -= germ->norm[n] * d[n - 1];
            }
            p[n + 1] = next / germ->norm[n + 1];
            d[n + 1] = slope / germ->norm[n + 1];
        }
    }
    for (int t = 0; t < at->terms; t++) {
        const int *degrees = at->degrees + (size_t)t * INPUTS;
        double value = 1.0, change = 0.0;
        for (int k = 0; k < INPUTS; k++)
            if (degrees[k]) value *= of->polynomials[k][degrees[k]];
        if (differentiate)
            for (int k = 0; k < INPUTS; k++) {
                if (!degrees[k] || of->slopes[k] == 0.0) continue;
                double product = of->derivatives[k][degrees[k]] * of->slopes[k];
                for (int j = 0; j < INPUTS; j++)
                    if (j != k && degrees[j]) product *= of->polynomials[j][degrees[j]];
                change += product;
            }
        of->basis[t] = value;
        of->change[t] = change;
    }
}

/* --- the basis to an output --- */

/* Sum of the basis and coefficients that are `stride` apart. */
static double summed(int terms, const double *basis, const double *coefficients, size_t stride) {
    double found = 0.0;
    for (int t = 0; t < terms; t++) found += basis[t] * coefficients[(size_t)t * stride];
    return found;
}

static double segment_value(Model *of, const Surrogate *at, const Part *part, const Element *one, int row, double time,
                            int differentiate) {
    const int count = one->segments;
    const size_t stride = (size_t)count + 1, values = (size_t)count * part->outputs * one->powers;
    for (int s = 0; s <= count; s++) {
        of->edges[s] = summed(one->terms, of->basis, one->edges + s, stride);
        of->moving[s] = differentiate ? summed(one->terms, of->change, one->edges + s, stride) : 0.0;
        if (s && of->edges[s] < of->edges[s - 1]) {
            of->edges[s] = of->edges[s - 1];
            of->moving[s] = of->moving[s - 1];
        }
    }
    const double slack = 1e-12 * larger(fabs(at->time[0]), fabs(at->time[at->times - 1]));
    if (!(time <= of->edges[count] + slack)) return NAN;
    int s = 0;
    while (s < count - 1 && !(time < of->edges[s + 1])) s++;
    const double begin = of->edges[s], end = of->edges[s + 1], length = end - begin;
    const double share = length > 0 ? (time - begin) / length : 0.0;
    const double x = larger(-1.0, smaller(length > 0 ? (time - begin) * (2.0 / length) - 1.0 : -1.0, 1.0));
    double slid = 0.0; /* change of the normalised time; values outside a segment do not depend on it */
    if (differentiate && share > 0 && share < 1)
        slid = -2 * (of->moving[s] * (1 - share) + of->moving[s + 1] * share) / length;
    const double *from = one->values + ((size_t)s * part->outputs + row) * one->powers;
    double found = 0.0, polynomial = 1.0, before = 0.0, second = 1.0, earlier = 0.0;
    for (int n = 0; n < one->powers; n++) {
        /* T_n in `polynomial`, U_(n-1) in `earlier`: the derivative of T_n is n U_(n-1) */
        const double own = summed(one->terms, of->basis, from + n, values);
        if (!differentiate)
            found += own * polynomial;
        else
            found += summed(one->terms, of->change, from + n, values) * polynomial + own * n * earlier * slid;
        const double next = n ? 2 * x * polynomial - before : x;
        before = polynomial;
        polynomial = next;
        const double following = n ? 2 * x * second - earlier : 2 * x;
        earlier = second;
        second = following;
    }
    return found;
}

static double harmonic_value(const Model *of, const Part *part, const Element *one, int row, double time,
                             int differentiate) {
    const double t = time - part->origin;
    const size_t bases = (size_t)part->bases, outputs = (size_t)part->outputs, each = (size_t)part->harmonics;
    const double *basis = differentiate ? of->change : of->basis;
    double found = summed(one->terms, basis, one->constants + row, outputs) +
                   t * summed(one->terms, basis, one->drifts + row, outputs);
    for (int h = 0; h < part->harmonics; h++) {
        double frequency = 0.0, moved = 0.0;
        for (int b = 0; b < part->bases; b++) {
            const int times = part->lattice[h * part->bases + b];
            if (!times) continue;
            frequency += times * summed(one->terms, of->basis, one->frequencies + b, bases);
            if (differentiate) moved += times * summed(one->terms, of->change, one->frequencies + b, bases);
        }
        const size_t at = (size_t)row * each + (size_t)h;
        const double c = cos(frequency * t), s = sin(frequency * t);
        found += summed(one->terms, basis, one->cosines + at, outputs * each) * c +
                 summed(one->terms, basis, one->sines + at, outputs * each) * s;
        if (differentiate)
            found += moved * t * (summed(one->terms, of->basis, one->sines + at, outputs * each) * c -
                                  summed(one->terms, of->basis, one->cosines + at, outputs * each) * s);
    }
    return found;
}

/* Value of an output of a part, or its change, at a time; plain parts: at the output time `place`. */
static double part_value(Model *of, const Surrogate *at, int owner, int row, int place, double time, int differentiate) {
    const Part *part = at->part + owner;
    const Element *one = element_at(of, part);
    if (!one) return NAN;
    find_basis(of, one, differentiate);
    if (part->kind == SEGMENTS) return segment_value(of, at, part, one, row, time, differentiate);
    if (part->kind == HARMONICS) return harmonic_value(of, part, one, row, time, differentiate);
    const size_t times = at->times ? (size_t)at->times : 1;
    return summed(one->terms, differentiate ? of->change : of->basis, one->coefficients + (size_t)row * times + place,
                  (size_t)part->outputs * times);
}

/* Find the last output time that is not after a time, and the share of the interval after it; -1 outside the times. */
static int place_of(const Surrogate *at, double time, double *share) {
    *share = 0.0;
    if (!at->times) return 0;
    const double *times = at->time;
    const int last = at->times - 1;
    const double slack = 1e-9 * larger(fabs(times[0]), fabs(times[last])); /* rounding of sums of steps */
    if (!(time >= times[0] - slack && time <= times[last] + slack)) return -1;
    int low = 0, high = last;
    while (low < high) {
        const int middle = (low + high + 1) / 2;
        if (times[middle] <= time)
            low = middle;
        else
            high = middle - 1;
    }
    if (fabs(time - times[low]) <= slack * 1e-3) return low;
    if (low < last && fabs(times[low + 1] - time) <= slack * 1e-3) return low + 1;
    if (low == last || time < times[0]) return low;
    *share = (time - times[low]) / (times[low + 1] - times[low]);
    return low;
}

static double output_value(Model *of, const Surrogate *at, int output, int differentiate) {
    double share;
    const int place = place_of(at, of->time, &share), width = at->times ? at->times : 1;
    if (place < 0) return NAN;
    const int *owner = at->owner + (size_t)output * width, *row = at->row + (size_t)output * width;
    const double here = at->times ? at->time[place] : 0.0;
    if (share == 0.0) return part_value(of, at, owner[place], row[place], place, here, differentiate);
    if (owner[place] == owner[place + 1] && at->part[owner[place]].kind != PLAIN)
        return part_value(of, at, owner[place], row[place], place, of->time, differentiate);
    const double before = part_value(of, at, owner[place], row[place], place, here, differentiate);
    const double after = part_value(of, at, owner[place + 1], row[place + 1], place + 1, at->time[place + 1],
                                    differentiate);
    return before + share * (after - before);
}

static double table_value(const Model *of, const Surrogate *at, const Content *content) {
    double share;
    const int place = place_of(at, of->time, &share);
    if (place < 0) return NAN;
    if (share == 0.0) return content->table[place];
    const double found = content->table[place] + share * (content->table[place + 1] - content->table[place]);
    if (content->what != STATED_ERROR) return found;
    const double between = 4 * share * (1 - share) * content->between[place];
    return sqrt(found * found + between * between);
}

double model_get(void *model, unsigned variable, int begun, Report *to) {
    Model *of = model;
    const Content *content = contents + variable;
    const Surrogate *at = surrogates + content->surrogate;
    (void)begun;
    if (content->what == INPUT_VALUE) return of->inputs[content->index];
    if (content->what == STATISTIC || content->what == STATED_ERROR) return table_value(of, at, content);
    const int outside = find_germs(of, at, NULL);
    if (outside >= 0) {
        if (content->what == VALID) return 0.0;
        report(to, WARNING, "The input %s is %g, outside the support of its distribution; outputs are not valid.",
               input_names[outside], of->inputs[outside]);
        return NAN;
    }
    const double value = output_value(of, at, content->index, 0);
    return content->what == VALID ? (double)isfinite(value) : value;
}

void model_differentiate(void *model, const unsigned *unknown, size_t unknowns, const unsigned *known, size_t knowns,
                         const double *seed, double *change, Report *to) {
    Model *of = model;
    double direction[INPUTS] = {0};
    for (size_t k = 0; k < knowns; k++) direction[contents[known[k]].index] += seed[k];
    for (size_t k = 0; k < unknowns; k++) {
        const Content *content = contents + unknown[k];
        const Surrogate *at = surrogates + content->surrogate;
        change[k] = 0.0; /* statistics and stated errors do not depend on the inputs */
        if (content->what != OUTPUT_VALUE) continue;
        const int outside = find_germs(of, at, direction);
        if (outside >= 0) {
            report(to, DISCARD, "The input %s is %g, outside the support of its distribution; there is no derivative.",
                   input_names[outside], of->inputs[outside]);
            return;
        }
        change[k] = output_value(of, at, content->index, 1);
    }
}
