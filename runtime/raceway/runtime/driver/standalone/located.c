/* The stepper once more, for runs whose steps end on the kinks of the laws: located.h. */
#define RACEWAY_LOCATED
#define raceway_run raceway_run_located
#define raceway_sizes raceway_sizes_located
#include "stepper.c"
