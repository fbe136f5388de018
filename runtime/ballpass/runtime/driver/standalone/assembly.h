/* Whether the linkage can be assembled at every angle of a turn; assembly.c defines it for a scene that has a linkage. */
#ifndef BALLPASS_ASSEMBLY_H
#define BALLPASS_ASSEMBLY_H

/* Says on stderr which dyads cannot be assembled, and at which crank angle they are worst; returns how many.

   values   parameters and derived constants
   turn     time of a turn [s], or infinity: then the linkage stands as it starts */
int refuse_unassembled(const double *values, double turn);

#endif
