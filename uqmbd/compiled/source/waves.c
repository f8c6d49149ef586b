/* Sums of harmonics of base frequencies at even times, of eight samples at once. */
#include "vectors.h"

/* exp(i k x) of all harmonics (H), whose multiples of the bases are the lattice (H, M), from exp(i x) of the bases (M)
   of each lane.  `powers` has room for 2 M (highest + 1) vectors. */
INLINE void harmonics_of(int64_t harmonics, int64_t bases, int64_t highest, const int64_t *lattice,
                         const double *const *turns, V *powers, V *found) {
    for (int64_t m = 0; m < bases; m++) {
        V *own = powers + 2 * m * (highest + 1);
        Lanes re, im;
        for (int64_t l = 0; l < LANES; l++) {
            re.of[l] = turns[l][2 * m];
            im.of[l] = turns[l][2 * m + 1];
        }
        own[0] = splat(1.0);
        own[1] = splat(0.0);
        for (int64_t k = 1; k <= highest; k++) {
            own[2 * k] = own[2 * k - 2] * re.all - own[2 * k - 1] * im.all;
            own[2 * k + 1] = own[2 * k - 2] * im.all + own[2 * k - 1] * re.all;
        }
    }
    for (int64_t h = 0; h < harmonics; h++) {
        V re = splat(1.0), im = splat(0.0);
        for (int64_t m = 0; m < bases; m++) {
            const int64_t k = lattice[h * bases + m];
            const V *own = powers + 2 * (m * (highest + 1) + (k < 0 ? -k : k));
            const V other = k < 0 ? -own[1] : own[1], next = re * own[0] - im * other;
            im = re * other + im * own[0];
            re = next;
        }
        found[2 * h] = re;
        found[2 * h + 1] = im;
    }
}

/* Sums over harmonics of even and of odd parts at two distances from the middle of a block. */
INLINE void parts_of(int64_t count, const int64_t *used, const V *middle, const V *near, const V *far, V *even,
                     V *odd) {
    V even0 = splat(0.0), even1 = even0, odd0 = even0, odd1 = even0;
    for (int64_t n = 0; n < count; n++) {
        const int64_t h = 2 * used[n];
        even0 += middle[2 * n] * near[h];
        even1 += middle[2 * n] * far[h];
        odd0 += middle[2 * n + 1] * near[h + 1];
        odd1 += middle[2 * n + 1] * far[h + 1];
    }
    even[0] = even0;
    even[1] = even1;
    odd[0] = odd0;
    odd[1] = odd1;
}

/* Values (T) of C outputs of K samples, put into rows of `found` (R, C, T): constants and drifts (K, C), and waves
   (K, C, H), a - i b for a cos + b sin, times harmonics of the bases, whose multiples are the lattice (H, M), none above
   `highest`.

   Times go block by block, `half` of them on both sides of a middle.  exp(i w t) of the bases is given in the middles,
   coarse (K, blocks, M), and at distances from them, fine (K, half + 1, M).  What is even about the middle is
   summed apart from what is odd, which serves two times.  `used` (C, H + 1) holds the numbers of the harmonics that an
   output has, behind how many there are.  There are blocks (2 half + 1) times, the last ones any.  `work` has room for
   2 H (half + 4 + C) + 2 M (highest + 1) + 2 half + 1 + 2 C vectors. */
void wave_values(int64_t samples, int64_t outputs, int64_t harmonics, int64_t bases, int64_t highest, int64_t blocks,
                 int64_t half, int64_t count, const int64_t *lattice, const int64_t *used, const double *coarse,
                 const double *fine, const double *waves, const double *constants, const double *drifts,
                 const double *times, const int64_t *places, double *found, double *work) {
    const int64_t width = 2 * half + 1;
    V *away = (V *)work, *here = away + 2 * harmonics * (half + 2), *middle = here + 2 * harmonics;
    V *powers = middle + 2 * harmonics, *sums = powers + 2 * bases * (highest + 1);
    V *still = sums + width, *size = still + 2 * outputs;
    for (int64_t group = 0; group < samples; group += LANES) {
        int64_t row[LANES];
        const double *turns[LANES];
        /* samples that are not there are the first one */
        for (int64_t l = 0; l < LANES; l++) row[l] = group + l < samples ? group + l : group;
        for (int64_t l = 0; l < LANES; l++)
            for (int64_t o = 0; o < outputs; o++) {
                const int64_t which = row[l] * outputs + o;
                ((double *)still)[2 * o * LANES + l] = constants[which];
                ((double *)still)[(2 * o + 1) * LANES + l] = drifts[which];
                for (int64_t h = 0; h < 2 * harmonics; h++)
                    ((double *)size)[2 * o * harmonics * LANES + h * LANES + l] = waves[2 * which * harmonics + h];
            }
        for (int64_t b = 0; b <= half; b++) {
            for (int64_t l = 0; l < LANES; l++) turns[l] = fine + 2 * bases * (row[l] * (half + 1) + b);
            harmonics_of(harmonics, bases, highest, lattice, turns, powers, away + 2 * harmonics * b);
        }
        for (int64_t a = 0; a < blocks; a++) {
            for (int64_t l = 0; l < LANES; l++) turns[l] = coarse + 2 * bases * (row[l] * blocks + a);
            harmonics_of(harmonics, bases, highest, lattice, turns, powers, here);
            const int64_t begin = a * width, left = count - begin < width ? count - begin : width;
            for (int64_t o = 0; o < outputs; o++) {
                const int64_t *own = used + o * (harmonics + 1);
                const V constant = still[2 * o], drift = still[2 * o + 1];
                for (int64_t n = 0; n < own[0]; n++) {
                    const int64_t h = own[1 + n];
                    const V *wave = size + 2 * (o * harmonics + h);
                    middle[2 * n] = wave[0] * here[2 * h] - wave[1] * here[2 * h + 1];
                    middle[2 * n + 1] = wave[0] * here[2 * h + 1] + wave[1] * here[2 * h];
                }
                for (int64_t b = 0; b <= half; b += 2) {
                    V even[2], odd[2];
                    parts_of(own[0], own + 1, middle, away + 2 * harmonics * b, away + 2 * harmonics * (b + 1), even,
                             odd);
                    for (int64_t i = 0; i < 2 && b + i <= half; i++) {
                        const int64_t after = half + b + i, before = half - b - i;
                        sums[after] = even[i] - odd[i] + (constant + drift * times[begin + after]);
                        sums[before] = even[i] + odd[i] + (constant + drift * times[begin + before]);
                    }
                }
                int64_t j = 0;
                for (; j + 4 <= left; j += 4) {
                    transpose_halves(sums + j);
                    for (int64_t l = 0; l < LANES; l++) {
                        double *to = found + (places[row[l]] * outputs + o) * count + begin + j;
                        *(Quad *)to = l < 4 ? first_quad(sums[j + l]) : second_quad(sums[j + l - 4]);
                    }
                }
                for (; j < left; j++)
                    for (int64_t l = 0; l < LANES; l++)
                        found[(places[row[l]] * outputs + o) * count + begin + j] = sums[j][l];
            }
        }
    }
}
