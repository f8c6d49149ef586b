#include "vectors.h"

/* Order statistics of rows, without sorting them: numbers are counted in cells of equal width, and only cells that hold
   a wanted rank are sorted.  A cell with many numbers, as of a heavy tail, is divided in turn. */

enum { CELLS = 4096, FEW_NUMBERS = 48, MOST_RANKS = 62 };

/* Sort a few numbers. */
INLINE void insert_all(double *x, int64_t count) {
    for (int64_t i = 1; i < count; i++) {
        const double own = x[i];
        int64_t j = i;
        for (; j > 0 && x[j - 1] > own; j--) x[j] = x[j - 1];
        x[j] = own;
    }
}

/* Sort numbers in a time that does not depend on their order. */
static void heap_sort(double *x, int64_t count) {
    for (int64_t begin = count / 2, end = count; end > 1;) {
        double own;
        if (begin > 0) {
            own = x[--begin];
        } else {
            own = x[--end];
            x[end] = x[0];
        }
        int64_t at = begin;
        for (int64_t next = 2 * at + 1; next < end; next = 2 * at + 1) {
            if (next + 1 < end && x[next] < x[next + 1]) next++;
            if (!(own < x[next])) break;
            x[at] = x[next];
            at = next;
        }
        x[at] = own;
    }
}

/* Smallest and largest number, and whether all are numbers: NaN is not. */
INLINE int range_of(const double *x, int64_t count, double *least, double *most) {
    double low = x[0], high = x[0], wrong = 0.0;
    int64_t i = 0;
    if (count >= LANES) {
        Lanes lows, highs, wrongs;
        lows.all = highs.all = *(const Loose *)x;
        wrongs.all = splat(0.0);
        for (; i + LANES <= count; i += LANES) {
            const V own = *(const Loose *)(x + i);
            lows.all = smaller(own, lows.all);
            highs.all = larger(own, highs.all);
            wrongs.mask |= own != own;
        }
        for (int64_t l = 0; l < LANES; l++) {
            low = lows.of[l] < low ? lows.of[l] : low;
            high = highs.of[l] > high ? highs.of[l] : high;
            wrong += wrongs.flag[l] ? 1.0 : 0.0;
        }
    }
    for (; i < count; i++) {
        low = x[i] < low ? x[i] : low;
        high = x[i] > high ? x[i] : high;
        wrong += x[i] != x[i] ? 1.0 : 0.0;
    }
    *least = low, *most = high;
    return wrong == 0.0;
}

/* Order statistics of count numbers at ascending ranks; all are numbers.  The numbers are overwritten.  `cell` has room
   for as many indices, `spare` for as many numbers. */
static void select_ranks(double *x, int64_t count, const int64_t *ranks, int64_t wanted, double *found, uint16_t *cell,
                         double *spare, int depth) {
    double low, high;
    if (count <= FEW_NUMBERS) {
        insert_all(x, count);
        for (int64_t r = 0; r < wanted; r++) found[r] = x[ranks[r]];
        return;
    }
    range_of(x, count, &low, &high);
    if (low == high) {
        for (int64_t r = 0; r < wanted; r++) found[r] = x[0];
        return;
    }
    const int64_t cells = count / 2 < CELLS ? count / 2 : CELLS;
    const double scale = (double)cells / (high - low);
    /* infinite numbers, and ranges whose inverse is none */
    if (depth > 6 || !(scale > 0.0 && scale < 1e300 && high - low < 1e300)) {
        heap_sort(x, count);
        for (int64_t r = 0; r < wanted; r++) found[r] = x[ranks[r]];
        return;
    }
    int32_t sizes[CELLS];
    uint8_t place[CELLS];
    for (int64_t c = 0; c < cells; c++) sizes[c] = 0, place[c] = 0;
    for (int64_t i = 0; i < count; i++) {
        /* rounding keeps the order: a larger number is never in an earlier cell */
        int64_t own = (int64_t)((x[i] - low) * scale);
        own = own < cells ? own : cells - 1;
        cell[i] = (uint16_t)own;
        sizes[own]++;
    }
    /* cells of the ranks; several ranks may share one */
    int64_t starts[MOST_RANKS + 1], before[MOST_RANKS + 1], first[MOST_RANKS + 2], filled[MOST_RANKS + 1];
    int64_t groups = 0, below = 0, at = 0;
    for (int64_t c = 0; c < cells && at < wanted; c++) {
        const int64_t above = below + sizes[c];
        if (ranks[at] < above) {
            groups++;
            place[c] = (uint8_t)groups;
            before[groups] = below;
            starts[groups] = groups == 1 ? 0 : starts[groups - 1] + filled[groups - 1];
            filled[groups] = sizes[c];
            first[groups] = at;
            while (at < wanted && ranks[at] < above) at++;
        }
        below = above;
    }
    first[groups + 1] = wanted;
    int64_t ends[MOST_RANKS + 1];
    for (int64_t g = 1; g <= groups; g++) ends[g] = starts[g];
    for (int64_t i = 0; i < count; i++) {
        const uint8_t g = place[cell[i]];
        if (g) spare[ends[g]++] = x[i];
    }
    for (int64_t g = 1; g <= groups; g++) {
        int64_t own[MOST_RANKS];
        const int64_t many = first[g + 1] - first[g];
        for (int64_t r = 0; r < many; r++) own[r] = ranks[first[g] + r] - before[g];
        select_ranks(spare + starts[g], filled[g], own, many, found + first[g], cell, x, depth + 1);
    }
}

/* Order statistics (rows, wanted) of rows of count numbers at ascending ranks, at most MOST_RANKS; NaN of rows with one.
   The rows are overwritten; `cell` and `spare` have room for count indices and numbers. */
void order_statistics(double *rows, int64_t number, int64_t count, const int64_t *ranks, int64_t wanted, double *found,
                      uint16_t *cell, double *spare) {
    for (int64_t k = 0; k < number; k++) {
        double *x = rows + k * count, low, high;
        if (range_of(x, count, &low, &high)) {
            select_ranks(x, count, ranks, wanted, found + k * wanted, cell, spare, 0);
        } else {
            for (int64_t r = 0; r < wanted; r++) found[k * wanted + r] = __builtin_nan("");
        }
    }
}
