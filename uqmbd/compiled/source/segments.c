/* Outputs of samples that are expanded from landmark to landmark, at given times: eight samples at once. */
#include "vectors.h"

enum {
    FOUR = 4,   /* polynomials whose sums do not wait for one another, and times that are taken at once */
    PAIR = 2,   /* times whose polynomials stay in registers */
    ROOM = 136, /* times of a sample that are kept until they are put into its row, and four more */
};

/* What is expanded: P terms, S segments, C outputs, and at most B times four Chebyshev polynomials. */
typedef struct {
    int64_t segments, outputs, terms, blocks;
    const double *edges;        /* (S + 1, P): coefficients of the times at which segments begin and end */
    const int64_t *used;        /* (S, C): so many times four polynomials */
    const int64_t *counts;      /* (S, C, B): so many terms of four polynomials are not zero: the first ones */
    const int64_t *starts;      /* (S, C): where coefficients begin: (counts, 4) of one block after the other */
    const double *coefficients;
} Segments;

/* Terms (P) of eight samples, those of the first one where there are fewer. */
INLINE void terms_of(int64_t terms, const double *basis, int64_t lanes, V *own) {
    for (int64_t l = 0; l < LANES; l++)
        for (int64_t p = 0; p < terms; p++) ((double *)own)[p * LANES + l] = basis[(l < lanes ? l : 0) * terms + p];
}

/* Time at which a segment of eight samples begins, from the coefficients of the terms. */
INLINE V edge_of(int64_t terms, const V *basis, const double *coefficients) {
    V sum = splat(0.0);
    for (int64_t p = 0; p < terms; p++) sum += basis[p] * coefficients[p];
    return sum;
}

/* Coefficients of one output in one segment at eight samples: combinations of those of the terms. */
INLINE void combined_of(int64_t blocks, const int64_t *counts, const V *basis, const double *from, V *local) {
    for (int64_t n = 0; n < blocks; n++) {
        V sum0 = splat(0.0), sum1 = sum0, sum2 = sum0, sum3 = sum0;
        for (int64_t p = 0; p < counts[n]; p++, from += FOUR) {
            const V b = basis[p];
            sum0 += b * from[0];
            sum1 += b * from[1];
            sum2 += b * from[2];
            sum3 += b * from[3];
        }
        local[FOUR * n] = sum0;
        local[FOUR * n + 1] = sum1;
        local[FOUR * n + 2] = sum2;
        local[FOUR * n + 3] = sum3;
    }
}

/* Chebyshev polynomials of `powers` degrees (4 or more) at some times of eight samples, from -1 to 1; two times in turn,
   whose numbers stay in registers. */
INLINE void chebyshev(const int64_t width, int64_t powers, const V *x, V *found) {
#pragma clang loop unroll(full)
    for (int64_t i = 0; i < width; i += PAIR) {
        const int64_t other = i + 1 < width ? i + 1 : i;
        const V twice0 = 2.0 * x[i], twice1 = 2.0 * x[other];
        V before0 = splat(1.0), before1 = before0, last0 = x[i], last1 = x[other];
        found[i] = found[other] = before0;
        found[width + i] = last0;
        found[width + other] = last1;
        for (int64_t n = 2; n < powers; n++) {
            const V next0 = twice0 * last0 - before0, next1 = twice1 * last1 - before1;
            before0 = last0;
            before1 = last1;
            found[n * width + i] = last0 = next0;
            found[n * width + other] = last1 = next1;
        }
    }
}

/* Values of some outputs in one segment at `width` times, which begin at times[at] of each lane; they are kept (C, ROOM)
   for each lane, from kept[to] on. */
INLINE void taken(const int64_t width, int64_t outputs, const int64_t *used, int64_t most, int64_t stride,
                  const Lanes *at, const Lanes *to, const double *times, V begin, V scale, const V *local, V *power,
                  double *kept) {
    V x[FOUR], sum[FOUR];
    if (width == FOUR) {
#pragma clang loop unroll(full)
        for (int64_t i = 0; i < FOUR; i++)
            x[i] = of_quads(*(const Quad *)(times + at->flag[i]), *(const Quad *)(times + at->flag[FOUR + i]));
        transpose_halves(x);
    } else {
#pragma clang loop unroll(full)
        for (int64_t i = 0; i < width; i++) {
            Lanes some;
#pragma clang loop unroll(full)
            for (int64_t l = 0; l < LANES; l++) some.of[l] = times[at->flag[l] + i];
            x[i] = some.all;
        }
    }
#pragma clang loop unroll(full)
    for (int64_t i = 0; i < width; i++)
        x[i] = smaller(larger((x[i] - begin) * scale - 1.0, splat(-1.0)), splat(1.0));
    chebyshev(width, FOUR * most, x, power);
    for (int64_t o = 0; o < outputs; o++, local += stride, kept += ROOM) {
#pragma clang loop unroll(full)
        for (int64_t i = 0; i < width; i++) sum[i] = splat(0.0);
        for (int64_t n = 0; n < FOUR * used[o]; n++)
#pragma clang loop unroll(full)
            for (int64_t i = 0; i < width; i++) sum[i] += local[n] * power[n * width + i];
        if (width == FOUR) {
            transpose_halves(sum);
#pragma clang loop unroll(full)
            for (int64_t i = 0; i < FOUR; i++) {
                *(Quad *)(kept + to->flag[i]) = first_quad(sum[i]);
                *(Quad *)(kept + to->flag[FOUR + i]) = second_quad(sum[i]);
            }
        } else {
#pragma clang loop unroll(full)
            for (int64_t l = 0; l < LANES; l++)
#pragma clang loop unroll(full)
                for (int64_t i = 0; i < width; i++) kept[to->flag[l] + i] = sum[i][l];
        }
    }
}

/* Put what is kept of samples (C, ROOM) into their rows (C, count), from the times `since` on until those of `at`. */
INLINE void put(int64_t lanes, int64_t outputs, int64_t count, Lanes *since, const Lanes *at, const double *kept,
                double *const *rows) {
    for (int64_t l = 0; l < lanes; l++) {
        const int64_t from = since->flag[l], some = at->flag[l] - from;
        for (int64_t o = 0; o < outputs; o++) {
            const double *own = kept + (l * outputs + o) * ROOM;
            double *row = rows[l] + o * count + from;
            int64_t j = 0;
            for (; j + LANES <= some; j += LANES) *(Loose *)(row + j) = *(const Loose *)(own + j);
            for (; j < some; j++) row[j] = own[j];
        }
    }
    since->mask = at->mask;
}

/* Edges (K, S + 1) of samples, none before the one before it, from the terms at them (K, P); `work` has room for P
   vectors. */
void segment_edges(const Segments *table, int64_t samples, const double *basis, double *found, double *work) {
    const int64_t terms = table->terms, count = table->segments + 1;
    for (int64_t group = 0; group < samples; group += LANES) {
        const int64_t lanes = samples - group < LANES ? samples - group : LANES;
        terms_of(terms, basis + group * terms, lanes, (V *)work);
        Lanes edge = {edge_of(terms, (V *)work, table->edges)};
        for (int64_t s = 0; s < count; s++) {
            if (s) edge.all = larger(edge_of(terms, (V *)work, table->edges + s * terms), edge.all);
            for (int64_t l = 0; l < lanes; l++) found[(group + l) * count + s] = edge.of[l];
        }
    }
}

/* Values at T increasing times of outputs first to last of K samples, put into rows of `found` (R, last - first, T).

   In a segment an output is a sum of Chebyshev polynomials of its normalised time, whose coefficients are combinations
   of those of the terms, with the basis (K, P) at a sample.  NaN behind the last edge, by more than `slack`.  Times
   before the first edge belong to the begin.  Behind the T times there are four more, any.  `below` (N + 1) says how
   many times are about before times[0] + n / rate, for n to N: where the search for the time of an edge begins.  `work`
   has room for (4 B + ROOM) (last - first) + 16 B + P + 2 S + 1 vectors. */
void segment_values(const Segments *table, int64_t samples, int64_t first, int64_t last, int64_t count,
                    const double *basis, const int64_t *places, const double *times, const int64_t *below,
                    int64_t most_below, double rate, double slack, double *found, double *work) {
    const int64_t terms = table->terms, outputs = last - first, stride = FOUR * table->blocks;
    V *power = (V *)work, *local = power + FOUR * stride, *own = local + outputs * stride;
    V *edges = own + terms;
    Mask *before = (Mask *)(edges + table->segments + 1);
    double *kept = (double *)(before + table->segments);
    for (int64_t group = 0; group < samples; group += LANES) {
        const int64_t lanes = samples - group < LANES ? samples - group : LANES;
        int64_t filled = 0;
        double *rows[LANES];
        Lanes at = {0}, since = {0}, ends = {0}, offset;
        for (int64_t l = 0; l < LANES; l++) {
            rows[l] = found + places[group + (l < lanes ? l : 0)] * outputs * count;
            offset.flag[l] = l * outputs * ROOM;
        }
        terms_of(terms, basis + group * terms, lanes, own);
        /* edges first, and how many times are before them: what follows does not wait for the search */
        edges[0] = edge_of(terms, own, table->edges);
        for (int64_t s = 0; s < table->segments; s++) {
            const V end = edges[s + 1] = larger(edge_of(terms, own, table->edges + (s + 1) * terms), edges[s]);
            const int closing = s == table->segments - 1;
            Lanes limit = {closing ? end + slack : end}, near;
            near.all = smaller(larger((limit.all - times[0]) * rate, splat(0.0)), splat((double)most_below));
            for (int64_t l = 0; l < LANES; l++) {
                int64_t to = below[(int64_t)near.of[l]];
                if (to < ends.flag[l]) to = ends.flag[l];
                while (to > ends.flag[l] && !(times[to - 1] < limit.of[l])) to--;
                while (to < count && times[to] < limit.of[l]) to++;
                while (closing && to < count && times[to] <= limit.of[l]) to++;
                ends.flag[l] = to;
            }
            before[s] = ends.mask;
        }
        for (int64_t s = 0; s < table->segments; s++) {
            const V begin = edges[s], end = edges[s + 1];
            int64_t most = 0;
            ends.mask = before[s];
            for (int64_t l = 0; l < LANES; l++)
                if (ends.flag[l] - at.flag[l] > most) most = ends.flag[l] - at.flag[l];
            if (!most) continue;
            const V scale = choose(end > begin, 2.0 / (end - begin), splat(0.0));
            const int64_t begun = s * table->outputs + first, *used = table->used + begun;
            int64_t degrees = 1;
            for (int64_t o = 0; o < outputs; o++) {
                combined_of(used[o], table->counts + (begun + o) * table->blocks, own,
                            table->coefficients + table->starts[begun + o], local + o * stride);
                if (used[o] > degrees) degrees = used[o];
            }
            for (int64_t left = most; left > 0;) {
                const int64_t some = left > 2 ? FOUR : left;
                if (filled + FOUR > ROOM - FOUR) {
                    put(lanes, outputs, count, &since, &at, kept, rows);
                    filled = 0;
                }
                const Lanes to = {.mask = at.mask - since.mask + offset.mask};
#define TAKEN(width) taken(width, outputs, used, degrees, stride, &at, &to, times, begin, scale, local, power, kept)
                if (some == 1)
                    TAKEN(1);
                else if (some == 2)
                    TAKEN(2);
                else
                    TAKEN(FOUR);
#undef TAKEN
                /* a sample that has no times left stays, and what is kept of it beyond is overwritten */
                const Mask next = at.mask + some, beyond = next > ends.mask;
                at.mask = (ends.mask & beyond) | (next & ~beyond);
                filled += some;
                left -= some;
            }
        }
        put(lanes, outputs, count, &since, &at, kept, rows);
        for (int64_t l = 0; l < lanes; l++)
            for (int64_t o = 0; o < outputs; o++)
                for (int64_t j = at.flag[l]; j < count; j++) rows[l][o * count + j] = __builtin_nan("");
    }
}
