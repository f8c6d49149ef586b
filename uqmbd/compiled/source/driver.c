/* One translation unit: all code that is compiled ahead of time. */
#include "program.c"
#include "contacts.c"
#include "events.c"
#include "projection.c"
#include "lanes.c"
#include "control.c"
#include "turning.c"
#include "attempt.c"
#include "radau.c"
#include "brief.c"
#include "dense.c"
#include "coulomb.c"
#include "reserves.c"
#include "collisions.c"
#include "lasting.c"
#include "limits.c"
#include "decisions.c"
#include "several.c"
#include "dop853.c"
#include "tables.c"
#include "coupled.c"
#include "segments.c"
#include "waves.c"
#include "assembly.c"
#include "parts.c"
#include "peaks.c"
#include "ranks.c"

/* Sizes of the structures, for driver.py, which mirrors them. */
void sizes(int64_t *found) {
    found[0] = sizeof(Step);
    found[1] = sizeof(Program);
    found[2] = sizeof(Source);
    found[3] = sizeof(Tableau);
    found[4] = sizeof(Problem);
    found[5] = sizeof(Pool);
    found[6] = sizeof(Coupled);
    found[7] = sizeof(Contacts);
    found[8] = sizeof(Encounters);
    found[9] = sizeof(Equations);
    found[10] = sizeof(Turns);
    found[11] = sizeof(Segments);
    found[12] = sizeof(Course);
    found[13] = sizeof(Seen);
    found[14] = sizeof(Parts);
    found[15] = sizeof(Fitted);
    found[16] = sizeof(Implicit);
    found[17] = sizeof(Control);
}
