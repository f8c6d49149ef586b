/* Outputs of samples that are expanded from landmark to landmark, at given times. */
#include "vectors.h"

typedef double Loose __attribute__((vector_size(64), aligned(8)));

enum { GROUP = 32 }; /* samples that share what is in the cache */

/* Coefficients of one segment of a sample: a combination (P) of those of the terms (P, N), N in vectors. */
INLINE void combined_of(int64_t terms, int64_t vectors, const double *basis, const V *coefficients, V *local) {
    V first = splat(0.0), second = first;
    for (int64_t p = 0; p < terms; p++) {
        first += basis[p] * coefficients[p * vectors];
        if (vectors > 1)
            second += basis[p] * coefficients[p * vectors + 1];
    }
    local[0] = first;
    if (vectors > 1)
        local[1] = second;
    for (int64_t n = 2; n < vectors; n++) {
        V sum = splat(0.0);
        for (int64_t p = 0; p < terms; p++)
            sum += basis[p] * coefficients[p * vectors + n];
        local[n] = sum;
    }
}

/* Chebyshev polynomials at eight points from -1 to 1: at least three. */
INLINE void chebyshev(int64_t count, V x, V *found) {
    const V twice = 2.0 * x, second = twice * x - 1.0, step = 2.0 * second;
    found[0] = splat(1.0);
    found[1] = x;
    found[2] = second;
    if (count > 3)
        found[3] = step * x - x;
    /* two chains, of even and of odd ones */
    for (int64_t n = 4; n < count; n++)
        found[n] = step * found[n - 2] - found[n - 4];
}

/* A sum of Chebyshev polynomials. */
INLINE V summed(int64_t count, const double *coefficients, const V *polynomials) {
    V even = splat(0.0), odd = even;
    int64_t n = 0;
    for (; n + 1 < count; n += 2) {
        even += coefficients[n] * polynomials[n];
        odd += coefficients[n + 1] * polynomials[n + 1];
    }
    if (n < count)
        even += coefficients[n] * polynomials[n];
    return even + odd;
}

/* Values (K, C, T) at T increasing times of C outputs of K samples.

   Sample k begins segment s at edges[k (S + 1) + s].  In a segment an output is a sum of `powers` Chebyshev polynomials
   (3 or more) of its normalised time, whose coefficients are a combination of P terms: basis (K, P) times coefficients
   (S, C, P, N), N being `powers` filled up to whole vectors.  NaN behind the last edge, by more than `slack`.
   Behind the times there is room for seven more; `work` has room for (powers + C vectors) vectors. */
void segment_values(int64_t samples, int64_t segments, int64_t outputs, int64_t terms, int64_t powers, int64_t count,
                    const double *edges, const double *basis, const double *coefficients, const double *times,
                    double *found, double *work, double slack) {
    const int64_t vectors = (powers + LANES - 1) / LANES;
    const V *table = (const V *)coefficients;
    V *power = (V *)work, *local = power + powers;
    for (int64_t group = 0; group < samples; group += GROUP) {
        const int64_t most = group + GROUP < samples ? group + GROUP : samples;
        int64_t place[GROUP] = {0};
        for (int64_t s = 0; s < segments; s++)
            for (int64_t k = group; k < most; k++) {
                const double begin = edges[k * (segments + 1) + s], end = edges[k * (segments + 1) + s + 1];
                const int64_t first = place[k - group];
                int64_t last = first;
                while (last < count && (times[last] < end || (s == segments - 1 && times[last] <= end + slack)))
                    last++;
                place[k - group] = last;
                if (last == first)
                    continue;
                for (int64_t o = 0; o < outputs; o++)
                    combined_of(terms, vectors, basis + k * terms, table + (s * outputs + o) * terms * vectors,
                                local + o * vectors);
                const V scale = splat(end > begin ? 2.0 / (end - begin) : 0.0);
                for (int64_t j = first; j < last; j += LANES) {
                    /* a time before the first edge belongs to the begin */
                    const V at = (*(const Loose *)(times + j) - begin) * scale - 1.0;
                    const V x = smaller(larger(at, splat(-1.0)), splat(1.0));
                    chebyshev(powers, x, power);
                    for (int64_t o = 0; o < outputs; o++) {
                        const V sum = summed(powers, (const double *)(local + o * vectors), power);
                        double *to = found + (k * outputs + o) * count + j;
                        /* what is written beyond this segment is written again by the next one */
                        if (j + LANES <= count)
                            *(Loose *)to = sum;
                        else
                            for (int64_t l = 0; j + l < count; l++)
                                to[l] = sum[l];
                    }
                }
            }
        for (int64_t k = group; k < most; k++)
            for (int64_t o = 0; o < outputs; o++)
                for (int64_t j = place[k - group]; j < count; j++)
                    found[(k * outputs + o) * count + j] = __builtin_nan("");
    }
}
