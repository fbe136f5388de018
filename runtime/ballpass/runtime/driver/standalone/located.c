/* The stepper once more, for runs whose steps end on the kinks of the laws: located.h. */
#define BALLPASS_LOCATED
#define ballpass_run ballpass_run_located
#define ballpass_magnitudes ballpass_magnitudes_located
#define ballpass_sizes ballpass_sizes_located
#define ballpass_states_at ballpass_states_at_located
#include "stepper.c"
