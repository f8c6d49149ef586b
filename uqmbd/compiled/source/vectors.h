/* Eight realisations at once: a number of each of them is a lane of a vector. */
#ifndef UQMBD_VECTORS_H
#define UQMBD_VECTORS_H

#include <stdint.h>

#define INLINE static inline __attribute__((always_inline))

enum { LANES = 8 };

typedef double V __attribute__((vector_size(64), aligned(64)));
typedef int64_t Mask __attribute__((vector_size(64), aligned(64))); /* -1: yes, 0: no */

INLINE V splat(double x) { return (V){x, x, x, x, x, x, x, x}; }

INLINE V choose(Mask which, V yes, V no) { return (V)(((Mask)yes & which) | ((Mask)no & ~which)); }

INLINE V larger(V a, V b) { return choose(a > b, a, b); }

INLINE V smaller(V a, V b) { return choose(a < b, a, b); }

INLINE V magnitude(V a) { return __builtin_elementwise_abs(a); }

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

#endif
