/* Eight realisations at once: a number of each of them is a lane of a vector. */
#ifndef UQMBD_VECTORS_H
#define UQMBD_VECTORS_H

#include <stdint.h>

#define INLINE static inline __attribute__((always_inline))

enum { LANES = 8 };

typedef double V __attribute__((vector_size(64), aligned(64)));
typedef int64_t Mask __attribute__((vector_size(64), aligned(64))); /* -1: yes, 0: no */

/* A vector whose lanes are written one by one: in memory, and read at once. */
typedef union {
    V all;
    Mask mask;
    double of[LANES];
    int64_t flag[LANES];
} Lanes;

INLINE V splat(double x) { return (V){x, x, x, x, x, x, x, x}; }

INLINE V choose(Mask which, V yes, V no) { return (V)(((Mask)yes & which) | ((Mask)no & ~which)); }

INLINE V larger(V a, V b) { return choose(a > b, a, b); }

INLINE V smaller(V a, V b) { return choose(a < b, a, b); }

INLINE V magnitude(V a) { return __builtin_elementwise_abs(a); }

/* Let the magnitude of x count for the largest one so far.  The zero is added lest a masked store be made of the choice,
   which takes ten times as long. */
INLINE void count_largest(V *most, V x) { *most = larger(magnitude(x), *most) + 0.0; }

INLINE V root(V a) { return __builtin_elementwise_sqrt(a); }

INLINE int any(Mask m) {
    int64_t found = 0;
    for (int64_t l = 0; l < LANES; l++) found |= m[l];
    return found != 0;
}

INLINE void copy(V *to, const V *from, int64_t count) {
    for (int64_t i = 0; i < count; i++) to[i] = from[i];
}

INLINE void fill(V *to, double value, int64_t count) {
    for (int64_t i = 0; i < count; i++) to[i] = splat(value);
}

/* Eight numbers of one realisation, wherever they stand. */
typedef double Loose __attribute__((vector_size(64), aligned(8), may_alias));

INLINE V evens(V a, V b) { return __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14); }
INLINE V odds(V a, V b) { return __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15); }
INLINE V even_pairs(V a, V b) { return __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13); }
INLINE V odd_pairs(V a, V b) { return __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15); }
INLINE V firsts(V a, V b) { return __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11); }
INLINE V seconds(V a, V b) { return __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15); }

/* Make rows of a square the columns. */
INLINE void transpose(V *x) {
    V a = evens(x[0], x[1]), b = odds(x[0], x[1]), c = evens(x[2], x[3]), d = odds(x[2], x[3]);
    V e = evens(x[4], x[5]), f = odds(x[4], x[5]), g = evens(x[6], x[7]), h = odds(x[6], x[7]);
    V ac = even_pairs(a, c), bd = even_pairs(b, d), ca = odd_pairs(a, c), db = odd_pairs(b, d);
    V eg = even_pairs(e, g), fh = even_pairs(f, h), ge = odd_pairs(e, g), hf = odd_pairs(f, h);
    x[0] = firsts(ac, eg), x[1] = firsts(bd, fh), x[2] = firsts(ca, ge), x[3] = firsts(db, hf);
    x[4] = seconds(ac, eg), x[5] = seconds(bd, fh), x[6] = seconds(ca, ge), x[7] = seconds(db, hf);
}

/* Put numbers of eight realisations, a row of each, into the lanes of vectors. */
INLINE void to_lanes(V *to, const double *const *rows, int64_t count) {
    int64_t i = 0;
    for (; i + LANES <= count; i += LANES) {
        for (int64_t l = 0; l < LANES; l++) to[i + l] = *(const Loose *)(rows[l] + i);
        transpose(to + i);
    }
    for (; i < count; i++)
        to[i] = (V){rows[0][i], rows[1][i], rows[2][i], rows[3][i], rows[4][i], rows[5][i], rows[6][i], rows[7][i]};
}

/* Put the first so many lanes of vectors into rows; the vectors are overwritten. */
INLINE void to_rows(double *const *rows, int64_t lanes, V *from, int64_t count) {
    int64_t i = 0;
    for (; i + LANES <= count; i += LANES) {
        transpose(from + i);
        for (int64_t l = 0; l < lanes; l++) *(Loose *)(rows[l] + i) = from[i + l];
    }
    for (; i < count; i++)
        for (int64_t l = 0; l < lanes; l++) rows[l][i] = from[i][l];
}

/* Four numbers of one realisation, wherever they stand. */
typedef double Quad __attribute__((vector_size(32), aligned(8), may_alias));

/* Make rows of squares of four the columns, in both halves of the vectors. */
INLINE void transpose_halves(V *x) {
    const V a = evens(x[0], x[1]), b = odds(x[0], x[1]), c = evens(x[2], x[3]), d = odds(x[2], x[3]);
    x[0] = even_pairs(a, c), x[1] = even_pairs(b, d), x[2] = odd_pairs(a, c), x[3] = odd_pairs(b, d);
}

INLINE V of_quads(Quad a, Quad b) { return __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7); }
INLINE Quad first_quad(V a) { return __builtin_shufflevector(a, a, 0, 1, 2, 3); }
INLINE Quad second_quad(V a) { return __builtin_shufflevector(a, a, 4, 5, 6, 7); }

#endif
