/* Reading a quadrature encoder in an interrupt at every edge, for boards that have no counter for it. */
#ifndef RIG_QUADRATURE_H
#define RIG_QUADRATURE_H

#include <stdint.h>

enum { QUADRATURE_SLIPPED = 2 };

/* From the two channels before and now, A in bit 0 and B in bit 1: +1, -1, 0, or slipped when both have changed at
 * once, which means that an edge was missed. */
static inline int8_t quadrature_step(uint8_t last, uint8_t now)
{
    uint8_t changed = now ^ last;
    if (changed == 3) {
        return QUADRATURE_SLIPPED;
    }
    if (changed == 0) {
        return 0;
    }
    /* Gray code 0 1 3 2 while the count grows: up when the new A differs from the old B. */
    return (now ^ last >> 1) & 1 ? 1 : -1;
}

#endif
