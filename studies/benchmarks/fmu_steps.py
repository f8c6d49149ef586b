"""Cost of communication steps of mechanism FMUs, relative to the driver inside them: times and counts.

    python studies/benchmarks/fmu_steps.py [NAME]...

Each study is exported at rtol 1e-6.  A program in C runs its FMU over the times of the study, and measures the whole
steps and the driver within them, by the processor's clock.  The rest of a step is the projection of its end, outputs
with accelerations and reactions, and checks.  The last columns are the accepted steps of the driver for each
communication step, and those of the same motion in one communication step, divided by the same number: steps end at
communication points, which shortens them.
"""

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import numpy as np

import uqmbd
from uqmbd_fmi import export_fmu
from uqmbd_fmi.compiling import find_compiler
from uqmbd_fmi.exporting import MECHANISM

STUDIES = Path(__file__).parents[1]
NAMES = ("slider_crank", "four_bar", "agile_eye", "pendulum", "robot")
REPEATS = 20

PROGRAM = r"""
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "model.h"
#include "motion.h"

static double inside;
static int64_t taken;

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int64_t __real_advance(const Problem *, const Pool *, const int64_t *, int64_t, double *, int64_t);
int64_t __wrap_advance(const Problem *a, const Pool *b, const int64_t *c, int64_t d, double *e, int64_t f);
int64_t __wrap_advance(const Problem *a, const Pool *b, const int64_t *c, int64_t d, double *e, int64_t f) {
    const double start = now();
    const int64_t before = b->steps[0], found = __real_advance(a, b, c, d, e, f);
    inside += now() - start;
    taken += b->steps[0] - before;
    return found;
}

void report(Report *to, int status, const char *format, ...) {
    (void)format;
    if (status > to->status) to->status = status;
}

void remark(Report *to, const char *format, ...) { (void)to, (void)format; }

int main(int count, char **words) {
    (void)count;
    const double begin = atof(words[1]), end = atof(words[2]);
    const int steps = atoi(words[3]), repeats = atoi(words[4]);
    void *memory = aligned_alloc(64, (model_bytes() + 63) / 64 * 64);
    Report told = {0};
    double whole = 0;
    for (int r = 0; r < repeats; r++) {
        model_start(memory);
        model_prepare(memory, begin, 0);
        model_initialise(memory, &told);
        const double start = now();
        for (int k = 1; k <= steps; k++) model_advance(memory, begin + (end - begin) * k / steps, &told);
        whole += now() - start;
    }
    printf("%.9g %.9g %g %d\n", whole / steps / repeats, inside / steps / repeats,
           (double)taken / steps / repeats, told.status);
    return 0;
}
"""


def measured(folder, times, steps):
    """Return seconds of a step and of the driver within it, steps of the driver in it, and the worst status."""
    words = [str(folder / "bench"), repr(float(times[0])), repr(float(times[-1])), str(steps), str(REPEATS)]
    found = subprocess.run(words, capture_output=True, text=True, check=True).stdout.split()
    return tuple(map(float, found))


def main(names):
    """Print a table of the studies."""
    compiler = find_compiler()
    assert compiler is not None, "there is no C compiler"
    print(f"{'study':16}{'FMU, kB':>9}{'step, us':>10}{'driver, us':>12}{'ratio':>8}{'steps':>10}{'in one':>9}")
    for name in names:
        study = uqmbd.load_study(STUDIES / f"{name}.py")
        with tempfile.TemporaryDirectory() as work:
            folder = Path(work)
            done = export_fmu(study.mechanism, folder / "one.fmu", times=study.times.tolist(), rtol=1e-6)
            with zipfile.ZipFile(done.path) as archive:
                archive.extractall(folder)
            sources = folder / "sources"
            (sources / "bench.c").write_text(PROGRAM)
            files = ["bench.c", *MECHANISM, "data.c"]
            flags = ["-std=gnu11", "-O2", "-ffp-contract=off", "-Wl,--wrap=advance", "-o", str(folder / "bench")]
            subprocess.run([*compiler.command, *flags, *files, "-lm"], cwd=sources, check=True)
            steps = len(study.times) - 1
            whole, inside, steps_inside, status = measured(folder, study.times, steps)
            _, _, once, _ = measured(folder, study.times, 1)
            assert status < 2, f"{name}: an FMU fails"
            print(
                f"{name:16}{done.size / 1000:9.0f}{whole * 1e6:10.1f}{inside * 1e6:12.1f}{whole / inside:8.2f}"
                f"{steps_inside:10.2f}{once / steps:9.2f}",
                flush=True,
            )


if __name__ == "__main__":
    np.seterr(all="raise")
    main(sys.argv[1:] or NAMES)
