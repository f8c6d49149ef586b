/* Outputs of samples that are expanded from landmark to landmark, at given times: eight samples at once. */
#include "vectors.h"

enum { FOUR = 4, PAIR = 2 }; /* polynomials whose sums do not wait for one another; times that are taken at once */

/* Coefficients of one output in one segment at eight samples: combinations (N) of those of the terms (P, M). */
INLINE void combined_of(int64_t terms, int64_t powers, int64_t width, const V *basis, const double *coefficients,
                        V *local) {
    for (int64_t n = 0; n < powers; n += FOUR) {
        const double *from = coefficients + n;
        V sum0 = splat(0.0), sum1 = sum0, sum2 = sum0, sum3 = sum0;
        for (int64_t p = 0; p < terms; p++, from += width) {
            const V b = basis[p];
            sum0 += b * from[0];
            sum1 += b * from[1];
            sum2 += b * from[2];
            sum3 += b * from[3];
        }
        local[n] = sum0;
        local[n + 1] = sum1;
        local[n + 2] = sum2;
        local[n + 3] = sum3;
    }
}

/* Chebyshev polynomials of `powers` degrees (4 or more) at two times of eight samples, from -1 to 1. */
INLINE void chebyshev(int64_t powers, const V *x, V *found) {
    const V second0 = 2.0 * x[0] * x[0] - 1.0, second1 = 2.0 * x[1] * x[1] - 1.0;
    const V step0 = 2.0 * second0, step1 = 2.0 * second1;
    found[0] = found[1] = splat(1.0);
    found[2] = x[0];
    found[3] = x[1];
    found[4] = second0;
    found[5] = second1;
    found[6] = step0 * x[0] - x[0];
    found[7] = step1 * x[1] - x[1];
    /* chains of even and of odd ones */
    for (int64_t n = 4; n < powers; n++) {
        found[2 * n] = step0 * found[2 * n - 4] - found[2 * n - 8];
        found[2 * n + 1] = step1 * found[2 * n - 3] - found[2 * n - 7];
    }
}

/* Sums of Chebyshev polynomials at two times; `powers` is even. */
INLINE void summed(int64_t powers, const V *coefficients, const V *polynomials, V *found) {
    V even0 = splat(0.0), even1 = even0, odd0 = even0, odd1 = even0;
    for (int64_t n = 0; n < powers; n += 2) {
        even0 += coefficients[n] * polynomials[2 * n];
        even1 += coefficients[n] * polynomials[2 * n + 1];
        odd0 += coefficients[n + 1] * polynomials[2 * n + 2];
        odd1 += coefficients[n + 1] * polynomials[2 * n + 3];
    }
    found[0] = even0 + odd0;
    found[1] = even1 + odd1;
}

/* Values (K, C, T) at T increasing times of C outputs of K samples.

   Sample k begins segment s at edges[k (S + 1) + s].  In a segment an output is a sum of `powers` Chebyshev polynomials
   (a multiple of 4) of its normalised time, whose coefficients are a combination of P terms: basis (K, P) times
   coefficients (S, C, P, powers).  NaN behind the last edge, by more than `slack`.  Times before the first edge belong
   to the begin.  `work` has room for (2 + C) powers + P + 4 vectors. */
void segment_values(int64_t samples, int64_t segments, int64_t outputs, int64_t terms, int64_t powers, int64_t count,
                    const double *edges, const double *basis, const double *coefficients, const double *times,
                    double *found, double *work, double slack) {
    V *power = (V *)work, *local = power + PAIR * powers, *own = local + outputs * powers;
    for (int64_t group = 0; group < samples; group += LANES) {
        const int64_t lanes = samples - group < LANES ? samples - group : LANES;
        int64_t place[LANES] = {0};
        for (int64_t l = 0; l < LANES; l++)
            for (int64_t p = 0; p < terms; p++)
                ((double *)own)[p * LANES + l] = basis[(group + (l < lanes ? l : 0)) * terms + p];
        for (int64_t s = 0; s < segments; s++) {
            int64_t first[LANES] = {0}, most = 0;
            double *begin = (double *)(own + terms), *scale = begin + LANES, *at = scale + LANES;
            for (int64_t l = 0; l < lanes; l++) {
                const double *edge = edges + (group + l) * (segments + 1) + s;
                const double limit = s == segments - 1 ? edge[1] + slack : edge[1];
                int64_t last = place[l];
                first[l] = last;
                while (last < count && times[last] < limit) last++;
                if (s == segments - 1 && last < count && times[last] == limit) last++;
                place[l] = last;
                if (last - first[l] > most) most = last - first[l];
                begin[l] = edge[0];
                scale[l] = edge[1] > edge[0] ? 2.0 / (edge[1] - edge[0]) : 0.0;
            }
            if (!most) continue;
            for (int64_t o = 0; o < outputs; o++)
                combined_of(terms, powers, powers, own, coefficients + (s * outputs + o) * terms * powers,
                            local + o * powers);
            for (int64_t step = 0; step < most; step += PAIR) {
                /* times of a sample that has none left: any */
                for (int64_t i = 0; i < PAIR; i++)
                    for (int64_t l = 0; l < lanes; l++) {
                        const int64_t j = first[l] + step + i;
                        at[i * LANES + l] = times[j < count ? j : count - 1];
                    }
                V x[PAIR];
                for (int64_t i = 0; i < PAIR; i++)
                    x[i] = smaller(larger((((V *)at)[i] - *(V *)begin) * *(V *)scale - 1.0, splat(-1.0)), splat(1.0));
                chebyshev(powers, x, power);
                for (int64_t o = 0; o < outputs; o++) {
                    double *sum = at;
                    summed(powers, local + o * powers, power, (V *)sum);
                    for (int64_t l = 0; l < lanes; l++) {
                        double *to = found + ((group + l) * outputs + o) * count + first[l] + step;
                        const int64_t left = place[l] - first[l] - step;
                        if (left > 0) to[0] = sum[l];
                        if (left > 1) to[1] = sum[LANES + l];
                    }
                }
            }
        }
        for (int64_t k = group; k < group + lanes; k++)
            for (int64_t o = 0; o < outputs; o++)
                for (int64_t j = place[k - group]; j < count; j++)
                    found[(k * outputs + o) * count + j] = __builtin_nan("");
    }
}
