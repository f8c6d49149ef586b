/* The largest values of polynomials on parts of steps, and the smallest values so far. */
#include "dop853.h"

/* Part of the largest value by which others are as large: rounding. */
static const double EQUAL = 1e-14;

enum { NEWTON = 5 }; /* steps of Newton's method, which converges where a polynomial is resolved */

/* One output on parts: values at the places and Chebyshev coefficients (part, outputs, PLACES). */
typedef struct {
    int64_t outputs, column;
    const double *values, *coefficients;
    const double *begin, *end; /* (part): s */
    const double *fine;        /* (PLACES, 8 FINE_ROOM): a coefficient to values at the fine places */
    const double *places;      /* (PLACES): as parts of a part */
} Fitted;

/* Value of a Chebyshev series, by the recurrence of Clenshaw. */
static double series_at(const double *series, double x) {
    double one = 0.0, two = 0.0;
    for (int64_t k = PLACES - 1; k > 0; k--) {
        double next = series[k] + 2.0 * x * one - two;
        two = one;
        one = next;
    }
    return series[0] + x * one - two;
}

/* Series of the derivative. */
static void derive(const double *series, double *found) {
    double after = 0.0, beyond = 0.0;
    found[PLACES - 1] = 0.0;
    for (int64_t k = PLACES - 1; k > 0; k--) {
        found[k - 1] = 2.0 * (double)k * series[k] + beyond;
        beyond = after;
        after = found[k - 1];
    }
    found[0] *= 0.5;
}

static double fine_place(int64_t i) { return 2.0 * (double)i / (FINE - 1) - 1.0; }

/* Values of a part at the fine places, times a sign; at the ends they are known: those on each side of a jump. */
static void fine_values(const Fitted *f, int64_t e, double sign, double *fine) {
    const double *series = f->coefficients + (e * f->outputs + f->column) * PLACES;
    const double *values = f->values + (e * f->outputs + f->column) * PLACES;
    for (int64_t i = 0; i < FINE_ROOM; i++) {
        V sum = splat(0.0);
        for (int64_t j = 0; j < PLACES; j++) sum += *(const Loose *)(f->fine + (j * FINE_ROOM + i) * LANES) * series[j];
        *(Loose *)(fine + i * LANES) = sign * sum;
    }
    fine[0] = sign * values[0];
    fine[FINE - 1] = sign * values[PLACES - 1];
}

/* Where, from -1 to 1, and what the largest value of a part is, times a sign: where it is constant, at the first place;
   where any is not finite it is not known. */
static void peak_of(const Fitted *f, int64_t e, double sign, double *place, double *value) {
    double fine[LANES * FINE_ROOM], series[PLACES], slope[PLACES], bend[PLACES], most = 0.0, zero = 0.0;
    const double *values = f->values + (e * f->outputs + f->column) * PLACES;
    for (int64_t j = 0; j < PLACES; j++) {
        series[j] = sign * f->coefficients[(e * f->outputs + f->column) * PLACES + j];
        if (__builtin_fabs(values[j]) > most) most = __builtin_fabs(values[j]);
        zero += values[j] - values[j];
    }
    *place = -1.0;
    *value = UNKNOWN;
    if (zero != 0.0) return;
    double tiny = EQUAL * most;
    fine_values(f, e, sign, fine);
    int64_t top = 0, first = 0, node = 0;
    for (int64_t i = 1; i < FINE; i++)
        if (fine[i] > fine[top]) top = i;
    while (fine[first] < fine[top] - tiny) first++;
    *place = fine_place(first);
    *value = fine[first];
    double low = fine_place(first ? first - 1 : 0), high = fine_place(first + 1 < FINE ? first + 1 : first), at = *place;
    derive(series, slope);
    derive(slope, bend);
    for (int64_t k = 0; k < NEWTON; k++) {
        double step = series_at(slope, at) / series_at(bend, at);
        if (step - step == 0.0) at -= step;
        at = at < low ? low : at > high ? high : at;
    }
    double between = series_at(series, at);
    if (between > *value + tiny) {
        *place = at;
        *value = between;
    }
    /* a node may be higher than what lies between: a kink that is resolved to the last */
    for (int64_t j = 1; j < PLACES; j++)
        if (sign * values[j] > sign * values[node]) node = j;
    if (sign * values[node] > *value + tiny) {
        *place = 2.0 * f->places[node] - 1.0;
        *value = sign * values[node];
    }
}

/* Peaks of some parts. */
void part_peaks(const Fitted *f, double sign, int64_t count, const int64_t *which, double *place, double *value) {
    for (int64_t k = 0; k < count; k++) peak_of(f, which[k], sign, place + k, value + k);
}

/* The smaller number; not known where one is not. */
static double least_of(double a, double b) { return a < b || a != a ? a : b; }

/* Smallest values so far (realisation, time) at ascending times; numbers first[r] .. first[r + 1] - 1 in the order of the
   parts are of one realisation. */
void least_so_far(const Fitted *f, int64_t members, const int64_t *first, const int64_t *order, int64_t count, const double *times,
                  double *found) {
    for (int64_t r = 0; r < members; r++) {
        double before = ENDLESS, so_far = ENDLESS, place = -1.0, peak = ENDLESS, fine[LANES * FINE_ROOM];
        int64_t e = -1, place_of = first[r];
        for (int64_t t = 0; t < count; t++) {
            int64_t last = t + 1 == count, known = e;
            while (e < 0 || (place_of + 1 < first[r + 1] && (last || f->begin[order[place_of + 1]] <= times[t]))) {
                if (e >= 0) before = least_of(before, -peak), place_of++;
                e = order[place_of];
                peak_of(f, e, -1.0, &place, &peak);
            }
            if (e != known) {
                fine_values(f, e, 1.0, fine);
                for (int64_t i = 1; i < FINE; i++) fine[i] = least_of(fine[i - 1], fine[i]);
            }
            double length = f->end[e] - f->begin[e], at = 1.0, here = least_of(before, so_far);
            if (length > 0.0 && !last) at = 2.0 * (times[t] - f->begin[e]) / length - 1.0;
            at = at < -1.0 ? -1.0 : at > 1.0 ? 1.0 : at;
            if (place <= at) here = least_of(here, -peak);
            here = least_of(here, fine[(int64_t)((at + 1.0) * 0.5 * (FINE - 1))]);
            if (at > -1.0 && !last)
                here = least_of(here, series_at(f->coefficients + (e * f->outputs + f->column) * PLACES, at));
            so_far = here;
            found[r * count + t] = so_far;
        }
    }
}
