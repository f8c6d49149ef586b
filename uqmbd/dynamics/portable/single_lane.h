/* One realisation: vectors of a single number, for the sources of the driver, which compute with vectors of realisations.
   Programs that run without uqmbd get this header as vectors.h. */
#ifndef UQMBD_VECTORS_H
#define UQMBD_VECTORS_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__) && !defined(__clang__)
/* hints for clang, and lanes that are written before they are read */
#pragma GCC diagnostic ignored "-Wunknown-pragmas"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif
#ifdef __clang__
#pragma clang diagnostic ignored "-Wpass-failed" /* hints to unroll loops that are for vectors of eight realisations */
#endif

#define INLINE static inline

enum { LANES = 1 };

typedef double V __attribute__((vector_size(8)));
typedef int64_t Mask __attribute__((vector_size(8))); /* -1: yes, 0: no */

typedef union {
    V all;
    Mask mask;
    double of[LANES];
    int64_t flag[LANES];
} Lanes;

INLINE V splat(double x) { return (V){x}; }

INLINE V choose(Mask which, V yes, V no) { return (V)(((Mask)yes & which) | ((Mask)no & ~which)); }

INLINE V larger(V a, V b) { return choose(a > b, a, b); }

INLINE V smaller(V a, V b) { return choose(a < b, a, b); }

INLINE V magnitude(V a) { return (V){fabs(a[0])}; }

INLINE void count_largest(V *most, V x) { *most = larger(magnitude(x), *most); }

INLINE V root(V a) { return (V){sqrt(a[0])}; }

INLINE int any(Mask m) { return m[0] != 0; }

INLINE void copy(V *to, const V *from, int64_t count) {
    for (int64_t i = 0; i < count; i++) to[i] = from[i];
}

INLINE void fill(V *to, double value, int64_t count) {
    for (int64_t i = 0; i < count; i++) to[i] = splat(value);
}

INLINE void to_lanes(V *to, const double *const *rows, int64_t count) {
    for (int64_t i = 0; i < count; i++) to[i] = splat(rows[0][i]);
}

INLINE void to_rows(double *const *rows, int64_t lanes, V *from, int64_t count) {
    for (int64_t i = 0; i < count && lanes; i++) rows[0][i] = from[i][0];
}

#endif
