/* Lanes of members and of directions: as many doubles as the processor's vectors hold. */
#ifndef BALLPASS_WIDTH_H
#define BALLPASS_WIDTH_H

/* Stage times evaluated at once: all of a step of most methods. */
enum { BP_AT_ONCE = 8 };

#if defined(__AVX512F__)
enum { BP_LANES = 8 };
#elif defined(__AVX__)
enum { BP_LANES = 4 };
#else
enum { BP_LANES = 2 }; /* SSE2, NEON, WebAssembly */
#endif

#endif
