/* Whether the linkage can be assembled at every angle that a run reaches; assembly.c defines it for a scene that has a linkage. */
#ifndef BALLPASS_ASSEMBLY_H
#define BALLPASS_ASSEMBLY_H

#include "faults.h"

/* Says which dyads cannot be assembled, and at which crank angle they are worst.

   values   parameters and derived constants
   turn     time of a turn [s], or infinity: then the linkage stays at its start
   end      of the run [s] */
void refuse_unassembled(const double *values, double turn, double end, ballpass_faults *faults);

#endif
