#include "tables.h"

/* The largest whole number that is not above x; numbers without fractions, infinities and NaN as they are. */
INLINE double whole(double x) {
    if (!(x < 4e15 && x > -4e15)) return x;
    double part = (double)(int64_t)x;
    return part > x ? part - 1.0 : part;
}

/* How many edges are not above x; of NaN: all of them. */
INLINE int64_t edges_below(const double *edges, int64_t count, double x) {
    int64_t low = 0, rest = count;
    while (rest > 0) {
        int64_t half = rest / 2;
        int right = !(edges[low + half] > x);
        low = right ? low + half + 1 : low;
        rest = right ? rest - half - 1 : half;
    }
    return low;
}

void look_up(const double *edges, const double *rows, int64_t knots, int64_t terms, int64_t numbers, double period,
             int64_t lanes, const double *x, double *found) {
    for (int64_t l = 0; l < lanes; l++) {
        double turns = period > 0.0 ? whole((x[l] - rows[0]) / period) * period : 0.0;
        int64_t which = edges_below(edges, knots, x[l] - turns);
        if (period > 0.0) which = which < 1 ? 1 : which > knots - 1 ? knots - 1 : which;
        const double *row = rows + which * (1 + terms) * numbers;
        for (int64_t c = 0; c < numbers; c++) {
            double sum = row[c];
            for (int64_t k = 1; k <= terms; k++) sum += x[k * lanes + l] * row[k * numbers + c];
            found[c * lanes + l] = sum;
        }
        found[l] += turns;
    }
}

/* Smaller values are not addresses. */
#define LEAST_ADDRESS 65536.0

void look_up_path(int64_t lanes, const double *x, double *found) {
    for (int64_t l = 0; l < lanes; l++) {
        double knot = x[l], value = 0.0, slope = 0.0, curvature = 0.0, third = 0.0;
        if (x[lanes + l] >= LEAST_ADDRESS) {
            const Path *path = (const Path *)(uintptr_t)(int64_t)x[lanes + l];
            double step = path->step, number = whole(x[l] / step), place = number - (double)path->begin;
            if (place >= 0.0 && place < (double)(path->count - 3)) {
                const double *c = path->coefficients + (int64_t)place;
                knot = number * step;
                value = (c[0] + 4.0 * c[1] + c[2]) / 6.0;
                slope = (c[2] - c[0]) / (2.0 * step);
                curvature = (c[0] - 2.0 * c[1] + c[2]) / (2.0 * step * step);
                third = (c[3] - c[0] + 3.0 * (c[1] - c[2])) / (6.0 * step * step * step);
            } else {
                value = __builtin_nan("");
            }
        }
        found[l] = knot;
        found[lanes + l] = value;
        found[2 * lanes + l] = slope;
        found[3 * lanes + l] = curvature;
        found[4 * lanes + l] = third;
    }
}
